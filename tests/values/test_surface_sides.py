"""Light at surfaces that cells do not resolve: both sides of thin walls, edges, and steps of the grid."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.values.diffusing import BLACK, grid_of, lit, seen_field
from translucent.diffusion.first_events import LayerSolution
from translucent.diffusion.sides import SurfaceSides, read_sides
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.solids import Box, Sphere, SphericalShell
from translucent.reference import slabs


@pytest.mark.parametrize("resolution", [13, 14, 15])
def test_walls_of_few_cells_are_slabs(resolution: int) -> None:
    """2, 2.2 and 2.4 cells thick, against layers that are added and doubled: R and T of three optical depths."""
    depths = np.array([2.0, 4.0, 8.0])
    slab = grid_of(Box((-4, -0.5, -4), (4, 0.5, 4)).tessellate(), resolution)
    top, middle = slab.face_normals[:, 1] > 0.9, np.abs(slab.points[:, [0, 2]]).max(axis=1) < 1
    bottom = slab.face_normals[:, 1] < -0.9
    for albedo in (0.85, 0.97):
        medium = tl.Medium(absorption=(1 - albedo) * depths, scattering=albedo * depths, ior=1.4)
        fluence = lit(slab, medium, np.where(top, 1.0, 0.0)[:, None]).fluence
        found = diffuse_interface(1.4).exit_share * np.stack(
            [fluence[side & middle].mean(axis=0) for side in (top, bottom)]
        )
        exact = np.array([slabs.scattered_fractions(albedo, depth, 1.4) for depth in depths.tolist()]).T
        print(resolution, albedo, found / exact)
        np.testing.assert_allclose(found, exact, rtol=0.12)


def test_a_lamp_in_a_hollow_leaves_no_rings() -> None:
    """Around the middle of a hollow ball all points outside are alike, wherever cells are cut."""
    hollow = SphericalShell(inner=0.84).tessellate(48)
    medium = tl.Medium(absorption=0.1, scattering=100.0, ior=1.5)
    found = seen_field(tl.Object(hollow, medium), tl.PointLight((0, 0, 0), (1, 1, 1)), resolution=24)
    points = Sphere().tessellate(90).vertices
    light = found.at_surface(found.fluence, points, points)[:, 1]
    print(light.std() / light.mean(), np.ptp(light) / light.mean())
    assert light.std() < 0.01 * light.mean()
    assert np.ptp(light) < 0.07 * light.mean()


def test_sides_of_a_sheet_and_faces_of_a_box_keep_apart() -> None:
    """Values that each face of a thin box has alone are read there, up to its edges; a slope is followed on a ball."""
    grid = grid_of(Box((-1, -0.04, -1), (1, 0.04, 1)).tessellate(), 24)
    axis = np.abs(grid.face_normals).argmax(axis=1)
    value = 1.0 + axis + 3.0 * (grid.face_normals.sum(axis=1) > 0.0)
    (volume,) = SurfaceSides.of(grid).volumes([(value[:, None], 0.0)])
    read = read_sides(volume, (grid.points - grid.cells.low) / grid.cells.step, grid.face_normals)[:, 0]
    np.testing.assert_allclose(read, value, atol=0.2)

    grid = grid_of(Sphere().tessellate(48), 24)
    slope = (2.0 + grid.points @ (0.3, 0.5, -0.4))[:, None]
    (volume,) = SurfaceSides.of(grid).volumes([(slope, 0.0)])
    read = read_sides(volume, (grid.points - grid.cells.low) / grid.cells.step, grid.normals)
    np.testing.assert_allclose(read, slope, atol=0.02)


def test_black_light_stays_black() -> None:
    found = seen_field(tl.Object(Sphere().tessellate(16), tl.Medium(scattering=5.0, ior=1.5)), environment=BLACK)
    assert not found.fluence.any()


def test_a_spread_beyond_its_first_order_takes_no_more_than_half_of_the_fluence() -> None:
    """Else what tips of dense bodies show is divided by nearly nothing, in each channel by another."""
    depth, spread = np.full(5, 0.01), np.array([-0.012, -0.0101, -0.005, 0.0, 0.005])
    layer = LayerSolution.of(depth, 30.0, 400.0, spread)
    plain = LayerSolution.of(depth, 30.0, 400.0, np.zeros(5))
    assert (layer.u >= 0.5 * plain.u).all()
    np.testing.assert_allclose(layer.u[3:], (plain.u + spread * plain.slope)[3:])
    # The events above the depth of reading are those of the same solution.
    near, _ = layer.events(np.arange(5), np.full(5, 300.0))
    assert (near > 0.0).all()
