"""Complete media as JSON, including what no other format holds. Written and read without loss.

Fields are those of `Medium`, in 1/m and linear Rec.709. Source: the toolkit's own vocabulary.
"""

from __future__ import annotations

import json

import numpy as np

from translucent.errors import InputError
from translucent.files.reading import json_value
from translucent.formulas.phase import parse_phase
from translucent.media.medium import Medium

_TRIPLES = ("absorption", "scattering", "emission")
_NUMBERS = ("anisotropy", "ior")
_PHASE = "phase"


def write_json(medium: Medium) -> str:
    """The medium as one JSON object."""
    triples = {field: np.asarray(getattr(medium, field)).tolist() for field in _TRIPLES}
    numbers = {field: float(getattr(medium, field)) for field in _NUMBERS}
    phase = {_PHASE: str(medium.phase)} if medium.phase else {}
    return json.dumps({**triples, **numbers, **phase}, indent=2) + "\n"


def read_json(text: str) -> Medium:
    """Read the medium of such an object; absent fields have their defaults.

    Raises
    ------
    InputError
        If the text is no JSON object, or has unknown fields or values that a medium cannot have.
    """
    try:
        values = json_value(text)
    except ValueError as error:
        raise InputError("medium as JSON", f"it is broken ({error})", "write it again") from error
    if not isinstance(values, dict):
        raise InputError("medium as JSON", "not an object", "write it again")
    known = (*_TRIPLES, *_NUMBERS, _PHASE)
    if unknown := sorted(set(values) - set(known)):
        raise InputError("medium as JSON", f"unknown {', '.join(unknown)}", f"use {', '.join(known)}")
    for field in _NUMBERS:
        if isinstance(number := values.get(field, 0), bool) or not isinstance(number, int | float):
            raise InputError("medium as JSON", f"{field} is {number!r}, not a number", "write it again")
    if _PHASE in values:
        values[_PHASE] = parse_phase(str(values[_PHASE]))
    return Medium(**values)
