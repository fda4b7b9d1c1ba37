"""Conversion of media to and from other systems: one file per target, each with its formula, its source and what it
loses.

`TARGETS` names the systems that `text_block` writes for; `load_medium` reads files of those that have files. Numbers of
the others: `translucent.materials.blender`, `unity` and `unreal`. Reading and writing whole glTF files:
`translucent.gltf.materials` and `translucent.gltf.write`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.reading import read_text
from translucent.materials.blender import blender_snippet
from translucent.materials.css import css_text
from translucent.materials.json_text import read_json, write_json
from translucent.materials.openpbr import read_openpbr, write_openpbr
from translucent.materials.standard_surface import read_standard_surface, write_standard_surface
from translucent.materials.unity import unity_text
from translucent.materials.unreal import unreal_text
from translucent.materials.usd import read_usda, usda_text
from translucent.media.medium import Medium

__all__ = ["TARGETS", "load_medium", "text_block"]

#: Largest difference between a given color and that of the medium, from a channel that was raised from black.
_SAME_COLOR = 1e-3


def _gltf_text(medium: Medium, distance: float) -> str:
    from translucent.gltf.write import volume_extensions

    extensions = volume_extensions(medium, distance, thickness=distance, ior=medium.ior)
    return json.dumps({"extensions": extensions}, indent=2) + "\n"


_WRITERS: dict[str, Callable[[Medium, float], str]] = {
    "gltf": _gltf_text,
    "openpbr": write_openpbr,
    "standard_surface": write_standard_surface,
    "blender": lambda medium, _: blender_snippet(medium),
    "unreal": unreal_text,
    "unity": unity_text,
    "usd": usda_text,
    "css": lambda medium, distance: css_text(medium, medium.transmittance(distance), distance),
    "json": lambda medium, _: write_json(medium),
}

#: Names of the systems that a medium can be written for.
TARGETS: tuple[str, ...] = tuple(_WRITERS)


def text_block(target: str, medium: Medium, color: npt.ArrayLike, distance: float) -> str:
    """Copy-ready block of text that describes the medium for another system.

    Parameters
    ----------
    target : str
        One of `TARGETS`; case, ``-`` and spaces do not matter.
    medium : Medium
    color : array_like (3,)
        Linear color that white light has after `distance` of the medium: a check that the three belong together.
    distance : float
        In metres, > 0 and finite: where the block states the color, and glTF's thickness. Shorter where the color there
        would be too dark to be stored; the medium is the same.

    Returns
    -------
    str
        Lines, the last without a line break.

    Raises
    ------
    InputError
        If the target is unknown, the distance is not positive and finite, or the color is not that of the medium.
    """
    writer = _WRITERS.get(target.lower().replace("-", "_").replace(" ", "_"))
    if writer is None:
        raise InputError(f"target {target!r}", "not a known target", f"use one of {', '.join(TARGETS)}")
    if not 0 < distance < np.inf:
        raise InputError(f"distance {distance!r}", "not above 0 and finite", "give it in metres, for example 0.02")
    given, own = np.asarray(color, dtype=np.float64), medium.transmittance(distance)
    if given.shape != (3,) or not (np.abs(given - own) <= _SAME_COLOR).all():
        raise InputError(
            f"color {given.tolist()} after {distance:g} m",
            f"the medium has {tuple(own.round(4).tolist())} there",
            "give medium.transmittance(distance)",
        )
    return writer(medium, distance).rstrip("\n")


def _read_materialx(text: str, unit: str) -> Medium:
    return read_openpbr(text, unit) if "<open_pbr_surface" in text else read_standard_surface(text, unit)


_READERS: dict[str, Callable[[str, str], Medium]] = {
    ".mtlx": _read_materialx,
    ".usda": lambda text, _: read_usda(text),
    ".json": lambda text, _: read_json(text),
}


def load_medium(path: str | Path, unit: str = "m") -> Medium:
    """Load the medium of a material file of another system.

    Parameters
    ----------
    path : str or Path
        ``.mtlx`` (OpenPBR or Standard Surface), ``.usda`` (the same as UsdShade), or ``.json`` as `write_json` has it.
        glTF files hold several materials: see `translucent.read_materials`.
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
