"""Rays through the hierarchies of meshes and objects, against Embree and the float64 reference."""

from __future__ import annotations

import dataclasses
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.ray_probe import RayProbe
from tests.rays import Found, agreeing, embree_nearest, inside_points, random_rays, through
from translucent.assets import mesh_path
from translucent.geometry.solids import Box, Sphere
from translucent.gpu import hierarchies
from translucent.gpu import hierarchies as module
from translucent.gpu.hierarchies import HierarchyCache, SceneHierarchies, packed_mesh
from translucent.gpu.layout import OBJECT_ROW
from translucent.gpu.textures import unlike_powers
from translucent.reference.hits import camera_hits

OWN = ("bear", "goblet", "knot", "bangle")
THIRD_PARTY = ("bunny.obj", "armadillo.obj")

#: Share of random rays on which two tracers in float32 may differ by more than rounding: they graze a silhouette.
DIFFERENT = 2e-5

CAMERA = tl.Camera.look_at((0, 0, 5), (0, 0, 0))
WATER = tl.Medium.from_color((0.8, 0.3, 0.2), 0.02, ior=1.5)


class Tracing:
    """Tracer of the rays of one context."""

    def __init__(self, gl: moderngl.Context) -> None:
        self.gl, self.probe, self.held = gl, RayProbe(gl), HierarchyCache(gl)

    def __call__(self, scene: tl.Scene, origins: Any, directions: Any, **bounds: Any) -> Found:
        hits = self.probe.nearest(scene, self.held.of(scene), origins, directions, **bounds)
        return Found(hits.path.astype(np.float64), hits.object, hits.face)


@pytest.fixture(scope="module")
def trace(renderer: tl.Renderer) -> Iterator[Tracing]:
    with renderer.gpu.context.current() as gl:
        made = Tracing(gl)
        yield made
        made.held.release()


@pytest.fixture(params=[*OWN, *THIRD_PARTY])
def mesh(request: pytest.FixtureRequest) -> tl.Mesh:
    if request.param in OWN:
        return tl.load_mesh(mesh_path(request.param))
    assets: Path = request.getfixturevalue("assets")
    return tl.load_mesh(assets / "meshes_clean" / request.param)


def scene_of(*objects: tl.Object) -> tl.Scene:
    return tl.Scene(list(objects), CAMERA)


def ball(subdivisions: int = 3) -> tl.Mesh:
    made = trimesh.creation.icosphere(subdivisions)
    return tl.Mesh(made.vertices, made.faces)


def test_nearest_surfaces_are_those_of_embree(trace: Tracing, mesh: tl.Mesh, rng: np.random.Generator) -> None:
    scene = scene_of(tl.Object(mesh, WATER))
    rays = random_rays(scene, 30_000, rng)
    ours, theirs = trace(scene, *rays), embree_nearest(scene, *rays)
    assert (theirs.face >= 0).sum() > 3000
    assert (~agreeing(scene, ours, theirs)).sum() <= max(1, DIFFERENT * len(rays[0]))


@pytest.mark.parametrize("name", ["bear", "goblet"])
def test_nearest_surfaces_are_those_of_the_reference(trace: Tracing, name: str) -> None:
    mesh = tl.load_mesh(mesh_path(name))
    size = (96, 96)
    scene = scene_of(tl.Object(mesh, WATER))
    for direction in ((1, 0.2, 0.3), (-0.3, -1, 0.5), (0.0, 0.1, -1.0)):
        camera = tl.Camera.framing(mesh.vertices, size, direction=direction)
        hits = camera_hits(mesh, np.eye(4), camera, size)
        pixels, first = np.unique(hits.pixel, return_index=True)
        truth = Found.nothing(size[0] * size[1])
        truth.path[pixels], truth.object[pixels], truth.face[pixels] = hits.distance[first], 0, hits.face[first]
        origins, directions = (part.reshape(-1, 3) for part in camera.rays(size))
        ours = trace(scene, origins, directions)
        assert len(pixels) > 1000
        # One pixel may see a silhouette otherwise than the truth does: its ray is rounded to float32.
        assert (~agreeing(scene, ours, truth)).sum() <= 1


