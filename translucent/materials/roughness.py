"""Roughness of the surface in a material file of another system: all that is read of it beside its medium.

Where a file states none, it is the shader's own default; where a texture or a node states it, 0.
Source of the defaults: OpenPBR Surface 1.1, Standard Surface 1.0.1 (specular_roughness), glTF 2.0 (roughnessFactor).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from translucent.errors import InputError
from translucent.files.reading import json_value, read_text
from translucent.materials.snippet import stated

_OPENPBR, _STANDARD_SURFACE = 0.3, 0.2


def _behind(start: str) -> Callable[[str], float]:
    return lambda text: float(stated("surface", text, start, default=0.0)[0])


def _materialx(text: str) -> float:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("entities may unpack into anything")
    root = ElementTree.fromstring(text)
    surface, default = root.find(".//open_pbr_surface"), _OPENPBR
    if surface is None:
        surface, default = root.find(".//standard_surface"), _STANDARD_SURFACE
    found = None if surface is None else surface.find("./input[@name='specular_roughness']")
    return default if found is None else float(found.get("value", "0"))


def _usda(text: str) -> float:
    found = re.search(r"inputs:specular_roughness(\.connect)?\s*=\s*([-+.\deE]*)", text)
    if found is None:
        return _OPENPBR if "ND_open_pbr_surface" in text else _STANDARD_SURFACE
    return float(found[2] or 0.0)


def _json(text: str) -> float:
    entry = json_value(text)
    if not (isinstance(entry, dict) and "extensions" in entry):
        return 0.0  # our own JSON, of a medium alone
    surface = entry.get("pbrMetallicRoughness", {})
    return 0.0 if "metallicRoughnessTexture" in surface else float(surface.get("roughnessFactor", 1.0))


_READERS: dict[str, Callable[[str], float]] = {
    ".mtlx": _materialx,
    ".usda": _usda,
    ".json": _json,
    ".py": _behind('surface.inputs["Roughness"].default_value'),
    ".js": _behind("  roughness:"),
    ".gdshader": _behind("uniform float roughness : hint_range(0.0, 1.0) ="),
    ".cs": lambda text: 1.0 - float(stated("surface", text, '"_Smoothness"', default=1.0)[0]),
    ".txt": _behind("  Roughness"),
}


def load_roughness(path: str | Path) -> float:
    """Roughness, 0 (polished) to 1, of a file of which `load_medium` has read the medium.

    Raises
    ------
    InputError
        If it is not a number in 0 to 1.
    """
    what = f"material {str(path)!r}"
    text = read_text(path, what)
    try:
        found = _READERS[Path(path).suffix.lower()](text)
    except (ValueError, TypeError, AttributeError, ElementTree.ParseError):
        found = math.nan
    if not 0 <= found <= 1:
        raise InputError(what, "its roughness is not a number in 0 to 1", "correct it")
    return found
