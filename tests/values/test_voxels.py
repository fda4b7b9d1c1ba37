"""Cut cells: volumes, centroids and open faces of solids that are known, and of meshes that are not as they should be.

Lines pass through each cell on a lattice of a quarter of a cell. What a lattice finds of an area or a volume is off by
what lies in the squares of the lattice that the outline crosses.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.solids import Box, Sphere, Torus
from translucent.bench.shapes import joined
from translucent.diffusion.grid import body_grid
from translucent.diffusion.voxels import LINES, Voxels, voxels

Array = npt.NDArray[np.float64]

STEP = 0.1
SPACING = STEP / LINES
EPS = float(np.finfo(np.float64).eps)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def cut(mesh: tl.Mesh, step: float = STEP, matrix: npt.ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1))) -> Voxels:
    return voxels(mesh.vertices @ np.transpose(matrix), mesh.faces, step)


def area(mesh: tl.Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def at_most_off(surface: float) -> float:
    """Largest error of a volume: in each square of the lattice thickness changes by up to its slope times half the
    diagonal, and integrated over the lattice the slope of both sides is no more than the area of the surface.
    """
    return SPACING / math.sqrt(2) * surface


def box_off(size: npt.ArrayLike) -> float:
    """Largest error of a box's volume: each side may count up to one line too many or too few."""
    sides = np.asarray(size)
    return float(np.mean([np.prod(np.delete(sides, i) + SPACING) * sides[i] for i in range(3)]) - sides.prod())


def ball_off(radius: float) -> float:
    """Error of a ball's volume on a lattice: four times its root mean square over all places of the lattice.

    By the Fourier series of the lattice: |F(q)|^2 of a ball is (4 pi R / q^2)^2 / 2 in the mean for large q, and the
    sum over the lattice of 1 / |k|^4 is 4 zeta(2) beta(2) = 6.027.
    """
    square = (4 * math.pi * radius * (SPACING / (2 * math.pi)) ** 2) ** 2 / 2 * 6.027
    return 4 * math.sqrt(square)


BALL = Sphere(center=(0.2, -0.1, 0.05)).tessellate(64)


def test_volume_of_a_box() -> None:
    size = np.array([1.0, 0.73, 0.41])
    assert cut(Box((0, 0, 0), tuple(size)).tessellate()).volume == pytest.approx(size.prod(), abs=box_off(size))


@pytest.mark.parametrize("matrix", [np.eye(3), TURN, np.diag([1.0, -1.0, 1.0])], ids=["as it is", "turned", "mirrored"])
def test_volume_of_a_ball(matrix: Array) -> None:
    mesh = BALL if np.linalg.det(matrix) > 0 else tl.Mesh(BALL.vertices, BALL.faces[:, ::-1])
    assert cut(mesh, matrix=matrix).volume == pytest.approx(BALL.volume, abs=ball_off(1.0))


def test_volume_of_a_torus_and_smaller_cells() -> None:
    mesh = Torus(1.0, 0.3).tessellate(32)
    off = [abs(cut(mesh, step, TURN).volume - mesh.volume) for step in (STEP, STEP / 2)]
    assert off[0] < at_most_off(area(mesh))
    assert off[1] < at_most_off(area(mesh)) / 2
    assert off[0] < 0.01 * mesh.volume  # what it is; the bound above holds for all bodies, whatever their place


def test_volume_of_nested_shells() -> None:
    """A hollow ball with a ball in it, in one mesh."""
    parts = [Sphere(radius=radius).tessellate(48) for radius in (1.0, 0.7, 0.4)]
    mesh = joined([(part.vertices, part.faces[:, :: (1, -1, 1)[i]]) for i, part in enumerate(parts)], "shells")
    volume = parts[0].volume - parts[1].volume + parts[2].volume
    assert cut(mesh).volume == pytest.approx(volume, abs=sum(ball_off(radius) for radius in (1.0, 0.7, 0.4)))


