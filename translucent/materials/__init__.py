"""Conversion of media to and from other systems, each with its formula, its source and its losses.

`TARGETS` names the systems that `text_block` writes for; `load_medium` reads their files. Numbers of
the others: `translucent.materials.blender` and `translucent.materials.engines`. Each text that is written can be saved
and read back, but for CSS; what each target cannot carry is lost. Reading and writing whole glTF files:
`translucent.gltf.materials` and `translucent.gltf.write`.

A new target is a `ExportTarget` beside its formulas, and a line in `TARGETS`.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import ParseError

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.files.reading import read_text
from translucent.materials.blender import BLENDER
from translucent.materials.engines import CSS, GLTF, GODOT, JSON, THREEJS, UNITY, UNREAL
from translucent.materials.materialx import OPENPBR_TARGET, STANDARD_SURFACE_TARGET
from translucent.materials.target import ExportTarget
from translucent.materials.usd import USD
from translucent.media.medium import Medium
from translucent.units import metres_per_unit

__all__ = ["TARGETS", "load_medium", "load_roughness", "text_block"]

#: Systems that a medium can be written for, by name.
TARGETS: dict[str, ExportTarget] = {
    "gltf": GLTF,
    "openpbr": OPENPBR_TARGET,
    "standard_surface": STANDARD_SURFACE_TARGET,
    "blender": BLENDER,
    "threejs": THREEJS,
    "godot": GODOT,
    "unreal": UNREAL,
    "unity": UNITY,
    "usd": USD,
    "css": CSS,
    "json": JSON,
}

#: Largest difference between a given color and that of the medium, from a channel that was raised from black.
_SAME_COLOR = 1e-3


@checked
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
    writer = TARGETS.get(target.lower().replace("-", "_").replace(" ", "_").replace(".", ""))
    if writer is None:
        raise InputError(f"target {target!r}", "no target has this name", f"use one of {', '.join(TARGETS)}")
    if not 0 < distance < np.inf:
        raise InputError(
            f"distance {distance!r}",
            "the distance must be finite and above 0",
            "give the distance in metres, for example 0.02",
        )
    if not 0 <= roughness <= 1:
        raise InputError(f"roughness {roughness!r}", "the roughness must lie in 0 to 1", "use 0 for a polished surface")
    given, own = np.asarray(color, dtype=np.float64), medium.transmittance(distance)
    if given.shape != (3,) or not (np.abs(given - own) <= _SAME_COLOR).all():
        raise InputError(
            f"color {given.tolist()} after {distance:g} m",
            f"the medium has the color {tuple(own.round(4).tolist())} after this distance",
            "use the color medium.transmittance(distance)",
        )
    return writer.write(medium, float(distance), float(roughness)).rstrip("\n")


@checked
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
    metres_per_unit(unit)
    what, reader = f"material {str(path)!r}", _target_of(path)
    if reader is None or reader.read is None:
        suffixes = dict.fromkeys(target.suffix for target in TARGETS.values() if target.suffix)
        do = f"give a {', '.join(suffixes)} file; for glTF, see translucent material show"
        raise InputError(what, f"suffix {Path(path).suffix!r}", do)
    text = read_text(path, what)
    try:
        return reader.read(text, unit)
    except InputError as error:
        raise InputError(what, str(error)) from None


def load_roughness(path: str | Path) -> float:
    """Roughness, 0 (polished) to 1, that a file states for the surface, after `load_medium` has read its medium.

    Raises
    ------
    InputError
        If it is not a number in 0 to 1.
    """
    what, reader, found = f"material {str(path)!r}", _target_of(path), math.nan
    text = read_text(path, what)
    try:
        if reader is not None and reader.roughness is not None:
            found = reader.roughness(text)
    except (ValueError, TypeError, AttributeError, ParseError):
        found = math.nan
    if not 0 <= found <= 1:
        raise InputError(what, "the roughness of the material is not a number in 0 to 1", "correct the roughness")
    return found


def _target_of(path: str | Path) -> ExportTarget | None:
    suffix = Path(path).suffix.lower()
    return next((target for target in TARGETS.values() if suffix and target.suffix == suffix), None)
