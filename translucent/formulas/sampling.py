"""Positions of samples within a pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas.sobol import sobol_points


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    shifts = sobol_points(samples) + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))
