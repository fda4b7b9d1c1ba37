"""Tone curves: fixed points, order, limits, and the numbers that their publications state."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.formulas.tone import TONES, agx_sigmoid, tone_agx, tone_curve, tone_neutral

GRAYS = np.concatenate([[0.0], np.geomspace(1e-30, 1e6, 2000)])[:, None] * np.ones(3)


@pytest.mark.parametrize("name", TONES)
def test_grays_stay_gray_in_order_and_within_the_display(name: str) -> None:
    shown = tone_curve(name)(GRAYS)
    np.testing.assert_allclose(shown, shown[:, :1] * np.ones(3), atol=1e-12)
    assert (np.diff(shown[:, 0]) >= -1e-15).all()
    assert shown[0].tolist() == [0.0, 0.0, 0.0]
    assert shown[-1] == pytest.approx(np.ones(3), abs=1e-6)
    assert shown.min() >= 0
    assert shown.max() <= 1


@pytest.mark.parametrize("name", TONES)
def test_colors_stay_within_the_display_and_none_gets_darker_in_more_light(name: str) -> None:
    curve = tone_curve(name)
    rng = np.random.default_rng(5)
    colors = 10.0 ** rng.uniform(-4, 6, (400, 3)) * (rng.random((400, 3)) > 0.2)
    shown = curve(colors)
    assert np.isfinite(shown).all()
    assert shown.min() >= 0
    assert shown.max() <= 1
    assert (curve(1.01 * colors).max(axis=1) >= shown.max(axis=1) - 1e-12).all()
    assert curve(-colors).max() == 0.0


def test_neutral_keeps_base_colors_less_what_glass_reflects() -> None:
    # A base color c lit by white light shows c + 0.04 with a dielectric's reflection: the curve takes that away again.
    base = np.array([[0.1, 0.4, 0.7], [0.5, 0.5, 0.5], [0.76, 0.2, 0.05]])
    np.testing.assert_allclose(tone_neutral(base + 0.04), base, atol=1e-15)
    # In the dark it takes less, smoothly: x^2 / 0.16 is left of a channel x below 0.08.
    np.testing.assert_allclose(tone_neutral(np.full(3, 0.04)), np.full(3, 0.01), atol=1e-15)
    # Beyond 0.76 the peak p becomes 1 - 0.24^2 / (p - 0.52): of 2.04, less 0.04, that is 0.9611.
    peak = 1 - 0.24**2 / (2.0 + 1 - 2 * 0.76)
    assert tone_neutral(np.full(3, 2.04)) == pytest.approx(np.full(3, peak), rel=1e-12)
    red = tone_neutral(np.array([2.04, 0.08, 0.08]))
    kept = 1 / (0.15 * (2.0 - peak) + 1)
    other = 0.04 * peak / 2.0 * kept + peak * (1 - kept)
    assert red == pytest.approx([peak, other, other], rel=1e-12)


def test_neutral_has_no_step_where_it_begins() -> None:
    for at in (0.08, 0.8):
        below, above = tone_neutral(np.full(3, at - 1e-9)), tone_neutral(np.full(3, at + 1e-9))
        assert (above - below).max() < 3e-9


def test_agx_shows_middle_gray_at_half_and_ends_where_it_should() -> None:
    assert tone_agx(np.full(3, 0.18)) == pytest.approx(np.full(3, 0.5**2.2), rel=1e-9)
    assert agx_sigmoid([0.0, 20 / 33, 1.0]) == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)
    # As published: coefficients 59.507875 below and 69.86278913545539 above, with powers 3 and 13/4.
    below, above = 0.3 - 20 / 33, 0.8 - 20 / 33
    exact = 0.5 + 2 * below * (1 + 59.507875 * -(below**3)) ** (-1 / 3)
    assert agx_sigmoid(0.3) == pytest.approx(exact, rel=1e-9)
    exact = 0.5 + 2 * above * (1 + 69.86278913545539 * above**3.25) ** (-4 / 13)
    assert agx_sigmoid(0.8) == pytest.approx(exact, rel=1e-9)
    step = 1e-6
    slope = np.diff(agx_sigmoid(20 / 33 + np.array([-step, 0, step]))) / step
    assert slope == pytest.approx([2.0, 2.0], rel=1e-4)
    # 10 stops below middle gray is black, 6.5 above is white.
    assert tone_agx(np.full(3, 0.18 / 1024)).max() < 1e-9
    assert tone_agx(np.full(3, 0.18 * 2**6.5)) == pytest.approx(np.ones(3), abs=1e-9)


def test_agx_fades_bright_colors_to_white() -> None:
    purity = [np.ptp(tone_agx(np.array([1.0, 0.1, 0.1]) * brightness)) for brightness in (1, 10, 100)]
    assert purity[0] > purity[1] > purity[2]
    assert purity[2] < 0.1


def test_an_unknown_curve_is_refused() -> None:
    with pytest.raises(
        tl.InputError, match="tone 'filmic'; no tone curve has this name; use one of none, neutral, agx"
    ):
        tone_curve("filmic")
