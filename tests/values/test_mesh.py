"""Meshes: what is wrong with hand-made ones, what loading mends, and what the winding number says."""

from __future__ import annotations

import csv
import itertools
import json
import math
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.diagnosis import Diagnosis, Finding
from translucent.mesh import MAX_COORDINATE, Mesh, load_mesh
from translucent.repair import WELD_TOLERANCE, weld
from translucent.solids import Sphere, Torus

Array = npt.NDArray[np.float64]
EPS = float(np.finfo(np.float64).eps)

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
#: A cube with corner i at (i >> 2, i >> 1, i) of 0..1, wound outwards.
CUBE = np.array([triangle for a, b, c, d in QUADS for triangle in ((a, b, c), (a, c, d))])
TETRAHEDRON = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def cube(low: float = 0.0, size: float = 1.0) -> Mesh:
    return Mesh(CORNERS * size + low, CUBE)


def changed(faces: npt.NDArray[Any], *, drop: int | None = None, flip: int | None = None, repeat: int | None = None):
    result = faces.copy()
    if flip is not None:
        result[flip] = result[flip, ::-1]
    if repeat is not None:
        result = np.vstack([result, result[repeat]])
    return result if drop is None else np.delete(result, drop, axis=0)


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    return Mesh(vertices, np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]))


