"""Frames that are drawn for being read: the same as targets that hold every array, from fewer bytes."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Sphere
from translucent.scene.camera import Window

SIZE = (40, 28)
EXACT = 4e-6  # some roundings of float32, of lengths of 1 and optical depths of 2
CAMERA = tl.Camera.look_at((0.3, 0.4, 5.0), (0, 0, 0), fov_y=30.0)
BALL = Sphere(radius=0.6).tessellate(16)
OPEN = tl.Mesh(BALL.vertices, BALL.faces[3:])
MEDIA = [tl.Medium(absorption=a) for a in ((0.2, 0.5, 0.9), (0.9, 0.1, 0.4), (0.3, 0.3, 1.2), (2.0, 0.2, 0.1))]
PART = Window(7, 5, (60, 50))


def balls(count: int, camera: tl.Camera = CAMERA, mesh: tl.Mesh = BALL, **rest: Any) -> tl.Scene:
    """So many balls of as many media, the next overlapping the last."""
    places = np.tile(np.eye(4), (count, 1, 1))
    places[:, 0, 3] = 0.5 * np.arange(count) - 0.25 * (count - 1)
    return tl.Scene([tl.Object(mesh, MEDIA[i], at) for i, at in enumerate(places)], camera, **rest)


def with_opaque() -> tl.Scene:
    scene = balls(2)
    stone = tl.Object(Sphere(radius=0.3).tessellate(12), color=(0.7, 0.2, 0.1))
    return dataclasses.replace(scene, objects=[*scene.objects, stone], environment=tl.Environment.checkerboard())


SCENES = {
    "one medium": (balls(1), None),
    "two media": (balls(2), None),
    "three media, a gradient": (balls(3, environment=tl.Environment.gradient((0.1, 0.2, 0.4), (1.0, 0.9, 0.7))), None),
    "before a stone": (with_opaque(), None),
    "part of a picture": (balls(2, dataclasses.replace(CAMERA, window=PART)), None),
    "parallel rays": (balls(2, tl.Camera.orthographic((0.3, 0.4, 5.0), (0, 0, 0), height=2.0)), None),
    "an open ball": (balls(1, mesh=OPEN), None),
    "two open balls": (balls(2, mesh=OPEN), None),
    "in order": (balls(2), tl.DepthPeeling()),
}


@pytest.fixture(scope="module")
def renderer() -> Iterator[tl.Renderer]:
    with tl.Renderer() as made:
        yield made


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
def test_it_is_the_frame_of_whole_targets(renderer: tl.Renderer, name: str) -> None:
    scene, method = SCENES[name]
    frame = renderer.render(scene, SIZE, method)
    renderer.render(balls(1, environment=tl.Environment.checkerboard()), SIZE)  # into the same targets
    gpu = renderer.gpu
    with gpu.context.current():
        job = gpu.prepare(renderer.plan(scene, method), SIZE)
        gpu.run(job)
        whole = gpu.read(job)
        job.release()
    assert list(frame.arrays) == list(whole.arrays)
    assert whole.coverage.any()
    assert whole.valid.all() == ("open" not in name)
    for key, values in whole.arrays.items():
        found = frame.arrays[key]
        assert (found.dtype, found.shape) == (values.dtype, values.shape)
        assert found.flags.c_contiguous
        assert found.flags.owndata
        assert found.flags.writeable
        np.testing.assert_allclose(found.astype(float), values.astype(float), rtol=EXACT, atol=EXACT, err_msg=key)


def test_media_have_an_accumulator_each_up_to_three(renderer: tl.Renderer) -> None:
    apart = []
    for count in range(1, 5):
        scene = balls(count)
        with renderer.gpu.context.current():
            job = renderer.gpu.prepare(renderer.plan(scene), SIZE, compact=True)
            apart.append(None if job.media_apart is None else job.media_apart.tolist())
            job.release()
    assert apart[0] is None
    assert apart[3] is None
    assert sorted(apart[1]) == [0, 1]
    assert sorted(apart[2]) == [0, 1, 2]


def test_an_array_is_made_when_it_is_asked_for_and_does_not_follow_others(renderer: tl.Renderer) -> None:
    frame = renderer.render(balls(1), SIZE)
    assert not {"transmittance", "optical_depth", "thickness"} & set(vars(frame))
    assert {"radiance", "thickness"} <= set(dir(frame))  # notebooks complete names by it
    truth = frame.thickness.copy()
    frame.thickness[:] = 7.0
    frame.radiance[:] = 0.0
    np.testing.assert_allclose(frame.optical_depth, truth[..., None] * np.array(MEDIA[0].extinction), rtol=1e-6)
    np.testing.assert_allclose(frame.transmittance, np.exp(-frame.optical_depth.astype(float)), rtol=1e-6)
    assert frame.thickness is frame.thickness
    with pytest.raises(AttributeError, match="has no attribute 'thickest'"):
        _ = frame.thickest  # type: ignore[attr-defined]


def test_copies_of_a_frame_have_all_arrays(renderer: tl.Renderer) -> None:
    frame = dataclasses.replace(renderer.render(balls(2), SIZE), scene=None)
    again = pickle.loads(pickle.dumps(dataclasses.replace(renderer.render(balls(2), SIZE), scene=None)))
    assert all(np.array_equal(again.arrays[name], values) for name, values in frame.arrays.items())
