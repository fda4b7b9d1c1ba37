"""Density of a body in the cells of its grid, below its surface, and along paths.

Where the density varies, lengths count for as much as the density on them: in metres that are stretched so, D and
sigma_a are those of the medium, and the one-dimensional solutions below the surface hold as they are, however the
density varies with depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from translucent.arrays import Array, Integers
from translucent.diffusion.grid import LAYER_PLACES, BodyGrid
from translucent.scene.scene import Object

#: Points in each cell, along each axis, at which its density is looked at.
_PLACES = (0.25, 0.75)

#: Points on a path through the body at which the density is read.
_PATH_POINTS = (np.arange(12) + 0.5) / 12

#: Relative difference of densities that are alike.
_ROUNDING = 1e-9

#: Pieces of each path of entering light, from the surface to the end of the grid.
_PIECES = 48


@dataclass(frozen=True, eq=False)
class Densities:
    """Density of a body in grid cells, below its surface, and along paths.

    Attributes
    ----------
    cells : (cells,) float64
        Mean density of each cell in the system.
    depth : (s,) float64
        Integral of the density from the samples of the surface down to the depth at which the fluence is read, in m.
    longest : float
        Longest diffusion coefficient in m that a cell gets: where hardly anything is, no free path is longer than the
        body is thick.
    """

    cells: Array
    depth: Array
    longest: float
    _grid: BodyGrid
    _means: Array | None = None

    @property
    def is_even(self) -> bool:
        """True if the density is the same everywhere, but for rounding."""
        return bool(np.ptp(self.cells) <= _ROUNDING * self.cells.max())

    def diffusion_coefficients(self, d: float) -> Array:
        """(cells,): diffusion coefficients in m of a medium that has `d` where the density is 1."""
        densest = float(self.cells.max(initial=0.0))
        return np.asarray(d / np.maximum(self.cells, min(d / self.longest, densest or np.inf)))

    def along(self, directions: Array, metres: Array) -> Array:
        """(s,): integral of the density in m from all samples in directions (s, 3), up to metres (s,)."""
        if self._means is None:
            return metres
        cells = self._grid.cells
        start = (self._grid.points - cells.low) / cells.step - 0.5
        places = (start + (fraction * metres / cells.step)[:, None] * directions for fraction in _PATH_POINTS)
        return np.asarray(
            metres * np.mean([map_coordinates(self._means, at.T, order=1, mode="nearest") for at in places], axis=0)
        )

    def lengths(self, samples: Integers, directions: Array) -> Callable[[Array], Array]:
        """Function from integrals of the density (k,), in m, along directions (k, 3) from samples (k,), to metres."""
        if self._means is None:
            return lambda integral: integral
        cells = self._grid.cells
        start = (self._grid.points[samples] - cells.low) / cells.step - 0.5
        slow = np.where(np.abs(directions) > np.finfo(np.float64).eps, directions, np.finfo(np.float64).eps)
        end = np.where(slow > 0.0, np.array(self._means.shape) - start, -1.0 - start) / slow
        piece = end.min(axis=1) * cells.step / _PIECES
        inside = (start + ((i + 0.5) * piece / cells.step)[:, None] * directions for i in range(_PIECES))
        dense = np.stack([map_coordinates(self._means, at.T, order=1, mode="nearest") for at in inside])
        sums = np.cumsum(dense * piece, axis=0)
        return lambda integral: _lengths(sums, dense, piece, integral)


def even_densities(grid: BodyGrid) -> Densities:
    """Densities of a homogeneous body: 1 everywhere."""
    return Densities(np.ones(grid.count), grid.below[1], np.inf, grid)


def densities(body: Object, grid: BodyGrid) -> Densities:
    """Densities of a body in its grid."""
    if body.density is None:
        return even_densities(grid)
    depth = grid.below[1]
    means = cell_means(body, grid)
    rows = body.to_unit_box(grid.cells.low)
    layer = np.zeros(len(depth))
    for place in LAYER_PLACES:
        points = grid.points - (place * depth)[:, None] * grid.face_normals - grid.cells.low
        layer += body.density.at(points @ rows[:, :3].T + rows[:, 3]) / len(LAYER_PLACES)
    return Densities(means[grid.number >= 0], layer * depth, body.mean_thickness, grid, means)


def cell_means(body: Object, grid: BodyGrid) -> Array:
    """(x, y, z): mean density of the body in each cell."""
    if body.density is None:
        return np.ones(grid.number.shape)
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in grid.number.shape), indexing="ij"), axis=-1)
    rows = body.to_unit_box(grid.cells.low)
    total = np.zeros(grid.number.shape)
    for place in np.stack(np.meshgrid(_PLACES, _PLACES, _PLACES), axis=-1).reshape(-1, 3):
        total += body.density.at((corner + place) * grid.cells.step @ rows[:, :3].T + rows[:, 3])
    return total / len(_PLACES) ** 3


def _lengths(sums: Array, dense: Array, piece: Array, integral: Array) -> Array:
    """Distances (s,) at which the integral of piecewise constant densities (n, s) reaches given values (s,)."""
    number = (sums <= integral).sum(axis=0)
    at = np.minimum(number, len(sums) - 1)
    row = np.arange(len(piece))
    before = np.where(at > 0, sums[at - 1, row], 0.0)
    rest = (integral - before) / np.where(dense[at, row] > 0.0, dense[at, row], 1.0)
    return np.where(number < len(sums), at * piece + rest, 2.0 * len(sums) * piece)
