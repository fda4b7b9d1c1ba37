"""Builder of glTF files: data appended to the binary chunk, with views, accessors, images and materials.

What the file has keeps its place and its index. Source: glTF 2.0, sections 3.6 (binary data) and 4.4 (GLB).
"""

from __future__ import annotations

import copy
import struct
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.gltf.accessors import COMPONENTS
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.pack import gather
from translucent.gltf.scene_media import primitives

VERTICES, INDICES = 34962, 34963  # what a buffer view is for

_CHUNK = struct.Struct("<II")
_BINARY_CHUNK = 0x004E4942
_ALIGNMENT = 4  # bytes: of views, and of each element of a vertex attribute
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_CODES = {dtype: code for code, dtype in COMPONENTS.items()}


class GlbBuilder:
    """Builder: a copy of a file, as a .glb, to which data can be added.

    Parameters
    ----------
    file : GltfFile
        Its buffers are gathered into the one of a .glb.

    Raises
    ------
    InputError
        If a buffer cannot be read.
    """

    def __init__(self, file: GltfFile) -> None:
        self._path, self._allow_outside = file.path, file.allow_outside
        if file.chunks:
            if "uri" in (file.items("buffers") or [{}])[0]:
                raise InputError(f"glTF {str(file.path)!r}", "its first buffer is a link", "export it as one .glb")
            tree, data = copy.deepcopy(file.tree), file.resource({})
            self._rest = file.chunks[_CHUNK.size + len(data) :]
        else:
            tree, data = gather(file, file.tree)
            self._rest = b""
        self.tree: Json = tree
        self._data = bytearray(data)

    def file(self) -> GltfFile:
        """Current state of the file; its JSON is the builder's own."""
        if self._data:
            buffers = self.tree.setdefault("buffers", [{}])
            buffers[0]["byteLength"] = len(self._data)
        data = bytes(self._data) + b"\0" * (-len(self._data) % _ALIGNMENT)
        chunk = _CHUNK.pack(len(data), _BINARY_CHUNK) + data if data else b""
        return GltfFile(self._path, self.tree, chunk + self._rest, self._allow_outside)

    def add(self, key: str, entry: Json) -> int:
        """Append an object to a list such as ``"materials"``; returns its index."""
        entries: list[Json] = self.tree.setdefault(key, [])
        entries.append(entry)
        return len(entries) - 1

    def add_view(self, data: bytes, **fields: Any) -> int:
        """Put bytes into a buffer view of their own; returns its index."""
        self._data += b"\0" * (-len(self._data) % _ALIGNMENT)
        self.tree.setdefault("buffers", [{}])
        start = len(self._data)
        self._data += data
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **fields})

    def add_accessor(
        self, values: npt.NDArray[Any], target: int | None = VERTICES, *, normalized: bool = False, bounds: bool = False
    ) -> int:
        """Put an array (n,) or (n, 2..4) into an accessor; returns its index.

        Parameters
        ----------
        values : array
            Of a type that glTF has.
        target : int, optional
            `VERTICES`, whose elements are aligned, `INDICES`, or None.
        normalized : bool
            Whether whole numbers stand for -1..1 or 0..1.
        bounds : bool
            Whether to state smallest and largest values, as positions must.
        """
        table = np.ascontiguousarray(values.reshape(len(values), -1), dtype=values.dtype.newbyteorder("<"))
        fields: Json = {} if target is None else {"target": target}
        raw = table.view(np.uint8).reshape(len(table), -1)
        if target == VERTICES and (gap := -raw.shape[1] % _ALIGNMENT):
            raw = np.pad(raw, ((0, 0), (0, gap)))
            fields["byteStride"] = raw.shape[1]
        entry: Json = {
            "bufferView": self.add_view(raw.tobytes(), **fields),
            "componentType": _CODES[f"<{values.dtype.str[1:]}"],
            "count": len(table),
            "type": _KINDS[table.shape[1]],
        }
        if normalized:
            entry["normalized"] = True
        if bounds:
            entry |= {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        return self.add("accessors", entry)

    def use_extension(self, name: str) -> None:
        """Declare an extension that the file uses."""
        used = self.tree.setdefault("extensionsUsed", [])
        if not isinstance(used, list):
            raise InputError(f"glTF {str(self._path)!r}", f"extensionsUsed is {used!r}, not a list", "mend the file")
        if name not in used:
            used.append(name)

    def primitive(self, mesh: int, index: int) -> Json:
        """A primitive of a mesh."""
        file = GltfFile(self._path, self.tree)
        return primitives(file, file.item("meshes", mesh))[index]

    def own_material(self, mesh: int, index: int) -> int:
        """Index of the material of a primitive, of which it is now the only user: shared ones are duplicated.

        Nodes that share the mesh share its material, too. Materials that variants name stay theirs.
        """
        file = GltfFile(self._path, self.tree)
        entry, primitive = file.item("meshes", mesh), self.primitive(mesh, index)
        old = primitive.get("material")
        if old is not None and self._users()[old] == 1:
            return int(old)
        name = str(entry.get("name", f"mesh {mesh}")) + (f"[{index}]" if len(entry["primitives"]) > 1 else "")
        if old is None:
            made: Json = {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0}}
        else:
            made = copy.deepcopy(file.item("materials", old))
            made["name"] = f"{made['name']} ({name})" if made.get("name") else name
        primitive["material"] = self.add("materials", made)
        return int(primitive["material"])

    def _users(self) -> Counter[int]:
        """Number of primitives and variants of primitives that use each material."""
        file = GltfFile(self._path, self.tree)
        users: Counter[int] = Counter()
        for mesh in file.items("meshes"):
            for primitive in primitives(file, mesh):
                if "material" in primitive:
                    users[primitive["material"]] += 1
                users.update(_variants(file, primitive))
        return users


def _variants(file: GltfFile, primitive: Json) -> list[int]:
    """Materials that variants give a primitive."""
    try:
        mappings = primitive.get("extensions", {}).get("KHR_materials_variants", {}).get("mappings", [])
        return [int(mapping["material"]) for mapping in mappings]
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"glTF {str(file.path)!r}", "KHR_materials_variants is malformed", "mend the file") from error