def inverted(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def moebius(count: int = 12) -> Mesh:
    """A band of `count` quads with half a turn."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = np.array(
        [
            [(1 + side * np.cos(t / 2)) * np.cos(t), (1 + side * np.cos(t / 2)) * np.sin(t), side * np.sin(t / 2)]
            for t in angle
            for side in (0.3, -0.3)
        ]
    )
    # Across the cut the two rims change places.
    pairs = [(2 * i, 2 * i + 1) for i in range(count)] + [(1, 0)]
    return Mesh(rim, [f for (a, b), (c, d) in itertools.pairwise(pairs) for f in ((a, b, c), (b, d, c))])


def ball(subdivisions: int = 3, radius: float = 1.0) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(sphere.vertices, sphere.faces)


CLEAN: dict[str, object] = {
    "nonfinite_vertices": 0,
    "unreferenced_vertices": 0,
    "degenerate_faces": 0,
    "duplicate_faces": 0,
    "open_edges": 0,
    "mixed_edges": 0,
    "nonmanifold_edges": 0,
    "components": 1,
    "closed": True,
    "solid": True,
    "inverted": False,
}


def facts(found: Diagnosis) -> dict[str, object]:
    values = {name: getattr(found, name) for name in CLEAN}
    return {name: value.count if isinstance(value, Finding) else value for name, value in values.items()}


WITH_NAN = np.vstack([CORNERS[:-1], [[1.0, np.nan, 1.0]]])
# A slit: two opposite walls at one place, joined along their border.
DOUBLED = np.vstack([CUBE[:2], CUBE[:2, ::-1]])
# Corner 0 to corner 2 of a cube, split by a vertex that lies on that edge: a face without area closes the gap.
SLIVER = (
    np.vstack([CORNERS, [[0.0, 0.5, 0.0]]]),
    np.vstack([changed(CUBE, drop=8), [[0, 8, 6], [8, 2, 6], [0, 2, 8]]]),
)


@pytest.mark.parametrize(
    ("mesh", "differs"),
    [
        (Mesh(*TETRAHEDRON), {}),
        (cube(), {}),
        (Mesh(CORNERS, CUBE[:, ::-1]), {"inverted": True}),
        (Mesh(CORNERS, changed(CUBE, drop=4)), {"open_edges": 3, "closed": False, "solid": False}),
        (Mesh(CORNERS, changed(CUBE, flip=4)), {"mixed_edges": 3, "solid": False}),
        (
            Mesh(CORNERS, changed(CUBE, repeat=4)),
            {"duplicate_faces": 1, "open_edges": 3, "nonmanifold_edges": 3, "closed": False, "solid": False},
        ),
        (Mesh(CORNERS, DOUBLED), {"duplicate_faces": 2, "nonmanifold_edges": 1, "unreferenced_vertices": 4}),
        (Mesh(CORNERS, np.vstack([CUBE, [[0, 3, 3]]])), {"degenerate_faces": 1}),
        (Mesh(*SLIVER), {"degenerate_faces": 1}),
        (Mesh(WITH_NAN, CUBE), {"nonfinite_vertices": 1, "solid": False}),
        (Mesh(np.vstack([CORNERS, [[9.0, 9, 9]]]), CUBE), {"unreferenced_vertices": 1}),
        (joined(cube(), Mesh(CORNERS + np.array([1, 1, 0]), CUBE)), {"nonmanifold_edges": 1}),
        (joined(cube(), cube(low=1.0)), {}),
        (joined(cube(), cube(low=3.0)), {"components": 2}),
        (joined(cube(), inverted(cube(low=0.25, size=0.5))), {"components": 2}),
        (moebius(), {"open_edges": 24, "mixed_edges": 1, "closed": False, "solid": False}),
    ],
    ids=[
        "tetrahedron",
        "cube",
        "all faces flipped",
        "one face missing",
        "one face flipped",
        "a face twice",
        "opposite walls at one place",
        "a face with two corners at one place",
        "a face of three points in a line",
        "a NaN vertex",
        "an unreferenced vertex",
        "two cubes that share an edge",
        "two cubes that share a corner",
        "two cubes apart",
        "a cavity",
        "a Moebius strip",
    ],
)
def test_the_diagnosis_of_a_hand_made_mesh(mesh: Mesh, differs: dict[str, object]) -> None:
    assert facts(mesh.diagnosis) == CLEAN | differs


@pytest.mark.parametrize(
    ("mesh", "problem"),
    [
        (Mesh(CORNERS, changed(CUBE, drop=0)), "3 open edges (first: vertices (0, 1), (0, 3), (1, 3))"),
        (Mesh(CORNERS, changed(CUBE, flip=0)), "3 edges with mixed winding (first: vertices (0, 1), (0, 3), (1, 3))"),
        (Mesh(CORNERS, np.vstack([CUBE, CUBE[3:4]])), "1 duplicated faces (first: face 12)"),
        (Mesh(CORNERS, DOUBLED), "1 edges with more than two faces (first: vertices (0, 3))"),
        (Mesh(CORNERS, DOUBLED), "2 duplicated faces (first: face 2, 3)"),
        (Mesh(CORNERS, DOUBLED), "4 unreferenced vertices (first: vertex 4, 5, 6)"),
        (Mesh(CORNERS, np.vstack([CUBE, [[0, 3, 3]]])), "1 faces of zero area (first: face 12)"),
        (Mesh(WITH_NAN, CUBE), "1 non-finite vertices (first: vertex 7)"),
        (Mesh(CORNERS, CUBE[:, ::-1]), "inverted: all faces look inwards"),
    ],
)
def test_a_problem_is_told_with_its_count_and_first_offenders(mesh: Mesh, problem: str) -> None:
    assert problem in mesh.diagnosis.problems
    assert problem in str(mesh.diagnosis)


def test_a_clean_solid_has_no_problems() -> None:
    assert cube().diagnosis.problems == ()
    assert str(cube().diagnosis) == "closed, convex, 1 component"
    assert str(joined(cube(), cube(low=3.0)).diagnosis) == "closed, 2 components"


def test_vertices_at_one_position_count_as_one() -> None:
    soup = Mesh(CORNERS[CUBE].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    minus_zero = Mesh(np.where(soup.vertices == 0, np.where(np.arange(36)[:, None] % 2, -0.0, 0.0), 1.0), soup.faces)
    for mesh in (soup, minus_zero):
        assert facts(mesh.diagnosis) == CLEAN


def _bitten_box() -> Mesh:
    """An L of unit thickness: a 2 x 2 square without its far quarter."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0)])
    cap = [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)]
    walls = [f for i in range(6) for j in [(i + 1) % 6] for f in ((i, j, j + 6), (i, j + 6, i + 6))]
    return Mesh(vertices, [*[c[::-1] for c in cap], *walls, *[tuple(v + 6 for v in c) for c in cap]])