def test_no_ray_from_inside_leaks(trace: Tracing, mesh: tl.Mesh, rng: np.random.Generator) -> None:
    if not mesh.diagnosis.solid:
        pytest.skip(f"{mesh.name} is open")
    scene = scene_of(tl.Object(mesh, WATER))
    points = inside_points(mesh, 32, rng)
    origins = np.repeat(points, 1000, axis=0)
    directions = rng.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (trace(scene, origins, directions).face < 0).sum() == 0


def test_no_ray_leaks_through_edges_and_vertices(trace: Tracing, mesh: tl.Mesh, rng: np.random.Generator) -> None:
    if not mesh.diagnosis.solid:
        pytest.skip(f"{mesh.name} is open")
    scene = scene_of(tl.Object(mesh, WATER))
    points = inside_points(mesh, 16, rng)
    origins = np.repeat(points, 2000, axis=0)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=len(origins))]]
    share = np.where(np.arange(len(origins)) % 3 == 0, 0.0, rng.random(len(origins)))[:, None]
    targets = (1 - share) * corners[:, 0] + share * corners[:, 1]
    assert (trace(scene, *through(origins, targets)).face < 0).sum() == 0


def test_rays_along_axes_through_edges_of_a_box(trace: Tracing) -> None:
    box = trimesh.creation.box((2, 2, 2)).subdivide().subdivide()
    scene = scene_of(tl.Object(tl.Mesh(box.vertices, box.faces), WATER))
    at = np.linspace(-0.75, 0.75, 7)
    a, b = (part.ravel() for part in np.meshgrid(at, at))
    for axis in range(3):
        for side in (-1.0, 1.0):
            origins = np.insert(np.stack([a, b], axis=1), axis, 0.0, axis=1)
            directions = np.zeros_like(origins)
            directions[:, axis] = side
            found = trace(scene, origins, directions)
            np.testing.assert_array_equal(found.path, 1.0)


def test_surfaces_count_between_start_and_end(trace: Tracing) -> None:
    scene = scene_of(tl.Object(ball(), WATER))
    origins, directions = np.tile((-3.0, 0.01, 0.02), (4, 1)), np.tile((1.0, 0.0, 0.0), (4, 1))
    found = trace(scene, origins, directions, start=[0, 2.5, 0, 2.5], end=[1e30, 1e30, 1.5, 3.5])
    np.testing.assert_allclose(found.path[:2], [2, 4], atol=0.02)
    assert found.object.tolist() == [0, 0, -1, -1]


def turned(angle: float, axis: tuple[float, float, float]) -> np.ndarray:
    return np.asarray(trimesh.transformations.rotation_matrix(angle, axis))


def placed(scale: Any, offset: Any, matrix: np.ndarray | None = None) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = (np.eye(4) if matrix is None else matrix)[:3, :3] * np.asarray(scale, dtype=float)
    made[:3, 3] = offset
    return made


PLACEMENTS = {
    "two bodies": [placed(1, (0, 0, 0)), placed(0.7, (0.8, 0.3, 0.1), turned(1.0, (1, 2, 3)))],
    "three bodies": [placed(1, (0, 0, 0)), placed(0.4, (1.2, 0, 0)), placed(2.5, (0, -1, -1))],
    "mirrored": [placed((-1, 1, 1), (0, 0, 0)), placed((1, -0.8, 1.2), (1.5, 0, 0), turned(0.5, (0, 1, 1)))],
    "not uniform": [placed((1, 0.02, 3), (0, 0, 0)), placed((0.3, 2, 0.01), (0.5, 0, 0), turned(0.5, (0, 1, 1)))],
    "tiny": [placed(1, (0, 0, 0)), placed(1e-4, (1.001, 0, 0)), placed(1e-4, (0, 2, 0), turned(1.0, (1, 2, 3)))],
    "far": [placed(1, (1e6, -1e6, 1e6)), placed(0.5, (1e6 + 1, -1e6, 1e6), turned(1.0, (1, 2, 3)))],
    "tiny and far": [placed(1e-4, (1e6, 0, 1e6)), placed(5e-5, (1e6 + 1e-4, 0, 1e6))],
    "huge": [placed(1e15, (0, 0, 0)), placed(5e14, (1e15, 0, 0), turned(1.0, (1, 2, 3)))],
}


