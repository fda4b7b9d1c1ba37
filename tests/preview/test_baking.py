"""A baked map shown on its model, and a bake that is cancelled; the baker itself has tests of its own."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.preview import baking
from translucent.preview.document import Orbit
from translucent.preview.tasks import CancelledError, Task

SQUARE = tl.Mesh(
    [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]], [[0, 0], [1, 0], [1, 1], [0, 1]]
)


def fake(mesh: tl.Mesh, size: int, progress: Callable[[int, int, int], None], **options: Any) -> Any:
    for i in range(3):
        progress(i, 3, 1000 * i)
        time.sleep(0.001)
    values = np.linspace(0.0, 2.0, size * size, dtype=np.float32).reshape(size, size)
    return SimpleNamespace(mesh=mesh, values=values, coverage=values >= 0, options=options)


def task() -> Task:
    return Task("baking", lambda _: None, lambda _: None)


@pytest.fixture(autouse=True)
def baker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tl, "bake_thickness", fake, raising=False)


def test_the_model_is_painted_with_its_map() -> None:
    body = tl.Object(SQUARE, tl.Medium(absorption=1.0))
    baked = baking.bake_map(task(), body, tl.Medium(absorption=2.0), "transmittance", 8, 16)
    assert baked.map.options == {"mode": "transmittance", "rays": 16, "medium": tl.Medium(absorption=2.0)}
    assert baked.thickest_text("mm") == "2000 mm"
    assert baked.covered == 1.0
    orbit = Orbit(distance=6.0, yaw=0.0, pitch=0.0)
    scene = baked.seen_from(orbit)
    assert scene is not None
    assert baked.seen_from(dataclasses.replace(orbit)) is scene
    assert scene.objects[0].surface is not None
    assert scene.objects[0].surface.color_texture is not None


def test_a_mesh_without_texture_coordinates_is_not_painted() -> None:
    bare = tl.Object(tl.Mesh(SQUARE.vertices, SQUARE.faces), tl.Medium(absorption=1.0))
    assert baking.bake_map(task(), bare, tl.Medium(), "cone", 8, 16).seen_from(Orbit()) is None


def test_a_bake_that_nobody_waits_for_ends() -> None:
    cancelled = task()
    cancelled.cancel()
    with pytest.raises(CancelledError):
        baking.bake_map(cancelled, tl.Object(SQUARE, tl.Medium(absorption=1.0)), tl.Medium(), "cone", 8, 16)
