"""Turntables: where the camera goes, what goes with it, and that nothing leaves the picture."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.frames.animation import framed_all_around, swept_points, turntable
from translucent.geometry.solids import Box

SIZE = (160, 90)


def scene(environment: tl.Environment | None = None) -> tl.Scene:
    """A long box, off the origin, so that its sides differ."""
    turn = np.eye(4)
    turn[:3, 3] = 1.0, 2.0, -3.0
    mesh = Box((-2.0, -0.5, -0.25), (2.0, 0.5, 0.25)).tessellate()
    shown = tl.Object(mesh, tl.Medium(absorption=1.0), transform=turn)
    camera = tl.Camera.look_at((1.0, 3.0, 5.0), (1.0, 2.0, -3.0), fov_y=40)
    return tl.Scene([shown], camera, environment=environment or tl.Environment.constant(1.0))


def test_the_camera_goes_around_counterclockwise_and_keeps_its_distance() -> None:
    start = scene()
    center = start.bounds.mean(axis=0)
    views = list(turntable(start, 4))
    eyes = np.array([view.camera.eye - center for view in views])
    np.testing.assert_allclose(eyes, [[0, 1, 8], [8, 1, 0], [0, 1, -8], [-8, 1, 0]], atol=1e-12)
    for view, eye in zip(views, eyes, strict=True):
        np.testing.assert_allclose(view.camera.forward, -eye / np.linalg.norm(eye), atol=1e-12)
        assert view.camera.fov_y == 40
        assert view.objects == start.objects
    np.testing.assert_allclose(views[0].camera.pose, start.camera.pose, atol=1e-12)


def test_environment_and_background_go_with_it() -> None:
    pixels = np.random.default_rng(1).random((8, 16, 3))
    around = tl.Environment.image(pixels, rotation=10).with_background(tl.Environment.image(pixels[::-1]))
    start, _, turned = list(turntable(scene(around), 3))
    assert (turned.environment.rotation, turned.environment.seen.rotation) == (250.0, 240.0)
    _, before = start.camera.rays((5, 4))
    _, after = turned.camera.rays((5, 4))
    position = np.zeros((4, 5, 2))
    np.testing.assert_allclose(
        turned.environment.radiance(after, position), start.environment.radiance(before, position), rtol=1e-9
    )
    np.testing.assert_allclose(turned.environment.lighting(after), start.environment.lighting(before), rtol=1e-9)


def test_all_of_the_model_is_in_all_pictures() -> None:
    start = framed_all_around(scene(), SIZE)
    corners = start.objects[0].mesh.vertices + start.objects[0].matrix[:3, 3]
    reach = []
    for view in turntable(start, 24):
        local = (corners - view.camera.eye) @ view.camera.pose[:3, :3]
        half = np.array(view.camera.half_extent(SIZE))
        reach.append(np.abs(local[:, :2] / -local[:, 2:] / half).max())
    assert max(reach) < 1.0
    assert max(reach) > 0.75  # and not much smaller than it must be
    np.testing.assert_allclose(start.camera.forward, scene().camera.forward, atol=1e-12)


def test_what_a_model_sweeps_encloses_it() -> None:
    points = swept_points(scene())
    center = scene().bounds.mean(axis=0)
    assert points[:, 1].max() == pytest.approx(2.5)
    assert points[:, 1].min() == pytest.approx(1.5)
    assert np.hypot(*(points - center)[:, [0, 2]].T).max() == pytest.approx(np.hypot(2, 0.25), rel=3e-3)


def test_an_orthographic_camera_stays() -> None:
    flat = tl.Scene(scene().objects, tl.Camera.orthographic((0, 0, 9), (0, 0, 0), height=5.0))
    assert framed_all_around(flat, SIZE) is flat


@pytest.mark.parametrize("count", [1, 0, -3, 2.5, None])
def test_a_count_that_is_none_is_refused(count: object) -> None:
    with pytest.raises(
        tl.InputError, match=r"turntable of .* pictures; the number of pictures must be a whole number above 1"
    ):
        next(turntable(scene(), count))  # type: ignore[arg-type]
