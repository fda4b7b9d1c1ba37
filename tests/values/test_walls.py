"""Light in walls of few cells: slabs against adding and doubling, and a plate that lies at a slant in its grid."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.diffusion.walls import SLAB, SlabSolution, Walls
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.phase import HenyeyGreenstein
from translucent.formulas.slab import slab_fluxes
from translucent.geometry.solids import Box, Sphere
from translucent.reference.slabs import (
    entering_transmittance,
    scattered_fractions,
    total_fractions,
    unscattered_fractions,
)

from .diffusing import grid_of, lit


@pytest.mark.parametrize("ior", [1.0, 1.4])
@pytest.mark.parametrize("albedo", [0.5, 0.86, 1.0])
def test_slabs_send_as_much_light_to_both_sides(albedo: float, ior: float) -> None:
    table = slab_fluxes(albedo, ior)
    for number in range(2, len(table.depths), 6):
        exact = scattered_fractions(albedo, table.depths[number], ior)
        found = table.own[number] @ table.uniform, table.across[number] @ table.uniform
        assert found == pytest.approx(exact, rel=2e-3, abs=1e-6)


def test_what_is_scattered_ahead_counts_as_unscattered() -> None:
    albedo, g, ior = 0.8, 0.7, 1.4
    table = slab_fluxes(albedo, ior, HenyeyGreenstein(g))
    number = int(np.argmin(np.abs(table.depths - 2.0)))
    scattered = albedo / (1 - g)
    depth = table.depths[number] * (1 - albedo + scattered)
    every = total_fractions(scattered / (1 - albedo + scattered), depth, ior, g)
    rest = unscattered_fractions(table.depths[number], ior)
    found = table.own[number] @ table.uniform, table.across[number] @ table.uniform
    assert found == pytest.approx(np.subtract(every, rest), rel=5e-3)
    assert 0 < entering_transmittance(depth, ior) < rest[1]


@pytest.mark.parametrize("cosine", [0.3, 0.9])
def test_fluences_make_these_fluxes(cosine: float) -> None:
    """At depths and cosines of the table, and as much in all as diffusion finds where slabs are thick."""
    table, conductance = slab_fluxes(0.9, 1.3), diffuse_interface(1.3).conductance
    everywhere, ones = np.arange(len(table.depths)), np.ones(len(table.depths))
    slab = SlabSolution(Walls(ones, everywhere, 0.01 * table.depths, ones), 1.3, 10.0, 90.0, HenyeyGreenstein(0.0))
    at = int(np.argmin(np.abs(table.cosines - cosine)))
    found = slab.events(everywhere, np.full(len(everywhere), table.cosines[at]))
    for fluence, flux in zip(found, (table.own, table.across), strict=True):
        np.testing.assert_allclose(conductance * fluence, flux[:, at], rtol=1e-9, atol=1e-12)


def test_a_plate_at_a_slant_has_no_contour_lines() -> None:
    """It is two cells thick; each place of it is as bright as an exact slab, wherever the surface cuts cells."""
    plate = Box((-12, -12, -0.5), (12, 12, 0.5)).tessellate()
    turn = np.linalg.qr(np.array([(1, 0.3, 0.05), (-0.3, 1, 0), (0, -0.05, 1)]))[0]
    turn *= np.sign(np.diag(turn))
    grid = grid_of(tl.Mesh(1e-3 * plate.vertices @ turn.T, plate.faces), 32)
    walls, local = Walls.of(grid), 1e3 * grid.points @ turn
    middle = (np.abs(local[:, :2]) < 8).all(axis=1)
    assert 1.5 < 1e-3 / grid.cells.step < SLAB + 0.5
    assert (walls.part[middle] > 0.75).all()
    assert (np.sign(local[walls.across[middle], 2]) == -np.sign(local[middle, 2])).all()
    medium, faces = tl.Medium(500.0, 3000.0, ior=1.4), local[:, 2] > 0
    fluence = lit(grid, medium, np.where(faces, 1.0, 0.0)[:, None] * np.ones(3)).fluence[:, 0]
    exact = scattered_fractions(3000 / 3500, 3.5, 1.4)
    for side, fraction in ((faces, exact[0]), (~faces, exact[1])):
        found = fluence[middle & side] * diffuse_interface(1.4).exit_share
        assert found.mean() == pytest.approx(fraction, rel=0.03)
        assert found.std() < 0.01 * found.mean()


def test_balls_have_no_walls() -> None:
    assert not Walls.of(grid_of(Sphere().tessellate(16), 16)).any
