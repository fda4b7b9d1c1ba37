"""Lengths with units, and what is none."""

from __future__ import annotations

import re

import pytest

from translucent.errors import InputError
from translucent.units import METRES_PER_UNIT, metres_per_unit, parse_length


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("um", 1e-6), ("µm", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("dm", 0.1), ("m", 1.0), ("km", 1e3)]
    + [("in", 0.0254), ("ft", 12 * 0.0254)],
)
def test_a_unit_in_metres(unit: str, metres: float) -> None:
    assert metres_per_unit(unit) == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize("unit", ["parsec", "", "M", "m m"])
def test_an_unknown_unit_names_the_known_ones(unit: str) -> None:
    with pytest.raises(
        InputError, match=re.escape(f"unit {unit!r}; no unit of length has this name; use one of um, mm")
    ):
        metres_per_unit(unit)
    assert unit not in METRES_PER_UNIT


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("2cm", 0.02),
        ("0.8 in", 0.8 * 0.0254),
        ("0.02", 0.02),
        (" 1e-3 m ", 1e-3),
        (".5", 0.5),
        ("+3.mm", 3e-3),
        ("7µm", 7e-6),
        ("1E2cm", 1.0),
    ],
)
def test_a_length_can_be_written_so(text: str, metres: float) -> None:
    assert parse_length(text) == pytest.approx(metres, rel=1e-15)


def test_a_bare_number_takes_the_default_unit_and_a_written_unit_wins() -> None:
    assert parse_length("2", default_unit="cm") == 0.02
    assert parse_length("2m", default_unit="cm") == 2.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "length ''; the text is not a number with a unit"),
        ("cm", "not a number with a unit"),
        ("abc", "not a number with a unit"),
        ("1,5cm", "not a number with a unit"),
        ("1cm2", "not a number with a unit"),
        ("0x10", "not a number with a unit"),
        ("0", "length '0'; the length must be positive and finite"),
        ("-1cm", "the length must be positive and finite"),
        ("nan", "the length must be positive and finite"),
        ("inf", "the length must be positive and finite"),
        ("-inf cm", "the length must be positive and finite"),
        ("1e400", "the length must be positive and finite"),
        ("1e-330", "the length must be positive and finite"),
        ("3 furlong", "unit 'furlong'; no unit of length has this name"),
    ],
)
def test_what_is_no_length_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        parse_length(text)
