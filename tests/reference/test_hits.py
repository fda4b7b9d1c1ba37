"""Rays against triangles: watertight on edges and vertices, and the same as a plain ray tracer elsewhere."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.reference import Hits, camera_hits, line_hits
from translucent.reference.hits import CHUNK, _edge_functions
from translucent.scene.camera import Camera

IDENTITY = np.eye(4)


def voxels(filled: npt.NDArray[np.bool_]) -> Mesh:
    """Unit cubes at the integer positions that are filled, (x, y, z), without the walls between them."""
    padded = np.pad(filled, 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        square = np.array([0 * u, u, u + v, v])
        for side in (0, 1):
            neighbor = np.roll(padded, 1 - 2 * side, axis=axis)
            corner = np.argwhere(padded & ~neighbor) - 1 + side * np.eye(3)[axis]
            quads.append(corner[:, None] + (square if side else square[::-1]))
    points, index = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    quad = index.reshape(-1, 4)
    return Mesh(points, np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]))


def menger(level: int) -> npt.NDArray[np.bool_]:
    sponge = np.ones((1, 1, 1), dtype=bool)
    cell = np.ones((3, 3, 3), dtype=bool)
    cell[1, 1, :] = cell[1, :, 1] = cell[:, 1, 1] = False
    for _ in range(level):
        sponge = np.kron(sponge, cell)
    return sponge


def signed_sums(hits: Hits, size: tuple[int, int]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(h, w): the sum of signs, and of signed distances."""
    count, total = (
        np.bincount(hits.pixel, weights, size[0] * size[1]).reshape(size[::-1])
        for weights in (hits.sign, -hits.sign * hits.distance)
    )
    return count, total


def lattice_camera(cells: int, size: int) -> Camera:
    """Looks down on the cells' lattice, with `size` pixels whose centers are 1 / 2 or 1 apart, on its lines."""
    # An odd number of pixels has one in the middle: the height makes pixels 1/2 apart, from -1/2 to cells + 1/2.
    height = size * (cells + 1) / (size - 1)
    return Camera.orthographic((cells / 2, cells / 2, cells + 5.0), (cells / 2, cells / 2, 0.0), height=height)


@pytest.mark.parametrize("kind", ["cube", "sponge", "random"])
def test_vertices_and_edges_on_pixel_centers(kind: str) -> None:
    cells, size = 9, 21
    filled = {
        "cube": np.ones((9, 9, 9), dtype=bool),
        "sponge": menger(2),
        "random": np.random.default_rng(1).random((9, 9, 9)) < 0.5,
    }[kind]
    camera = lattice_camera(cells, size)
    xy = camera.rays((size, size))[0][..., :2]
    assert np.abs(2 * xy - np.rint(2 * xy)).max() < 1e-12, "every pixel center is on a lattice line or in a middle"
    count, thickness = signed_sums(camera_hits(voxels(filled), IDENTITY, camera, (size, size)), (size, size))
    assert not count.any()
    # On a tie the ray moves right and up, so a ray on a vertex belongs to the column of cells there.
    column, row = (np.floor(np.rint(2 * xy[..., i]) / 2).astype(int) + 1 for i in range(2))
    expected = np.pad(filled, ((1, 1), (1, 1), (0, 0))).sum(axis=2)[column, row]
    np.testing.assert_array_equal(thickness, expected)


@pytest.mark.parametrize("pixels", [8, 32])
@pytest.mark.parametrize("shift", [(0, 0), (-1, 0), (-2, -1)])
def test_grid_cube_with_all_its_vertices_on_pixel_centers(pixels: int, shift: tuple[int, int]) -> None:
    grid = voxels(np.ones((4, 4, 4), dtype=bool))
    low = (np.array([*shift, 0]) + 0.5) / pixels
    mesh = Mesh(grid.vertices / 4 + low, grid.faces)
    camera = Camera.orthographic((0.5, 0.5, 3.0), (0.5, 0.5, 0.0), height=1.0)
    count, thickness = signed_sums(camera_hits(mesh, IDENTITY, camera, (pixels, pixels)), (pixels, pixels))
    assert not count.any()
    at = camera.rays((pixels, pixels))[0]
    # The ray moves right and up: the cube has its left and lower edge, not its right and upper one.
    covered = ((at >= low) & (at < low + 1))[..., :2].all(axis=-1)
    np.testing.assert_array_equal(thickness, np.where(covered, 1.0, 0.0))


