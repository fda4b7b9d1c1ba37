"""Accessors of a glTF file: arrays in its buffers, strided, sparse and normalized.

Source: glTF 2.0, section 3.6 (binary data storage), and KHR_mesh_quantization, which lets positions be integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.files.reading import require_room
from translucent.geometry.mesh import MAX_INDEX
from translucent.gltf.fields import refused, section, whole
from translucent.gltf.file import GltfFile, Json

Indices = npt.NDArray[np.int64]

#: Types of NumPy by componentType.
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


#: Bytes of memory per vertex until its mesh is welded and diagnosed: counted where no buffer holds it.
_MADE_UP = 512


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
            raise refused(self.file, f"accessor {index}: indices are no unsigned integers")
        return values[:, 0]

    def _elements(self, index: object, kind: str) -> tuple[npt.NDArray[Any], Json]:
        """(n, width): the elements as they are stored, and their accessor."""
        entry = self.file.item("accessors", index)
        where = f"accessor {index}"
        if entry.get("type") != kind:
            raise refused(self.file, f"{where}: type {entry.get('type')!r} where {kind} belongs")
        count, dtype = whole(self.file, where, entry, "count"), self._dtype(where, entry)
        if count > MAX_INDEX:
            raise refused(self.file, f"{where} has {count} elements", "split the mesh")
        if "bufferView" in entry:
            found = self._block(where, entry, dtype, count, _WIDTHS[kind])
        elif "sparse" in entry:
            self._require_room(f"{where}: {count} elements", _MADE_UP * count)
            found = np.zeros((count, _WIDTHS[kind]), dtype)
        else:
            raise refused(self.file, f"{where} has no data", "export the file without compression")
        if "sparse" in entry:
            found = self._replaced(where, section(self.file, where, entry, "sparse"), found)
        return found, entry

    def keep(self, what: str, size: int) -> None:
        """Count the bytes of a mesh that is kept, since many meshes may share one buffer of a small file."""
        self._kept += size
        self._require_room(f"{what} and what was read before it", self._kept)

    def _require_room(self, what: str, size: int) -> None:
        require_room(f"glTF {str(self.file.path)!r}", what, size, self.file.stored, "split the file")

    def _replaced(self, where: str, sparse: Json, stored: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Copy of `stored` with the elements of a sparse accessor replaced."""
        count = whole(self.file, where, sparse, "count")
        indices = section(self.file, where, sparse, "indices")
        values = section(self.file, where, sparse, "values")
        at = self._block(where, indices, self._dtype(where, indices), count, 1)[:, 0].astype(np.int64)
        if ((at < 0) | (at >= len(stored))).any():
            raise refused(self.file, f"{where}: a sparse index is not one of {len(stored)}")
        found = stored.copy()
        found[at] = self._block(where, values, stored.dtype, count, stored.shape[1])
        return found

    def _dtype(self, where: str, entry: Json) -> np.dtype[Any]:
        code = entry.get("componentType")
        if not isinstance(code, int) or code not in COMPONENTS:
            raise refused(self.file, f"{where}: componentType {code!r} is none of glTF 2.0")
        return np.dtype(COMPONENTS[code])

    def _block(self, where: str, entry: Json, dtype: np.dtype[Any], count: int, width: int) -> npt.NDArray[Any]:
        """(count, width): contents of a buffer view from the entry's offset on."""
        view = self.file.item("bufferViews", entry.get("bufferView"))
        data = self.file.buffer(view.get("buffer"))
        start, length = (whole(self.file, where, view, key, 0) for key in ("byteOffset", "byteLength"))
        offset, element = whole(self.file, where, entry, "byteOffset", 0), dtype.itemsize * width
        stride = whole(self.file, where, view, "byteStride", element)
        end = offset + stride * (count - 1) + element
        if count < 1 or stride < element or end > length or start + length > len(data):
            raise refused(self.file, f"{where} leaves its buffer", "copy or export the file again")
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))
