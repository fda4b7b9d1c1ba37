"""All surfaces on pixel rays: bit for bit those of the reference, however hard the mesh is for float32 rays."""

from __future__ import annotations

import builtins
import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import translucent as tl
from translucent.cpu import hits as picture
from translucent.cpu.hits import Band, PictureRays, PixelTracer, TracedMesh, joined_hits
from translucent.geometry.ray_caster import RayCaster
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.reference import Hits, line_hits

IDENTITY = np.eye(4)
MESHES = Path(__file__).parents[2] / "meshes"


def embree_hits(
    mesh: tl.Mesh, matrix: Any, camera: tl.Camera, size: tuple[int, int], offset: tuple[float, float] = (0.0, 0.0)
) -> Hits:
    """All surfaces of a mesh on the pixel rays, as `line_hits` finds them."""
    seen = PictureRays.of(camera, size, offset)
    tracer = PixelTracer(TracedMesh.of(mesh), tl.Object(mesh, transform=matrix), seen)
    parts = []
    for band in seen.bands():
        hits = tracer.hits(band)
        parts.append(replace(hits, pixel=hits.pixel + band.first_row * band.width))
    return joined_hits(parts)


def assert_same(found: Hits, expected: Hits) -> None:
    for name in ("pixel", "face", "sign", "distance", "barycentric"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def assert_as_reference(
    mesh: tl.Mesh, camera: tl.Camera, size: tuple[int, int] = (64, 64), matrix: npt.ArrayLike = IDENTITY
) -> Hits:
    expected = line_hits(mesh, matrix, camera, size)
    assert_same(embree_hits(mesh, matrix, camera, size), expected)
    return expected


def together(parts: Sequence[tl.Mesh]) -> tl.Mesh:
    """Several meshes as one, in which nothing is welded."""
    begins = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + begin for part, begin in zip(parts, begins, strict=False)]
    return tl.Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def cells(filled: npt.NDArray[np.bool_]) -> tl.Mesh:
    """Unit boxes at integer positions; neighbors share their walls, which coincide in opposite directions."""
    corners = np.argwhere(filled).astype(np.float64)
    return together([Box(tuple(low), tuple(low + 1.0)).tessellate() for low in corners])


def cameras(mesh: tl.Mesh, size: tuple[int, int]) -> dict[str, tl.Camera]:
    center, reach = mesh.center, mesh.diagonal
    view = np.array([0.45, 0.35, 1.0]) / np.linalg.norm([0.45, 0.35, 1.0])
    return {
        "near": tl.Camera.framing(mesh.vertices, size),
        "far": tl.Camera.look_at(center + 1e4 * reach * view, center, fov_y=np.degrees(1e-4)),
        "orthographic": tl.Camera.orthographic(center + reach * view, center, height=reach),
        "along an axis": tl.Camera.orthographic(center + (0.0, 0.0, reach), center, height=reach),
        "inside": tl.Camera.look_at(center + 0.01 * reach * view, center - reach * view[[1, 0, 2]], fov_y=100.0),
        "on a vertex": tl.Camera.look_at(mesh.vertices[mesh.faces[0, 0]], center, fov_y=100.0),
    }


@pytest.mark.parametrize("name", ["bunny.obj", "armadillo.obj", "mengerSponge3.glb", "quadknot.obj", "ballA.off"])
def test_scanned_and_made_meshes(name: str, assets: Path) -> None:
    mesh = tl.load_mesh(assets / "meshes_clean" / name, unit="m")
    for camera in cameras(mesh, (40, 30)).values():
        assert_as_reference(mesh, camera, (40, 30))


@pytest.mark.parametrize("path", sorted(MESHES.glob("*.ply")), ids=lambda path: path.stem)
def test_meshes_of_the_project(path: Path) -> None:
    mesh = tl.load_mesh(path)
    seen = cameras(mesh, (16, 16))
    for name in ("near", "inside", "on a vertex"):
        assert len(assert_as_reference(mesh, seen[name], (16, 16)).pixel)


