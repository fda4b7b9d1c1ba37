"""Positions of samples within a pixel: the Sobol sequence, centered."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.formulas.sampling import sample_shifts


@pytest.mark.parametrize("samples", [1, 2, 3, 16])
def test_shifts_are_centered_and_one_in_each_of_as_many_columns_and_rows(samples: int) -> None:
    shifts = sample_shifts(samples)
    np.testing.assert_allclose(shifts.mean(axis=0), 0.0, atol=1e-15)
    if samples & (samples - 1) == 0:
        for axis in (0, 1):
            cells = np.floor((shifts[:, axis] + 0.5) * samples)
            assert sorted(cells) == list(range(samples))
