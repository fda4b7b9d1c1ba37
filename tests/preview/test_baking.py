"""A baked map shown on its model, and work in a process of its own; the baker itself has tests elsewhere."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.normals import drawn_normals, has_drawn_normals, made_normals
from translucent.geometry.solids import Box
from translucent.preview import exports
from translucent.preview.document import Orbit
from translucent.preview.tasks import Task
from translucent.preview.worker import Pool

BOX = Box((0.0, 0.0, 0.0), (0.02, 0.02, 0.02)).tessellate()


@pytest.fixture
def task() -> Task:
    return Task("baking", lambda _: None, lambda _: None)


def test_the_model_is_painted_with_its_map(task: Task, pool: Pool) -> None:
    body = tl.Object(BOX, tl.Medium(absorption=1.0))
    baked = exports.bake_map(task, pool, body, tl.Medium(absorption=2.0), "transmittance", 32, 4)
    assert baked.map.settings.medium == tl.Medium(absorption=2.0)
    assert (baked.map.settings.size, baked.map.settings.rays) == (32, 4)
    assert task.share is not None
    values = baked.map.values[baked.map.coverage]
    assert float(baked.thickest_text("mm").removesuffix(" mm")) == pytest.approx(1e3 * values.max(), rel=1e-4)
    assert 0.0 < baked.covered < 1.0
    orbit = Orbit(distance=6.0, yaw=0.0, pitch=0.0)
    scene = baked.seen_from(orbit)
    assert baked.seen_from(dataclasses.replace(orbit)) is scene
    assert scene.objects[0].mesh.uv is not None
    assert scene.objects[0].surface is not None
    assert scene.objects[0].surface.color_texture is not None
    assert has_drawn_normals(scene.objects[0].mesh)  # the picture makes none
    np.testing.assert_array_equal(drawn_normals(scene.objects[0].mesh), made_normals(scene.objects[0].mesh))


def test_what_the_baker_refuses_is_told(task: Task, pool: Pool) -> None:
    with pytest.raises(tl.InputError, match=r"rays 1"):
        exports.bake_map(task, pool, tl.Object(BOX, tl.Medium(absorption=1.0)), tl.Medium(), "cone", 8, 1)
