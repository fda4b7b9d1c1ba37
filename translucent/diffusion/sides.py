"""Values at the surface of a body, as pictures look them up: a volume around it for each of six sides.

A place alone does not say what to look up where a wall is thinner than a cell, or at an edge: the other side of the
wall is as near. So cells hold a value for each of six directions, from the samples of the surface that look there, and
the normal says how much of each counts (as the ambient cube of McTaggart 2004, "Half-Life 2 / Valve Source shading").
In a cell it is what a linear function has there that fits the samples around (moving least squares, Lancaster &
Salkauskas 1981): interpolated between cells it follows them, without steps at the cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.grid import BodyGrid

#: Directions: two along each axis.
SIDES = 6

#: Samples around a cell that it fits, at most, and their distance in cells.
AROUND, REACH = 32, 2.0

#: Cosine between a sample's normal and the plane of a side, above which it counts there: what looks hardly aside does.
_ASIDE = -0.1

#: Squared distance in cells over which samples must be spread for their gradient to count.
_STIFF = 0.1


@dataclass(frozen=True, eq=False)
class SurfaceSides:
    """Interpolation of samples' values in the cells around a surface, for each side. Cells farther inside have others.

    Attributes
    ----------
    weights : (n, s) csr_array
        Of the samples, for each side of each cell that has some.
    places : (n,) int64
        Of these in the flat grids (6, x, y, z).
    deep, numbers : (m,), (m,) int64
        Places of the other cells in the system in a flat grid, and their numbers.
    shape : tuple of 3 int
    """

    weights: sparse.csr_array
    places: Integers
    deep: Integers
    numbers: Integers
    shape: tuple[int, ...]

    @classmethod
    def of(cls, grid: BodyGrid) -> SurfaceSides:
        """Interpolation on a grid."""
        shape, step = grid.number.shape, grid.cells.step
        cells = _cells_near(grid)
        centers = np.stack(np.unravel_index(cells, shape), axis=1) + 0.5
        points = (grid.points - grid.cells.low) / step
        count = min(AROUND, len(points))
        distance, sample = cKDTree(points).query(centers, count, distance_upper_bound=REACH)
        distance, sample = distance.reshape(-1, count), np.asarray(sample).reshape(-1, count)
        near = np.where(np.isfinite(distance), (1.0 - (distance / REACH) ** 2) ** 2, 0.0)
        sample = np.where(near > 0.0, sample, 0)
        near *= grid.areas[sample]
        offset = points[sample] - centers[:, None]
        rows, columns, values, places = list[Integers](), list[Integers](), list[Array](), list[Integers]()
        size = 0
        for side in range(SIDES):
            sign = 1.0 - 2.0 * (side % 2)
            facing = np.maximum(sign * grid.face_normals[sample, side // 2] - _ASIDE, 0.0)
            weight = near * facing**2
            own = np.flatnonzero(weight.sum(axis=1) > 0.0)
            fitted = _fitted(weight[own], offset[own], grid.face_normals[sample[own]])
            row, column = np.nonzero(fitted)
            rows.append(row + size)
            columns.append(sample[own][row, column])
            values.append(fitted[row, column])
            places.append(side * int(np.prod(shape)) + cells[own])
            size += len(own)
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        number = grid.number.ravel()
        deep = np.setdiff1d(np.flatnonzero(number >= 0), cells, assume_unique=True)
        weights = sparse.csr_array(entries, (size, len(points)), dtype=np.float32)
        return cls(weights, np.concatenate(places), deep, number[deep], shape)

    def volume(self, values: Floats, deep: Floats) -> Floats:
        """(6, x, y, z, n) float32: values (s, n) of the samples, interpolated, and `deep` (cells, n) farther inside."""
        found = np.zeros((SIDES, int(np.prod(self.shape)), values.shape[1]), np.float32)
        found[:, self.deep] = deep[self.numbers]
        found.reshape(-1, values.shape[1])[self.places] = np.maximum(self.weights @ values, 0.0)
        return found.reshape(SIDES, *self.shape, -1)


def _cells_near(grid: BodyGrid) -> Integers:
    """(c,): places in the flat grid of the cells that look-ups at the surface read."""
    shape = np.array(grid.number.shape)
    corner = np.clip(np.floor((grid.points - grid.cells.low) / grid.cells.step - 0.5).astype(int), 0, shape - 2)
    near = np.zeros(grid.number.shape, bool)
    for offset in np.ndindex(2, 2, 2):
        near[tuple((corner + offset).T)] = True
    # Between the samples there are places whose cells none of these has.
    wide = np.zeros_like(near)
    for axis in range(3):
        for towards in (-1, 1):
            wide |= np.roll(near, towards, axis)
    return np.flatnonzero(near | wide)


def _fitted(weight: Array, offset: Array, normals: Array) -> Array:
    """(k, n): factors of values at offsets (k, n, 3) from cells, for what the linear fit to these has in the cells.

    Along the mean normal nothing changes. Where samples say little of a gradient it is small.
    """
    share = weight / weight.sum(axis=1, keepdims=True)
    normal = np.einsum("kn,kni->ki", share, normals)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    along = offset - np.einsum("kni,ki->kn", offset, normal)[..., None] * normal[:, None]
    mean = np.einsum("kn,kni->ki", share, along)
    apart = along - mean[:, None]
    spread = np.einsum("kn,kni,knj->kij", share, apart, apart) + _STIFF * np.eye(3)
    slope = np.linalg.solve(spread, mean[..., None])[..., 0]
    return np.asarray(share * (1.0 - np.einsum("ki,kni->kn", slope, apart)))


def side_weights(normals: Array) -> Array:
    """(k, 6): how much each side counts for normals (k, 3) in the grid; all alike where there is none."""
    squares = normals**2
    total = squares.sum(axis=1, keepdims=True)
    parts = np.where(total > 0.0, squares / np.where(total > 0.0, total, 1.0), 1.0 / 3.0)
    found = np.zeros((len(normals), SIDES))
    found[:, 0::2], found[:, 1::2] = np.where(normals >= 0.0, parts, 0.0), np.where(normals < 0.0, parts, 0.0)
    return found


def read_sides(volume: Floats, places: Array, normals: Array) -> Array:
    """(k, n): values (6, x, y, z, n) of the sides at places (k, 3), in cells, with normals (k, 3) in the grid."""
    found = np.zeros((len(places), volume.shape[-1]))
    for side, weight in enumerate(side_weights(normals).T):
        own = np.flatnonzero(weight)
        at = (places[own] - 0.5).T
        for channel in range(volume.shape[-1] if len(own) else 0):
            values = map_coordinates(volume[side, ..., channel], at, np.float64, order=1, mode="nearest")
            found[own, channel] += weight[own] * values
    return found
