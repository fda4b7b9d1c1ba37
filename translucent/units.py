"""Lengths with units. Inside the toolkit every length is in metres; files and the command line take a unit."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from translucent.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

METRES_PER_UNIT = {
    "um": 1e-6,
    "mm": 1e-3,
    "cm": 1e-2,
    "dm": 1e-1,
    "m": 1.0,
    "km": 1e3,
    "in": 0.0254,
    "ft": 0.3048,
}

_LENGTH = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf|nan)\s*([a-zA-Zµ]*)\s*")


def metres_per_unit(unit: str) -> float:
    """Length of one `unit` in metres: of a name, such as ``mm``, or of a length, such as ``25mm``.

    Raises
    ------
    InputError
        If the unit is not known.
    """
    name = unit.replace("µ", "u")
    if name in METRES_PER_UNIT:
        return METRES_PER_UNIT[name]
    if (match := _LENGTH.fullmatch(name)) is not None and match[2]:
        return parse_length(name)
    raise InputError(f"unit {unit!r}", "not a known unit of length", f"use one of {', '.join(METRES_PER_UNIT)}")


def parse_length(text: str, default_unit: str = "m") -> float:
    """Metres of a length such as ``2cm``, ``0.8 in`` or, in `default_unit`, ``0.02``.

    Raises
    ------
    InputError
        If the text is not a positive, finite number with an optional unit.
    """
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise InputError(f"length {text!r}", "not a number with a unit", "write for example 2cm, 0.8in or 0.02")
    metres = float(match[1]) * metres_per_unit(match[2] or default_unit)
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(f"length {text!r}", "not positive and finite", "give a distance above zero, for example 2cm")
    return metres


def metres_in(text: str) -> float | None:
    """Metres of a length with a unit; None of a text that is none."""
    match = _LENGTH.fullmatch(text)
    if match is None or match[2].replace("µ", "u") not in METRES_PER_UNIT:
        return None
    return float(match[1]) * metres_per_unit(match[2])


def length_text(metres: float) -> str:
    """Length in words, with three digits, in the largest of m, mm, µm and nm that it exceeds."""
    scale, name = next((one for one in _WORDS if metres >= one[0]), _WORDS[-1])
    return f"{metres / scale:.3g} {name}"


def short_length(metres: float) -> str:
    """Length with three digits, in the largest of m, cm, mm and um that it exceeds, as options take it."""
    name = next((one for one in ("m", "cm", "mm") if metres >= METRES_PER_UNIT[one]), "um")
    return f"{_digits(metres / METRES_PER_UNIT[name])} {name}"


def extent_text(extent: npt.NDArray[np.float64]) -> str:
    """Sides of a box with three digits, in the unit that suits the longest."""
    name = short_length(float(extent.max())).split()[1]
    return f"{' x '.join(_digits(side / METRES_PER_UNIT[name]) for side in extent.tolist())} {name}"


def _digits(value: float) -> str:
    """Number with three digits, and with none behind its point from 100 on."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


_WORDS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
