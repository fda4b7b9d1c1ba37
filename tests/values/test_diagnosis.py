"""Diagnoses of hand-made meshes, and which are convex."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh

from tests.values.handmade import (
    CLEAN,
    CORNERS,
    CUBE,
    DOUBLED,
    QUADS,
    TETRAHEDRON,
    ball,
    bitten_box,
    changed,
    cube,
    facts,
    inverted,
    joined,
    moebius,
)
from translucent.geometry.mesh import Mesh

WITH_NAN = np.vstack([CORNERS[:-1], [[1.0, np.nan, 1.0]]])
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
        (Mesh(CORNERS, CUBE[:, ::-1]), "inverted: all faces point inwards"),
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


@pytest.mark.parametrize(
    ("mesh", "convex"),
    [
        (cube(), True),
        (inverted(cube()), True),
        (Mesh(*TETRAHEDRON), True),
        (ball(), True),
        (ball(radius=1e-6), True),
        (Mesh(ball().vertices + 1e6, ball().faces), True),
        (bitten_box(), False),
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