@pytest.mark.parametrize(
    "eye", [(4.5, 4.5, 20.0), (4.0, 4.0, 13.0), (4.5, 4.5, 4.5), (3.0, 3.0, 4.0), (20.0, 17.0, 14.0)]
)
def test_perspective_through_a_sponge_is_balanced(eye: tuple[float, float, float]) -> None:
    camera = Camera.look_at(eye, (eye[0], eye[1], 0.0) if eye[0] < 10 else (4.5, 4.5, 4.5), fov_y=90.0)
    count, _ = signed_sums(line_hits(voxels(menger(2)), IDENTITY, camera, (65, 65)), (65, 65))
    assert not count.any()


@pytest.mark.parametrize("distance", [3.0, 1e6])
def test_rays_at_the_pole_of_a_sphere(distance: float) -> None:
    mesh = Sphere().tessellate(256)  # needles meet at the pole, in the center of the picture
    camera = Camera.look_at((0.0, 0.0, distance), (0.0, 0.0, 0.0), fov_y=1e-4 / distance)
    hits = camera_hits(mesh, IDENTITY, camera, (9, 9))
    count, thickness = signed_sums(hits, (9, 9))
    assert not count.any()
    np.testing.assert_allclose(thickness, 2.0, atol=1e-9)


def test_equal_positions_are_one_vertex_however_they_are_indexed() -> None:
    mesh = Sphere().tessellate(32)
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    camera = Camera.look_at((1.3, 2.1, 2.7), (0.1, 0.0, 0.0), fov_y=60)
    a, b = (camera_hits(m, IDENTITY, camera, (64, 64)) for m in (mesh, soup))
    for name in ("pixel", "distance", "sign", "face"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_sorted_and_described() -> None:
    camera = Camera.look_at((0.3, 0.4, 5.0), (0.0, 0.0, 0.0))
    mesh = Sphere().tessellate(24)
    hits = camera_hits(mesh, IDENTITY, camera, (40, 30))
    assert [getattr(hits, n).dtype for n in ("pixel", "distance", "sign", "face")] == [
        np.int64,
        np.float64,
        np.int8,
        np.int64,
    ]
    order = np.lexsort((hits.distance, hits.pixel))
    np.testing.assert_array_equal(order, np.arange(len(order)))
    origins, directions = (a.reshape(-1, 3)[hits.pixel] for a in camera.rays((40, 30)))
    at = np.einsum("ki,kij->kj", hits.barycentric, mesh.vertices[mesh.faces[hits.face]])
    np.testing.assert_allclose(at, origins + hits.distance[:, None] * directions, atol=1e-14)
    np.testing.assert_array_equal(hits.sign, np.where(np.arange(len(order)) % 2 == 0, 1, -1))


def test_entries_go_before_exits_at_one_distance() -> None:
    a, b = Box((0, 0, 0), (1, 1, 1)).tessellate(), Box((1, 0, 0), (2, 1, 1)).tessellate()
    camera = Camera.orthographic((-1.0, 0.6, 0.4), (0.0, 0.6, 0.4), height=0.1)
    for first, second in ((a, b), (b, a)):
        faces = np.concatenate([first.faces, second.faces + 8])
        hits = camera_hits(Mesh(np.concatenate([first.vertices, second.vertices]), faces), IDENTITY, camera, (1, 1))
        assert hits.distance.tolist() == [1, 2, 2, 3]
        assert hits.sign.tolist() == [1, 1, -1, -1]


def test_faces_without_area_contribute_nothing() -> None:
    box = Box().tessellate()
    faces = np.concatenate([box.faces, [(0, 0, 1), (2, 2, 2)]])
    camera = Camera.orthographic((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), height=0.9)
    hits = camera_hits(Mesh(box.vertices, faces), IDENTITY, camera, (6, 6))
    assert len(hits.pixel) == 72
    # The four sides are parallel to all rays.
    assert set(hits.face) == set(np.flatnonzero(np.ptp(box.vertices[box.faces][..., 2], axis=1) == 0))


def test_one_large_triangle_in_many_chunks() -> None:
    size = (512, 3 * CHUNK // 512)
    mesh = Mesh([(-9e3, -9e3, -1), (9e3, -9e3, -1), (0, 9e3, -1)], [(0, 1, 2)])
    hits = camera_hits(mesh, IDENTITY, Camera(np.eye(4), fov_y=90.0), size)
    np.testing.assert_array_equal(hits.pixel, np.arange(size[0] * size[1]))


@given(
    st.lists(
        st.floats(-1.0, 1.0, allow_subnormal=False).filter(lambda x: x == 0 or abs(x) > 1e-60), min_size=4, max_size=4
    ),
    st.integers(-3, 3),
)
def test_edge_function_has_the_sign_of_exact_arithmetic(point: list[float], ulps: int) -> None:
    a = np.array(point[:2])
    b = a * point[2]  # nearly, or exactly, on one line with a and 0
    b[1] += ulps * np.spacing(b[1] or 1e-60)
    exact = Fraction(a[0]) * Fraction(b[1]) - Fraction(a[1]) * Fraction(b[0])
    (sign,), (size,) = _edge_functions(a[None], b[None])
    (other,), _ = _edge_functions(b[None], a[None])
    assert sign == -other
    if exact:
        assert sign == (1 if exact > 0 else -1)
        assert size == pytest.approx(float(abs(exact)), rel=1e-14)
    else:
        assert size == 0
        assert (sign == 0) == np.array_equal(a, b)


def moller_trumbore(
    mesh: Mesh, origins: npt.NDArray[np.float64], directions: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
    """(rays, faces): hit, too near to an edge or to the origin to tell, and distance."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    e1, e2 = b - a, c - a
    p = np.cross(directions[:, None], e2)
    determinant = np.einsum("fi,rfi->rf", e1, p)
    s = origins[:, None] - a
    q = np.cross(s, e1)
    determinant = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
    u = np.einsum("rfi,rfi->rf", s, p) / determinant
    v = np.einsum("ri,rfi->rf", directions, q) / determinant
    t = np.einsum("fi,rfi->rf", e2, q) / determinant
    edge = np.min([u, v, 1 - u - v], axis=0)
    return (edge > 0) & (t > 0), (np.abs(edge) < 1e-9) | (np.abs(t) < 1e-9), t


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.floats(5.0, 170.0))
def test_same_as_moller_trumbore(seed: int, perspective: bool, fov: float) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 30))
    mesh = Mesh(random.normal(size=(3 * count, 3)), np.arange(3 * count).reshape(-1, 3))
    eye, target = random.normal(size=(2, 3))  # among the triangles
    camera = Camera.look_at(eye, target, fov_y=fov) if perspective else Camera.orthographic(eye, target, height=3.0)
    size = (int(random.integers(1, 20)), int(random.integers(1, 20)))
    hits = camera_hits(mesh, IDENTITY, camera, size)
    origins, directions = (a.reshape(-1, 3) for a in camera.rays(size))
    expected, unsure, distance = moller_trumbore(mesh, origins, directions)
    found = np.zeros_like(expected)
    found[hits.pixel, hits.face] = True
    assert len(hits.pixel) == found.sum(), "no pair twice"
    assert not ((found != expected) & ~unsure).any()
    sure = ~unsure[hits.pixel, hits.face]
    np.testing.assert_allclose(hits.distance[sure], distance[hits.pixel, hits.face][sure], rtol=1e-6, atol=1e-9)
    a, b, c = mesh.vertices[mesh.faces[hits.face]].transpose(1, 0, 2)
    facing = -np.einsum("ki,ki->k", np.cross(b - a, c - a), directions[hits.pixel])
    np.testing.assert_array_equal(hits.sign[sure], np.sign(facing)[sure])
