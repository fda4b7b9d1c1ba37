"""Accessors of a glTF file, and the triangles of its primitives as meshes.

Accessors are arrays in buffers, strided, sparse and normalized. Meshes are read here and not by trimesh, whose reader
(5.2) loses what a scene needs: which material a primitive has, where two share a name; sparse accessors, whose values
become zeros; normalized positions; triangle fans; and what hangs below a camera.

Source: glTF 2.0, sections 3.6 (binary data storage) and 3.7.2 (meshes), and KHR_mesh_quantization, which lets positions
be integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.files.reading import require_memory, require_room
from translucent.geometry.grouping import use_mask
from translucent.geometry.mesh import MAX_INDEX, PER_TRIANGLE, Mesh, adopted, mended
from translucent.gltf.file import GltfFile, Json, JsonFields

Indices = npt.NDArray[np.int64]

#: Types of NumPy by componentType.
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


#: Bytes of memory per vertex until its mesh is welded and diagnosed: counted where no buffer holds it.
_MADE_UP = 512


AnyIndices = npt.NDArray[np.integer]

_POINTS_AND_LINES = (0, 1, 2, 3)

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


class Accessors:
    """Arrays of a file, by the index of their accessor; the memory that they take is limited by `require_room`."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self._kept = 0

    def vectors(self, index: object, kind: str) -> Array:
        """(n, width) float64: an accessor of vectors of this kind, such as ``"VEC3"``.

        Normalized integers become -1..1 or 0..1; others, their value.

        Raises
        ------
        InputError
            If there is no such accessor, it is of another kind, has no data, or leaves its buffer.
        """
        values, entry = self._elements(index, kind)
        with np.errstate(invalid="ignore"):  # a signaling NaN: the mesh that it is part of is refused by name
            found = values.astype(np.float64)
        if entry.get("normalized") is True and values.dtype.kind in "iu":
            found = np.maximum(found / np.iinfo(values.dtype).max, -1.0)
        return found

    def indices(self, index: object) -> npt.NDArray[np.unsignedinteger]:
        """(n,): an accessor of indices, of the type that is stored; raises `InputError` like `vectors`."""
        values, _ = self._elements(index, "SCALAR")
        if values.dtype.kind != "u":
            raise self.file.refused(f"accessor {index}: the indices are not unsigned integers")
        return values[:, 0]

    def _elements(self, index: object, kind: str) -> tuple[npt.NDArray[Any], Json]:
        """(n, width): the elements as they are stored, and their accessor."""
        values = self.file.item("accessors", index)
        entry = JsonFields(self.file, f"accessor {index}", values)
        if values.get("type") != kind:
            entry.refuse(f"the type is {values.get('type')!r}, but must be {kind}")
        count, dtype = entry.whole("count"), self._dtype(entry)
        if count > MAX_INDEX:
            raise self.file.refused(f"{entry.where} has {count} elements", "split the mesh")
        if "bufferView" in values:
            found = self._block(entry, dtype, count, _WIDTHS[kind])
        elif "sparse" in values:
            self._require_room(f"{entry.where}: {count} elements", _MADE_UP * count)
            found = np.zeros((count, _WIDTHS[kind]), dtype)
        else:
            raise self.file.refused(f"{entry.where} has no data", "export the file without compression")
        return (self._replaced(entry.section("sparse"), found) if "sparse" in values else found), values

    def keep(self, what: str, size: int) -> None:
        """Count the bytes of a mesh that is kept, since many meshes may share one buffer of a small file."""
        self._kept += size
        self._require_room(f"{what}, together with the data before it,", self._kept)

    def _require_room(self, what: str, size: int) -> None:
        require_room(f"glTF {str(self.file.path)!r}", what, size, self.file.stored, "split the file")

    def _replaced(self, sparse: JsonFields, stored: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Copy of `stored` with the elements of a sparse accessor replaced."""
        count, indices = sparse.whole("count"), sparse.section("indices")
        at = self._block(indices, self._dtype(indices), count, 1)[:, 0].astype(np.int64)
        if ((at < 0) | (at >= len(stored))).any():
            sparse.refuse(f"a sparse index is not one of {len(stored)}")
        found = stored.copy()
        found[at] = self._block(sparse.section("values"), stored.dtype, count, stored.shape[1])
        return found

    def _dtype(self, entry: JsonFields) -> np.dtype[Any]:
        code = entry.values.get("componentType")
        if not isinstance(code, int) or code not in COMPONENTS:
            raise self.file.refused(f"{entry.where}: componentType {code!r} is not defined in glTF 2.0")
        return np.dtype(COMPONENTS[code])

    def _block(self, entry: JsonFields, dtype: np.dtype[Any], count: int, width: int) -> npt.NDArray[Any]:
        """(count, width): contents of a buffer view from the entry's offset on."""
        view = JsonFields(self.file, entry.where, self.file.item("bufferViews", entry.values.get("bufferView")))
        data = self.file.buffer(view.values.get("buffer"))
        start, length = view.whole("byteOffset", 0), view.whole("byteLength", 0)
        offset, element = entry.whole("byteOffset", 0), dtype.itemsize * width
        stride = view.whole("byteStride", element)
        end = offset + stride * (count - 1) + element
        if count < 1 or stride < element or end > length or start + length > len(data):
            raise self.file.refused(f"{entry.where} exceeds its buffer", "copy or export the file again")
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))


