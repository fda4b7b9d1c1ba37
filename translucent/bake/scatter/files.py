"""Files of baked scattered light: .exr images and .glb attributes; each appears complete, with its record, or not.

======  =============================================================================================
file    holds
======  =============================================================================================
.exr    float32 ``SH0.R``, ``SH0.G`` to ``SH8.B``, ``coverage.Y``; what they mean in its header
.glb    attributes ``_SCATTER_SH0`` to ``_SCATTER_SH8`` of the vertices, FLOAT VEC3; what they mean in the ``extras``
        of their primitive, as ``translucent_scatter``
======  =============================================================================================
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arrays import Array, Floats, Mask
from translucent.bake.gltf.bodies import PrimitiveKey
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.record import Record, plain
from translucent.errors import InputError
from translucent.files.images import write_exr
from translucent.files.paths import require_file
from translucent.files.unpacking import read_exr
from translucent.formulas.spherical_harmonics import COUNT
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile
from translucent.gltf.write_file import write_gltf

#: Suffix of images, and of values at vertices.
MAP_SUFFIX, VERTEX_SUFFIX = ".exr", ".glb"

#: Names of the attributes of vertices, and key of what they mean in the extras of a primitive.
ATTRIBUTES, EXTRAS = tuple(f"_SCATTER_SH{i}" for i in range(COUNT)), "translucent_scatter"

_CHANNELS = {f"SH{i}.{color}": (i, k) for i in range(COUNT) for k, color in enumerate("RGB")}


def fill_scatter_exr(path: Path, values: Floats, coverage: Mask, meaning: Record) -> None:
    """Write a map (h, w, 9, 3) as an OpenEXR file with what it means; raises `OSError` if it cannot be written."""
    channels = {name: values[:, :, i, k] for name, (i, k) in _CHANNELS.items()} | {"coverage.Y": coverage}
    header = {"comments": str(meaning["definition"]), "scatter": json.dumps(plain(meaning), ensure_ascii=False)}
    write_exr(path, channels, header)


def read_scatter_exr(path: Path) -> tuple[Floats, Mask, Record]:
    """Map (h, w, 9, 3), its coverage (h, w), and what it means, of a file that `fill_scatter_exr` wrote.

    Raises
    ------
    InputError
        If it is another file.
    RenderError
        If the OpenEXR package is missing.
    """
    asked = f"scatter map {str(path)!r}"
    require_file(path, asked)
    header, channels = read_exr(path, asked)
    if missing := [name for name in (*_CHANNELS, "coverage.Y") if name not in channels]:
        raise InputError(asked, f"it has no channel {missing[0]}", "give a file of translucent bake --mode scatter")
    values = np.stack([channels[name] for name in _CHANNELS], axis=-1).astype(np.float32)
    meaning: Record = json.loads(header.get("scatter", "{}"))
    return values.reshape(*values.shape[:2], COUNT, 3), channels["coverage.Y"] > 0, meaning


def write_scatter_glb(
    path: Path,
    builder: GlbBuilder,
    values: Mapping[PrimitiveKey, Floats],
    meanings: Mapping[PrimitiveKey, Record],
) -> None:
    """Write a .glb whose vertices have these values (n, 9, 3), in the order of the file, and what they mean.

    Raises
    ------
    InputError
        If the file's data are wrong.
    RenderError
        If the file cannot be written.
    """
    for key, found in values.items():
        primitive = builder.primitive(*key)
        for i, name in enumerate(ATTRIBUTES):
            primitive["attributes"][name] = builder.add_accessor(np.ascontiguousarray(found[:, i], np.float32))
        extras = primitive.get("extras")
        known: dict[str, Any] = extras if isinstance(extras, dict) else {}
        primitive["extras"] = {**known, EXTRAS: plain(meanings[key])}
    write_gltf(builder.file(), path)


def positions_of(file: GltfFile, key: PrimitiveKey) -> Array:
    """(n, 3): positions of the vertices of a primitive, in units of the file."""
    return Accessors(file).vectors(_attributes(file, key).get("POSITION"), "VEC3")


def read_scatter_glb(file: GltfFile, key: PrimitiveKey) -> Floats:
    """Values (n, 9, 3) at the vertices of a primitive; raises `InputError` if it has none."""
    accessors, attributes = Accessors(file), _attributes(file, key)
    columns = [accessors.vectors(attributes.get(name), "VEC3") for name in ATTRIBUTES]
    return np.stack(columns, axis=1).astype(np.float32)


def _attributes(file: GltfFile, key: PrimitiveKey) -> dict[str, Any]:
    found: dict[str, Any] = file.item("meshes", key[0])["primitives"][key[1]]["attributes"]
    return found
