"""Light that a scattering half-space gives back: against exact moments and a published value, and in limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from translucent.formulas import diffuse_interface as diffuse
from translucent.formulas.diffuse_interface import half_space_reflectance

#: The iteration ends where it changes less than this; it converges by halves, so the rest is no more.
LEFT = 4 * diffuse.H_TOLERANCE


@pytest.mark.parametrize("albedo", [1.0, 0.999999, 0.99, 0.5, 0.01])
def test_h_has_its_exact_mean(albedo: float) -> None:
    """2 / w (1 - sqrt(1 - w)): Chandrasekhar 1960, V 11."""
    cosine, weight = diffuse._nodes(1.0)
    found = diffuse._chandrasekhar_h(albedo, cosine, weight)
    assert (found * weight).sum() == pytest.approx(2 / albedo * (1 - math.sqrt(1 - albedo)), abs=LEFT)


def test_h_of_a_lossless_half_space() -> None:
    """The first moment is 2 / sqrt(3), and at the zenith H is 2.90781 (Chandrasekhar 1960, V, tables)."""
    cosine, weight = diffuse._nodes(1.0)
    found = diffuse._chandrasekhar_h(1.0, cosine, weight)
    assert (found * cosine * weight).sum() == pytest.approx(2 / math.sqrt(3), abs=LEFT)
    assert 1 / (0.5 * (cosine * weight * found / (1 + cosine)).sum()) == pytest.approx(2.90781, abs=5e-6)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.6])
def test_what_is_not_absorbed_comes_back(ior: float) -> None:
    assert half_space_reflectance(1.0, ior) == pytest.approx(1.0, abs=1e-8)
    assert half_space_reflectance(0.0, ior) == 0.0


@pytest.mark.parametrize("albedo", [0.9999, 0.9, 0.3])
def test_an_interface_keeps_light_inside(albedo: float) -> None:
    rising = [half_space_reflectance(albedo, ior) for ior in (1.6, 1.33, 1.0)]
    assert (np.diff(rising) > 0).all()
