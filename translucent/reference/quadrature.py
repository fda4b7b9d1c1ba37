"""Quadrature of intervals: positions of samples and the parts that they stand for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers

Words = npt.NDArray[np.uint64]

_MASK = np.uint64(0xFFFFFFFF)

#: Function from positions (k, p) in intervals, 0 to 1, to distances (k, p) on the rays, and to their derivative (k, p).
Variable = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps through intervals, in order; in metres along the rays.

    Attributes
    ----------
    begin, end : (k, p) float64
        Of each step. The medium at the sample counts for all of it.
    at : (k, p) float64
        Where the sample is, from `begin` to `end`.
    weight : (k, p) float64
        Length for which the source at the sample counts.
    """

    begin: Array
    end: Array
    at: Array
    weight: Array


def even_steps(variable: Variable, offset: Array) -> Steps:
    """Even steps in some variable, as in a Riemann sum.

    In the distance itself, offset 0 is the left rule, 0.5 the midpoint rule, and random ones are stratified sampling.

    Parameters
    ----------
    variable : callable
    offset : (k, p) float64
        Position of each sample in its step, 0 to 1.
    """
    count = offset.shape[1]
    edges, _ = variable(np.broadcast_to(np.arange(count + 1) / count, (len(offset), count + 1)))
    at, stretch = variable((np.arange(count) + offset) / count)
    begin, end = edges[:, :-1], edges[:, 1:]
    return Steps(begin, end, at, stretch / count)


def gauss_steps(start: Array, end: Array, count: int) -> Steps:
    """Gauss-Legendre steps with `count` points from `start` (k,) to `end` (k,).

    Each point stands for a step of the length of its weight; by the separation theorem (Szego 1939, section 3.41) these
    steps, put one after the other, hold one point each.
    """
    points, weights = np.polynomial.legendre.leggauss(count)
    edges = np.concatenate([[0.0], np.cumsum(weights)]) / weights.sum()
    length = (end - start)[:, None]
    at = start[:, None] + length * (0.5 + 0.5 * points)
    edges = start[:, None] + length * edges
    return Steps(edges[:, :-1], edges[:, 1:], at, length * (0.5 * weights))


def hashed(column: Integers, row: Integers, number: Integers, seed: int) -> Array:
    """Hashed random numbers in 0 to 1 - 2^-24, all of them multiples of 2^-24, so that float32 holds them exactly.

    The first component of pcg3d (Jarzynski & Olano 2020) of column, row, and number + 2654435769 seed, mod 2^32.

    Parameters
    ----------
    column, row, number : (...) int64
        Of the pixel, and of the sample in it; >= 0, they broadcast.
    seed : int
    """
    keys = np.broadcast_arrays(column, row, number + (2654435769 * seed & 0xFFFFFFFF))
    # Modulo 2^32; a product and a sum of such numbers stay below 2^64.
    x, y, z = ((key.astype(np.uint64) & _MASK) * np.uint64(1664525) + np.uint64(1013904223) & _MASK for key in keys)
    x, y, z = (value ^ (value >> np.uint64(16)) for value in _mixed(x, y, z))
    return np.asarray((_mixed(x, y, z)[0] >> np.uint64(8)) * 2.0**-24)


def _mixed(x: Words, y: Words, z: Words) -> tuple[Words, Words, Words]:
    x = (x + y * z) & _MASK
    y = (y + z * x) & _MASK
    return x, y, (z + x * y) & _MASK