def test_what_overlaps_counts_once() -> None:
    first, second = Box((0, 0, 0), (1, 1, 1)).tessellate(), Box((0.5, 0.3, 0.2), (1.5, 0.8, 0.7)).tessellate()
    both = joined([(first.vertices, first.faces), (second.vertices, second.faces)], "both")
    assert cut(both).volume == pytest.approx(1.125, abs=box_off((1, 1, 1)) + box_off((0.5, 0.5, 0.5)))
    assert cut(both).inside.max() <= 1.0


def test_mirrored_bodies_have_the_same_cells() -> None:
    """A body whose matrix turns its mesh inside out is wound anew."""
    medium = tl.Medium(scattering=1.0)
    plain, mirrored = (
        body_grid(tl.Object(BALL, medium, np.diag([side, 1.0, 1.0, 1.0])), STEP).cells for side in (1.0, -1.0)
    )
    assert mirrored.volume == pytest.approx(BALL.volume, abs=ball_off(1.0))
    assert mirrored.volume == pytest.approx(plain.volume, abs=2 * ball_off(1.0))


def test_centroids() -> None:
    """The centroid of the whole, by those of the cells; of each cell, within it; of whole cells, their middle."""
    found = cut(BALL)
    center = (found.inside[..., None] * found.center).sum(axis=(0, 1, 2)) / found.inside.sum()
    moment = 4 * ball_off(1.0) / BALL.volume  # first moments are over distances up to the radius, with both signs
    middle = BALL.vertices.mean(axis=0)
    np.testing.assert_allclose(found.low + STEP * center, middle, atol=moment)
    corner = np.stack(np.indices(found.inside.shape), axis=-1)
    assert ((found.center >= corner) & (found.center <= corner + 1)).all()
    whole = found.inside > 1 - 1e-9
    np.testing.assert_allclose((found.center - corner)[whole], 0.5, atol=1e-9)


def test_centroids_of_cut_cells_of_a_box() -> None:
    """Cells of a wide slab: halfway between its face and the cell's."""
    found = cut(Box((0, 0, 0), (1.0, 1.0, 0.25)).tessellate())
    # Two cells and a half are centred on three: the outer ones are three quarters inside, at their inner end.
    column = found.center[6, 6, :, 2][found.inside[6, 6] > 0]
    assert column == pytest.approx([1.625, 2.5, 3.375], abs=1e-9)
    assert found.inside[6, 6][found.inside[6, 6] > 0] == pytest.approx([0.75, 1.0, 0.75], abs=1e-9)


def differences(found: Voxels) -> Array:
    """(x, y, z, 3): open area of each cell's lower face less that of its upper one, along each axis."""
    return np.stack([-np.diff(found.open_area[axis], axis=axis) for axis in range(3)], axis=-1)


def boundary_areas(mesh: tl.Mesh, found: Voxels) -> Array:
    """(x, y, z, 3): area vector of the mesh in each cell, outwards and in faces of a cell, by small pieces."""
    triangles = (mesh.vertices[mesh.faces] - found.low) / found.step
    for _ in range(4):
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    vectors = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    place = np.ravel_multi_index(tuple(triangles.mean(axis=1).astype(int).T), found.inside.shape)
    sums = [np.bincount(place, part, found.inside.size).reshape(found.inside.shape) for part in vectors.T]
    return np.stack(sums, axis=-1)


@pytest.mark.parametrize("mesh", [BALL, Torus(1.0, 0.4).tessellate(48)], ids=["ball", "torus"])
def test_open_faces_and_the_boundary_close_each_cell(mesh: tl.Mesh) -> None:
    """The divergence theorem: open faces and the surface in a cell have no area vector together; nor has all of it."""
    found = cut(mesh)
    open_faces, boundary = differences(found), boundary_areas(mesh, found)
    np.testing.assert_allclose(open_faces.sum(axis=(0, 1, 2)), 0.0, atol=1e-9)
    crossed = np.abs(boundary).max(axis=-1) > 0
    off = (open_faces - boundary)[crossed]
    # Of 16 lines through a cell, the outline of a patch passes up to 4 * 4 squares, each right by chance: their spread
    # is 1/3 of a square at most, so that of the patch 4 / 3 of 16 squares.
    assert np.sqrt((off**2).mean()) < 4 / 3 / LINES**2
    inner = found.inside > 1 - 1e-9
    assert np.abs(open_faces[inner & ~crossed]).max() < 1e-9