@pytest.mark.parametrize("placements", PLACEMENTS.values(), ids=PLACEMENTS)
def test_instances(trace: Tracing, placements: list[np.ndarray], rng: np.random.Generator) -> None:
    mesh = tl.load_mesh(mesh_path("bear"))
    size = placed(1.0 / np.abs(mesh.vertices - mesh.center).max(), (0, 0, 0)) @ placed(1, -mesh.center)
    scene = scene_of(*(tl.Object(mesh, WATER, transform=matrix @ size) for matrix in placements))
    rays = random_rays(scene, 20_000, rng)
    ours, theirs = trace(scene, *rays), embree_nearest(scene, *rays)
    assert set(np.unique(theirs.object)) == {-1, *range(len(placements))}
    # A position in float32 is a share of the scene off, by which rays miss the silhouettes of a tiny body.
    smallest = min(0.5 * np.ptp(body.bounds, axis=0).max() for body in scene.objects)
    different = DIFFERENT + 6e-8 * scene.diagonal / smallest
    assert (~agreeing(scene, ours, theirs)).sum() <= max(1, different * len(rays[0]))


def test_objects_of_different_meshes(trace: Tracing, rng: np.random.Generator) -> None:
    meshes = ball(3), ball(1), ball(2)
    scene = scene_of(*(tl.Object(mesh, WATER, transform=placed(1, (3 * i, 0, 0))) for i, mesh in enumerate(meshes)))
    rays = random_rays(scene, 20_000, rng)
    ours, theirs = trace(scene, *rays), embree_nearest(scene, *rays)
    assert agreeing(scene, ours, theirs).all()
    assert (ours.face == theirs.face).mean() > 0.999


def test_rays_from_afar_do_not_pass_between_triangles(trace: Tracing, rng: np.random.Generator) -> None:
    mesh = ball(5)
    scene = scene_of(tl.Object(mesh, WATER))
    for distance in (10.0, 1e3, 1e5):
        targets = 0.9 * random_directions(rng, 20_000) * rng.random((20_000, 1))
        origins = (distance * random_directions(rng, 20_000)).astype(np.float32).astype(np.float64)
        found = trace(scene, *through(origins, targets))
        assert (found.face < 0).sum() == 0
        # A direction in float32 misses its aim by 6e-8 of the distance, on a ball that it meets at a cosine above 0.4.
        assert np.abs(found.path - (distance - 0.7)).max() < 1.0 + 1e-5 * distance


