"""Positions of samples within a pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Binary digits of a coordinate.
DIGITS = 30


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    shifts = sobol_points(samples) + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))


def sobol_points(count: int) -> npt.NDArray[np.float64]:
    """(count, 2) in 0..1: the first points of the Sobol sequence, in the order of Gray codes (Antonov & Saleev 1979).

    The directions of the second dimension are those of the polynomial x + 1 (Joe & Kuo 2008). The points are those of
    `scipy.stats.qmc.Sobol`, whose import takes 0.6 s of processor time.
    """
    index = np.arange(count)
    gray = index ^ (index >> 1)
    first, second = np.zeros((2, count), np.int64)
    direction = 1
    for digit in range(DIGITS):
        chosen, place = (gray >> digit) & 1, DIGITS - 1 - digit
        first ^= chosen << place
        second ^= chosen * (direction << place)
        direction ^= direction << 1
    return np.stack([first, second], axis=1) / 2.0**DIGITS
