"""Sweeps along directions through a grid of cells: discrete ordinates by short characteristics.

References
----------
Kunasz & Auer 1988, "Short characteristic integration of radiative transfer problems"; Chandrasekhar 1950 for discrete
ordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers

_Index = tuple[slice, slice]
Floats = npt.NDArray[np.float32]

#: Optical depth below which two terms of a series are enough for float32.
_SERIES = np.float32(1e-2)


def swept(
    extinction: Array, emission: Array, arriving: Array, directions: Array, solid_angles: Array, step: float
) -> Array:
    """Mean fluence in cells, of light from the boundary of a grid and of what the cells send out, dimmed on the way.

    Along each direction slice after slice, each from the one before; light between the cells of that one is
    interpolated. What a uniform medium sends out and takes away is exact, and in cells that let nothing through the
    mean is that of all that gets in.

    Parameters
    ----------
    extinction, emission : (x, y, z, 3) float64
        Of each cell, 1/m, and radiance for each metre that it sends in all directions.
    arriving : (k, 3) float64
        Radiance at the boundary, from each direction.
    directions : (k, 3) float64
        Unit vectors towards where light comes from.
    solid_angles : (k,) float64
        That each direction stands for.
    step : float
        Side of a cell in metres.

    Returns
    -------
    fluence : (x, y, z, 3) float64
    """
    fluence = np.zeros(emission.shape)
    for axis in range(3):
        for alike in _alike(directions, axis):
            sweep = _Sweep.along(directions[alike.numbers], axis, alike.signs, step)
            matter, source, found = (np.moveaxis(values, axis, 0) for values in (extinction, emission, fluence))
            sweep.run(matter, source, found, arriving[alike.numbers], solid_angles[alike.numbers])
    return fluence


@dataclass(frozen=True)
class _Alike:
    """Directions that lead from each cell between the same cells of the slice before."""

    numbers: Integers
    signs: tuple[float, float, float]


def _alike(directions: Array, axis: int) -> list[_Alike]:
    order = [axis, *(other for other in range(3) if other != axis)]
    steepest = np.flatnonzero(np.abs(directions).argmax(axis=1) == axis)
    signs = np.where(directions[steepest][:, order] >= 0.0, 1.0, -1.0)
    kinds, kind = np.unique(signs, axis=0, return_inverse=True)
    return [_Alike(steepest[kind.ravel() == i], (s[0], s[1], s[2])) for i, s in enumerate(kinds)]


@dataclass(frozen=True, eq=False)
class _Sweep:
    """One sweep along an axis; arrays of a slice have one more row and column, on the side where light comes from."""

    backwards: bool
    here: _Index
    beside: tuple[tuple[_Index, Floats], ...]
    length: Floats

    @classmethod
    def along(cls, directions: Array, axis: int, signs: tuple[float, float, float], step: float) -> _Sweep:
        ahead = np.abs(directions[:, axis])
        aside = [np.abs(directions[:, other]) / ahead for other in range(3) if other != axis]
        near, far = (tuple(_ends(sign, farther) for sign in signs[1:]) for farther in (False, True))
        beside = []
        for i, j in np.ndindex(2, 2):
            weight = (aside[0] if i else 1.0 - aside[0]) * (aside[1] if j else 1.0 - aside[1])
            index = (far if i else near)[0], (far if j else near)[1]
            beside.append((index, weight.astype(np.float32)[:, None, None, None]))
        length = (step / ahead).astype(np.float32)[:, None, None, None]
        return cls(signs[0] > 0.0, (near[0], near[1]), tuple(beside), length)

    def run(self, extinction: Array, emission: Array, fluence: Array, arriving: Array, solid_angles: Array) -> None:
        """Add the fluence of these directions to slices (x, y, z, 3) of an array."""
        count, (_, n, m, channels) = len(arriving), extinction.shape
        light = np.empty((count, n + 1, m + 1, channels), np.float32)
        light[...] = arriving[:, None, None, :]
        before = np.zeros((2, 1, n + 1, m + 1, channels), np.float32)
        weights = solid_angles.astype(np.float32)
        for i in range(len(extinction))[:: -1 if self.backwards else 1]:
            sigma, source = extinction[i].astype(np.float32), emission[i].astype(np.float32)
            half = 0.5 * self.length
            edge = _after(self._between(light), self._between(before[0]), self._between(before[1]), half)
            # On the way through all of the cell, what has come to its edge and what it sends out itself.
            share, rest = _means(sigma * self.length)
            light[:, *self.here] = _after(edge, sigma, source, half)
            before[0, 0, *self.here], before[1, 0, *self.here] = sigma, source
            fluence[i] += np.tensordot(weights, edge * share + rest * source * self.length, axes=1)

    def _between(self, values: Floats) -> Floats:
        """(g, n, m, c): what lies where the directions come from, between cells of the slice before."""
        (first, weight), *others = self.beside
        total = weight * values[:, *first]
        for index, weight in others:
            total = total + weight * values[:, *index]
        return total


def _after(light: Floats, extinction: Floats, emission: Floats, length: Floats) -> Floats:
    """Light after a way through what takes it away and adds to it."""
    depth = extinction * length
    return np.asarray(light * np.exp(-depth) + emission * length * _means(depth)[0], np.float32)


def _means(depth: Floats) -> tuple[Floats, Floats]:
    """Mean transmittance over a way, (1 - e^-x) / x, and the mean of what comes from all places before on it."""
    safe = np.maximum(depth, _SERIES)
    mean = -np.expm1(-safe) / safe
    small = depth < _SERIES
    first = np.where(small, 1.0 - depth * (0.5 - depth / 6.0), mean)
    return first, np.where(small, 0.5 - depth * (1.0 / 6.0 - depth / 24.0), (1.0 - mean) / safe)


def _ends(sign: float, farther: bool) -> slice:
    """Cells of a slice in arrays with one more at the end where light comes from; or each one's neighbor there."""
    return slice(1, None) if (sign > 0.0) == farther else slice(0, -1)
