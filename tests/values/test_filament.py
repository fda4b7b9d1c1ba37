"""Transmission distances of filaments: the formula, its way back, and what has none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.formulas.color import luminance
from translucent.media.conversion import TD_TRANSMITTANCE, extinction_of_td, td_of

lengths = st.floats(1e-5, 1e2)
shares = st.floats(1e-3, 0.9)


def test_a_tenth_is_left_after_one_td() -> None:
    """T = 10^(-d / TD), the formula of the source."""
    medium = tl.Medium(absorption=extinction_of_td(4e-3))
    np.testing.assert_allclose(medium.transmittance(0.8e-3), 10 ** (-0.8 / 4.0), rtol=1e-14)
    np.testing.assert_allclose(medium.extinction, math.log(10) / 4e-3, rtol=1e-14)
    assert TD_TRANSMITTANCE == 0.1


@given(lengths, shares)
def test_td_there_and_back(td: float, share: float) -> None:
    assert td_of(extinction_of_td(td, share), share) == pytest.approx(td, rel=1e-12)


@given(st.tuples(*[st.floats(1e-2, 1e5)] * 3), shares)
def test_the_luminance_that_is_left_is_the_one_that_was_asked_for(sigma: tuple[float, ...], share: float) -> None:
    td = td_of(sigma, share)
    with np.errstate(under="ignore"):
        assert luminance(np.exp(-np.array(sigma) * td)) == pytest.approx(share, rel=1e-9)


def test_what_stays_brighter_has_no_td() -> None:
    # Green alone is 0.7152 of the luminance, blue 0.0722.
    assert td_of((100, 0, 100)) == math.inf
    assert td_of((0, 0, 0)) == math.inf
    assert luminance(np.exp(-np.array([100, 100, 0]) * td_of((100, 100, 0)))) == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0, math.nan])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(tl.InputError, match="the transmittance must lie between 0 and 1"):
        extinction_of_td(1e-3, share)
    with pytest.raises(tl.InputError, match="the transmittance must lie between 0 and 1"):
        td_of((1, 1, 1), share)
