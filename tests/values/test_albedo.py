"""Diffuse color to single-scattering albedo and back: published values, round trips, ends and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

import translucent as tl
from translucent.media.albedo import (
    CHIANG_MAX_ALBEDO,
    chiang_albedo,
    chiang_color,
    hulst_albedo,
    hulst_color,
    scattering_medium,
)

COLORS = np.concatenate([np.linspace(0, 1, 2001), [1e-12, 1e-5, 1 - 1e-6, 1 - 1e-12]])
G = [-0.999, -0.5, 0.0, 0.3, 0.8, 0.999]


def test_known_values() -> None:
    assert hulst_albedo([0, 0.1, 0.5, 1]).tolist() == pytest.approx([0, 0.384, 0.912, 1], abs=5e-4)
    assert chiang_albedo(0.5) == pytest.approx(1 - math.exp(-2.54703 + 0.65297 - 0.53975625), rel=1e-14)


@pytest.mark.parametrize("g", G)
def test_it_is_the_inverse_that_the_paper_prints(g: float) -> None:
    s = 4.09712 + 4.20863 * COLORS - np.sqrt(9.59217 + 41.6808 * COLORS + 17.7126 * COLORS**2)
    with np.errstate(under="ignore"):
        printed = (1 - s**2) / (1 - g * s**2)
    # Six printed digits of s, stretched by d a / d s, which is 2 s (1 - g) / (1 - g s^2)^2.
    stretch = 2 * s * (1 - g) / (1 - g * s**2) ** 2
    assert (np.abs(hulst_albedo(COLORS, g) - printed) <= 2e-5 * np.abs(stretch) + 1e-9).all()


@pytest.mark.parametrize("g", G)
def test_hulst_round_trip(g: float) -> None:
    # At the white end the color goes with the root of 1 - a, so a rounding e of a is one of 2.3 sqrt(e / (1 - g)).
    again = hulst_color(hulst_albedo(COLORS, g), g)
    s = (1 - COLORS) / (1 + COLORS)
    allowed = np.minimum(1e-14 / (1 - g) / np.maximum(s, 1e-30), 5e-8 / math.sqrt(1 - g)) + 2e-13
    assert (np.abs(again - COLORS) <= allowed).all()
    assert hulst_albedo([0.0, 1.0], g).tolist() == [0, 1]
    assert hulst_color([0.0, 1.0], g).tolist() == [0, 1]


def test_chiang_round_trip() -> None:
    albedo = chiang_albedo(COLORS)
    assert (np.diff(albedo[:2001]) > 0).all()
    # d C / d a is at most 1 / (4.56 (1 - a)), with 1 - a at least 0.0011.
    assert np.abs(chiang_color(albedo) - COLORS).max() <= 1e-15 * 4 / 4.56 / 0.0011
    assert chiang_albedo(1.0) == CHIANG_MAX_ALBEDO
    assert chiang_color([0.0, CHIANG_MAX_ALBEDO]) == pytest.approx([0, 1], abs=1e-13)


@pytest.mark.parametrize("g", [0.0, 0.7, -0.4])
def test_a_scattering_medium_has_its_path_and_color(g: float) -> None:
    medium = scattering_medium((0.9, 0.5, 0.1), (1e-3, 2e-3, 4e-3), anisotropy=g, ior=1.3)
    assert medium.mean_free_path == pytest.approx([1e-3, 2e-3, 4e-3], rel=1e-14)
    assert hulst_color(medium.scattering / medium.extinction, g) == pytest.approx([0.9, 0.5, 0.1], rel=1e-12)
    assert (medium.anisotropy, medium.ior) == (g, 1.3)


def test_white_scatters_only_black_absorbs_only_and_chiang_differs() -> None:
    medium = scattering_medium((1, 0, 0.5), 0.01)
    assert np.asarray(medium.absorption)[:2].tolist() == [0, 100]
    assert np.asarray(medium.scattering)[:2].tolist() == [100, 0]
    other = scattering_medium((1, 0, 0.5), 0.01, model="chiang")
    assert np.asarray(other.scattering) == pytest.approx(100 * chiang_albedo([1, 0, 0.5]), rel=1e-14)
    assert other.extinction == pytest.approx([100] * 3, rel=1e-14)


@pytest.mark.parametrize("g", [0.0, 0.9])
def test_near_white_absorption_has_no_cancellation(g: float) -> None:
    medium = scattering_medium((1 - 1e-9,) * 3, 1.0, anisotropy=g)
    s = 1e-9 / (1.139 + 1.17)  # to first order
    assert np.asarray(medium.absorption) == pytest.approx([s * s * (1 - g)] * 3, rel=1e-6)


def test_values_outside_the_domain_are_refused() -> None:
    with pytest.raises(tl.InputError, match=r"color 1.1; the value must lie in 0 to 1"):
        hulst_albedo([0.5, 1.1])
    with pytest.raises(tl.InputError, match="color nan; the value must lie in 0 to 1"):
        chiang_albedo(math.nan)
    with pytest.raises(tl.InputError, match=r"albedo -0.1; the value must lie in 0 to 1"):
        hulst_color(-0.1)
    with pytest.raises(tl.InputError, match=r"albedo 0.999; the value must lie in 0 to 0\.99888"):
        chiang_color(0.999)
    with pytest.raises(tl.InputError, match=r"anisotropy 1.0; the anisotropy must lie between -1 and 1"):
        hulst_albedo(0.5, 1.0)
    with pytest.raises(tl.InputError, match=r"anisotropy 0.5; Chiang's formula is only for isotropic scattering"):
        scattering_medium((0.5,) * 3, 1, anisotropy=0.5, model="chiang")
    for path in (0, -1, math.inf, math.nan, (1, 2)):
        with pytest.raises(
            tl.InputError, match=r"mean free path .*; the mean free path must be one length or three lengths above 0"
        ):
            scattering_medium((0.5,) * 3, path)
