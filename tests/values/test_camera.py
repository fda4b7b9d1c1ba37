"""Cameras: rays by hand, framing by its definition, and refusals."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.scene.camera import FRAMING_MARGIN, Camera, check_size, view_ray

EPS = float(np.finfo(np.float64).eps)
FRONT = Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=90.0)

coordinates = st.integers(-1000, 1000).map(lambda v: v / 100)
points = st.tuples(coordinates, coordinates, coordinates)


def unit(*vector: float) -> list[float]:
    return (np.array(vector) / np.linalg.norm(vector)).tolist()


@pytest.mark.parametrize(
    ("size", "row", "column", "direction"),
    [
        ((1, 1), 0, 0, (0, 0, -1)),
        ((3, 3), 1, 1, (0, 0, -1)),
        ((2, 2), 0, 0, (-0.5, 0.5, -1)),  # row 0 is the top row, column 0 the left one
        ((2, 2), 0, 1, (0.5, 0.5, -1)),
        ((2, 2), 1, 0, (-0.5, -0.5, -1)),
        ((4, 2), 0, 3, (1.5, 0.5, -1)),  # the angle of view is the vertical one
        ((2, 4), 3, 0, (-0.25, -0.75, -1)),
        ((8192, 1), 0, 8191, (8191, 0, -1)),
    ],
)
def test_a_ray_of_a_right_angled_view(size: tuple[int, int], row: int, column: int, direction: tuple[float, ...]):
    origins, directions = FRONT.rays(size)
    assert origins.shape == directions.shape == (size[1], size[0], 3)
    assert origins[row, column].tolist() == [0, 0, 5]
    assert directions[row, column] == pytest.approx(unit(*direction), abs=4 * EPS)


@pytest.mark.parametrize("fov_y", [1.0, 45.0, 90.0, 150.0])
def test_the_upper_edge_is_half_the_angle_of_view_above_the_middle(fov_y: float) -> None:
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=fov_y)
    _, directions = camera.rays((1, 1), offset=(0.0, -0.5))
    angle = math.degrees(math.acos(float(directions[0, 0] @ camera.forward)))
    # acos loses digits near 0: EPS / sin(angle), in degrees.
    assert angle == pytest.approx(fov_y / 2, abs=60 * 4 * EPS / math.sin(math.radians(fov_y / 2)))


def test_an_offset_moves_right_and_down_in_pixels() -> None:
    coarse, fine = FRONT.rays((3, 3), offset=(0.25, 0.75))[1], FRONT.rays((12, 12))[1]
    assert coarse[1, 1] == pytest.approx(unit(2 * 0.25 / 3, -2 * 0.75 / 3, -1), abs=4 * EPS)
    # An eighth of a pixel from its center is the center of the next of 4 x 4 finer pixels.
    assert FRONT.rays((3, 3), offset=(1 / 8, 1 / 8))[1][1, 1] == pytest.approx(fine[6, 6], abs=4 * EPS)
    each = np.arange(9).reshape(3, 3) / 9 - 0.5, np.arange(9).reshape(3, 3) / 18
    own = FRONT.rays((3, 3), each)[1]
    for row, column in ((0, 2), (2, 1)):
        shift = each[0][row, column], each[1][row, column]
        np.testing.assert_array_equal(own[row, column], FRONT.rays((3, 3), shift)[1][row, column])


def test_orthographic_rays_are_parallel_and_start_beside_the_eye() -> None:
    camera = Camera.orthographic((1, 2, 5), (1, 2, 0), height=4.0)
    origins, directions = camera.rays((4, 2))
    assert (directions == [0, 0, -1]).all()
    assert origins[0, 0].tolist() == [1 - 3, 2 + 1, 5]
    assert origins[1, 3].tolist() == [1 + 3, 2 - 1, 5]


@given(points, points, st.integers(1, 9), st.integers(1, 9), st.floats(1, 170))
def test_rays_are_of_unit_length_and_owned(
    eye: tuple[float, ...], target: tuple[float, ...], width: int, height: int, fov_y: float
) -> None:
    backward = np.subtract(eye, target)
    if np.linalg.norm(np.cross(backward, (0, 1, 0))) < 1e-3:
        return
    camera = Camera.look_at(eye, target, fov_y=fov_y)
    origins, directions = camera.rays((width, height))
    assert np.linalg.norm(directions, axis=-1) == pytest.approx(1.0, abs=4 * EPS)
    assert camera.forward == pytest.approx(-backward / np.linalg.norm(backward), abs=4 * EPS)
    assert camera.pose[:3, :3].T @ camera.pose[:3, :3] == pytest.approx(np.eye(3), abs=16 * EPS)
    assert np.linalg.det(camera.pose[:3, :3]) == pytest.approx(1.0, abs=16 * EPS)
    assert camera.up[1] >= 0
    assert origins.flags.owndata
    assert origins.flags.writeable


@pytest.mark.parametrize("camera", [FRONT, Camera.look_at((3, -2, 7), (1, 1, 1), (0.1, 0, 1), fov_y=33.0)])
@pytest.mark.parametrize("size", [(1, 1), (7, 4), (4, 7)])
def test_view_ray_is_the_ray_through_a_pixel(camera: Camera, size: tuple[int, int]) -> None:
    half_width, half_height = camera.half_extent(size)
    column, row = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    ray = view_ray(
        np.stack([column, row], axis=-1), size, camera.right * half_width, camera.up * half_height, camera.forward
    )
    assert ray @ camera.forward == pytest.approx(1.0, abs=8 * EPS)
    assert ray / np.linalg.norm(ray, axis=-1, keepdims=True) == pytest.approx(camera.rays(size)[1], abs=8 * EPS)


# Framing


def _in_picture(camera: Camera, seen: Any, size: tuple[int, int]) -> np.ndarray[Any, Any]:
    """Positions of points: -1..1 in both directions are in the picture."""
    local = (np.asarray(seen) - camera.eye) @ camera.pose[:3, :3]
    assert (local[:, 2] < 0).all()
    return local[:, :2] / -local[:, 2:] / camera.half_extent(size)


CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


@pytest.mark.parametrize("size", [(1, 1), (1280, 720), (100, 900)], ids=str)
@pytest.mark.parametrize("fov_y", [5.0, 30.0, 90.0])
@pytest.mark.parametrize("shift", [0.0, 1e6])
def test_framing_shows_all_points_and_touches_the_margin(size: tuple[int, int], fov_y: float, shift: float) -> None:
    seen = CUBE * (3, 1, 2) + shift
    positions = np.abs(_in_picture(Camera.framing(seen, size, fov_y=fov_y), seen, size))
    # The points are at 1e6 with EPS of it, seen from some meters: 1e6 EPS, and a few more in the eye's position.
    assert positions.max() == pytest.approx(1 / FRAMING_MARGIN, abs=1e-8 if shift else 1e-12)


def test_framing_with_a_wide_angle_stays_before_the_nearest_point() -> None:
    # At 150 degrees the margin alone would put the eye inside the box.
    seen = CUBE * (3, 1, 2)
    camera = Camera.framing(seen, fov_y=150.0)
    assert np.abs(_in_picture(camera, seen, (1, 1))).max() < 1 / FRAMING_MARGIN


@given(st.lists(points, min_size=2, max_size=12), st.integers(1, 50), st.integers(1, 50), st.floats(5, 120))
def test_framing_shows_any_points(seen: list[tuple[float, ...]], width: int, height: int, fov_y: float) -> None:
    camera = Camera.framing(seen, (width, height), fov_y=fov_y)
    assert np.abs(_in_picture(camera, seen, (width, height))).max() <= 1 / FRAMING_MARGIN + 1e-9


def test_framing_of_a_single_point_looks_at_it_from_somewhere_else() -> None:
    camera = Camera.framing([(1.0, 2.0, 3.0)])
    assert np.linalg.norm(camera.eye - (1, 2, 3)) > 0
    assert _in_picture(camera, [(1.0, 2.0, 3.0)], (1, 1)) == pytest.approx(np.zeros((1, 2)), abs=1e-9)


def test_framing_looks_along_the_given_direction_with_the_given_up() -> None:
    camera = Camera.framing(CUBE, direction=(0, -2, 0), up=(0, 0, 1))
    assert camera.forward == pytest.approx([0, -1, 0], abs=4 * EPS)
    assert camera.up == pytest.approx([0, 0, 1], abs=4 * EPS)


# Refusals

POSE = np.eye(4)
SCALED, MIRRORED, SHORT = np.diag([2.0, 2, 2, 1]), np.diag([-1.0, 1, 1, 1]), np.eye(3)
NAN_POSE = np.where(np.eye(4) == 1, np.nan, 0)
TARGET_ABOVE = ((0, 0, 0), (0, 5, 0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Camera.look_at((1, 2, 3), (1, 2, 3)),
            "eye and target are at the same point (1.0, 2.0, 3.0); move one of them",
        ),
        (
            lambda: Camera.look_at(*TARGET_ABOVE),
            "the up direction (0.0, 1.0, 0.0) is parallel to the view direction; choose another up",
        ),
        (
            lambda: Camera.look_at((0, 0, 1), (0, 0, 0), up=(0, 0, 0)),
            "the up direction (0.0, 0.0, 0.0) is parallel to the view direction",
        ),
        (lambda: Camera.look_at((0, 0, np.nan), (0, 0, 0)), "each of them must be three finite numbers"),
        (lambda: Camera.look_at((0, 0, np.inf), (0, 0, 0)), "each of them must be three finite numbers"),
        (lambda: Camera.look_at((0, 0), (0, 0, 0)), "each of them must be three finite numbers"),
        (lambda: Camera.look_at((0, 0, 1e200), (0, 0, 0)), "a coordinate is beyond 1e+18"),
        (
            lambda: Camera.look_at((0, 0, 1), (0, 0, 0), fov_y=0),
            "camera fov_y 0; the angle must lie between 0 and 180 degrees",
        ),
        (
            lambda: Camera.look_at((0, 0, 1), (0, 0, 0), fov_y=180),
            "camera fov_y 180; the angle must lie between 0 and 180 degrees",
        ),
        (
            lambda: Camera.look_at((0, 0, 1), (0, 0, 0), fov_y=np.nan),
            "camera fov_y nan; the angle must lie between 0 and 180 degrees",
        ),
        (
            lambda: Camera.orthographic((0, 0, 1), (0, 0, 0), height=0),
            "camera height 0; the height must be positive and finite",
        ),
        (
            lambda: Camera.orthographic((0, 0, 1), (0, 0, 0), height=np.inf),
            "camera height inf; the height must be positive and finite",
        ),
        (lambda: Camera(POSE, fov_y=45, height=1), "camera; a camera needs either fov_y or height"),
        (lambda: Camera(POSE, fov_y=None), "camera; a camera needs either fov_y or height"),
        (lambda: Camera(SCALED), "camera pose; the pose scales, shears or mirrors"),
        (lambda: Camera(MIRRORED), "camera pose; the pose scales, shears or mirrors"),
        (lambda: Camera(SHORT), "camera pose; the pose must be a finite 4x4 matrix"),
        (lambda: Camera(NAN_POSE), "camera pose; the pose must be a finite 4x4 matrix"),
    ],
)
def test_there_is_no_such_camera(make: Callable[[], Camera], message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        make()


def test_the_pose_is_a_read_only_copy() -> None:
    source = np.eye(4)
    camera = Camera(source)
    source[0, 3] = 7
    assert camera.eye.tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        camera.pose[0, 3] = 7


@pytest.mark.parametrize("size", [(4, 3), [4, 3], np.array([4, 3]), (4.0, 3.0)], ids=repr)
def test_a_size_is_two_whole_numbers(size: Any) -> None:
    assert check_size(size) == (4, 3)


@pytest.mark.parametrize("size", [(0, 3), (4, -1), (1.5, 2), (4,), (4, 3, 2), 4, None, ("a", 2), (np.nan, 2)], ids=repr)
def test_a_frame_has_no_such_size(size: Any) -> None:
    with pytest.raises(tl.InputError, match=re.escape(f"frame size {size!r}; the size must be ")):
        check_size(size)


def test_framing_takes_the_part_of_the_picture_that_is_requested() -> None:
    points = np.random.default_rng(3).normal(size=(50, 3))
    for size, fit in (((64, 48), 0.8), ((48, 64), 0.5)):
        camera = Camera.framing(points, size, fit=fit)
        assert np.abs(_in_picture(camera, points, size)).max() == pytest.approx(fit, abs=1e-12)
    with pytest.raises(tl.InputError, match=r"fit 1\.5; the value must be above 0 and at most 1"):
        Camera.framing(points, fit=1.5)