def lattice_camera(size: int, span: float) -> tl.Camera:
    """Looks down on [0, span]^2 with pixel centers on the multiples of 1/2 there, and beyond."""
    return tl.Camera.orthographic((span / 2, span / 2, 99.0), (span / 2, span / 2, 0.0), height=size / 2)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_vertices_edges_and_double_walls_on_pixel_centers(share: float, rng: np.random.Generator) -> None:
    mesh = cells(rng.random((5, 5, 5)) < share)
    camera, size = lattice_camera(13, 5.0), (13, 13)
    at = camera.rays(size)[0][..., :2]
    assert np.abs(2 * at - np.rint(2 * at)).max() < 1e-12, "every pixel center is on a lattice line or in a middle"
    assert len(assert_as_reference(mesh, camera, size).pixel)
    # The same walls from within: rays run inside of them.
    for eye in ((2.5, 2.5, 2.5), (2.0, 2.0, 2.0), (0.0, 0.0, 0.0)):
        assert_as_reference(mesh, tl.Camera.look_at(eye, (eye[0], eye[1], -9.0), fov_y=90.0), (21, 21))


def test_coincident_faces() -> None:
    plate = Box((0.0, 0.0, 0.0), (1.0, 1.0, 0.1)).tessellate()
    shifted = Box((0.3, 0.2, 0.0), (1.4, 1.3, 0.1)).tessellate()
    behind = Box((0.0, 0.0, 0.1), (1.0, 1.0, 0.3)).tessellate()
    for mesh in (
        together([plate, plate]),
        together([plate, plate, plate]),
        together([plate, shifted]),
        together([plate, behind]),
        together([plate, shifted, behind, plate]),
    ):
        for camera in cameras(mesh, (40, 40)).values():
            assert_as_reference(mesh, camera, (40, 40))


@pytest.mark.parametrize("thickness", [1e-4, 1e-6, 1e-9])
def test_thin_slabs(thickness: float) -> None:
    slab = Box((0.0, 0.0, 0.0), (1.0, 1.0, thickness)).tessellate()
    for eye in ((0.4, 0.3, 2.0), (0.3, 0.4, 300.0), (3.0, 0.4, 1e-3), (3.0, 0.4, thickness / 2)):
        target = (0.5, 0.5, thickness / 2)
        fov = np.degrees(1.5 / np.linalg.norm(np.subtract(eye, target)))
        # An odd number of rows, for the middle one meets the edge of the slab.
        assert len(assert_as_reference(slab, tl.Camera.look_at(eye, target, fov_y=fov), (65, 65)).pixel)


def test_a_hundred_nested_shells() -> None:
    shells = [
        tl.Mesh(radius * sphere.vertices, sphere.faces[:, ::side])
        for sphere in [Sphere().tessellate(16)]
        for radius, side in zip(np.linspace(0.01, 1.0, 100), itertools.cycle([1, -1]), strict=False)
    ]
    mesh = together(shells)
    camera = tl.Camera.look_at((0.3, 0.5, 3.0), (0.0, 0.0, 0.0), fov_y=45.0)
    hits = assert_as_reference(mesh, camera, (25, 25))
    assert np.bincount(hits.pixel).max() == 200
    assert_as_reference(mesh, tl.Camera.look_at((0.1, 0.2, 0.3), (0.0, 0.0, 0.0), fov_y=90.0), (24, 24))


@pytest.mark.parametrize("distance", [3.0, 1e6])
def test_needles_at_the_pole_of_a_sphere(distance: float) -> None:
    camera = tl.Camera.look_at((0.0, 0.0, distance), (0.0, 0.0, 0.0), fov_y=1e-4 / distance)
    assert len(assert_as_reference(Sphere().tessellate(256), camera, (9, 9)).pixel) >= 162