def random_directions(rng: np.random.Generator, count: int) -> np.ndarray:
    directions = rng.normal(size=(count, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@pytest.mark.parametrize("size", [1e-15, 1e-6, 1e6, 1e17])
def test_rays_almost_along_an_axis_in_a_mesh_of_any_size(trace: Tracing, size: float) -> None:
    made = ball(4)
    scene = scene_of(tl.Object(tl.Mesh(made.vertices * size, made.faces), WATER))
    slope = np.concatenate([[0.0], np.geomspace(1e-12, 0.5, 400)])
    directions = np.stack([np.ones_like(slope), slope, 0.3 * slope], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = trace(scene, np.tile((-0.9 * size, 0, 0), (len(slope), 1)), directions)
    x = directions[:, 0]
    expected = 0.9 * x + np.sqrt((0.9 * x) ** 2 + 1 - 0.81)
    np.testing.assert_allclose(found.path / size, expected, rtol=3e-3)


def test_vertices_that_no_face_uses_cost_no_precision(trace: Tracing, rng: np.random.Generator) -> None:
    made = ball()
    mesh = tl.Mesh(np.vstack([made.vertices, [[1e9, 0, 0]]]), made.faces)
    scene = scene_of(tl.Object(mesh, WATER))
    rays = np.zeros((2000, 3)), random_directions(rng, 2000)
    np.testing.assert_allclose(trace(scene, *rays).path, 1.0, atol=0.02)


def test_a_body_that_moves_keeps_the_textures(trace: Tracing, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = ball()
    still = tl.Object(mesh, WATER)
    rays = np.array([[5.0, 0.01, 0.02]]), np.array([[-1.0, 0.0, 0.0]])
    before = scene_of(still, tl.Object(mesh, WATER, transform=placed(1, (-9, 0, 0))))
    assert trace(before, *rays).object.tolist() == [0]
    held = trace.held.of(before)

    def refuse(*_: object) -> None:
        raise AssertionError("made anew")

    monkeypatch.setattr(module, "_texture", refuse)
    after = dataclasses.replace(before, objects=(still, tl.Object(mesh, WATER, transform=placed(1, (2, 0, 0)))))
    found = trace(after, *rays)
    assert trace.held.of(after) is held
    assert found.object.tolist() == [1]
    np.testing.assert_allclose(found.path, 2.0, atol=0.02)


def fake(limit: int) -> Any:
    """An OpenGL in which nothing can be made."""
    return SimpleNamespace(info={"GL_MAX_TEXTURE_SIZE": limit}, extra=None)


def test_textures_that_do_not_fit_are_refused_before_they_are_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hierarchies, "build_hierarchy", None)
    with pytest.raises(
        tl.RenderError, match=r"this OpenGL allows 2048 texels along a side, .* use interfaces=tl.ScreenInterfaces\(\)$"
    ):
        SceneHierarchies(fake(2048), [ball()], 1)
    # Thirty million triangles: only their number is read.
    crowd: Any = SimpleNamespace(faces=np.broadcast_to(np.int32(0), (30_000_000, 3)))
    with pytest.raises(tl.RenderError, match=r"at least 119,999,992 texels, .* allows 67,108,864; .* coarser meshes"):
        SceneHierarchies(fake(16384), [crowd], 1)


def test_textures_that_turn_out_not_to_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_require_room", lambda gl, meshes: None)
    monkeypatch.setattr(module, "_MOST_ROWS", 2)
    with pytest.raises(tl.RenderError, match="texels, but this OpenGL allows 8,192"):
        SceneHierarchies(fake(16384), [ball()], 1)


def test_much_memory_is_told_before_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hierarchies, "build_hierarchy", None)
    monkeypatch.setattr(module, "MUCH_MEMORY", 1 << 20)
    with pytest.warns(
        tl.TranslucentWarning, match=r"20,480 triangles takes up to 18.6 MiB of memory; to save memory, use"
    ):
        module._require_room(fake(16384), [ball(5)])


def test_memory_is_not_underestimated() -> None:
    mesh = ball(5)
    tracemalloc.start()
    packed = packed_mesh(mesh)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 2 * (packed.nodes.nbytes + packed.triangles.nbytes) < module._PACKED_BYTES * len(mesh.faces)
    assert peak < (module._PACKED_BYTES + module._BUILD_BYTES) * len(mesh.faces) < 2 * peak
    assert kept < peak


def test_numbers_of_nodes_survive_float32() -> None:
    names = OBJECT_ROW.dtype.names or ()
    for number in (4095, 4096, (1 << 24) + 1, (1 << 28) - 1):
        record = {name: np.zeros(OBJECT_ROW.dtype[name].shape) for name in names}
        record["first_node"] = divmod(number, 1 << 12)
        packed = OBJECT_ROW.pack([record]).ravel().view(OBJECT_ROW.dtype)["first_node"][0]
        assert int(packed[0]) << 12 | int(packed[1]) == number


def test_code_compiled_for_a_small_scene_fits_a_large_one(renderer: tl.Renderer) -> None:
    assert [unlike_powers(side) for side in (1, 2, 3, 64, 100)] == [3, 3, 3, 65, 100]
    with renderer.gpu.context.current() as gl:
        for mesh in (Box().tessellate(), Sphere().tessellate(32)):
            made = SceneHierarchies(gl, [mesh], 1)
            for texture in (made.nodes, made.triangles):
                # Another code is compiled where a side is a power of two: the width always is, the height never.
                assert texture.height & (texture.height - 1) != 0
            made.release()