@pytest.mark.parametrize(
    ("mesh", "convex"),
    [
        (cube(), True),
        (inverted(cube()), True),
        (Mesh(*TETRAHEDRON), True),
        (ball(), True),
        (ball(radius=1e-6), True),
        (Mesh(ball().vertices + 1e6, ball().faces), True),
        (_bitten_box(), False),
        (joined(cube(), cube(low=3.0)), False),
        (joined(ball(2), inverted(ball(2, 0.5))), False),
        (Mesh(CORNERS, changed(CUBE, drop=4)), False),
        (Mesh(CORNERS, DOUBLED), False),
    ],
    ids=["cube", "inverted", "tetrahedron", "ball", "tiny", "far", "L", "two", "shell", "open", "slit"],
)
def test_only_a_single_solid_without_dents_is_convex(mesh: Mesh, convex: bool) -> None:
    assert mesh.diagnosis.convex is convex


@pytest.mark.parametrize(
    ("depth", "convex"), [(0.0, True), (1e-12, True), (1e-7, True), (1e-5, False), (-1e-7, True), (-0.5, True)]
)
def test_a_dent_is_not_convex_unless_it_is_rounding(depth: float, convex: bool) -> None:
    # The wall x = 0 as four triangles around a ninth vertex in its middle, pushed in by `depth`.
    fan = [(a, b, 8) for a, b in itertools.pairwise((*QUADS[0], QUADS[0][0]))]
    mesh = Mesh(np.vstack([CORNERS, [[depth, 0.5, 0.5]]]), np.vstack([CUBE[2:], fan]))
    assert mesh.diagnosis.solid
    assert mesh.diagnosis.convex is convex


def test_a_torus_is_not_convex() -> None:
    torus = trimesh.creation.torus(1.0, 0.25, major_sections=24, minor_sections=12)
    mesh = Mesh(torus.vertices, torus.faces)
    assert facts(mesh.diagnosis) == CLEAN
    assert not mesh.diagnosis.convex


# Volume


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (cube(), 1.0),
        (inverted(cube()), -1.0),
        (Mesh(*TETRAHEDRON), 1 / 6),
        (joined(cube(), inverted(cube(low=0.25, size=0.5))), 0.875),
        (_bitten_box(), 3.0),
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


# Construction


@pytest.mark.parametrize(
    ("vertices", "faces", "uv", "message"),
    [
        (CORNERS, [], None, "mesh 'mesh'; it has no faces"),
        ([], [[0, 1, 2]], None, "face 0 = (0, 1, 2) points outside the 0 vertices"),
        (CORNERS, [[0, 1, 2], [0, 1, 8]], None, "face 1 = (0, 1, 8) points outside the 8 vertices"),
        (CORNERS, [[0, 1, -1]], None, "face 0 = (0, 1, -1) points outside"),
        (CORNERS[:, :2], CUBE, None, "vertices of shape (8, 2); give shape (n, 3)"),
        (CORNERS, [[0, 1, 2, 3]], None, "faces of shape (1, 4); give shape (n, 3)"),
        (CORNERS, [0, 1, 2], None, "faces of shape (3,)"),
        (CORNERS, CUBE, CORNERS, "uv of shape (8, 3); give shape (n, 2)"),
        (CORNERS, CUBE, CORNERS[:4, :2], "4 uv for 8 vertices"),
        ([["a", "b", "c"]], CUBE, None, "vertices are not numbers of float64"),
        (CORNERS, [[0, 1, 2**40]], None, "faces are not numbers of int32"),
        ([[0, 0, 0], [1, 1]], CUBE, None, "vertices are not numbers"),
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
        (2 * MAX_COORDINATE, "a coordinate of 2e+18 m, beyond 1e+18 m; give the file's unit"),
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


# Welding


def test_welding_joins_what_is_within_the_tolerance_and_nothing_else() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [1 + 0.9e-6, 0, 0], [1 + 1.7e-6, 0, 0], [1.1, 0, 0]])
    # The third to the fifth are a chain: neighbours of neighbours are joined.
    assert weld(points, 1e-6).tolist() == [0, 1, 0, 1, 1, 5]


@pytest.mark.parametrize(("gap", "solid"), [(0.0, True), (0.5, True), (3.0, False)])
def test_loading_closes_cracks_of_rounding_and_leaves_wider_ones(tmp_path: Path, gap: float, solid: bool) -> None:
    body = ball(1)
    corners = body.vertices[body.faces] * 1.0
    corners[0] += gap * WELD_TOLERANCE * body.diagonal / math.sqrt(3)
    path = tmp_path / "cracked.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    path.write_text("\n".join([*lines, *[f"f {i} {i + 1} {i + 2}" for i in range(1, len(lines), 3)]]))
    mesh = load_mesh(path)
    assert mesh.diagnosis.solid is solid
    assert len(mesh.vertices) == len(body.vertices) + (0 if solid else 3)
    assert f"welded {len(lines) - len(mesh.vertices)} of {len(lines)} vertices" in mesh.repairs[0]


