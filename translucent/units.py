"""Lengths with units, and sizes of models: assumed and likely units, and factors between them.

Inside the toolkit every length is in metres; files and the command line take a unit.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from translucent.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


from pathlib import Path
from typing import Literal, Protocol

from translucent.arrays import Array

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
    raise InputError(f"unit {unit!r}", "no unit of length has this name", f"use one of {', '.join(METRES_PER_UNIT)}")


def parse_length(text: str, default_unit: str = "m") -> float:
    """Metres of a length such as ``2cm``, ``0.8 in`` or, in `default_unit`, ``0.02``.

    Raises
    ------
    InputError
        If the text is not a positive, finite number with an optional unit.
    """
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise InputError(
            f"length {text!r}", "the text is not a number with a unit", "write a length such as 2cm, 0.8in or 0.02"
        )
    metres = float(match[1]) * metres_per_unit(match[2] or default_unit)
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(
            f"length {text!r}", "the length must be positive and finite", "give a length above zero, for example 2cm"
        )
    return metres


def metres_in(text: str) -> float | None:
    """Metres of a length with a unit; None for other texts."""
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


#: Longest sides in metres of what light shines through, usually.
USUAL = (5e-3, 0.5)

#: Longest side from which on coordinates are rarely metres: below, models without a size were often scaled to 1 or 10.
HARDLY_METRES = 20.0

#: Height in metres of a figurine, for models of no known size.
FIGURINE = 0.12

#: Names of units in sentences.

Way = Literal["option", "argument", "field"]

#: Texts that set a unit, and a size.
_WAYS: dict[Way, tuple[str, str]] = {
    "option": ("--unit {}", "--{0} {2:g}cm"),
    "argument": ("unit='{}'", "{0}={1:g}"),
    "field": ("File > Unit of the file > {}", "set the height under Look to {2:g} cm"),
}

_ADJECTIVES = {"height": "tall", "longest": "long"}
_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}


class _Model(Protocol):
    """Mesh, as far as its size goes."""

    @property
    def name(self) -> str: ...

    @property
    def bounds(self) -> Array: ...

    @property
    def assumed_unit(self) -> str: ...


def size_note(mesh: _Model, assumed_unit: str | None = None, *, way: Way = "option") -> str:
    """Sentence on the size of a mesh whose file names no unit, with what sets another; empty where it is known.

    Parameters
    ----------
    mesh : Mesh
    assumed_unit : str, optional
        Default: that of the mesh.
    way : {"option", "argument", "field"}
        What sets another size: options, arguments of `load_mesh`, or fields of the window.
    """
    assumed = mesh.assumed_unit if assumed_unit is None else assumed_unit
    if not assumed:
        return ""
    metres = METRES_PER_UNIT[assumed]
    longest = float((mesh.bounds[1] - mesh.bounds[0]).max())
    taken = f"{tall(mesh.bounds)}; taken as {_NAMES[assumed]}"
    if (likely := likely_unit(longest / metres, Path(mesh.name).suffix)) is not None:
        unit, why = likely
        factor = METRES_PER_UNIT[unit] / metres
        stated = _WAYS[way][0].format(unit)
        return f"{taken}; {why}: {stated} makes it {tall(factor * mesh.bounds)}"
    if USUAL[0] <= longest <= USUAL[1]:
        return taken
    name = side_of(mesh.bounds)[0]
    stated = _WAYS[way][1].format(name, FIGURINE, 100 * FIGURINE)
    return f"{taken}; for a figurine {stated}"


def tall(bounds: Array) -> str:
    """Text on the size of a box (2, 3): its height, or where it lies flat, its longest side."""
    name, length = side_of(bounds)
    return f"{short_length(length)} {_ADJECTIVES[name]}"


def other_size(bounds: Array, factor: float) -> str:
    """Text on the size of a box (2, 3) that is so many times the present one, to two digits, with its option."""
    name, length = side_of(bounds)
    text = short_length(float(f"{factor * length:.2g}"))
    return f"{text} {_ADJECTIVES[name]} (--{name} {text.replace(' ', '')})"


def likely_unit(longest: float, suffix: str) -> tuple[str, str] | None:
    """Unit that a file without one is likely in, and the reason; None where nothing says so.

    Parameters
    ----------
    longest : float
        Side of its box, in its coordinates.
    suffix : str
        Of the file.
    """
    usual = [unit for unit in ("mm", "cm") if USUAL[0] <= longest * METRES_PER_UNIT[unit] <= USUAL[1]]
    if suffix.lower() == ".stl" and "mm" in usual:
        return "mm", ".stl files usually use millimetres"
    if longest < HARDLY_METRES or not usual:
        return None
    return usual[0], f"a size of {longest:.0f} metres is unusual, and {_NAMES[usual[0]]} are common"


def scale_to(bounds: Array, height: float | None, longest: float | None, name: str) -> float:
    """Factor that gives a box (2, 3) this height, or longest side, in metres.

    Raises
    ------
    InputError
        If the length is not positive and finite, or the box has no height.
    """
    requested, side = ("height", height) if height is not None else ("longest", longest)
    if side is None or not (math.isfinite(side) and side > 0):
        raise InputError(
            f"{requested} {side!r}",
            "the length must be positive and finite",
            "give a length in metres, for example 0.12",
        )
    extent = bounds[1] - bounds[0]
    present = float(extent[1] if requested == "height" else extent.max())
    if not present > 0:
        raise InputError(
            f"{requested} {side:g} m of {name!r}",
            "the model is flat, so it has no extent in this direction",
            "give the length of the longest side instead",
        )
    return side / present


def side_of(bounds: Array) -> tuple[str, float]:
    """Option that states the size of a box best, and that side of it in metres."""
    extent = (bounds[1] - bounds[0]).tolist()
    return ("height", extent[1]) if extent[1] >= 0.5 * max(extent) else ("longest", max(extent))
