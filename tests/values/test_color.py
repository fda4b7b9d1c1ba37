"""Color encodings against the standard's numbers, and every way to write a color."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from translucent.errors import InputError
from translucent.formulas import color
from translucent.media.colors import parse_color

EPS = float(np.finfo(np.float64).eps)


@pytest.mark.parametrize(
    ("encoded", "linear"),
    [
        (0.0, 0.0),
        (1.0, 1.0),
        (0.04, 0.04 / 12.92),  # on the straight part
        (0.041, (0.096 / 1.055) ** 2.4),  # just above it
        (0.5, 0.21404114048223255),  # ((0.5 + 0.055) / 1.055)^2.4
        (188 / 255, 0.50288646),  # the well-known middle gray, 8 digits
        (-0.5, -0.21404114048223255),
    ],
)
def test_srgb_curve_by_hand(encoded: float, linear: float) -> None:
    assert color.srgb_to_linear(encoded) == pytest.approx(linear, rel=1e-8)
    assert color.linear_to_srgb(linear) == pytest.approx(encoded, rel=1e-8)


@given(st.floats(-4, 4, allow_subnormal=False).filter(lambda v: v == 0 or abs(v) > 1e-300))
def test_srgb_round_trip(value: float) -> None:
    # The standard's rounded constants leave the two branches 1e-8 apart where they meet, and nowhere else.
    assert color.linear_to_srgb(color.srgb_to_linear(value)) == pytest.approx(value, rel=8 * EPS, abs=4 * EPS)


def test_srgb_curve_rises_where_its_branches_meet() -> None:
    for curve, limit in ((color.srgb_to_linear, 0.04045), (color.linear_to_srgb, 0.0031308)):
        values = curve(np.linspace(0.9 * limit, 1.1 * limit, 1001))
        # The branches meet within 1e-7 of each other (IEC 61966-2-1 rounds its constants).
        assert (np.diff(values) > -1e-7).all()
        assert values[-1] > values[0]


def test_what_is_all_but_black_is_encoded() -> None:
    """The float64 reference leaves such numbers behind a dense medium."""
    assert color.linear_to_srgb([5e-324, 1e-310, 0.0]).max() < 1e-300


def test_every_byte_survives_the_way_to_linear_and_back() -> None:
    bytes_ = np.arange(256)
    assert np.rint(color.linear_to_srgb(color.srgb_to_linear(bytes_ / 255)) * 255).astype(int).tolist() == [*bytes_]


def test_luminance_of_the_primaries_adds_up_to_white() -> None:
    assert color.luminance(np.eye(3)).tolist() == [0.2126, 0.7152, 0.0722]
    assert color.luminance([1.0, 1.0, 1.0]) == pytest.approx(1.0, rel=2 * EPS)


@pytest.mark.parametrize(("stops", "factor"), [(0, 1.0), (1, 2.0), (-2, 0.25), (0.5, 2**0.5)])
def test_one_stop_doubles_the_light(stops: float, factor: float) -> None:
    assert color.exposure_scale(stops) == pytest.approx(factor, rel=2 * EPS)


RED = (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("written", "linear"),
    [
        ("#ff0000", RED),
        ("#F00", RED),
        ("ff0000", RED),  # as a shell leaves it without quotes, or who does not know what # is for
        (" FF0000 ", RED),
        (" red ", RED),
        ("srgb(1, 0, 0)", RED),
        ("SRGB(0.5,0.5,0.5)", (0.21404114048223255,) * 3),
        ("linear(0.18, 0.62, 0.35)", (0.18, 0.62, 0.35)),
        (" linear( .5 , 1e-3, 1 ) ", (0.5, 1e-3, 1.0)),
        ((0.18, 0.62, 0.35), (0.18, 0.62, 0.35)),
        (np.array([2.0, -1.0, 0.0]), (2.0, -1.0, 0.0)),
    ],
    ids=str,
)
def test_a_color_can_be_written_so(written: object, linear: tuple[float, ...]) -> None:
    assert parse_color(written) == pytest.approx(linear, rel=1e-15)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("reddish", "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ("#12345", "color '#12345'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ("", "color ''; the text is empty; in a shell, quote the color: '#7b1e3a' (# begins a comment)"),
        ("123", "color '123'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ("7b1e3aff", "color '7b1e3aff'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ("0.1,0.2,0.3", "neither a hex color"),
        ("linear(1, 2)", "color 'linear(1, 2)'; the parentheses must contain three numbers"),
        ("srgb(a, b, c)", "the parentheses must contain three numbers"),
        ("linear(nan, 0, 0)", "a channel of the color is not a finite number"),
        ("srgb(inf, 0, 0)", "a channel of the color is not a finite number"),
        ((0.1, 0.2), "the color has shape (2,), and not (3,)"),
        (0.5, "the color has shape (), and not (3,)"),
        (((1, 1, 1),), "the color has shape (1, 3), and not (3,)"),
        ((1.0, float("nan"), 0.0), "a channel of the color is not a finite number"),
        ((1, 2, "x"), "a color needs three numbers"),
        (None, "shape"),
    ],
    ids=str,
)
def test_what_is_no_color_is_refused(written: object, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message) if written is not None else "color None"):
        parse_color(written)


@pytest.mark.parametrize("text", ["#000000", "#7b1e3a", "#010203", "#ffffff"])
def test_hex_round_trip(text: str) -> None:
    assert color.to_hex(parse_color(text)) == text


@pytest.mark.parametrize(("linear", "text"), [((-1, 0, 2), "#0000ff"), ((1e-9, 1, 1e300), "#00ffff")])
def test_hex_clamps(linear: tuple[float, float, float], text: str) -> None:
    assert color.to_hex(linear) == text