# Loading


def save(path: Path, mesh: Mesh) -> Path:
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return path


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off", "glb"])
def test_a_format_is_read_back_as_it_was_written(tmp_path: Path, suffix: str) -> None:
    body = cube(low=0.25, size=0.5)  # float32 holds these
    mesh = load_mesh(save(tmp_path / f"cube.{suffix}", body))
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.name == f"cube.{suffix}"
    assert len(mesh.vertices) == 8
    corners = {tuple(row) for row in mesh.vertices.tolist()}
    assert corners == {tuple(row) for row in body.vertices.tolist()}
    assert mesh.volume == pytest.approx(0.125, rel=8 * EPS)


def test_an_ascii_stl_and_a_capital_suffix_are_read(tmp_path: Path) -> None:
    path = tmp_path / "CUBE.STL"
    path.write_text(trimesh.Trimesh(CORNERS, CUBE, process=False).export(file_type="stl_ascii"))
    assert facts(load_mesh(path).diagnosis) == CLEAN


@pytest.mark.parametrize(("unit", "size"), [("m", 2.0), ("cm", 0.02), ("in", 0.0508), ("µm", 2e-6), ("km", 2000.0)])
def test_coordinates_are_in_the_given_unit(tmp_path: Path, unit: str, size: float) -> None:
    mesh = load_mesh(save(tmp_path / "cube.obj", cube(size=2.0)), unit=unit)
    assert mesh.bounds == pytest.approx(np.array([[0] * 3, [size] * 3]), rel=1e-15)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="unit 'furlong'; not a known unit"):
        load_mesh(save(tmp_path / "cube.obj", cube()), unit="furlong")


def test_the_nodes_of_a_scene_become_one_mesh_in_their_places(tmp_path: Path) -> None:
    scene, part = trimesh.Scene(), trimesh.Trimesh(CORNERS, CUBE, process=False)
    for x in (0.0, 5.0):
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix((x, 0, 0)))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    assert facts(mesh.diagnosis) == CLEAN | {"components": 2}
    assert mesh.bounds.tolist() == [[0, 0, 0], [6, 1, 1]]


def test_one_flipped_face_is_turned_back_with_a_warning(tmp_path: Path) -> None:
    path = save(tmp_path / "cube.off", Mesh(CORNERS, changed(CUBE, flip=4)))
    with pytest.warns(tl.TranslucentWarning, match=re.escape("'cube.off': turned 1 of 12 faces to agree with")):
        mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.volume == 1.0


def test_a_body_inside_out_is_turned_outwards_with_a_warning(tmp_path: Path) -> None:
    path = save(tmp_path / "cube.off", inverted(cube()))
    with pytest.warns(tl.TranslucentWarning, match=re.escape("mesh 'cube.off': turned 1 closed part outwards")):
        mesh = load_mesh(path)
    assert mesh.volume == 1.0
    assert mesh.repairs == ("turned 1 closed part outwards",)


def test_a_cavity_stays_a_cavity(tmp_path: Path) -> None:
    hollow = joined(cube(), inverted(cube(low=0.25, size=0.5)))
    assert load_mesh(save(tmp_path / "hollow.off", hollow)).volume == pytest.approx(0.875, rel=8 * EPS)


@pytest.mark.parametrize("mesh", [moebius(), Mesh(CORNERS, DOUBLED), Mesh(CORNERS, CUBE[2:])])
def test_what_cannot_be_mended_is_left_alone(tmp_path: Path, mesh: Mesh) -> None:
    loaded = load_mesh(save(tmp_path / "mesh.off", mesh))
    left = facts(mesh.diagnosis) | {"unreferenced_vertices": 0}
    assert facts(loaded.diagnosis) == left


