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

    Along each direction slice after slice: what leaves a cell is shared out to the cells of the next slice that it gets
    to. So each cell takes away as much as is missing behind it, and no power is lost or won.

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


def condensed(extinction: Array, directions: Array, step: float) -> Array:
    """Extinction (...) in 1/m at which sweeps spread light as far as it spreads with the given one.

    In a sweep light is scattered on from anywhere in the cell where it was scattered, and gets into several cells of
    each slice: from event to event it goes too far. Along a direction of largest component m, with tangents t aside, it
    crosses n edges of cells of a depth x with E[n] = m / x and E[n^2] = coth(x / 2 m) m / x, and is moved aside
    by 1 with a chance t at each. The mean square of the way, in cells, is E[n^2] / m^2 + E[n] sum t (1 - t),
    so that the diffusion coefficient, x / 6 times as much, is (2 / x + S + B x) / 6 up to x^2, with the means
    S of m sum t (1 - t) and B of 1 / 6 m^2 over the directions. It has to be 1 / 3 tau, where tau is the true depth of
    a cell. Then light that starts anywhere has the right power, and the right mean square of its way, whatever is
    absorbed. From about tau = 1.2 on there is no such depth: then the one with the shortest ways is it.

    The same is done for lattice gases (Henon 1987, "Viscosity of a lattice gas").
    """
    slopes = np.sort(np.abs(directions), axis=1)
    most, aside = slopes[:, 2], slopes[:, :2] / slopes[:, 2:]
    mixed = float((most * (aside * (1.0 - aside)).sum(axis=1)).mean())
    flat = float((1.0 / (6.0 * most**2)).mean())
    depth = extinction * step
    half = np.maximum(2.0 - mixed * depth, np.sqrt(8.0 * flat) * depth)
    return np.asarray(4.0 * extinction / (half + np.sqrt(np.maximum(half**2 - 8.0 * flat * depth**2, 0.0))))


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
        weights = solid_angles.astype(np.float32)
        for i in range(len(extinction))[:: -1 if self.backwards else 1]:
            sigma, source = extinction[i].astype(np.float32), emission[i].astype(np.float32)
            # All that leaves a cell gets into those of the next slice: nothing is lost between them.
            edge = self._between(light)
            share, rest = _means(sigma * self.length)
            light[:, *self.here] = edge * np.exp(-sigma * self.length) + source * self.length * share
            fluence[i] += np.tensordot(weights, edge * share + rest * source * self.length, axes=1)

    def _between(self, values: Floats) -> Floats:
        """(g, n, m, c): what lies where the directions come from, between cells of the slice before."""
        (first, weight), *others = self.beside
        total = weight * values[:, *first]
        for index, weight in others:
            total = total + weight * values[:, *index]
        return total


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
