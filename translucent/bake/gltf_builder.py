"""Builder of glTF files: data appended to the binary chunk, materials given thickness, and meshes as new files.

What a file has keeps its place and its index. A thickness map is thicknessFactor = max, and max * G / 255 is the
thickness in mesh space: KHR_materials_volume with factor and texture, and KHR_materials_transmission with factor 1
where no light came in so far. Then metallicFactor becomes 0, too, since metal transmits nothing. doubleSided is
dropped, since it has no effect on the boundary of a volume and validators warn of it. The texture is a new image with
R = B = 0; an image that the material had before stays in the file.

Source: glTF 2.0, sections 3.6 (binary data) and 4.4 (GLB); Khronos, KHR_materials_volume, KHR_materials_transmission,
KHR_texture_transform.
"""

from __future__ import annotations

import copy
import io
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.images import write_png
from translucent.geometry.grouping import equal_rows
from translucent.geometry.mesh import Mesh
from translucent.gltf.accessors import COMPONENTS
from translucent.gltf.file import BINARY_CHUNK, CHUNK, GltfFile, Json, gather
from translucent.gltf.materials import DIFFUSE_TRANSMISSION, TRANSMISSION, VOLUME, volume_extensions_of
from translucent.gltf.nodes import primitives, variant_materials
from translucent.gltf.textures import TEXTURE_TRANSFORM
from translucent.media.medium import Medium, color_at

VERTICES, INDICES = 34962, 34963  # what a buffer view is for

_ALIGNMENT = 4  # bytes: of views, and of each element of a vertex attribute
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_CODES = {dtype: code for code, dtype in COMPONENTS.items()}
_LINEAR, _MIPMAPS, _REPEAT, _CLAMP = 9729, 9987, 10497, 33071

#: Angle between face and smooth normal, in degrees, beyond which a corner keeps the face's: an edge stays an edge.
CREASE = 30.0