@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_flips_of_a_cube_are_repaired(tmp_path_factory: pytest.TempPathFactory, flips: list[bool]) -> None:
    faces = np.where(np.array(flips)[:, None], CUBE[:, ::-1], CUBE)
    path = save(tmp_path_factory.mktemp("flips") / "cube.off", Mesh(CORNERS, faces))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.TranslucentWarning)
        mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.volume == pytest.approx(1.0, rel=8 * EPS)


SEAM = """
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
vt 0 0\nvt 1 0\nvt 0 1\nvt 0.5 0.5
f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 1/4 4/3 3/1\nf 2/1 3/2 4/3
"""


def test_a_uv_seam_survives_welding(tmp_path: Path) -> None:
    path = tmp_path / "seam.obj"
    path.write_text(SEAM)
    mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.uv is not None
    # By hand: corner, position and uv of every face corner, and 4 positions with 9 different pairs.
    pairs = {(*p, *t) for p, t in zip(mesh.vertices.tolist(), mesh.uv.tolist(), strict=True)}
    assert (len(mesh.vertices), len(pairs)) == (8, 8)
    assert {pair[3:] for pair in pairs if pair[:3] == (0, 0, 0)} == {(0, 0), (0.5, 0.5)}
    first = mesh.faces[0]
    assert mesh.vertices[first].tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]
    assert mesh.uv[first].tolist() == [[0, 0], [0, 1], [1, 0]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "no such file; check the path"),
        ("mesh.xyzw", b"", "format '.xyzw' is not known; use obj, stl, ply, off or glb"),
        ("mesh", b"", "format 'without suffix' is not known"),
        ("empty.obj", b"", "it has no faces"),
        ("empty.stl", b"", "it has no faces"),
        ("empty.ply", b"", "it cannot be read"),
        ("garbage.glb", b"\x00\xff" * 200, "it cannot be read"),
        ("garbage.ply", b"\x00\xff" * 200, "it cannot be read"),
        ("garbage.off", b"\x00\xff" * 200, "it cannot be read"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "it has no faces; give a triangle mesh, not points or lines"),
        ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 vertices are not finite (first: 0)"),
        ("huge.obj", b"v 0 0 1e30\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "beyond 1e+18 m"),
    ],
)
def test_such_a_file_is_refused(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(tl.InputError, match=re.escape(message)) as caught:
        load_mesh(path)
    assert name in str(caught.value)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="it is a folder; give a file in it"):
        load_mesh(tmp_path)


# Meshes of other people


def _manifest(assets: Path, folder: str) -> dict[str, dict[str, str]]:
    with (assets / "MANIFEST.csv").open(encoding="utf-8") as stream:
        return {Path(row["file"]).name: row for row in csv.DictReader(stream) if row["file"].startswith(f"{folder}/")}


CLEAN_FILES = [
    "1002_tray_bottom.STL",
    "angle_block.STL",
    "armadillo.obj",
    "ballA.off",
    "ballB.off",
    "bunny.obj",
    "cow.obj",
    "cylinder.stl",
    "featuretype.STL",
    "idler_riser.STL",
    "mengerSponge3.glb",
    "penguin.obj",
    "quadknot.obj",
    "rocker-arm.obj",
    "spot.obj",
    "testplate.glb",
    "torus.obj",
    "unit_cube.STL",
    "unit_sphere.STL",
]


