"""Conversion of media to and from other systems: one file per target, each with its formula, its source and what it
loses.

`TARGETS` names the systems that `text_block` writes for; `load_medium` reads files of those that have files. Numbers of
the others: `translucent.materials.blender`, `unity` and `unreal`. Each text that is written can be saved and read back,
but for CSS; what each target cannot carry is lost. Reading and writing whole glTF files:
`translucent.gltf.materials` and `translucent.gltf.write`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.reading import json_value, read_text
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import materials_of
from translucent.materials.blender import blender_snippet, read_blender
from translucent.materials.css import css_text
from translucent.materials.godot import godot_text, read_godot
from translucent.materials.json_text import read_json, write_json
from translucent.materials.openpbr import read_openpbr, write_openpbr
from translucent.materials.standard_surface import read_standard_surface, write_standard_surface
from translucent.materials.threejs import read_threejs, threejs_text
from translucent.materials.unity import read_unity, unity_text
from translucent.materials.unreal import read_unreal, unreal_text
from translucent.materials.usd import read_usda, usda_text
from translucent.media.medium import Medium

__all__ = ["TARGETS", "TITLES", "load_medium", "text_block"]

#: Largest difference between a given color and that of the medium, from a channel that was raised from black.
_SAME_COLOR = 1e-3


def _gltf_text(medium: Medium, distance: float, roughness: float) -> str:
    from translucent.gltf.write import volume_extensions

    extensions = volume_extensions(medium, distance, thickness=distance, ior=medium.ior)
    # Without these, a material is a rough metal.
    surface = {"metallicFactor": 0.0, "roughnessFactor": roughness}
    return json.dumps({"pbrMetallicRoughness": surface, "extensions": extensions}, indent=2) + "\n"


_WRITERS: dict[str, Callable[[Medium, float, float], str]] = {
    "gltf": _gltf_text,
    "openpbr": lambda medium, distance, roughness: write_openpbr(medium, distance, roughness=roughness),
    "standard_surface": lambda medium, distance, rough: write_standard_surface(medium, distance, roughness=rough),
    "blender": lambda medium, _, roughness: blender_snippet(medium, roughness),
    "threejs": threejs_text,
    "godot": godot_text,
    "unreal": unreal_text,
    "unity": unity_text,
    "usd": lambda medium, distance, roughness: usda_text(medium, distance, roughness=roughness),
    "css": lambda medium, distance, _: css_text(medium, medium.transmittance(distance), distance),
    "json": lambda medium, *_: write_json(medium),
}

#: Names of the systems that a medium can be written for.
TARGETS: tuple[str, ...] = tuple(_WRITERS)

#: What they are called.
TITLES = {
    "gltf": "glTF",
    "openpbr": "OpenPBR",
    "standard_surface": "Standard Surface",
    "blender": "Blender",
    "threejs": "three.js",
    "godot": "Godot",
    "unreal": "Unreal",
    "unity": "Unity",
    "usd": "USD",
    "css": "CSS",
    "json": "JSON",
}


def text_block(target: str, medium: Medium, color: npt.ArrayLike, distance: float, roughness: float = 0.0) -> str:
    """Copy-ready block of text that describes the medium for another system.

    Parameters
    ----------
    target : str
        One of `TARGETS`; case, ``-``, ``.`` and spaces do not matter.
    medium : Medium
    color : array_like (3,)
        Linear color that white light has after `distance` of the medium: a check that the three belong together.
    distance : float
        In metres, > 0 and finite: where the block states the color, and glTF's thickness. Shorter where the color there
        would be too dark to be stored; the medium is the same.
    roughness : float
        Of the surface, 0 (polished) to 1: the square root of the GGX alpha, as in `Surface`.

    Returns
    -------
    str
        Lines, the last without a line break.

    Raises
    ------
    InputError
        If the target is unknown, the distance is not positive and finite, the color is not that of the medium, or the
        roughness is outside its range.
    """
    writer = _WRITERS.get(target.lower().replace("-", "_").replace(" ", "_").replace(".", ""))
    if writer is None:
        raise InputError(f"target {target!r}", "not a known target", f"use one of {', '.join(TARGETS)}")
    if not 0 < distance < np.inf:
        raise InputError(f"distance {distance!r}", "not above 0 and finite", "give it in metres, for example 0.02")
    if not 0 <= roughness <= 1:
        raise InputError(f"roughness {roughness!r}", "not in 0 to 1", "give 0 for a polished surface")
    given, own = np.asarray(color, dtype=np.float64), medium.transmittance(distance)
    if given.shape != (3,) or not (np.abs(given - own) <= _SAME_COLOR).all():
        raise InputError(
            f"color {given.tolist()} after {distance:g} m",
            f"the medium has {tuple(own.round(4).tolist())} there",
            "give medium.transmittance(distance)",
        )
    return writer(medium, float(distance), float(roughness)).rstrip("\n")


def _read_materialx(text: str, unit: str) -> Medium:
    return read_openpbr(text, unit) if "<open_pbr_surface" in text else read_standard_surface(text, unit)


def _read_json(text: str) -> Medium:
    """Read our own JSON, or a glTF material as `text_block` writes it."""
    try:
        entry = json_value(text)
    except ValueError:
        return read_json(text)  # which says what is wrong
    if not (isinstance(entry, dict) and "extensions" in entry):
        return read_json(text)
    (found,) = materials_of(GltfFile(Path("material.gltf"), {"asset": {"version": "2.0"}, "materials": [entry]}))
    if (medium := found.medium()) is None:
        raise InputError("glTF material", "it has no volume", "give one with KHR_materials_volume")
    return medium


_READERS: dict[str, Callable[[str, str], Medium]] = {
    ".mtlx": _read_materialx,
    ".usda": lambda text, _: read_usda(text),
    ".json": lambda text, _: _read_json(text),
    ".py": lambda text, _: read_blender(text),
    ".js": lambda text, _: read_threejs(text),
    ".gdshader": lambda text, _: read_godot(text),
    ".cs": lambda text, _: read_unity(text),
    ".txt": lambda text, _: read_unreal(text),
}


def load_medium(path: str | Path, unit: str = "m") -> Medium:
    """Load the medium of a material file of another system.

    Parameters
    ----------
    path : str or Path
        ``.mtlx`` (OpenPBR or Standard Surface), ``.usda`` (the same as UsdShade), ``.json`` as `write_json` has it or
        of a glTF material, or what `text_block` wrote for Blender (``.py``, which is not run), three.js (``.js``),
        Godot (``.gdshader``), Unity (``.cs``) or Unreal (``.txt``). glTF files hold several materials: see
        `translucent.read_materials`.
    unit : str
        Of the lengths in a .mtlx file, which states none.

    Raises
    ------
    InputError
        If there is no such file, or it holds no such material.
    """
    what, reader = f"material {str(path)!r}", _READERS.get(Path(path).suffix.lower())
    if reader is None:
        do = f"give a {', '.join(_READERS)} file; of glTF, translucent material show tells the colors"
        raise InputError(what, f"suffix {Path(path).suffix!r}", do)
    text = read_text(path, what)
    try:
        return reader(text, unit)
    except InputError as error:
        raise InputError(what, str(error)) from None
