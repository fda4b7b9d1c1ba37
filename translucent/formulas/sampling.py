"""Positions of samples within a pixel, and the low-discrepancy points that they are made of."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas.stored import stored

#: Number of points of each stored sequence: as many samples as a pixel may have.
MOST_POINTS = 4096


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    shifts = sobol_points(samples) + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))


def sobol_points(count: int, *, scrambled: bool = False) -> npt.NDArray[np.float64]:
    """(count, 2): the first points in 0..1 of a Sobol sequence in two dimensions.

    Those of `scipy.stats.qmc.Sobol`, stored by ``tools/make_tables.py``: importing ``scipy.stats`` takes longer than
    drawing a small picture.

    Parameters
    ----------
    count : int
        0 to 4096; numbers other than powers of 2 lose the balance of the sequence, but are still well spread.
    scrambled : bool
        A sequence scrambled once and for all (Matousek 1998), in which no point lies in a corner.

    Raises
    ------
    ValueError
        If so many are not stored.
    """
    if not 0 <= count <= MOST_POINTS:
        raise ValueError(f"{count} points of a sequence of {MOST_POINTS}")
    points = stored("sobol_scrambled" if scrambled else "sobol")
    return np.asarray(points[:count] / float(1 << 8 * points.itemsize))