@pytest.mark.parametrize("name", CLEAN_FILES)
def test_a_clean_file_is_a_solid_with_the_listed_volume(assets: Path, name: str) -> None:
    row = _manifest(assets, "meshes_clean")[name]
    mesh = load_mesh(assets / "meshes_clean" / name)
    assert mesh.diagnosis.solid
    assert not mesh.diagnosis.inverted
    assert len(mesh.faces) == int(row["tri_raw"])
    # Welding moves a vertex by up to 1e-6 of the diagonal where it closes a crack: volume by that times the area.
    corners = mesh.vertices[mesh.faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(sides, axis=1).sum()
    assert mesh.volume == pytest.approx(float(row["volume"]), abs=WELD_TOLERANCE * mesh.diagonal * area)


def test_the_list_of_clean_files_is_complete(assets: Path) -> None:
    assert sorted(path.name for path in (assets / "meshes_clean").iterdir()) == sorted(CLEAN_FILES)


@pytest.mark.parametrize(
    ("name", "volume", "relative"),
    [
        ("unit_cube.STL", 1.0, 1e-6),
        ("mengerSponge3.glb", (20 / 27) ** 3, 1e-6),  # coordinates are float32
        ("angle_block.STL", 0.041358 / 0.036127, 2e-3),  # the CAD system's own; curved parts are tessellated
        ("idler_riser.STL", 0.14522859 / 0.09754366, 2e-3),
    ],
)
def test_the_volume_of_a_known_body(assets: Path, name: str, volume: float, relative: float) -> None:
    assert load_mesh(assets / "meshes_clean" / name).volume == pytest.approx(volume, rel=relative)


def test_seams_of_a_textured_model_survive(assets: Path) -> None:
    spot = load_mesh(assets / "meshes_clean" / "spot.obj")
    assert spot.uv is not None
    # The file has 3225 texture vertices on 2930 positions.
    assert len(np.unique(spot.vertices, axis=0)) == 2930
    assert 2930 < len(spot.vertices) <= 3225 + 2930


SOLID = dict(CLEAN)
OPEN = CLEAN | {"closed": False, "solid": False}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("3storybuilding.glb", SOLID | {"nonmanifold_edges": 26, "duplicate_faces": 8}),
        ("capsule.obj", SOLID | {"degenerate_faces": 200}),
        ("chair_model.obj", SOLID | {"nonmanifold_edges": 9518, "duplicate_faces": 6382, "components": 3}),
        ("cube_no_bottom.obj", OPEN | {"open_edges": 8}),
        ("fan3.obj", OPEN | {"open_edges": 7, "nonmanifold_edges": 1}),
        ("joined_tetrahedra.obj", SOLID | {"nonmanifold_edges": 3, "duplicate_faces": 1}),
        ("large_block.STL", SOLID),
        ("moebius.obj", OPEN | {"open_edges": 112, "mixed_edges": 4}),
        ("nested_shell_Cray_left.obj", SOLID | {"components": 2}),
        ("not_convex.obj", SOLID | {"nonmanifold_edges": 12}),
        ("notenoughindices.obj", OPEN | {"open_edges": 3}),
        ("self_intersectA.obj", SOLID),
        ("shared.STL", SOLID | {"nonmanifold_edges": 1}),
        ("soup.stl", OPEN | {"open_edges": 300, "components": 100}),
        ("sphereWithHole.stl", OPEN | {"open_edges": 9}),
        ("suzanne.obj", OPEN | {"open_edges": 42, "nonmanifold_edges": 1, "duplicate_faces": 1}),
        ("teapot.obj", OPEN | {"open_edges": 160, "components": 3}),
        ("wallhole.obj", SOLID | {"degenerate_faces": 11, "nonmanifold_edges": 1, "duplicate_faces": 1}),
    ],
)
def test_the_diagnosis_of_a_nasty_file(assets: Path, name: str, expected: dict[str, object]) -> None:
    assert facts(load_mesh(assets / "meshes_nasty" / name).diagnosis) == expected


