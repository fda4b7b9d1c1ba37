"""Properties of a mesh: volume, bounds, normals, winding number; and what is none."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from tests.values.handmade import (
    CORNERS,
    CUBE,
    DOUBLED,
    EPS,
    TETRAHEDRON,
    ball,
    bitten_box,
    cube,
    inverted,
    joined,
    moebius,
)
from translucent.geometry.mesh import MAX_COORDINATE, Mesh
from translucent.geometry.normals import corner_angles

# Volume


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (cube(), 1.0),
        (inverted(cube()), -1.0),
        (Mesh(*TETRAHEDRON), 1 / 6),
        (joined(cube(), inverted(cube(low=0.25, size=0.5))), 0.875),
        (bitten_box(), 3.0),
        (Mesh(CORNERS, DOUBLED), 0.0),
    ],
    ids=["cube", "inverted", "tetrahedron", "cavity", "L", "slit"],
)
def test_the_signed_volume_by_hand(mesh: Mesh, volume: float) -> None:
    assert mesh.volume == pytest.approx(volume, rel=8 * EPS, abs=8 * EPS)


@given(st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_the_volume_does_not_depend_on_the_place(shift: tuple[float, ...]) -> None:
    body = ball(2)
    moved = Mesh(body.vertices + shift, body.faces)
    # Vertices round by EPS/2 of 1e6 each; volume changes by at most that times the area, 4 pi.
    assert moved.volume == pytest.approx(body.volume, abs=1e6 * EPS * 4 * math.pi)


def test_a_far_away_cube_has_exactly_its_volume() -> None:
    assert Mesh(CORNERS + np.array([1e6, -1e6, 1e6]), CUBE).volume == 1.0


# Geometry


def test_bounds_center_and_diagonal_ignore_unreferenced_vertices() -> None:
    mesh = Mesh(np.vstack([CORNERS * (1, 2, 3), [[99.0, 0, 0]]]), CUBE)
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 2, 3]]
    assert mesh.center.tolist() == [0.5, 1, 1.5]
    assert mesh.diagonal == pytest.approx(math.sqrt(14), rel=2 * EPS)


def test_angles_at_the_corners_of_triangles() -> None:
    places = np.random.default_rng(1).normal(size=(200, 3, 3))
    # Roundings of two edges, their cross product and the angle, at each of three corners.
    assert corner_angles(places).sum(axis=1) == pytest.approx(math.pi, abs=12 * EPS)
    right = corner_angles(np.array([[[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [0.0, 3.0, 5.0]]]))
    assert right[0] == pytest.approx([math.pi / 2, math.atan2(3, 4), math.atan2(4, 3)], abs=4 * EPS)


def test_vertex_normals_of_a_ball_point_outwards() -> None:
    # By angle weights the error is of second order in the edge length, 0.16 here at most.
    body = ball(3)
    edge = np.linalg.norm(body.vertices[body.faces[:, 0]] - body.vertices[body.faces[:, 1]], axis=1).max()
    assert np.linalg.norm(body.vertex_normals, axis=1) == pytest.approx(1.0, abs=4 * EPS)
    assert np.linalg.norm(body.vertex_normals - body.vertices, axis=1).max() < edge**2


def test_vertex_normals_of_a_cube_are_its_diagonals_whatever_its_triangulation() -> None:
    # Every corner has three right angles, one per face, however many triangles share them.
    assert cube().vertex_normals == pytest.approx((CORNERS - 0.5) / np.linalg.norm([0.5] * 3), abs=8 * EPS)


def test_vertex_normals_are_unit_where_nothing_says_which_way() -> None:
    mesh = Mesh(np.vstack([CORNERS, [[5.0, 5, 5]]]), np.vstack([CUBE, [[0, 0, 1]]]))
    assert np.linalg.norm(mesh.vertex_normals, axis=1) == pytest.approx(1.0, abs=4 * EPS)
    assert np.linalg.norm(Mesh(CORNERS, DOUBLED).vertex_normals, axis=1) == pytest.approx(1.0, abs=4 * EPS)


@pytest.mark.parametrize(
    ("point", "number"),
    [
        ((0.5, 0.5, 0.5), 1.0),
        ((1e-9, 0.3, 0.9), 1.0),
        ((1.5, 0.5, 0.5), 0.0),
        ((-1e-9, 0.3, 0.9), 0.0),
        ((1e6, 2e6, 3e6), 0.0),
        ((0.0, 0.3, 0.9), 1 / 2),  # on a face
        ((0.7, 0.5, 0.5), 1.0),
        ((0.0, 0.5, 0.5), 1 / 2),  # where its triangles meet
        ((0.0, 0.0, 0.3), 1 / 4),  # on an edge
        ((0.0, 0.0, 0.0), 1 / 8),  # on a corner
        ((1.0, 1.0, 1.0), 1 / 8),
    ],
)
def test_the_winding_number_is_the_share_of_the_sphere_of_directions_inside(
    point: tuple[float, float, float], number: float
) -> None:
    # Twelve solid angles; next to a face, 1e-9 away, its angle lacks some 1e-9.
    assert cube().winding_number(point) == pytest.approx(number, abs=1e-8)
    assert inverted(cube()).winding_number(point) == pytest.approx(-number, abs=1e-8)


@pytest.mark.parametrize("weights", [(1, 1, 1), (3, 1, 1), (1, 0.1, 7)])
def test_the_winding_number_is_a_half_on_a_slanted_face_too(weights: tuple[float, ...]) -> None:
    point = np.array(weights) / sum(weights)  # x + y + z = 1, up to rounding
    assert Mesh(*TETRAHEDRON).winding_number(point) == pytest.approx(0.5, abs=1e-14)


def test_the_winding_number_counts_how_often_a_point_is_enclosed() -> None:
    nested = joined(cube(), cube(low=0.25, size=0.5))
    cavity = joined(cube(), inverted(cube(low=0.25, size=0.5)))
    for mesh, inside, between in ((nested, 2, 1), (cavity, 0, 1)):
        assert mesh.winding_number((0.5, 0.5, 0.5)) == pytest.approx(inside, abs=1e-14)
        assert mesh.winding_number((0.1, 0.2, 0.3)) == pytest.approx(between, abs=1e-14)


def test_half_of_the_directions_leave_through_a_missing_wall() -> None:
    open_box = Mesh(CORNERS, CUBE[2:])  # without the wall x = 0
    assert open_box.winding_number((0.0, 0.5, 0.5)) == pytest.approx(0.5, abs=1e-14)
    assert open_box.winding_number((0.5, 0.5, 0.5)) == pytest.approx(5 / 6, abs=1e-14)


@pytest.mark.parametrize(
    ("distance", "near"), [(0.0, True), (9e-4, True), (1.1e-3, False), (-9e-4, True), (0.4, False)]
)
def test_near_a_surface(distance: float, near: bool) -> None:
    box = Mesh(CORNERS, CUBE)
    assert box.is_near((0.3, 0.6, 1.0 + distance), 1e-3) is near


# Construction


@pytest.mark.parametrize(
    ("vertices", "faces", "uv", "message"),
    [
        (CORNERS, [], None, "mesh 'mesh'; the mesh has no faces"),
        ([], [[0, 1, 2]], None, "face 0 = (0, 1, 2) refers to points outside the 0 vertices"),
        (CORNERS, [[0, 1, 2], [0, 1, 8]], None, "face 1 = (0, 1, 8) refers to points outside the 8 vertices"),
        (CORNERS, [[0, 1, -1]], None, "face 0 = (0, 1, -1) refers to points outside"),
        (CORNERS[:, :2], CUBE, None, "vertices has the shape (8, 2); use the shape (n, 3)"),
        (CORNERS, [[0, 1, 2, 3]], None, "faces has the shape (1, 4); use the shape (n, 3)"),
        (CORNERS, [0, 1, 2], None, "faces has the shape (3,)"),
        (CORNERS, CUBE, CORNERS, "uv has the shape (8, 3); use the shape (n, 2)"),
        (CORNERS, CUBE, CORNERS[:4, :2], "4 uv for 8 vertices"),
        ([["a", "b", "c"]], CUBE, None, "the values of vertices cannot be converted to float64"),
        (CORNERS, [[0, 1, 2**40]], None, "the values of faces cannot be converted to int32"),
        ([[0, 0, 0], [1, 1]], CUBE, None, "the values of vertices cannot be converted"),
    ],
)
def test_such_arrays_are_no_mesh(vertices: Any, faces: Any, uv: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        Mesh(vertices, faces, uv)


def test_a_mesh_keeps_its_own_read_only_arrays() -> None:
    source = CORNERS.copy()
    mesh = Mesh(source, CUBE, uv=CORNERS[:, :2])
    source[:] = 7.0
    assert mesh.vertices.tolist() == CORNERS.tolist()
    for array in (mesh.vertices, mesh.faces, mesh.uv):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.nan, "2 vertices are not finite (first: 1)"),
        (-np.inf, "2 vertices are not finite (first: 1)"),
        (2 * MAX_COORDINATE, "a coordinate is 2e+18 m, beyond the limit of 1e+18 m; state the unit of the file"),
    ],
)
def test_coordinates_that_cannot_be_drawn_are_refused(value: float, message: str) -> None:
    vertices = CORNERS.copy()
    vertices[[1, 5], [0, 2]] = value
    with pytest.raises(tl.InputError, match=re.escape(message)):
        Mesh(vertices, CUBE).require_finite()


def test_the_summary_can_be_written_as_json() -> None:
    written = json.loads(json.dumps(cube().summary()))
    assert written["volume"] == 1.0
    assert written["bounds"] == [[0, 0, 0], [1, 1, 1]]
    assert json.loads(json.dumps(moebius().summary()))["volume"] is None


@pytest.mark.parametrize("faces", [[[0, 1, 2**63]], [[0.5, 1, 2.7]], [[True, False, True]], [["a", "b", "c"]]])
def test_indices_that_are_no_indices_are_refused(faces: list[list[object]]) -> None:
    with pytest.raises(tl.InputError, match="the values of faces cannot be converted to int32"):
        Mesh(np.eye(3), np.array(faces))
