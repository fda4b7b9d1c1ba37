"""Thickness maps and thickness per vertex as files; each appears complete, with its record beside it, or not at all.

==========  =========================================================================================
file        holds
==========  =========================================================================================
.exr        float32: ``Y`` the values, ``standard_error.Y``, ``coverage.Y``; unit, mode, settings in its header
.npy        float32: the values
.npz        ``values``, ``standard_error``, ``coverage``, ``scale``, ``offset``
.png        16-bit gray; scale, offset, unit and mode in its text chunks
.glb        the mesh with its UVs and a volume material, 8 bits in the G channel of the thickness texture
.ply        of thickness per vertex: the mesh with a float property ``thickness``
==========  =========================================================================================

Where the UVs were made for the map, ``thickness.exr.uv.glb`` is the mesh that has them, in metres.

Row 0 is the top of the image. How stored numbers become metres: `translucent.bake.encoding`. The record
(``thickness.exr.json``): `translucent.bake.record`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from translucent.bake.baked import BakedMap, BakedVertices
from translucent.bake.encoding import Encoding
from translucent.bake.gltf.export import mesh_file
from translucent.bake.gltf.maps import write_maps
from translucent.bake.gltf.vertices import write_vertices
from translucent.bake.record import DEFINITIONS, Record, add_record, describe, fingerprint, plain, unit_of, write_record
from translucent.errors import InputError, RenderError
from translucent.extras import require_package
from translucent.files.images import write_exr, write_npy, write_npz, write_png
from translucent.files.paths import OutputFiles, require_output, write_atomically
from translucent.gltf.file import GltfFile
from translucent.gltf.write_file import fill_gltf

MAP_SUFFIXES = (".exr", ".png", ".npy", ".npz", ".glb")
VERTEX_SUFFIXES = (".ply", ".glb", ".npy")

#: Suffix, after the name of a map, of the mesh with the UVs that were made for it.
UV_SUFFIX = ".uv.glb"

#: Largest level of a 16-bit PNG.
PNG_LEVELS = 65535
#: Prefix of its text chunks.
PNG_PREFIX = "translucent:"


@dataclass(frozen=True)
class _Task:
    result: BakedMap
    encoding: Encoding


def save_map(
    result: BakedMap,
    path: str | Path,
    *,
    normalize: bool = False,
    invert: bool = False,
    about: Record | None = None,
) -> Record:
    """Write a thickness map, and beside it its record and, if it has new UVs, the mesh with them.

    Parameters
    ----------
    result : BakedMap
    path : path
        One of the module's table, not ``.ply``.
    normalize : bool
        Store shares of the largest value. A PNG always does; what turns them into metres is in file and record.
    invert : bool
        Store 1 minus that share, the translucency that some engines want.
    about : dict, optional
        More for the record, such as where the mesh is from.

    Returns
    -------
    dict
        The record.

    Raises
    ------
    InputError
        If the suffix is another one, the folder is missing, or the file cannot hold what is asked.
    RenderError
        If a file cannot be written, or ``.exr`` is asked for without the OpenEXR package.
    """
    path = Path(path)
    if check_map_output(path, normalize=normalize, invert=invert) == ".glb":
        return write_maps(mesh_file(result.mesh), path, {(0, 0): result}, about=about)
    about = dict(about or {})
    with OutputFiles() as files:
        if result.report.uv_from == "xatlas":
            about["uv_file"] = add_uv_file(files, mesh_file(result.mesh), path)
        return add_map(files, result, path, normalize=normalize, invert=invert, about=about)


def add_map(
    files: OutputFiles, result: BakedMap, path: Path, *, normalize: bool, invert: bool, about: Record
) -> Record:
    """Write a map as an image, and its record, together with other files, as `save_map`; returns the record."""
    suffix = check_map_output(path, normalize=normalize, invert=invert)
    levels = PNG_LEVELS if suffix == ".png" else 0
    unit = unit_of(result.settings.mode)
    encoding = Encoding.of(result.values, levels, normalize=normalize, invert=invert, unit=unit)
    filled = files.write(path, partial(_WRITERS[suffix], _Task(result, encoding)))
    return add_record(files, path, {**fingerprint(path, filled), **about, **describe(result, encoding)})


def add_uv_file(files: OutputFiles, model: GltfFile, path: Path) -> Record:
    """Write a model with new UVs beside their map at `path`, together with other files; returns its name and hash."""
    uv_path = path.with_name(f"{path.name}{UV_SUFFIX}")
    return fingerprint(uv_path, files.write(uv_path, partial(fill_gltf, file=model, place=uv_path)))


def check_map_output(
    path: Path, suffixes: tuple[str, ...] = MAP_SUFFIXES, *, normalize: bool = False, invert: bool = False
) -> str:
    """Check the output path of a map before any work is done, as `save_map` does; returns the suffix in lower case."""
    asked, suffix = f"output {str(path)!r}", path.suffix.lower()
    others = [other for other in suffixes if other != ".exr"]
    if suffix not in suffixes:
        *more, last = suffixes
        known = f"{', '.join(more)} or {last}" if more else last
        raise InputError(asked, f"suffix {path.suffix!r}", f"use {known}")
    require_output(path, asked)
    if not os.access(path.parent, os.W_OK):
        raise RenderError(asked, f"the folder {str(path.parent)!r} is read-only", "choose another folder")
    if suffix == ".glb" and (normalize or invert):
        raise InputError(asked, "glTF stores t / max and the max", "leave --normalize and --invert out")
    if suffix == ".exr":
        require_package("OpenEXR", asked, f"write {' or '.join(others)}" if others else "")
    return suffix


def _write_exr(task: _Task, path: Path) -> None:
    result, encoding = task.result, task.encoding
    channels = {
        "Y": encoding.encode(result.values),
        "standard_error.Y": result.standard_error,
        "coverage.Y": result.coverage,
    }
    told = f"{DEFINITIONS[result.settings.mode]}; value = offset + scale * Y in {encoding.unit}"
    write_exr(path, channels, {"comments": told, **_stated(task)})


def _stated(task: _Task) -> dict[str, Any]:
    """Metadata of a file."""
    settings = task.result.settings
    return {
        "unit": task.encoding.unit,
        "mode": settings.mode,
        # OpenEXR keeps a Python float as a float32; text has all digits.
        "scale": repr(task.encoding.scale),
        "offset": repr(task.encoding.offset),
        "seed": int(settings.seed),
        "settings": json.dumps(plain(settings.summary()), ensure_ascii=False),
    }


def _write_npy(task: _Task, path: Path) -> None:
    write_npy(path, task.encoding.encode(task.result.values))


def _write_npz(task: _Task, path: Path) -> None:
    result, encoding = task.result, task.encoding
    arrays = {
        "values": encoding.encode(result.values),
        "scale": np.array(encoding.scale),
        "offset": np.array(encoding.offset),
        "standard_error": result.standard_error,
        "coverage": result.coverage,
    }
    write_npz(path, arrays)


def _write_png(task: _Task, path: Path) -> None:
    stated = {PNG_PREFIX + key: str(value) for key, value in _stated(task).items()}
    text = {"Description": DEFINITIONS[task.result.settings.mode], **stated}
    write_png(path, task.encoding.encode(task.result.values), text)


_WRITERS: dict[str, Callable[[_Task, Path], None]] = {
    ".exr": _write_exr,
    ".npy": _write_npy,
    ".npz": _write_npz,
    ".png": _write_png,
}


def save_vertices(result: BakedVertices, path: str | Path, *, about: Record | None = None) -> Record:
    """Write thickness per vertex, and its record beside it.

    Parameters
    ----------
    result : BakedVertices
    path : path
        ``.ply``: the mesh with a property ``thickness``; ``.glb``: with an attribute ``_THICKNESS``; both float32.
        ``.npy``: (n,) float32.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError, RenderError
        As `save_map`.
    """
    path = Path(path)
    suffix = check_map_output(path, VERTEX_SUFFIXES)
    if suffix == ".glb":
        return write_vertices(mesh_file(result.mesh), path, {(0, 0): result}, about=about)
    values = np.ascontiguousarray(result.values, dtype=np.float32)

    def fill(temporary: Path) -> None:
        if suffix == ".npy":
            write_npy(temporary, values)
        else:
            temporary.write_bytes(_ply(result, values))

    write_atomically(path, fill)
    encoding = Encoding(unit=unit_of(result.settings.mode))
    return write_record(path, {**(about or {}), **describe(result, encoding)})


def _ply(result: BakedVertices, values: Any) -> bytes:
    import trimesh

    mesh = trimesh.Trimesh(result.mesh.vertices, result.mesh.faces, process=False)
    mesh.vertex_attributes["thickness"] = values
    with np.errstate(all="ignore"):
        return bytes(mesh.export(file_type="ply", include_attributes=True))