def test_needles_seen_along_them(rng: np.random.Generator) -> None:
    start = rng.normal(size=(200, 3))
    corners = np.stack([start, start + rng.normal(size=(200, 3)), start + 1e-7 * rng.normal(size=(200, 3))], axis=1)
    mesh = tl.Mesh(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    # Each eye is in the line of a needle.
    for a, b, _ in corners[:10]:
        assert_as_reference(mesh, tl.Camera.look_at(b + 0.5 * (b - a), a, fov_y=1e-5), (15, 15))


@pytest.mark.parametrize("perspective", [True, False])
def test_edges_and_vertices_on_rays_up_to_rounding(perspective: bool, rng: np.random.Generator) -> None:
    eye, target, size, count = (0.4, 0.3, 3.0), (0.1, 0.0, 0.0), (40, 30), 400
    camera = tl.Camera.look_at(eye, target) if perspective else tl.Camera.orthographic(eye, target, height=2.0)
    origins, directions = (array.reshape(-1, 3)[rng.integers(0, 1200, count)] for array in camera.rays(size))
    on_ray = origins + rng.uniform(0.5, 5.0, (count, 1)) * directions
    along, beside = rng.normal(size=(2, count, 3))
    start = np.where(np.arange(count)[:, None] < count // 4, on_ray, on_ray - along)
    corners = np.stack([start, on_ray + rng.uniform(0.1, 2.0, (count, 1)) * along, on_ray + beside], axis=1)
    assert_as_reference(tl.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), camera, size)


TRANSFORMS = {
    "scaled": np.diag([1e-3, 1.0, 20.0, 1.0]),
    "mirrored": np.diag([-1.0, 1.0, 1.0, 1.0]),
    "sheared": np.array([(1, 2, 0, 0), (0, 1, 0, 0), (0.5, 0, -1, 0), (0, 0, 0, 1.0)]),
    "far away": np.array([(1, 0, 0, 1e6), (0, 1, 0, -2e6), (0, 0, 1, 3e5), (0, 0, 0, 1.0)]),
}


@pytest.mark.parametrize("kind", TRANSFORMS)
def test_transforms(kind: str) -> None:
    mesh, matrix = Sphere().tessellate(40), TRANSFORMS[kind]
    world = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    assert len(assert_as_reference(mesh, tl.Camera.framing(world, (48, 32)), (48, 32), matrix).pixel)


@pytest.mark.parametrize("scale", [1e-13, 1e13])
def test_any_unit(scale: float) -> None:
    sphere = Sphere().tessellate(24)
    mesh = tl.Mesh(scale * sphere.vertices, sphere.faces)
    for camera in cameras(mesh, (16, 16)).values():
        assert len(assert_as_reference(mesh, camera, (16, 16)).pixel)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.floats(1e-3, 179.0), st.booleans())
def test_random_triangles_around_the_eye(seed: int, perspective: bool, fov: float, rounded: bool) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 40))
    vertices = random.normal(size=(2 * count, 3))
    if rounded:  # vertices in common, faces in common planes, of no area, and through the eye
        vertices = np.rint(vertices)
    faces = random.integers(0, len(vertices), size=(count, 3))
    eye, target = random.normal(size=(2, 3))
    eye = np.rint(eye) if rounded else eye
    camera = (
        tl.Camera.look_at(eye, target, fov_y=fov) if perspective else tl.Camera.orthographic(eye, target, height=3.0)
    )
    mesh = tl.Mesh(vertices, faces)
    if mesh.diagonal > 0:
        assert_as_reference(mesh, camera, (int(random.integers(1, 25)), int(random.integers(1, 25))))


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (300, 1), (8192, 2)])
def test_narrow_pictures(size: tuple[int, int]) -> None:
    mesh = Sphere().tessellate(32)
    camera = tl.Camera.orthographic((0.1, 0.2, 3.0), (0.0, 0.0, 0.0), height=1.5 * max(1.0, size[1] / size[0]))
    assert len(assert_as_reference(mesh, camera, size).pixel)


def test_bands_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = Sphere().tessellate(32)
    camera = tl.Camera.look_at((0.9, 0.2, 0.1), (0.0, 0.1, 0.0), fov_y=120.0)
    whole = embree_hits(mesh, IDENTITY, camera, (50, 41))
    for band, rows in ((1, 256), (300, 256), (1 << 20, 3)):
        monkeypatch.setattr(picture, "BAND", band)
        monkeypatch.setattr(picture, "BAND_ROWS", rows)
        assert_same(embree_hits(mesh, IDENTITY, camera, (50, 41)), whole)