def primitive_mesh(accessors: Accessors, primitive: Json, name: str, moved: Array | None = None) -> Mesh | None:
    """The mesh of a primitive in the file's unit, welded and wound as by `load_mesh`; None for points and lines.

    Its vertices are at the positions `moved` (n, 3), if these are given. Raises `InputError` like `raw_mesh`, and if a
    coordinate is not finite.
    """
    raw = raw_mesh(accessors, primitive, name, moved)
    if raw is None:
        return None
    raw.require_finite()
    return mended(raw)


def raw_mesh(accessors: Accessors, primitive: Json, name: str, moved: Array | None = None) -> Mesh | None:
    """The mesh of a primitive in the file's unit, as the file has it, or `moved` there; None for points and lines.

    Raises
    ------
    InputError
        If its data are missing or of a wrong kind, or an index points at no vertex.
    """
    mode = primitive.get("mode", _TRIANGLES)
    if mode in _POINTS_AND_LINES:
        return None
    attributes = primitive["attributes"]
    positions = accessors.vectors(attributes.get("POSITION"), "VEC3") if moved is None else moved
    corners = accessors.indices(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    if corners.max(initial=0) >= len(positions):
        found = f"{name!r}: the index {corners.max()} is beyond the last of {len(positions)} vertices"
        raise accessors.file.refused(found)
    count = len(corners) // 3 if mode == _TRIANGLES else len(corners)
    requested, do = f"glTF {str(accessors.file.path)!r}", "close other programs, or decimate the mesh"
    require_memory(requested, f"the {count} triangles of {name!r}", PER_TRIANGLE * count, do)
    faces = _faces(accessors, mode, corners, name)
    stored = len(positions)
    positions, faces, kept = _compact(positions, faces)
    uv = None
    if "TEXCOORD_0" in attributes:
        uv = accessors.vectors(attributes["TEXCOORD_0"], "VEC2")
        if len(uv) != stored:
            raise accessors.file.refused(f"mesh {name!r} has {len(uv)} texture coordinates, but {stored} vertices")
        uv = np.column_stack([uv[kept, 0], 1.0 - uv[kept, 1]])  # glTF counts v downwards
    colors = None if "COLOR_0" not in attributes else _colors(accessors, attributes["COLOR_0"], stored, name)
    colors = None if colors is None or (colors[kept] == 1).all() else colors[kept]
    accessors.keep(repr(name), (24 if colors is None else 56) * len(positions) + 8 * faces.size)
    return adopted(positions, faces, uv, name, colors=colors)


def _compact(positions: Array, faces: AnyIndices) -> tuple[Array, npt.NDArray[np.int32], Integers | slice]:
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
        raise accessors.file.refused(f"mesh {name!r} has {len(colors)} colors, but {count} vertices")
    return np.column_stack([colors, np.ones(count)]) if kind == "VEC3" else colors


def _faces(accessors: Accessors, mode: Any, corners: AnyIndices, name: str) -> AnyIndices:
    """(m, 3): the faces of a list, strip or fan of triangles."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise accessors.file.refused(f"mesh {name!r} has {len(corners)} corners, which is not a multiple of 3")
        return corners.reshape(-1, 3)
    if mode not in (_STRIP, _FAN):
        raise accessors.file.refused(f"mesh {name!r}: the primitive mode {mode!r} is not defined in glTF 2.0")
    if len(corners) < 3:
        raise accessors.file.refused(f"mesh {name!r} has only {len(corners)} corners, too few for a triangle")
    first, second, third = corners[:-2], corners[1:-1], corners[2:]
    if mode == _FAN:
        return np.column_stack([second, third, np.full_like(first, corners[0])])
    odd = np.arange(len(first)) % 2 == 1  # every other triangle of a strip is wound in reverse
    faces = np.column_stack([first, np.where(odd, third, second), np.where(odd, second, third)])
    # Strips are joined by triangles without area.
    return np.asarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
