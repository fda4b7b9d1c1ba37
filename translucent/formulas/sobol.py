"""Sobol points in the unit square (Sobol 1967; direction numbers as those of Joe and Kuo 2008).

They are those of `scipy.stats.qmc.Sobol`, digit by digit, whose import takes most of a second.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

#: Binary digits of the points.
DIGITS = 30

Words = npt.NDArray[np.uint64]


def sobol_points(count: int, seed: int | None = None) -> Array:
    """The first points of the sequence.

    Parameters
    ----------
    count : int
        Any number at least 0; powers of 2 are balanced.
    seed : int, optional
        Scramble them by a random linear map and a shift (Matousek 1998); default: they are as they are, the first at 0.

    Returns
    -------
    (count, 2) float64
        From 0 to below 1.
    """
    directions, shift = _directions(), np.zeros(2, dtype=np.uint64)
    if seed is not None:
        rng = np.random.default_rng(seed)
        shift = rng.integers(2, size=(2, DIGITS), dtype=np.uint32) @ (1 << np.arange(DIGITS, dtype=np.uint64))
        lower = np.tril(rng.integers(2, size=(2, DIGITS, DIGITS), dtype=np.uint32), -1)
        directions = _mapped(directions, lower + np.eye(DIGITS, dtype=np.uint32))
    number = np.arange(count, dtype=np.uint64)
    gray = number ^ (number >> np.uint64(1))
    points = np.tile(shift.astype(np.uint64), (count, 1))
    for digit in range(max(count - 1, 0).bit_length()):
        chosen = ((gray >> np.uint64(digit)) & np.uint64(1)).astype(bool)
        points[chosen] ^= directions[digit]
    return points / 2.0**DIGITS


def _directions() -> Words:
    """(DIGITS, 2): direction numbers; of the second coordinate those of the polynomial x + 1."""
    found, odd = np.empty((DIGITS, 2), dtype=np.uint64), 1
    for digit in range(DIGITS):
        found[digit] = 1 << (DIGITS - 1 - digit), odd << (DIGITS - 1 - digit)
        odd ^= odd << 1
    return found


def _mapped(directions: Words, matrices: npt.NDArray[np.uint32]) -> Words:
    """Direction numbers, each coordinate's digits, the highest first, times a matrix (2, DIGITS, DIGITS) modulo 2."""
    places = np.arange(DIGITS - 1, -1, -1, dtype=np.uint64)
    digits = ((directions[..., None] >> places) & np.uint64(1)).astype(np.int64)
    turned = np.einsum("cij,dcj->dci", matrices.astype(np.int64), digits) % 2
    return np.asarray((turned.astype(np.uint64) << places).sum(axis=2, dtype=np.uint64))