def test_open_faces_are_plane_sections() -> None:
    """Sections of a ball: pi (R^2 - z^2)."""
    found = cut(BALL)
    for axis in range(3):
        sections = found.open_area[axis].sum(axis=tuple({0, 1, 2} - {axis})) * STEP**2
        height = found.low[axis] + STEP * np.arange(len(sections)) - BALL.bounds.mean(axis=0)[axis]
        disc = np.maximum(1.0 - height**2, 0.0)
        # The lattice: an outline of 2 pi r passes some 8 r / spacing squares, of which the spread is 1/3, four times
        # that of their sum; and the tessellation.
        squares = 4 / 3 * np.sqrt(8 * np.sqrt(disc) / SPACING + 1) * SPACING**2
        sagitta = Sphere().sagitta(64)
        assert (np.abs(sections - math.pi * disc) <= squares + 2 * math.pi * sagitta + 1e-9).all()


def test_vertices_on_cell_planes() -> None:
    """Cells are whole or empty, and all faces between whole ones open."""
    found = cut(Box((0, 0, 0), (8.0, 4.0, 2.0)).tessellate(), step=0.5)
    assert found.volume == pytest.approx(64.0, rel=1e-12)
    whole = found.inside > 1 - 1e-9
    assert whole.sum() == 512
    assert np.abs(found.inside[~whole]).max() < 1e-9
    for axis in range(3):
        inner = [slice(None)] * 3
        inner[axis] = slice(1, -1)
        pair = np.moveaxis(whole, axis, 0)
        between = np.moveaxis(found.open_area[axis][tuple(inner)], axis, 0)
        np.testing.assert_allclose(between[pair[1:] & pair[:-1]], 1.0, atol=1e-12)


def test_degenerate_triangles_change_nothing() -> None:
    flat = np.array([(0, 0, 0), (0, 1, 1), (3, 40, 3), (5, 6, 5)])
    more = tl.Mesh(BALL.vertices, np.concatenate([BALL.faces, flat]))
    plain, found = cut(BALL), voxels(more.vertices, np.concatenate([BALL.faces, flat]), STEP)
    np.testing.assert_array_equal(found.inside, plain.inside)
    np.testing.assert_array_equal(found.center, plain.center)


def test_a_mesh_thinner_than_a_cell() -> None:
    """Lines across it are exact, those along it meet it by chance: a third of the volume at least, and no crash."""
    size = (1.0, 1.0, 0.01)
    found = cut(Box((0, 0, 0), size).tessellate())
    assert 0.01 / 3 * (1 - 2 * SPACING) < found.volume < 0.01 + box_off(size)
    assert found.inside.shape == (12, 12, 3)


def test_a_mesh_with_a_hole_has_no_intervals_there() -> None:
    """A box without its top: lines through the hole do not balance, all others do."""
    mesh = Box((0, 0, 0), (1, 1, 1)).tessellate()
    normals = np.cross(*(mesh.vertices[mesh.faces[:, i]] - mesh.vertices[mesh.faces[:, 0]] for i in (1, 2)))
    opened = voxels(mesh.vertices, mesh.faces[normals[:, 2] <= 0], STEP)
    assert opened.volume == pytest.approx(2 / 3, abs=box_off((1, 1, 1)))
    assert opened.open_area[2].max() == 0.0
    assert opened.open_area[0].max() == 1.0


def test_a_mesh_without_volume_is_empty() -> None:
    assert voxels(np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.array([(0, 1, 2)]), STEP).volume == 0.0


def test_a_body_of_many_chunks_is_that_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs of triangles and lines are tested some at a time."""
    plain = cut(BALL, 0.3)
    monkeypatch.setattr("translucent.geometry.winding.CROSSINGS_AT_A_TIME", 50)
    np.testing.assert_array_equal(cut(BALL, 0.3).inside, plain.inside)
