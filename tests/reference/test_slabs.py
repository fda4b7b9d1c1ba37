"""Slabs by adding and doubling against published shares, balances of energy and scaling laws."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.reference import slabs


def test_a_slab_that_scatters_forwards_is_that_of_the_tables() -> None:
    """Albedo 0.9, depth 2, g = 0.75, light straight on: van de Hulst 1980, table 35, as MCML is checked by, too."""
    mu, weight = slabs.cosines(1.0)
    flux = mu * weight
    for matrix, share in zip(slabs.bare(0.9, 2.0, mu, weight, 0.75), (0.09739, 0.66096), strict=True):
        steep = [flux @ matrix[:, j] / flux[j] for j in range(-4, 0)]
        assert np.polyval(np.polyfit(mu[-4:], steep, 2), 1.0) == pytest.approx(share, abs=3e-5)


@pytest.mark.parametrize("ior", [1.0, 1.5])
@pytest.mark.parametrize("anisotropy", [0.0, 0.5, 0.9])
def test_a_lossless_slab_loses_nothing(anisotropy: float, ior: float) -> None:
    assert sum(slabs.total_fractions(1.0, 10.0, ior, anisotropy)) == pytest.approx(1.0, abs=3e-4)


def test_a_deep_slab_depends_on_reduced_scattering_alone() -> None:
    """Similarity of media that scatter often (van de Hulst 1980, chapter 14), to a percent."""
    g, depth, absorbed = 0.9, 100.0, 1e-3
    forwards = slabs.total_fractions(1 - absorbed, depth, 1.0, g)
    reduced = (1 - absorbed) * (1 - g) / ((1 - absorbed) * (1 - g) + absorbed)
    alike = slabs.total_fractions(reduced, depth * (1 - g * (1 - absorbed)), 1.0)
    np.testing.assert_allclose(forwards, alike, atol=0.01)
