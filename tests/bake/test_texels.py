"""Texels that a mesh covers, what they show, and what is said of texture coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Sphere
from translucent.bake.atlas import Atlas, pad, unwrap
from translucent.bake.rays import PreparedMesh

SQUARE = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]]


def atlas(uv: Any, size: int) -> Atlas:
    return Atlas(np.array(uv, dtype=float), size, size)


def coverage(made: Atlas) -> np.ndarray:
    texels = made.strip(0, made.height)
    covered = np.zeros((made.height, made.width), dtype=bool)
    covered[texels.row, texels.column] = True
    return covered


def test_every_texel_that_a_triangle_touches(rng: np.random.Generator) -> None:
    """Against many points of random triangles, small and slender ones among them."""
    triangles = rng.random((40, 3, 2)) * rng.choice([0.01, 0.1, 1.0], (40, 1, 1))
    triangles[:8, 2] = triangles[:8, 0] * 0.5 + triangles[:8, 1] * 0.5 + 1e-6
    triangles = np.clip(triangles, 0.0, 0.999)
    covered = coverage(atlas(triangles, 61))
    weights = rng.dirichlet([0.5, 0.5, 0.5], 20000)
    touched = np.zeros_like(covered)
    for triangle in triangles:
        u, v = (weights @ triangle).T
        touched[((1.0 - v) * 61).astype(int), (u * 61).astype(int)] = True
    assert not (touched & ~covered).any()
    # And no other: what is too much is a corner that no random point has hit.
    assert (covered & ~touched).sum() <= 0.02 * covered.sum()


def test_no_texel_beside_a_chart_that_ends_on_its_edge() -> None:
    covered = coverage(atlas(np.array(SQUARE) * 0.5, 8))
    assert covered[4:, :4].all()
    assert covered.sum() == 16


def test_strips_are_the_whole(rng: np.random.Generator) -> None:
    made = atlas(rng.random((30, 3, 2)) * 2.5 - 0.7, 32)
    whole = made.strip(0, 32)
    parts = [made.strip(begin, min(begin + 5, 32)) for begin in range(0, 32, 5)]
    for name in ("row", "column", "face", "barycentric", "inside", "overlapping"):
        assert np.array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))


def test_a_texel_shows_its_center_or_the_nearest_point() -> None:
    made = atlas([[[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]], 10)
    texels = made.strip(0, 10)
    shown = np.einsum("kc,ci->ki", texels.barycentric, [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    center = np.stack([texels.column + 0.5, 9.5 - texels.row], axis=1) / 10
    assert np.allclose(shown[texels.inside], center[texels.inside])
    outside = ~texels.inside & (center.sum(axis=1) > 1.0)
    away = center[outside] - shown[outside]
    # Across the long edge, straight.
    assert np.allclose(away[:, 0], away[:, 1])
    assert outside.any()


def test_the_face_that_has_the_center_shows_in_the_texel() -> None:
    """Whatever its number: the first face only touches the texel in the middle."""
    sliver, owner = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.4]], [[0.41, 0.3], [0.9, 0.3], [0.6, 0.9]]
    texels = atlas([sliver, owner], 3).strip(1, 2)
    middle = texels.column == 1
    assert texels.face[middle].tolist() == [1]
    assert texels.inside[middle].all()


def test_the_first_row_is_the_top() -> None:
    covered = coverage(atlas([[[0.0, 0.9], [0.1, 0.9], [0.0, 1.0]]], 10))
    assert covered[0, 0]
    assert covered.sum() == 1


def box_with_uv(uv: np.ndarray) -> tl.Mesh:
    """A cube whose twelve faces all have these texture coordinates (12, 3, 2)."""
    solid = Box().tessellate()
    corners = solid.vertices[solid.faces].reshape(-1, 3)
    return tl.Mesh(corners, np.arange(36).reshape(-1, 3), uv.reshape(-1, 2))


def grid_uv(shift: float = 0.0) -> np.ndarray:
    cell = np.array([[0.02, 0.02], [0.2, 0.02], [0.02, 0.2]])
    return np.array([cell + (0.25 * (i % 4), 0.25 * (i // 4)) for i in range(12)]) + shift


def test_overlapping_texture_coordinates_are_counted() -> None:
    uv = grid_uv()
    uv[1] = uv[0] + 1 / 64
    with pytest.warns(tl.TranslucentWarning, match="texels lie in several triangles in UV"):
        baked = tl.bake_thickness(box_with_uv(uv), 64, mode="normal")
    a, b = (coverage(atlas(uv[i : i + 1], 64)) for i in (0, 1))
    assert 0 < baked.report.overlapping_texels <= (a & b).sum()
    assert tl.bake_thickness(box_with_uv(grid_uv()), 64, mode="normal").report.overlapping_texels == 0


def test_texture_coordinates_outside_repeat_the_map() -> None:
    inside = tl.bake_thickness(box_with_uv(grid_uv()), 64, mode="normal")
    with pytest.warns(tl.TranslucentWarning, match=r"12 of 12 faces have texture coordinates outside 0\.\.1"):
        outside = tl.bake_thickness(box_with_uv(grid_uv(-3.0)), 64, mode="normal")
    assert np.array_equal(inside.coverage, outside.coverage)
    assert np.allclose(inside.values, outside.values)


def test_udim_tiles() -> None:
    uv = grid_uv()
    uv[6:] += (1.0, 1.0)
    mesh = box_with_uv(uv)
    with pytest.warns(tl.TranslucentWarning, match="UDIM tiles 1001, 1012"):
        baked = tl.bake_thickness(mesh, 64, mode="normal")
    assert baked.report.udim_tiles == (1001, 1012)
    one, other = (tl.bake_thickness(mesh, 64, mode="normal", tile=tile).coverage for tile in (1001, 1012))
    assert np.array_equal(one | other, baked.coverage)
    assert one.sum() < baked.coverage.sum() > other.sum()
    with pytest.raises(tl.InputError, match="UDIM tile 1002; mesh 'mesh' has faces in 1001, 1012"):
        tl.bake_thickness(mesh, 64, mode="normal", tile=1002)


def test_faces_without_texel_are_counted() -> None:
    uv = grid_uv()
    uv[2:6] = uv[0].mean(axis=0) + 1e-5 * (uv[2:6] - uv[2:6].mean(axis=1, keepdims=True))
    with pytest.warns(tl.TranslucentWarning, match="of 12 faces, 33% of the surface, have no texel"):
        baked = tl.bake_thickness(box_with_uv(uv), 16, mode="normal", rays=1, padding=0)
    assert baked.report.faces_without_texel >= 3


def test_a_texture_that_repeats_on_a_face_is_refused() -> None:
    with pytest.raises(tl.InputError, match=r"face 0 covers 18 tiles in UV"):
        tl.bake_thickness(box_with_uv(100 * grid_uv()), 16)


def test_texture_coordinates_without_area_or_not_finite_are_refused() -> None:
    with pytest.raises(tl.InputError, match="no face of the mesh has an area in UV space"):
        tl.bake_thickness(box_with_uv(np.zeros((12, 3, 2))), 16)
    with pytest.raises(tl.InputError, match="36 texture coordinates are not finite"):
        tl.bake_thickness(box_with_uv(np.full((12, 3, 2), np.nan)), 16)


def test_no_texture_coordinates_and_no_xatlas(uninstalled: Callable[[str], None]) -> None:
    uninstalled("xatlas")
    wanted = r"new texture coordinates for '.*'; the package xatlas is not installed; .*\[bake\]', or unwrap it"
    with pytest.raises(tl.RenderError, match=wanted):
        tl.bake_thickness(Box().tessellate(), 16)


def test_a_mesh_without_area_gets_no_texture_coordinates() -> None:
    line = tl.Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], name="line")
    with pytest.raises(tl.InputError, match="mesh 'line'; no face of the mesh has an area; export the mesh again"):
        unwrap(line, 64, None)


def test_new_texture_coordinates_come_with_the_mesh() -> None:
    solid = Sphere().tessellate(24)
    baked = tl.bake_thickness(solid, 64, mode="normal")
    assert baked.report.uv_from == "xatlas"
    assert baked.mesh.uv is not None
    assert len(baked.mesh.faces) == len(solid.faces)
    assert {tuple(v) for v in baked.mesh.vertices} == {tuple(v) for v in solid.vertices}
    assert np.allclose(baked.mesh.volume, solid.volume)


def test_padding_takes_the_nearest_and_changes_no_chart() -> None:
    values, valued = np.zeros((9, 20), np.float32), np.zeros((9, 20), dtype=bool)
    values[4, 3], values[4, 12] = 1.0, 2.0
    valued[4, 3] = valued[4, 12] = True
    pad(values, valued, 3)
    assert values[4].tolist() == [1.0] * 7 + [0.0] * 2 + [2.0] * 7 + [0.0] * 4
    assert (values > 0).sum() == 2 * 29  # texels within 3 of a texel
    wide = np.where(valued, values, np.float32(0))
    pad(wide, valued, 30)
    # The gap of eight texels is shared evenly.
    assert wide[4].tolist() == [1.0] * 8 + [2.0] * 12


def test_supersampling_averages_points_of_the_texel() -> None:
    """Nine points have a third of the error of one, in the same texels, and about the same mean."""
    mesh = Box().tessellate()
    one, nine = (tl.bake_thickness(mesh, 48, mode="cone", supersample=count) for count in (1, 3))
    assert np.array_equal(one.coverage, nine.coverage)
    assert nine.report.samples > 6 * one.report.samples
    both = one.coverage
    assert nine.standard_error[both].mean() < 0.5 * one.standard_error[both].mean()
    assert np.abs(one.values - nine.values)[both].mean() < 0.05


def seam_jumps(baked: tl.ThicknessMap) -> tuple[np.ndarray, np.ndarray]:
    """Differences of the bilinear map across UV seams, and the larger standard error of the texels read."""
    mesh = baked.mesh
    _, position = np.unique(mesh.vertices, axis=0, return_inverse=True)
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for face in mesh.faces:
        for a, b in zip(face, np.roll(face, -1), strict=True):
            ends = (a, b) if position[a] < position[b] else (b, a)
            sides.setdefault((position[ends[0]], position[ends[1]]), []).append(ends)
    seams = np.array([pair for pair in sides.values() if len(pair) == 2 and pair[0] != pair[1]])
    share = (np.arange(7) / 6)[:, None, None]
    read = []
    for side in (0, 1):
        start, end = mesh.uv[seams[:, side, 0]], mesh.uv[seams[:, side, 1]]
        read.append(bilinear(baked, ((1 - share) * start + share * end).reshape(-1, 2)))
    (one, one_error), (other, other_error) = read
    return np.abs(one - other), np.maximum(one_error, other_error)


def bilinear(baked: tl.ThicknessMap, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    size = len(baked.values)
    x, y = uv[:, 0] * size - 0.5, (1 - uv[:, 1]) * size - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    value, error = np.zeros(len(uv)), np.zeros(len(uv))
    for i in (0, 1):
        for j in (0, 1):
            at = np.clip(row + i, 0, size - 1), np.clip(column + j, 0, size - 1)
            weight = np.abs(1 - i - (y - row)) * np.abs(1 - j - (x - column))
            value += weight * baked.values[at]
            error = np.maximum(error, baked.standard_error[at])
    return value, error


@pytest.mark.parametrize("size", [64, 128])
def test_seams_of_a_sphere(size: int) -> None:
    jump, error = seam_jumps(tl.bake_thickness(Sphere(radius=0.05).tessellate(64), size))
    assert len(jump) > 500
    assert (jump <= 3.0 * error).all()


def test_both_sides_of_a_smooth_edge_have_the_same_points_and_normals() -> None:
    """Each corner of a ball, from all its faces; the normal of none of these."""
    solid = Sphere().tessellate(16)
    surface = PreparedMesh.of(solid)
    count = len(surface.faces)
    points = surface.points(np.repeat(np.arange(count), 3), np.tile(np.eye(3), (count, 1)))
    index = solid.faces.ravel()
    first = np.unique(index, return_index=True)[1]
    assert np.array_equal(points.exact, points.exact[first][index])
    assert np.allclose(points.normal, points.normal[first][index], atol=1e-12)
    outwards = points.exact / np.linalg.norm(points.exact, axis=1, keepdims=True)
    # Faces tilt by a 16th of pi from one to the next; their mean is off by a fraction of that, most beside the poles.
    assert np.allclose(points.normal, outwards, atol=np.pi / 16 / 4)
    # A box keeps its edges.
    box = PreparedMesh.of(Box().tessellate())
    assert np.allclose(box.normals, box.planes[:, None, :3])


def test_seams_of_the_normal_mode() -> None:
    """No rays at random: both sides read the same but for the slope between texels."""
    sphere = Sphere(radius=0.05)
    jump, _ = seam_jumps(tl.bake_thickness(sphere.tessellate(64), 256, mode="normal"))
    assert (jump <= 2 * sphere.sagitta(64)).all()
