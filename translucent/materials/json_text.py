"""Media as JSON: complete ones, including what no other format holds, and glTF materials.

Complete media are written and read without loss. Their fields are those of `Medium`, in 1/m and linear Rec.709. Source:
the toolkit's own vocabulary. A glTF material is one entry of a file's ``materials``; reading and writing whole files:
`translucent.gltf.materials` and `translucent.gltf.write`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from translucent.errors import InputError
from translucent.files.reading import json_value
from translucent.formulas.phase import parse_phase
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import materials_of
from translucent.gltf.write import volume_extensions
from translucent.materials.target import ExportTarget
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


def _gltf_text(medium: Medium, distance: float, roughness: float) -> str:
    extensions = volume_extensions(medium, distance, thickness=distance, ior=medium.ior)
    # Without these, a material is a rough metal.
    surface = {"metallicFactor": 0.0, "roughnessFactor": roughness}
    return json.dumps({"pbrMetallicRoughness": surface, "extensions": extensions}, indent=2) + "\n"


def _read(text: str, _: str) -> Medium:
    if (entry := _gltf_entry(text)) is None:
        return read_json(text)
    (found,) = materials_of(GltfFile(Path("material.gltf"), {"asset": {"version": "2.0"}, "materials": [entry]}))
    if (medium := found.medium()) is None:
        raise InputError("glTF material", "it has no volume", "give one with KHR_materials_volume")
    return medium


def _roughness(text: str) -> float:
    surface = (_gltf_entry(text) or {"pbrMetallicRoughness": {"roughnessFactor": 0.0}}).get("pbrMetallicRoughness", {})
    return 0.0 if "metallicRoughnessTexture" in surface else float(surface.get("roughnessFactor", 1.0))


def _gltf_entry(text: str) -> Any:
    """A glTF material; None where the text is another, or broken."""
    try:
        entry = json_value(text)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) and "extensions" in entry else None


GLTF = ExportTarget("glTF", _gltf_text, ".json", _read, _roughness)
JSON = ExportTarget("JSON", lambda medium, *_: write_json(medium), ".json", _read, _roughness)
