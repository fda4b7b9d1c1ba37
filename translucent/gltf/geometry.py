"""Triangles of glTF primitives as meshes.

Read here and not by trimesh, whose reader (5.2) loses what a scene needs: which material a primitive has, where two
share a name; sparse accessors, whose values become zeros; normalized positions; triangle fans; and what hangs below a
camera. Source: glTF 2.0, section 3.7.2 (meshes).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.files.reading import require_memory
from translucent.geometry.grouping import use_mask
from translucent.geometry.mesh import PER_TRIANGLE, Mesh, adopted, mended
from translucent.gltf.accessors import Accessors
from translucent.gltf.fields import refused
from translucent.gltf.file import Json

Indices = npt.NDArray[np.integer]

_POINTS_AND_LINES = (0, 1, 2, 3)
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def primitive_mesh(accessors: Accessors, primitive: Json, name: str) -> Mesh | None:
    """The mesh of a primitive in the file's unit, welded and wound as by `load_mesh`; None for points and lines.

    Raises `InputError` like `raw_mesh`, and if a coordinate is not finite.
    """
    raw = raw_mesh(accessors, primitive, name)
    if raw is None:
        return None
    raw.require_finite()
    return mended(raw)


def raw_mesh(accessors: Accessors, primitive: Json, name: str) -> Mesh | None:
    """The mesh of a primitive in the file's unit, as the file has it; None for points and lines.

    Raises
    ------
    InputError
        If its data are missing or of a wrong kind, or an index points at no vertex.
    """
    mode = primitive.get("mode", _TRIANGLES)
    if mode in _POINTS_AND_LINES:
        return None
    attributes = primitive["attributes"]
    positions = accessors.vectors(attributes.get("POSITION"), "VEC3")
    corners = accessors.indices(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    if corners.max(initial=0) >= len(positions):
        found = f"{name!r}: index {corners.max()} points outside the {len(positions)} vertices"
        raise refused(accessors.file, found)
    count = len(corners) // 3 if mode == _TRIANGLES else len(corners)
    asked, do = f"glTF {str(accessors.file.path)!r}", "close other programs, or decimate the mesh"
    require_memory(asked, f"the {count} triangles of {name!r}", PER_TRIANGLE * count, do)
    faces = _faces(accessors, mode, corners, name)
    stored = len(positions)
    positions, faces, kept = _compact(positions, faces)
    uv = None
    if "TEXCOORD_0" in attributes:
        uv = accessors.vectors(attributes["TEXCOORD_0"], "VEC2")
        if len(uv) != stored:
            raise refused(accessors.file, f"{name!r}: {len(uv)} texture coordinates for {stored} vertices")
        uv = np.column_stack([uv[kept, 0], 1.0 - uv[kept, 1]])  # glTF counts v downwards
    colors = None if "COLOR_0" not in attributes else _colors(accessors, attributes["COLOR_0"], stored, name)
    colors = None if colors is None or (colors[kept] == 1).all() else colors[kept]
    accessors.keep(repr(name), (24 if colors is None else 56) * len(positions) + 8 * faces.size)
    return adopted(positions, faces, uv, name, colors=colors)


def _compact(positions: Array, faces: Indices) -> tuple[Array, npt.NDArray[np.int32], Integers | slice]:
    """The vertices that faces use, the faces among these, and the numbers that they had.

    Primitives may share their vertices with others.
    """
    used = use_mask(faces, len(positions))
    if used.all():
        return positions, faces.astype(np.int32), slice(None)
    kept = np.flatnonzero(used)
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return positions[kept], number[faces], kept


def _colors(accessors: Accessors, index: Any, count: int, name: str) -> npt.NDArray[np.float64]:
    """(n, 4): colors of the vertices, which are linear, and their opacity: 1 where none is stated."""
    kind = "VEC3" if accessors.file.item("accessors", index).get("type") == "VEC3" else "VEC4"
    colors = accessors.vectors(index, kind).clip(0.0, 1.0)
    if len(colors) != count:
        raise refused(accessors.file, f"{name!r}: {len(colors)} colors for {count} vertices")
    return np.column_stack([colors, np.ones(count)]) if kind == "VEC3" else colors


def _faces(accessors: Accessors, mode: Any, corners: Indices, name: str) -> Indices:
    """(m, 3): the faces of a list, strip or fan of triangles."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise refused(accessors.file, f"{name!r}: {len(corners)} corners make no whole number of triangles")
        return corners.reshape(-1, 3)
    if mode not in (_STRIP, _FAN):
        raise refused(accessors.file, f"{name!r}: primitive mode {mode!r} is none of glTF 2.0")
    if len(corners) < 3:
        raise refused(accessors.file, f"{name!r}: {len(corners)} corners make no triangle")
    first, second, third = corners[:-2], corners[1:-1], corners[2:]
    if mode == _FAN:
        return np.column_stack([second, third, np.full_like(first, corners[0])])
    odd = np.arange(len(first)) % 2 == 1  # every other triangle of a strip is wound the other way
    faces = np.column_stack([first, np.where(odd, third, second), np.where(odd, second, third)])
    # Strips are joined by triangles without area.
    return np.asarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
