"""Named media with their sources, from ``presets.toml``."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

import numpy as np

from translucent.errors import InputError
from translucent.medium import Medium
from translucent.units import metres_per_unit, parse_length


@dataclass(frozen=True)
class Preset:
    """A named medium.

    Attributes
    ----------
    name : str
    medium : Medium
    kind : {"measured", "estimated"}
    source : str
        The paper, or how it was estimated.
    """

    name: str
    medium: Medium
    kind: Literal["measured", "estimated"]
    source: str


@cache
def presets() -> dict[str, Preset]:
    """All presets by name."""
    text = files("translucent").joinpath("presets.toml").read_text(encoding="utf-8")
    return {name: _preset(name, entry) for name, entry in tomllib.loads(text).items()}


def preset(name: str) -> Preset:
    """The preset of this name; raises `InputError` if there is none."""
    try:
        return presets()[name.lower().replace("-", "_").replace(" ", "_")]
    except KeyError:
        raise InputError(f"preset {name!r}", "not a known preset", f"use one of {', '.join(presets())}") from None


def _preset(name: str, entry: dict[str, object]) -> Preset:
    ior = float(str(entry["ior"]))
    if "color" in entry:
        medium = Medium.from_color(np.array(entry["color"]), parse_length(str(entry["distance"])), ior=ior)
    else:
        per_metre = 1.0 / metres_per_unit(str(entry["unit"]))
        absorption, scattering = (np.array(entry[key]) * per_metre for key in ("absorption", "scattering"))
        medium = Medium(absorption=absorption, scattering=scattering, ior=ior)
    kind: Literal["measured", "estimated"] = "measured" if entry["kind"] == "measured" else "estimated"
    return Preset(name, medium, kind, str(entry["source"]))
