"""Inscribed spheres against all points of all faces, and against the shapes for which they are known."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from math import cos, radians

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.assets import mesh_path
from translucent.bake import inscribed
from translucent.bake.inscribed import InscribedSpheres
from translucent.bake.measure import Measure
from translucent.bake.rays import Points, PreparedMesh
from translucent.bake.settings import BakeSettings
from translucent.geometry.solids import Torus

#: Points along each side of a face.
GRID = 30


def prism() -> tl.Mesh:
    """An L, turned off the axes: flat faces of several triangles each, and an edge that looks inwards."""
    outline = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))[:3, :3]
    made = trimesh.creation.extrude_triangulation(outline, np.array(faces), 0.8).subdivide()
    return tl.Mesh(made.vertices @ turn.T, made.faces)


def points_of(mesh: tl.Mesh, count: int, *, flat: bool) -> tuple[PreparedMesh, Points]:
    """A surface and points all over it, with the normals of the faces where they are `flat`."""
    surface = PreparedMesh.of(mesh)
    if flat:
        surface = dataclasses.replace(surface, normals=np.repeat(surface.planes[:, None, :3], 3, axis=1))
    rng = np.random.default_rng(5)
    return surface, surface.points(rng.integers(0, len(surface.faces), count), rng.dirichlet([1, 1, 1], count))


def by_points(surface: PreparedMesh, points: Points) -> np.ndarray:
    """Diameters by the definition, over a grid of points in each face: never too small, and too large by its step."""
    i, j = np.array([(i, j) for i in range(GRID + 1) for j in range(GRID + 1 - i)]).T / GRID
    grid = np.einsum("gc,mci->mgi", np.stack([i, j, 1 - i - j], axis=1), surface.corners)
    found = np.full(len(points), np.inf)
    for k in range(len(points)):
        start, inward = points.start[k], -points.normal[k]
        away = np.delete(grid, points.face[k], axis=0).reshape(-1, 3) - start
        depth, square = away @ inward, (away**2).sum(axis=1)
        seen = depth > cos(radians(70)) * np.sqrt(square)
        found[k] = min((square[seen] / depth[seen]).min(initial=np.inf), 2.0)
    return found


SHAPES = [
    pytest.param(prism, True, id="prism"),
    pytest.param(lambda: Torus(0.1, 0.04).tessellate(16), False, id="torus"),
    pytest.param(lambda: trimesh_mesh(trimesh.creation.icosphere(2)), False, id="ball"),
]


def trimesh_mesh(made: trimesh.Trimesh) -> tl.Mesh:
    return tl.Mesh(made.vertices, made.faces)


@pytest.mark.parametrize(("make", "flat"), SHAPES)
def test_no_point_of_the_surface_is_in_the_sphere(make: Callable[[], tl.Mesh], flat: bool) -> None:
    surface, points = points_of(make(), 40, flat=flat)
    found = Measure(surface, BakeSettings(mode="inscribed")).at(points).values / surface.radius
    expected = by_points(surface, points)
    assert (found <= expected * (1 + 1e-9)).all()
    # The face that touches may be met between two points, or at the edge of the cone.
    step = np.linalg.norm(np.diff(surface.corners, axis=1), axis=2).max() / GRID
    assert (expected <= found + 2.0 * step).all()
    assert np.median(expected / found) < 1.003


def test_the_tree_leaves_no_face_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers as from all faces, whatever the first sphere and however many pairs are looked at at a time."""
    surface, points = points_of(tl.load_mesh(mesh_path("bangle")), 40, flat=False)
    spheres = InscribedSpheres(surface)
    first = np.full(len(points), 1.0)
    found = spheres.diameters(points, first)
    every = np.arange(len(surface.faces))
    radius = first.copy()
    spheres._touch(points, np.repeat(np.arange(len(points)), len(every)), np.tile(every, len(points)), radius)
    np.testing.assert_array_equal(found, 2.0 * radius)
    monkeypatch.setattr(inscribed, "MOST_PAIRS", 1000)
    np.testing.assert_array_equal(spheres.diameters(points, 1.001 * radius), found)


def test_a_large_mesh_may_be_off_by_its_slack(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, points = points_of(tl.load_mesh(mesh_path("knot")), 200, flat=False)
    exact = InscribedSpheres(surface).diameters(points, np.ones(200))
    monkeypatch.setattr(inscribed, "LARGE", 100)
    close = InscribedSpheres(surface).diameters(points, np.ones(200))
    assert (close >= exact).all()
    assert (close <= exact * (1 + 1.01 * inscribed.LARGE_SLACK)).all()


def test_edges_against_many_points_of_each(rng: np.random.Generator) -> None:
    start, along, inward = rng.standard_normal((3, 400, 3))
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    found = inscribed._on_edge(start, along, inward)
    points = start[:, None] + np.linspace(0, 1, 5001)[:, None] * along[:, None]
    depth, square = np.einsum("kgi,ki->kg", points, inward), (points**2).sum(axis=2)
    seen = depth > cos(radians(70)) * np.sqrt(square)
    expected = np.where(seen, 0.5 * square / np.where(seen, depth, 1.0), np.inf).min(axis=1)
    none = np.isinf(expected)
    assert 100 < none.sum() < 300
    assert np.isinf(found[none]).mean() > 0.99  # a line may graze the cone between two points
    found, expected = found[~none], expected[~none]
    assert (found <= expected * (1 + 1e-12)).all()
    # At the edge of the cone the quotient falls, and is off by a step; elsewhere by the square of one.
    assert (expected <= found * 1.01).all()
    assert np.quantile(expected / found, 0.6) < 1 + 1e-6