def test_threads_do_not_show() -> None:
    mesh = Sphere().tessellate(64)
    camera = tl.Camera.look_at((0.3, 0.2, 3.0), (0.0, 0.1, 0.0))
    seen = PictureRays.of(camera, (160, 160))
    tracer = PixelTracer(TracedMesh.of(mesh), tl.Object(mesh), seen)
    alone = [tracer.hits(band) for band in seen.bands()]
    fresh = PixelTracer(TracedMesh.of(mesh), tl.Object(mesh), seen)
    with ThreadPoolExecutor(8) as pool:
        for hits, expected in zip(pool.map(fresh.hits, list(seen.bands()) * 4), alone * 4, strict=True):
            assert_same(hits, expected)


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("offset", [(0.25, -0.4), (-0.5, 0.5)])
def test_offset_from_the_pixel_centers(offset: tuple[float, float], perspective: bool) -> None:
    mesh, size = Sphere().tessellate(48), (40, 30)
    eye, target = (0.4, 0.3, 3.0), (0.1, 0.0, 0.0)
    camera = tl.Camera.look_at(eye, target) if perspective else tl.Camera.orthographic(eye, target, height=2.0)
    hits = embree_hits(mesh, IDENTITY, camera, size, offset)
    origins, directions = (array.reshape(-1, 3)[hits.pixel] for array in camera.rays(size, offset))
    at = np.einsum("ki,kij->kj", hits.barycentric, mesh.vertices[mesh.faces[hits.face]])
    np.testing.assert_allclose(at, origins + hits.distance[:, None] * directions, atol=1e-14)


@pytest.mark.parametrize("perspective", [True, False])
def test_rays_of_a_band_are_those_of_the_picture(perspective: bool) -> None:
    eye, target = (0.4, 0.3, 3.0), (0.1, 0.0, 0.0)
    camera = tl.Camera.look_at(eye, target) if perspective else tl.Camera.orthographic(eye, target, height=2.0)
    offset = (0.2, -0.3)
    expected = tl.reference.pixel_rays(camera, (40, 30), offset)
    rays = PictureRays.of(camera, (40, 30), offset).rays(Band(7, 5, 40))
    for name in ("origins", "directions", "backdrop"):
        found = getattr(expected.where(slice(280, 480)), name)
        np.testing.assert_allclose(getattr(rays, name), found, rtol=0, atol=1e-15)


class Forgetful(RayCaster):
    """Finds only some of the faces."""

    def candidates(self, *arguments: Any) -> Any:
        ray, face = super().candidates(*arguments)
        keep = np.arange(len(ray)) % 7 > 2
        return ray[keep], face[keep]


def test_what_embree_misses_is_noticed_and_found(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = Sphere().tessellate(48)
    seen = PictureRays.of(tl.Camera.look_at((0.3, 0.2, 3.0), (0.0, 0.1, 0.0)), (60, 60))
    traced = TracedMesh(Forgetful(mesh), TracedMesh.of(mesh).edges)
    tracer = PixelTracer(traced, tl.Object(mesh), seen)
    (band,) = seen.bands()
    expected = line_hits(mesh, IDENTITY, seen.camera, seen.size)
    found, incomplete = tracer.search(band)
    missed = np.bincount(expected.pixel, minlength=3600) != np.bincount(found.pixel, minlength=3600)
    assert missed.sum() > 500
    np.testing.assert_array_equal(incomplete, missed)
    assert_same(tracer.hits(band), expected)


@pytest.mark.parametrize("name", ["near", "far", "orthographic", "inside", "on a vertex"])
def test_the_last_resort_is_rare(name: str) -> None:
    # Thousands of rays meet faces; those through the middle of one are sure in float32, and edges are 10^-6 as wide.
    mesh = Torus().tessellate(64)
    seen = PictureRays.of(cameras(mesh, (96, 96))[name], (96, 96))
    (band,) = seen.bands()
    hits, incomplete = PixelTracer(TracedMesh.of(mesh), tl.Object(mesh), seen).search(band)
    assert len(hits.pixel) > 2500
    assert np.count_nonzero(incomplete) <= 2


def test_without_embreex(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *arguments: Any, **options: Any) -> Any:
        if name.startswith("embreex"):
            raise ImportError(f"No module named {name!r}")
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(
        tl.RenderError, match=r"embreex cannot be imported .*; pip install -U embreex, or render with OpenGL"
    ):
        TracedMesh.of(Sphere().tessellate(8))
