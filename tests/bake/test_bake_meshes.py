"""Bakes to vertices, from high to low, and of third-party meshes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Ellipsoid, Sphere
from translucent.bake.measure import Measure
from translucent.bake.rays import PreparedMesh
from translucent.bake.settings import BakeSettings


def test_vertices_of_a_sphere() -> None:
    sphere = Sphere(radius=0.02)
    found = tl.bake_vertex_thickness(sphere.tessellate(48))
    assert (np.abs(found.values - 0.08 / 3) <= 3 * found.standard_error + 4 * sphere.sagitta(48)).all()
    assert found.report.escaped == 0


def test_vertices_of_a_box_have_the_mean_of_its_sides() -> None:
    found = tl.bake_vertex_thickness(Box((0, 0, 0), (1.0, 2.0, 4.0)).tessellate(), "normal")
    assert np.allclose(found.values, (1.0 + 2.0 + 4.0) / 3, rtol=1e-6)


def test_a_vertex_shows_itself_and_not_its_surroundings() -> None:
    """The tip of a long ellipsoid: the normals of its next ring already lead out through the side."""
    tip = tl.bake_vertex_thickness(Ellipsoid(radii=(1.0, 1.0, 8.0)).tessellate(32), "normal").values.max()
    assert np.isclose(tip, 16.0, rtol=0.01)


def test_vertices_at_one_position_are_equal_and_unused_ones_are_zero() -> None:
    solid = Sphere().tessellate(16)
    corners = solid.vertices[solid.faces].reshape(-1, 3)
    split = tl.Mesh(np.concatenate([corners, [(9, 9, 9)]]), np.arange(len(corners)).reshape(-1, 3))
    found = tl.bake_vertex_thickness(split)
    assert found.values[-1] == 0
    assert np.allclose(found.values[:-1].reshape(-1, 3), tl.bake_vertex_thickness(solid).values[solid.faces], rtol=1e-6)


def high_and_low() -> tuple[tl.Mesh, tl.Mesh]:
    return Sphere(radius=1.0).tessellate(128), Sphere(radius=1.0).tessellate(24)


@pytest.mark.parametrize("way", ["cage", "distance", "default"])
def test_high_to_low(way: str) -> None:
    """A coarse ball shows the fine one's thickness, which is not its own."""
    high, low = high_and_low()
    cage = tl.Mesh(low.vertices * 1.05, low.faces)
    asked = {"cage": {"cage": cage}, "distance": {"high_distance": 0.05}, "default": {}}[way]
    baked = tl.bake_thickness(low, 48, mode="normal", high=high, **asked)
    fine, coarse = Sphere(radius=1.0).sagitta(128), Sphere(radius=1.0).sagitta(24)
    values = baked.values[baked.coverage]
    assert (np.abs(values - 2.0) <= 6 * fine).all()
    assert 6 * fine < coarse
    assert baked.report.missed == 0


def test_high_to_low_where_nothing_is_found() -> None:
    high, low = high_and_low()
    half = tl.Mesh(high.vertices, high.faces[high.vertices[high.faces][..., 2].mean(axis=1) > 0])
    with pytest.warns(tl.TranslucentWarning) as said:
        baked = tl.bake_thickness(low, 48, mode="normal", high=half)
    assert any("of the samples missed the detailed mesh" in str(one.message) for one in said)
    assert 0.4 < baked.report.missed < 0.6


def test_a_cage_of_another_mesh_is_refused() -> None:
    high, low = high_and_low()
    with pytest.raises(tl.InputError, match="make the cage by moving the vertices of the mesh outwards"):
        tl.bake_thickness(low, 16, high=high, cage=Sphere().tessellate(20))
    with pytest.raises(tl.InputError, match="each of them determines where rays search for the detailed mesh"):
        tl.bake_thickness(low, 16, high=high, cage=low, high_distance=1.0)


def test_a_unit_cube(assets: Path) -> None:
    baked = tl.bake_thickness(tl.load_mesh(assets / "meshes_clean" / "unit_cube.STL"), 64, mode="normal")
    assert np.allclose(baked.values[baked.coverage], 1.0, rtol=1e-6)
    assert (baked.values >= 0).all()