Indices = npt.NDArray[np.int64]


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
                raise file.refused("the first buffer of the file is a link", "export the model as a single .glb")
            tree, data = copy.deepcopy(file.tree), file.resource({})
            self._rest = file.chunks[CHUNK.size + len(data) :]
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
        chunk = CHUNK.pack(len(data), BINARY_CHUNK) + data if data else b""
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
            Whether whole numbers are normalized to -1..1 or 0..1.
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
            raise InputError(
                f"glTF {str(self._path)!r}", f"extensionsUsed is {used!r}, not a list", "correct the glTF file"
            )
        if name not in used:
            used.append(name)

    def primitive(self, mesh: int, index: int) -> Json:
        """A primitive of a mesh."""
        file = GltfFile(self._path, self.tree)
        return primitives(file, file.item("meshes", mesh))[index]

    def own_material(self, mesh: int, index: int) -> int:
        """Index of a material that this primitive alone uses: shared ones are duplicated.

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
                users.update(variant_materials(file, primitive))
        return users

    def let_light_in(self, index: int, medium: Medium | None, metres: float) -> None:
        """Make a material a volume that light enters, with the attenuation of a medium where it states none.

        Raises
        ------
        InputError
            If the material has an extension that excludes a volume.
        """
        material = self.tree["materials"][index]
        extensions = volume_extensions_of(index, material)
        diffuse = extensions.get(DIFFUSE_TRANSMISSION, {}).get("diffuseTransmissionFactor", 0)
        if not (extensions.get(TRANSMISSION, {}).get("transmissionFactor", 0) > 0 or diffuse > 0):
            extensions.setdefault(TRANSMISSION, {})["transmissionFactor"] = 1
            material.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 0
        material.pop("doubleSided", None)
        volume = extensions.setdefault(VOLUME, {})
        if medium is not None and "attenuationDistance" not in volume and medium.extinction.any():
            color, distance = color_at(medium, None)
            volume |= {"attenuationColor": color.tolist(), "attenuationDistance": distance / metres}

    def give_thickness(
        self, index: int, factor: float, levels: npt.NDArray[Any], mesh: Mesh, tex_coord: int, keeps_transform: bool
    ) -> int:
        """State the thickness of a material with a volume; returns the index of the new texture.

        Parameters
        ----------
        index : int
            Of the material.
        factor : float
            Thickness in mesh space where the texture is 255.
        levels : (h, w) uint8
            The texture's G channel.
        mesh : Mesh
            That the texture is for.
        tex_coord : int
            Set of its UVs.
        keeps_transform : bool
            Whether the texture is for UVs after the transform that the material's thickness texture had so far.
        """
        extensions = self.tree["materials"][index]["extensions"]
        volume = extensions[VOLUME]
        volume["thicknessFactor"] = factor
        texture = self._add_texture(levels, mesh)
        old = volume.get("thicknessTexture", {})
        kept = old.get("extensions", {})
        kept = {name: value for name, value in kept.items() if name != TEXTURE_TRANSFORM or keeps_transform}
        info = {key: value for key, value in old.items() if key not in ("index", "texCoord", "extensions")}
        info["index"] = texture
        if keeps_transform:
            info |= {"texCoord": old["texCoord"]} if "texCoord" in old else {}
        elif tex_coord:
            info["texCoord"] = tex_coord
        volume["thicknessTexture"] = {**info, "extensions": kept} if kept else info
        for name in (VOLUME, TRANSMISSION):
            if name in extensions:
                self.use_extension(name)
        return texture

    def _add_texture(self, levels: npt.NDArray[Any], mesh: Mesh) -> int:
        """Index of a new texture with these levels in its G channel."""
        color = np.zeros((*levels.shape, 3), np.uint8)
        color[..., 1] = levels
        stream = io.BytesIO()
        write_png(stream, color)
        name = f"{mesh.name} thickness"
        view = self.add_view(stream.getvalue())
        image = self.add("images", {"name": name, "bufferView": view, "mimeType": "image/png"})
        requested = {"magFilter": _LINEAR, "minFilter": _MIPMAPS, **wrapping(mesh)}
        samplers = self.tree.setdefault("samplers", [])
        sampler = samplers.index(requested) if requested in samplers else self.add("samplers", requested)
        return self.add("textures", {"name": name, "sampler": sampler, "source": image})


def wrapping(mesh: Mesh) -> Json:
    """Wrapping mode of a sampler for a map of this mesh.

    Clamped, it does not mix the map's left and right sides; UVs beyond 0..1 mean that the map repeats.
    """
    wrap = _CLAMP if mesh.uv is not None and mesh.uv.min() >= 0 and mesh.uv.max() <= 1 else _REPEAT
    return {"wrapS": wrap, "wrapT": wrap}


def mesh_file(mesh: Mesh) -> GltfFile:
    """Make a .glb with this mesh, its UVs if it has any, normals, and a clear material; nothing is written yet.

    Raises
    ------
    InputError
        If its coordinates are beyond float32.
    """
    vertex, faces, normals = _split_at_edges(mesh)
    if np.abs(mesh.vertices).max() > np.finfo(np.float32).max:
        raise InputError(
            f"mesh {mesh.name!r}", "some coordinates are too large for the float32 numbers of glTF", "scale the mesh"
        )
    tree: Json = {
        "asset": {"version": "2.0", "generator": "translucent"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": mesh.name}],
    }
    builder = GlbBuilder(GltfFile(Path(mesh.name), tree))
    with np.errstate(under="ignore"):
        positions = mesh.vertices[vertex].astype(np.float32)
    attributes = {
        "POSITION": builder.add_accessor(positions, bounds=True),
        "NORMAL": builder.add_accessor(normals),
    }
    if mesh.uv is not None:
        with np.errstate(under="ignore"):
            uv = np.column_stack([mesh.uv[:, 0], 1.0 - mesh.uv[:, 1]]).astype(np.float32)  # glTF counts v downwards
        attributes["TEXCOORD_0"] = builder.add_accessor(uv[vertex])
    surface = {"metallicFactor": 0, "roughnessFactor": 0}
    builder.add("materials", {"name": mesh.name, "pbrMetallicRoughness": surface})
    indices = builder.add_accessor(faces.astype(np.uint32).ravel(), INDICES)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    builder.add("meshes", {"name": mesh.name, "primitives": [primitive]})
    return builder.file()


def _split_at_edges(mesh: Mesh) -> tuple[Indices, Indices, npt.NDArray[np.float32]]:
    """Vertices repeated along sharp edges: the mesh vertex of each, the new faces, and unit normals."""
    points = equal_rows(mesh.vertices)
    # Across a seam of the UVs the surface is as smooth as elsewhere.
    welded = Mesh(mesh.vertices[points.first], points.of[mesh.faces].astype(np.int32))
    smooth = welded.vertex_normals[points.of]
    own, corner = mesh.face_normals[:, None], smooth[mesh.faces]
    sharp = np.einsum("fck,fck->fc", np.broadcast_to(own, corner.shape), corner) < np.cos(np.radians(CREASE))
    sharp &= own.any(axis=2)  # a face without area has no normal
    with np.errstate(under="ignore"):
        normals = np.where(sharp[..., None], own, corner).astype(np.float32).reshape(-1, 3)
    split = equal_rows(np.column_stack([mesh.faces.ravel(), normals]))
    return mesh.faces.ravel()[split.first].astype(np.int64), split.of.reshape(-1, 3), normals[split.first]
