"""Values at the surface of a body, as pictures look them up: a volume around it for each of six sides.

A place alone does not say what to look up where a wall is thinner than a cell, or at an edge: the other side of the
wall is as near. So cells hold a value for each of six directions, from the samples of the surface that look there, and
the normal says how much of each counts (as the ambient cube of McTaggart 2004, "Half-Life 2 / Valve Source shading").
In a cell it is what a linear function has there that fits the samples around (moving least squares, Lancaster &
Salkauskas 1981): interpolated between cells it follows them, without steps at the cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from scipy import sparse
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.diffusion.entering import Pose
from translucent.diffusion.grid import BodyGrid
from translucent.diffusion.voxels import Voxels
from translucent.formulas.diffusion import SAMPLE_REACH

#: Directions: two along each axis.
SIDES = 6

#: Samples around a cell that it fits, at most.
AROUND = 32

#: Cosine between a sample's normal and the plane of a side, above which it counts there: what looks hardly aside does.
_ASIDE = -0.1

#: Numbers of the entries of a symmetric matrix (3, 3) among those of its upper half.
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])

#: Cells that are fitted at a time: what that takes stays in the processor's cache.
_TOGETHER = 256

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
        distance, sample = cKDTree(points).query(centers, count, distance_upper_bound=SAMPLE_REACH)
        distance, sample = distance.reshape(-1, count), np.asarray(sample).reshape(-1, count)
        areas, face_normals = grid.areas.astype(np.float32), grid.face_normals.astype(np.float32)
        rows = []
        for part in np.array_split(np.arange(len(cells)), len(cells) // _TOGETHER + 1):
            near = np.where(np.isfinite(distance[part]), (1.0 - (distance[part] / SAMPLE_REACH) ** 2) ** 2, 0.0)
            own = np.where(near > 0.0, sample[part], 0)
            offset = (points[own] - centers[part, None]).astype(np.float32)
            rows.append(_rows(near.astype(np.float32) * areas[own], offset, face_normals[own], own))
        weight, samples, used, has = (np.concatenate(each) for each in zip(*rows, strict=True))
        cell, side = np.nonzero(has)
        number = grid.number.ravel()
        deep = np.setdiff1d(np.flatnonzero(number >= 0), cells, assume_unique=True)
        first = np.concatenate([[0], np.cumsum(used)])
        weights = sparse.csr_array((weight, samples, first), (len(used), len(points)))
        return cls(weights, side * int(np.prod(shape)) + cells[cell], deep, number[deep], shape)

    def volumes(self, parts: Sequence[tuple[Array, Array | float]]) -> list[Floats]:
        """(6, x, y, z, n) float32 of each part: values (s, n) of the samples, interpolated, and farther inside others.

        Those are (cells, n), or the same everywhere.
        """
        values = np.concatenate([own for own, _ in parts], axis=1).astype(np.float32)
        near = np.maximum(self.weights @ values, 0.0)
        ends, found = np.cumsum([own.shape[1] for own, _ in parts]), []
        for own, (_, deep) in zip(np.split(near, ends[:-1], axis=1), parts, strict=True):
            inside = np.zeros((int(np.prod(self.shape)), own.shape[1]), np.float32)
            inside[self.deep] = deep[self.numbers] if isinstance(deep, np.ndarray) else deep
            volume = np.repeat(inside[None], SIDES, axis=0)
            volume.reshape(-1, own.shape[1])[self.places] = own
            found.append(volume.reshape(SIDES, *self.shape, -1))
        return found


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


def _rows(near: Floats, offset: Floats, normals: Floats, sample: Integers) -> tuple[Floats, Integers, Integers, Mask]:
    """Rows of `SurfaceSides.weights` for k cells: numbers (u,), columns (u,), lengths (r,), and sides (k, 6) with one.

    Of n samples around each, with weights (k, n), offsets (k, n, 3) from the cell and normals (k, n, 3).
    """
    signs = np.where(np.arange(SIDES) % 2 == 0, np.float32(1.0), np.float32(-1.0))
    facing = np.maximum(signs * np.repeat(normals, 2, axis=2) - np.float32(_ASIDE), 0.0)
    weight = np.moveaxis(facing**2, 2, 1) * near[:, None]
    has = np.asarray(weight.any(axis=2))
    found = _fitted(weight, offset, normals)[has]
    used = found != 0.0
    return found[used], sample[np.nonzero(has)[0]][used], np.count_nonzero(used, axis=1), has


def _fitted(weight: Floats, offset: Floats, normals: Floats) -> Floats:
    """(k, 6, n): weights of values at offsets (k, n, 3) from cells, for their linear fit at the cells.

    For each side, with weights (k, 6, n). Along the mean normal nothing changes. Where samples say little of a gradient
    it is small. All sums over samples are one product of matrices: only the weights differ from side to side.
    """
    products = [offset[..., i] * offset[..., j] for i, j in combinations_with_replacement(range(3), 2)]
    terms = np.concatenate([offset, normals, np.stack(products, axis=2)], axis=2)
    # Of sides without samples all sums are 0.
    total = np.maximum(weight.sum(axis=2, keepdims=True), np.finfo(np.float32).tiny)
    share = weight / total
    sums = share @ terms
    mean, normal, squares = sums[..., :3], sums[..., 3:6], sums[..., 6:][..., _SYMMETRIC]
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), np.finfo(np.float32).tiny)
    across = np.eye(3, dtype=np.float32) - normal[..., :, None] * normal[..., None, :]
    spread = across @ (squares - mean[..., :, None] * mean[..., None, :]) @ across
    aside = (across @ mean[..., None])[..., 0]
    slope = np.linalg.solve(spread + np.float32(_STIFF) * np.eye(3, dtype=np.float32), aside[..., None])[..., 0]
    constant = 1.0 + (slope * mean).sum(axis=2, keepdims=True)
    return np.asarray(share * (constant - slope @ np.swapaxes(offset, 1, 2)))


def beside(sides: Floats) -> Floats:
    """(2 x, 3 y, z, n): values (6, x, y, z, n) of the sides, beside each other: along an axis in a row."""
    axes = [np.concatenate([sides[2 * axis], sides[2 * axis + 1]], axis=0) for axis in range(3)]
    return np.ascontiguousarray(np.concatenate(axes, axis=1))


def side_weights(normals: Array) -> Array:
    """(k, 6): how much each side counts for normals (k, 3) in the grid; all alike where there is none."""
    squares = normals**2
    total = squares.sum(axis=1, keepdims=True)
    parts = np.where(total > 0.0, squares / np.where(total > 0.0, total, 1.0), 1.0 / 3.0)
    found = np.zeros((len(normals), SIDES))
    found[:, 0::2], found[:, 1::2] = np.where(normals >= 0.0, parts, 0.0), np.where(normals < 0.0, parts, 0.0)
    return found


@dataclass(frozen=True, eq=False)
class GridPlacement:
    """Position, axes and cell size of a grid in the world.

    Attributes
    ----------
    low : (3,) float64
        Corner of the grid in metres.
    turn : (3, 3) float64
        Axes of the grid, in its columns.
    step : float
        Side of a cell in metres.
    """

    low: Array
    turn: Array
    step: float

    @classmethod
    def of(cls, cells: Voxels, pose: Pose) -> GridPlacement:
        """Placement of cells of a body in its own frame, which is at a pose."""
        return cls(pose.outwards(cells.low) + pose.shift, pose.turn, cells.step)

    def places(self, points: Array) -> Array:
        """(k, 3): places in the grid, in cells, of points (k, 3) of the world."""
        return np.asarray((points - self.low) @ self.turn / self.step)

    def read(self, volume: Floats, points: Array, normals: Array) -> Array:
        """(k, n): values (6, x, y, z, n) of cells at points (k, 3) of the surface with normals (k, 3)."""
        return read_sides(volume, self.places(points), normals @ self.turn)


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
