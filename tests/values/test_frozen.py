"""Values that never change: nor do their copies, in this process or in another."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import BOX, CAMERA

MEDIUM = tl.Medium(absorption=(1, 2, 3))
TEXTURE = tl.Texture(np.ones((2, 2, 3)))
MESH = tl.Mesh(BOX.vertices, BOX.faces, np.zeros((len(BOX.vertices), 2)))
SURFACE = tl.Surface(color=(0.1, 0.2, 0.3), color_texture=TEXTURE)
DENSITY = tl.DensityGrid(np.ones((2, 2, 2)))
SKY = tl.Environment.gradient(0.2, 1.0)
VALUES = {
    "mesh": MESH,
    "medium": MEDIUM,
    "camera": CAMERA,
    "texture": TEXTURE,
    "surface": SURFACE,
    "density": DENSITY,
    "environment": SKY,
    "picture of all directions": tl.Environment.studio(),
    "point light": tl.PointLight((1, 2, 3), 1.0),
    "sphere light": tl.SphereLight((1, 2, 3), 1.0, 0.5),
    "spot light": tl.SpotLight((1, 2, 3), (0, 0, 1), 1.0),
    "directional light": tl.DirectionalLight((1, 2, 3), 1.0),
    "backdrop": tl.Backdrop(np.ones((2, 3, 3)), np.ones((2, 3))),
    "object": tl.Object(MESH, MEDIUM, density=DENSITY, surface=SURFACE),
    "scene": tl.Scene([tl.Object(MESH, MEDIUM), tl.Object(BOX, color=(0.1, 0.2, 0.3))], CAMERA),
}


def arrays(value: Any) -> Iterator[np.ndarray]:
    """The arrays of a value, and of the values that it has."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, list | tuple):
        for item in value:
            yield from arrays(item)
    elif type(value).__module__.startswith("translucent.") and hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            yield from arrays(getattr(value, name))


@pytest.mark.parametrize("name", VALUES)
def test_copies_are_as_read_only_as_what_they_are_of(name: str) -> None:
    value = VALUES[name]
    assert all(not array.flags.writeable for array in arrays(value))
    sent = pickle.loads(pickle.dumps(value))
    for other in (copy.copy(value), copy.deepcopy(value), sent):
        assert type(other) is type(value)
        found = list(arrays(other))
        assert len(found) == len(list(arrays(value)))
        for array, expected in zip(found, arrays(value), strict=True):
            assert not array.flags.writeable
            np.testing.assert_array_equal(array, expected)


def test_what_is_kept_of_a_mesh_stays_true_of_its_copies() -> None:
    mesh = tl.Mesh(BOX.vertices, BOX.faces)
    before = mesh.bounds.copy()
    for other in (copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh))):
        with pytest.raises(ValueError, match="read-only"):
            other.vertices[:] *= 2.0
        with pytest.raises(ValueError, match="read-only"):
            other.bounds[:] = 0.0
        np.testing.assert_array_equal(other.bounds, before)