def test_the_bottom_of_a_tray(assets: Path) -> None:
    baked = tl.bake_thickness(tl.load_mesh(assets / "meshes_clean" / "1002_tray_bottom.STL"), 128, mode="normal")
    assert np.isclose(np.median(baked.values[baked.coverage]), 3.175, rtol=1e-6)


CLEAN = ["armadillo.obj", "featuretype.STL", "idler_riser.STL", "mengerSponge3.glb", "rocker-arm.obj", "testplate.glb"]


@pytest.mark.parametrize("name", CLEAN)
def test_no_ray_escapes_from_a_closed_mesh(assets: Path, name: str) -> None:
    """At most two rays of a hundred thousand escape, as Embree promises of watertight meshes."""
    _, surface, face, weights, _ = sampled(name, assets, 2000)
    measured = Measure(surface, BakeSettings()).at(surface.points(face, weights))
    assert measured.cast == 128_000
    assert measured.escaped <= 2


def sampled(name: str, assets: Path, count: int) -> tuple[tl.Mesh, PreparedMesh, np.ndarray, np.ndarray, np.ndarray]:
    """A mesh, and points of its faces whose normals are the faces' own."""
    mesh = tl.load_mesh(assets / "meshes_clean" / name)
    smooth = PreparedMesh.of(mesh)
    surface = dataclasses.replace(smooth, normals=np.repeat(smooth.planes[:, None, :3], 3, axis=1))
    rng = np.random.default_rng(2)
    area = np.linalg.norm(np.cross(*(surface.corners[:, i] - surface.corners[:, 0] for i in (1, 2))), axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    weights = 0.02 + 0.94 * rng.dirichlet([1, 1, 1], count)
    position = np.einsum("kc,kci->ki", weights, mesh.vertices[mesh.faces[surface.faces[face]]])
    return mesh, surface, face, weights, position


@pytest.mark.parametrize("name", ["unit_cube.STL", "1002_tray_bottom.STL", "bunny.obj"])
def test_trimesh_agrees(assets: Path, name: str) -> None:
    import trimesh

    mesh, surface, face, weights, position = sampled(name, assets, 2000)
    theirs = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    with np.errstate(all="ignore"):
        expected = trimesh.proximity.thickness(theirs, position, normals=surface.planes[face, :3], method="ray")
    found = Measure(surface, BakeSettings(mode="normal")).at(surface.points(face, weights)).values
    # trimesh lets Embree's float32 tell the distance.
    assert np.allclose(found, expected, rtol=1e-6, atol=2e-6 * mesh.diagonal)


def test_inscribed_spheres_agree_with_trimesh(assets: Path) -> None:
    pytest.importorskip("rtree", reason="trimesh needs it for its own spheres")
    import trimesh

    mesh, surface, face, weights, position = sampled("unit_cube.STL", assets, 100)
    theirs = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    with np.errstate(all="ignore"):
        expected = trimesh.proximity.thickness(theirs, position, normals=surface.planes[face, :3], method="max_sphere")
    found = Measure(surface, BakeSettings(mode="inscribed")).at(surface.points(face, weights)).values
    # Theirs stops shrinking at 1e-6 of the scale; ours starts off the edges of the face.
    assert np.allclose(found, expected, rtol=1e-4, atol=1e-4)


NASTY = [
    "3storybuilding.glb",
    "sphereWithHole.stl",
    "self_intersectA.obj",
    "chair_model.obj",
    "multibody.stl",
    "nested_shell_Cray_left.obj",
]


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
@pytest.mark.parametrize("gaps", ["first-exit", "total"])
def test_nasty_meshes_bake(assets: Path, name: str, gaps: str) -> None:
    mesh = tl.load_mesh(assets / "meshes_nasty" / name)
    found = tl.bake_vertex_thickness(tl.Mesh(mesh.vertices, mesh.faces[:3000]), rays=8, gaps=gaps)
    assert np.isfinite(found.values).all()
    assert (found.values >= 0).all()
