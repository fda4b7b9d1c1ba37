"""Relative density inside a body, which scales its medium from place to place.

Positions are in the unit box of the body: 0 to 1 along each axis of the mesh's bounds in object space, as in a 3D
texture. An affine transform keeps straight lines straight, so means along them hold in the world as well.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked, vectors
from translucent.arrays import Array, Frozen, Integers
from translucent.errors import InputError
from translucent.files.images import read_array
from translucent.files.reading import open_file
from translucent.formulas import optics

#: Largest relative density: its products with extinctions and lengths of any scene stay within float32.
MAX_DENSITY = 1e12

#: Number of pieces of segments that a grid integrates at a time: the working arrays stay below 100 MB.
CHUNK = 1 << 18

#: Gauss-Legendre points of [0, 1] that integrate cubics exactly, and trilinear density is cubic along a line.
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


@checked
@dataclass(frozen=True, eq=False)
class DensityGrid(Frozen):
    """Density from a voxel grid: trilinear between the centers of the voxels, constant from there to the boundary.

    Parameters
    ----------
    values : array_like (nx, ny, nz)
        Relative density, >= 0; sample [i, j, k] is at ((i + 0.5) / nx, (j + 0.5) / ny, (k + 0.5) / nz) of the unit
        box. One voxel is a constant.

    Raises
    ------
    InputError
        If the array is empty or not of three dimensions, or a value is negative, not finite or above 1e12.
    """

    values: npt.ArrayLike

    def __post_init__(self) -> None:
        try:
            with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused below
                values = np.array(self.values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                "density grid", "the array does not contain numbers", "give an array of shape (nx, ny, nz)"
            ) from None
        if values.ndim != 3 or not values.size:
            raise InputError(
                "density grid",
                f"the array has shape {values.shape}, and not (nx, ny, nz)",
                "give at least one voxel along each axis",
            )
        bad = ~((values >= 0) & (values <= MAX_DENSITY))
        if bad.any():
            where = tuple(int(i) for i in np.argwhere(bad)[0])
            raise InputError(
                "density grid",
                f"{int(bad.sum())} values are outside 0 to {MAX_DENSITY:g}; the first is {values[where]} at {where}",
                "replace these values, for example by 0",
            )
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> DensityGrid:
        """Read the array of a NumPy file (``.npy``); raises `InputError` if there is none that can be used."""
        where = f"density grid {str(path)!r}"
        with open_file(path, where) as stream:
            return cls(read_array(stream, os.fstat(stream.fileno()).st_size, where))

    def __repr__(self) -> str:
        return f"DensityGrid of {' x '.join(str(n) for n in np.shape(self.values))} voxels"

    @property
    def maximum(self) -> float:
        """Largest density."""
        return float(np.max(self.values))

    @checked
    def at(self, points: npt.ArrayLike) -> Array:
        """(...,): density at points (..., 3)."""
        values = np.asarray(self.values)
        count = np.array(values.shape)
        position = np.clip(vectors("density at points", points) * count - 0.5, 0.0, count - 1.0)
        low = np.minimum(position.astype(np.int64), np.maximum(count - 2, 0))
        weight = position - low
        high = np.minimum(low + 1, count - 1)
        x, y, z = np.moveaxis(np.stack([low, high]), -1, 0)
        lower, upper = (np.stack([values[x[i], y[j], z[k]] for j in (0, 1) for k in (0, 1)], axis=-1) for i in (0, 1))
        return trilinear(lower, upper, weight)

    @checked
    def mean_between(self, start: Array, end: Array) -> Array:
        """(k,): mean density on straight lines from `start` (k, 3) to `end` (k, 3), exact up to rounding.

        Between the planes through the centers of voxels the density is a cubic of the position on the line.
        """
        count = np.array(np.shape(self.values))
        start, end = _ends(start, end)
        begin, stop = start * count - 0.5, end * count - 0.5
        ends = np.cumsum(3 + np.abs(stop - begin).sum(axis=1).astype(np.int64))
        means = np.zeros(len(start))
        first = 0
        while first < len(start):
            done = ends[first - 1] if first else 0
            last = max(int(np.searchsorted(ends, done + CHUNK, side="right")), first + 1)
            means[first:last] = self._means(begin[first:last], stop[first:last])
            first = last
        return means

    def _means(self, begin: Array, stop: Array) -> Array:
        """`mean_between` in voxels, counted from the center of the first."""
        count = np.array(np.shape(self.values))
        line = np.arange(len(begin))
        cuts = [_cuts(begin[:, axis], stop[:, axis], count[axis]) for axis in range(3)]
        line = np.concatenate([line, *(index for index, _ in cuts), line])
        t = np.concatenate([np.zeros(len(begin)), *(at for _, at in cuts), np.ones(len(begin))])
        order = np.lexsort((t, line))
        line, t = line[order], t[order]
        same = np.flatnonzero(line[1:] == line[:-1])
        length, line = t[same + 1] - t[same], line[same]
        inner = t[same, None] + length[:, None] * _GAUSS
        position = begin[line, None] + inner[..., None] * (stop - begin)[line, None]
        with np.errstate(under="ignore"):
            mean = self.at((position + 0.5) / count).mean(axis=1)
            return np.asarray(np.bincount(line, mean * length, len(begin)), dtype=np.float64)


def _ends(start: npt.ArrayLike, end: npt.ArrayLike) -> tuple[Array, Array]:
    """Ends of lines, (k, 3) each."""
    first, last = vectors("density between points", start), vectors("density between points", end)
    if first.ndim != 2 or first.shape != last.shape:
        found = f"shapes {first.shape} and {last.shape}"
        raise InputError(
            "density between points", found, "give as many start points as end points, each of shape (k, 3)"
        )
    return first, last


def _cuts(begin: Array, stop: Array, count: int) -> tuple[Integers, Array]:
    """Cuts of lines at grid planes: line index, and where (0 to 1) the coordinate is one of 0 to count - 1."""
    low, high = np.minimum(begin, stop), np.maximum(begin, stop)
    first = np.clip(np.floor(low) + 1, 0, count).astype(np.int64)
    number = np.maximum(np.clip(np.ceil(high), 0, count).astype(np.int64) - first, 0)
    line = np.repeat(np.arange(len(begin)), number)
    plane = np.arange(len(line)) - np.repeat(np.cumsum(number) - number - first, number)
    return line, np.clip((plane - begin[line]) / (stop - begin)[line], 0.0, 1.0)


@checked
@dataclass(frozen=True)
class LinearDensity:
    """Density that changes linearly along an axis.

    Parameters
    ----------
    axis : {0, 1, 2}
        Of the object.
    start, end : float
        Density where the unit box begins and ends, >= 0.

    Raises
    ------
    InputError
        If the axis is none of these, or a density not in its range.
    """

    axis: int
    start: float
    end: float

    def __post_init__(self) -> None:
        _check_profile("LinearDensity", self.axis, self.start, self.end)

    @property
    def maximum(self) -> float:
        """Largest density."""
        return max(self.start, self.end)

    @checked
    def at(self, points: npt.ArrayLike) -> Array:
        """(...,): density at points (..., 3)."""
        return linear_density(_along(points, self.axis), self.start, self.end)

    @checked
    def mean_between(self, start: Array, end: Array) -> Array:
        """(k,): mean density on straight lines from `start` (k, 3) to `end` (k, 3), exact up to rounding."""
        return 0.5 * (self.at(start) + self.at(end))


@checked
@dataclass(frozen=True)
class ExponentialDensity:
    """Density that changes exponentially along an axis, as that of an atmosphere.

    Parameters
    ----------
    axis : {0, 1, 2}
        Of the object.
    start, end : float
        Density where the unit box begins and ends, > 0.

    Raises
    ------
    InputError
        If the axis is none of these, or a density not in its range.
    """

    axis: int
    start: float
    end: float

    def __post_init__(self) -> None:
        _check_profile("ExponentialDensity", self.axis, self.start, self.end, positive=True)

    @property
    def maximum(self) -> float:
        """Largest density."""
        return max(self.start, self.end)

    @checked
    def at(self, points: npt.ArrayLike) -> Array:
        """(...,): density at points (..., 3)."""
        return exponential_density(_along(points, self.axis), self.maximum, self.log_ratio)

    @checked
    def mean_between(self, start: Array, end: Array) -> Array:
        """(k,): mean density on straight lines from `start` (k, 3) to `end` (k, 3), exact up to rounding."""
        ends = _along(start, self.axis), _along(end, self.axis)
        return exponential_density_mean(*ends, self.maximum, self.log_ratio)

    @property
    def log_ratio(self) -> float:
        """Logarithm of the ratio of the last density to the first."""
        return float(np.log(self.end) - np.log(self.start))


Density = DensityGrid | LinearDensity | ExponentialDensity


def linear_density(along: npt.ArrayLike, start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """(...,): density from `start` to `end` at positions along an axis; constant beyond 0 and 1."""
    u = np.clip(np.asarray(along, dtype=np.float64), 0.0, 1.0)
    with np.errstate(under="ignore"):
        return np.asarray(np.asarray(start) * (1.0 - u) + np.asarray(end) * u)


def exponential_density(along: npt.ArrayLike, densest: npt.ArrayLike, log_ratio: npt.ArrayLike) -> Array:
    """(...,): exponential density at positions along an axis; constant beyond 0 and 1.

    Parameters
    ----------
    along : array_like (...)
    densest : array_like (...)
        The larger one of the densities at both ends, from which it falls.
    log_ratio : array_like (...)
        log(end / start).
    """
    u, ratio = np.clip(np.asarray(along, dtype=np.float64), 0.0, 1.0), np.asarray(log_ratio)
    with np.errstate(under="ignore"):
        return np.asarray(np.asarray(densest) * optics.transmittance(np.abs(ratio) * np.where(ratio > 0, 1.0 - u, u)))


def exponential_density_mean(
    start: npt.ArrayLike, end: npt.ArrayLike, densest: npt.ArrayLike, log_ratio: npt.ArrayLike
) -> Array:
    """(...,): mean of `exponential_density` on straight lines between positions `start` and `end` of the axis."""
    a, b = (np.clip(np.asarray(position, dtype=np.float64), 0.0, 1.0) for position in (start, end))
    ratio = np.asarray(log_ratio)
    thickest = exponential_density(np.where(ratio > 0, np.maximum(a, b), np.minimum(a, b)), densest, ratio)
    with np.errstate(under="ignore"):
        return np.asarray(thickest * optics.mean_transmittance(np.abs(ratio) * np.abs(a - b)))


def trilinear(low: npt.ArrayLike, high: npt.ArrayLike, fraction: npt.ArrayLike) -> Array:
    """(...,): values between the corners of cells.

    Parameters
    ----------
    low, high : array_like (..., 4)
        At the corners at the lower and the upper end along x, in the order of (y, z) = (low, low), (low, high),
        (high, low), (high, high).
    fraction : array_like (..., 3)
        Position in the cell, 0 to 1 along each axis.
    """
    u, v, w = np.moveaxis(np.asarray(fraction, dtype=np.float64), -1, 0)[..., None]
    with np.errstate(under="ignore"):
        face = np.asarray(low) * (1.0 - u) + np.asarray(high) * u
        edge = face[..., :2] * (1.0 - v) + face[..., 2:] * v
        return np.asarray(edge[..., 0] * (1.0 - w[..., 0]) + edge[..., 1] * w[..., 0])


def _along(points: npt.ArrayLike, axis: int) -> Array:
    """Positions on one axis of the unit box; positions that rounding puts outside are clamped to the boundary."""
    return np.clip(vectors("density at points", points)[..., axis], 0.0, 1.0)


def _check_profile(name: str, axis: int, start: float, end: float, positive: bool = False) -> None:
    if axis not in (0, 1, 2):
        raise InputError(
            f"{name} axis {axis!r}", "the axis must be 0, 1 or 2", "use 0, 1 or 2 for the x, y or z axis of the object"
        )
    for label, value in (("start", start), ("end", end)):
        if not 0 <= value <= MAX_DENSITY or (positive and value == 0):
            least = "above 0 and" if positive else "at least 0 and"
            raise InputError(
                f"{name} {label} {value}",
                f"the density must be {least} at most {MAX_DENSITY:g}",
                "give a density relative to the medium, for example 1",
            )
