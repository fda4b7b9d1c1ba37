"""Positions of samples within a pixel."""

from __future__ import annotations

import warnings

import numpy as np
import numpy.typing as npt


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns that numbers other than powers of 2 lose the balance of the sequence; they are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        points = qmc.Sobol(2, scramble=False).random(samples)
    shifts = points + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))