@pytest.mark.parametrize(
    ("name", "repair", "volume"),
    [
        ("fandisk_inverted.obj", "turned 1 closed part outwards", 20.244),
        ("sphere_inverted.obj", "turned 1 closed part outwards", 4.047),
        ("multibody.stl", "turned 6 of 32 faces to agree with their neighbours; turned 2 closed parts outwards", None),
        ("openscad-nonmanifold-crash.obj", "turned 1 of 1442 faces to agree", 451.96),
        ("spider_binary.stl", "turned 4 of 1368 faces to agree", None),
    ],
)
def test_the_winding_of_a_nasty_file_is_mended_aloud(
    assets: Path, name: str, repair: str, volume: float | None
) -> None:
    with pytest.warns(tl.TranslucentWarning, match=re.escape(f"mesh {name!r}: {repair}")):
        mesh = load_mesh(assets / "meshes_nasty" / name)
    assert not mesh.diagnosis.mixed_edges
    assert not mesh.diagnosis.inverted
    if volume is not None:
        # Listed with four or five digits.
        assert mesh.volume == pytest.approx(volume, rel=2e-4)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("empty.stl", "it has no faces"),
        ("points_bin.ply", "it has no faces; give a triangle mesh, not points"),
        ("huge_Cray_right.obj", "a coordinate of 3.4e+38 m, beyond 1e+18 m"),
    ],
)
def test_a_nasty_file_that_cannot_be_used_is_refused(assets: Path, name: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load_mesh(assets / "meshes_nasty" / name)


def test_every_nasty_file_loads_or_is_refused_in_one_line(assets: Path) -> None:
    refused = {}
    for path in sorted((assets / "meshes_nasty").iterdir()):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", tl.TranslucentWarning)
            try:
                mesh = load_mesh(path)
            except tl.InputError as error:
                refused[path.name] = str(error)
                continue
        assert math.isfinite(mesh.volume), path.name
        assert np.isfinite(mesh.vertex_normals).all(), path.name
    assert sorted(refused) == ["empty.stl", "huge_Cray_right.obj", "points_bin.ply"]
    assert not any("\n" in message for message in refused.values())


def test_a_box_at_the_limit_of_float32_loads_with_its_unit(assets: Path) -> None:
    # 3.4e38 um would still be 3.4e32 m; nothing but a scale of the file helps, and nothing overflows on the way.
    with pytest.raises(tl.InputError, match=r"a coordinate of 3.4e\+32 m"):
        load_mesh(assets / "meshes_nasty" / "huge_Cray_right.obj", unit="um")


def _joined(*meshes: Mesh) -> Mesh:
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def _written(mesh: Mesh, path: Path) -> Path:
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return path


def test_a_part_in_the_hole_of_a_ring_is_no_cavity_and_a_shell_in_a_ball_is(tmp_path: Path) -> None:
    """The box around the ring holds both; whether a part is a cavity is for the winding number to say."""
    ring, ball = Torus().tessellate(24), Sphere(radius=0.15).tessellate(12)
    inverted = Mesh(ball.vertices, ball.faces[:, ::-1])
    assert _joined(ring, inverted).diagnosis.inside_out_parts == 1
    assert "1 closed parts inside out" in _joined(ring, inverted).diagnosis.problems
    with pytest.warns(tl.TranslucentWarning, match="turned 1 closed part outwards"):
        mended = load_mesh(_written(_joined(ring, inverted), tmp_path / "ring.ply"))
    assert mended.volume == pytest.approx(ring.volume + ball.volume, rel=1e-6)
    shell = _joined(Sphere().tessellate(24), inverted)
    assert shell.diagnosis.inside_out_parts == 0
    assert load_mesh(_written(shell, tmp_path / "shell.ply")).repairs == ()


def test_a_stray_triangle_far_away_does_not_weld_the_model_into_one_point(tmp_path: Path) -> None:
    ball, stray = Sphere().tessellate(48), Sphere(center=(1e6, 0.0, 0.0)).tessellate(4)
    loaded = load_mesh(_written(_joined(ball, stray), tmp_path / "stray.ply"))
    assert len(loaded.vertices) == len(ball.vertices) + len(stray.vertices)


def test_many_parts_are_oriented_in_one_go(tmp_path: Path) -> None:
    """Every part inside out, 1500 of them: no loop over all parts for each part."""
    ball = Sphere(radius=0.3).tessellate(4)
    parts = [Mesh(ball.vertices + (i % 40, i // 40, 0.0), ball.faces[:, ::-1]) for i in range(1500)]
    with pytest.warns(tl.TranslucentWarning, match="turned 1500 closed parts outwards"):
        assert load_mesh(_written(_joined(*parts), tmp_path / "parts.ply")).diagnosis.solid


@pytest.mark.parametrize("faces", [[[0, 1, 2**63]], [[0.5, 1, 2.7]], [[True, False, True]], [["a", "b", "c"]]])
def test_indices_that_are_no_indices_are_refused(faces: list[list[object]]) -> None:
    with pytest.raises(tl.InputError, match="faces are not numbers of int32"):
        Mesh(np.eye(3), np.array(faces))


def test_text_in_latin_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / "latin.obj"
    path.write_bytes(
        "# modèle\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n".encode("latin-1")
    )
    assert load_mesh(path).diagnosis.solid


@pytest.mark.parametrize(
    ("distance", "near"), [(0.0, True), (9e-4, True), (1.1e-3, False), (-9e-4, True), (0.4, False)]
)
def test_near_a_surface(distance: float, near: bool) -> None:
    box = Mesh(CORNERS, CUBE)
    assert box.is_near((0.3, 0.6, 1.0 + distance), 1e-3) is near
