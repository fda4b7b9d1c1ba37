"""Primitives of a glTF file that get thickness or scattered light, and the bodies that they bound.

Targets are the primitives whose material lets light in, but for open meshes that it makes thin walls: they have no
inside. Where no material lets light in, all triangles, whose materials then will. Each is baked in the mesh's own
space, as glTF states thickness, so nodes that share a mesh share the map, whatever their scale.

The UVs are the ones where the material reads its thickness texture (KHR_texture_transform included, as long as it keeps
them in 0..1), else TEXCOORD_0, else new ones as the next set.

Modelling tools split a mesh by its materials: of a vase in four primitives none is closed, and all of them are. Such a
primitive is joined with the other open ones of its mesh, if that closes edges, and has the thickness of all of them
together. What is closed by itself stays alone: what lies inside it, such as wine in a glass, is another body.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bake.atlas import unwrap
from translucent.bake.gltf_builder import INDICES, GlbBuilder
from translucent.errors import InputError, TranslucentWarning
from translucent.geometry.mesh import Mesh, mended
from translucent.gltf.accessors import COMPONENTS, Accessors, primitive_mesh
from translucent.gltf.file import COMPRESSIONS, GltfFile, Json
from translucent.gltf.materials import GltfMaterial, materials_of
from translucent.gltf.nodes import node_transforms, primitives
from translucent.gltf.textures import TextureTransform
from translucent.media.medium import Medium, extinction_at

#: Mesh and primitive of a file.
PrimitiveKey = tuple[int, int]

_TRIANGLES = (4, 5, 6)

#: Relative difference of axes within which nodes show a mesh in one size.
SAME_SIZE = 1e-4


def read_primitive(file: GltfFile, key: PrimitiveKey, metres: float, tex_coord: int | None = None) -> Mesh:
    """Read a primitive in its own space, in metres, with a set of its UVs or none."""
    primitive = primitives(file, file.item("meshes", key[0]))[key[1]]
    attributes = {"POSITION": primitive["attributes"].get("POSITION")}
    if tex_coord is not None:
        attributes["TEXCOORD_0"] = primitive["attributes"][f"TEXCOORD_{tex_coord}"]
    mesh = primitive_mesh(Accessors(file), {**primitive, "attributes": attributes}, primitive_name(file, key))
    assert mesh is not None  # its mode is one of triangles
    return mesh if metres == 1.0 else dataclasses.replace(mesh, vertices=mesh.vertices * metres)


def primitive_name(file: GltfFile, key: PrimitiveKey) -> str:
    """The name of a primitive's mesh or node, with its number where there are several."""
    mesh = file.item("meshes", key[0])
    users = [node for node in file.items("nodes") if node.get("mesh") == key[0] and node.get("name")]
    name = str(mesh.get("name") or (users[0]["name"] if users else f"mesh {key[0]}"))
    return name + (f"[{key[1]}]" if len(mesh["primitives"]) > 1 else "")


def triangle_primitives(file: GltfFile) -> dict[PrimitiveKey, Json]:
    """The primitives of triangles of all meshes that nodes use."""
    used = {node["mesh"] for node in file.items("nodes") if "mesh" in node}
    return {
        (index, i): primitive
        for index, mesh in enumerate(file.items("meshes"))
        if index in used
        for i, primitive in enumerate(primitives(file, mesh))
        if primitive.get("mode", 4) in _TRIANGLES
    }


def positions_of(file: GltfFile, key: PrimitiveKey) -> Array:
    """(n, 3): positions of the vertices of a primitive, in units of the file."""
    attributes = file.item("meshes", key[0])["primitives"][key[1]]["attributes"]
    return Accessors(file).vectors(attributes.get("POSITION"), "VEC3")


def nearest(vertices: Array, positions: Array) -> npt.NDArray[np.intp]:
    """(k,): indices of the vertices (n, 3) that are nearest to positions (k, 3)."""
    from scipy.spatial import cKDTree

    with np.errstate(under="ignore"):
        found: npt.NDArray[np.intp] = cKDTree(vertices).query(positions)[1]
    return found


class Bodies:
    """The bodies that the primitives of a file bound.

    Parameters
    ----------
    file : GltfFile
    metres : float
        Per unit of the file.
    """

    def __init__(self, file: GltfFile, metres: float) -> None:
        self._file, self._metres = file, metres
        self._triangles = tuple(triangle_primitives(file))
        self._outlines: dict[PrimitiveKey, Mesh] = {}
        self._joined: dict[int, tuple[Mesh, dict[PrimitiveKey, int]] | None] = {}

    def is_closed(self, key: PrimitiveKey) -> bool:
        """True if a primitive is closed, together with those adjacent to it."""
        whole = self.around(key) or self._outline(key)
        return whole.diagnosis.closed

    def around(self, key: PrimitiveKey) -> Mesh | None:
        """Body of an open primitive: joined with the other open ones of its mesh, if that closes edges."""
        joined = self.joined(key)
        return None if joined is None else joined[0]

    def joined(self, key: PrimitiveKey) -> tuple[Mesh, int] | None:
        """Body `around` an open primitive, and the index of its first face there; None for a closed primitive."""
        if len(self._primitives(key[0])) == 1:  # the usual mesh, which need not be read and examined for that
            return None
        if self._outline(key).diagnosis.closed or (joined := self._join(key[0])) is None:
            return None
        return joined[0], joined[1][key]

    def wound(self, key: PrimitiveKey, mesh: Mesh) -> Mesh:
        """Mesh of a primitive, with the winding of its faces in the body `around` it."""
        joined = self._join(key[0])
        assert joined is not None
        whole, starts = joined
        normals = whole.face_normals[starts[key] : starts[key] + len(mesh.faces)]
        turned = np.einsum("fi,fi->f", mesh.face_normals, normals) < 0
        return dataclasses.replace(mesh, faces=np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces))

    def _outline(self, key: PrimitiveKey) -> Mesh:
        if key not in self._outlines:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TranslucentWarning)  # of faces that are turned: the bake reports them
                self._outlines[key] = read_primitive(self._file, key, self._metres)
        return self._outlines[key]

    def _primitives(self, index: int) -> list[PrimitiveKey]:
        return [key for key in self._triangles if key[0] == index]

    def _join(self, index: int) -> tuple[Mesh, dict[PrimitiveKey, int]] | None:
        """All open primitives of a mesh joined, and the first face of each; None if joining closes no edge."""
        if index not in self._joined:
            parts = {key: self._outline(key) for key in self._primitives(index)}
            parts = {key: part for key, part in parts.items() if not part.diagnosis.closed}
            self._joined[index] = None
            if len(parts) > 1:
                whole, starts = _joined(parts)
                before = sum(part.diagnosis.open_edges.count for part in parts.values())
                if whole.diagnosis.open_edges.count < before:
                    self._joined[index] = whole, starts
        return self._joined[index]


def _joined(parts: dict[PrimitiveKey, Mesh]) -> tuple[Mesh, dict[PrimitiveKey, int]]:
    meshes = list(parts.values())
    first_vertex = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first_face = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + begin for mesh, begin in zip(meshes, first_vertex, strict=False)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # as above
        whole = mended(Mesh(vertices, faces.astype(np.int32), name=meshes[0].name))
    return whole, dict(zip(parts, first_face.tolist(), strict=False))


def first_transforms(file: GltfFile) -> dict[int, Array]:
    """Mesh to world (4x4) of each mesh by the first node that shows it.

    Warns
    -----
    TranslucentWarning
        If nodes show a mesh in several sizes.
    """
    transforms, first = node_transforms(file), dict[int, Array]()
    for index, node in enumerate(file.items("nodes")):
        matrix = transforms[index]
        if "mesh" not in node or np.linalg.matrix_rank(matrix[:3, :3]) < 3:
            continue  # without an extent along some axis: it is hidden, or has no inside
        known = first.setdefault(node["mesh"], matrix)
        if not np.allclose(_sizes(known), _sizes(matrix), rtol=SAME_SIZE, atol=SAME_SIZE * np.abs(_sizes(known)).max()):
            name = file.item("meshes", node["mesh"]).get("name", f"mesh {node['mesh']}")
            text = f"glTF {str(file.path)!r}: nodes use {name!r} in several sizes; the map fits only the first"
            warnings.warn(text, TranslucentWarning, stacklevel=2)
    return first


def _sizes(matrix: Array) -> Array:
    """Metric of a matrix: the same for two that differ by a rotation, a translation or a reflection."""
    return np.asarray(matrix[:3, :3].T @ matrix[:3, :3])


def transformed(mesh: Mesh, matrix: Array, metres: float) -> Mesh:
    """Mesh in metres, transformed by a matrix in units of its file; faces of a mirrored mesh are flipped."""
    vertices = mesh.vertices @ matrix[:3, :3].T + metres * matrix[:3, 3]
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return dataclasses.replace(mesh, vertices=vertices, faces=faces)


@dataclass(frozen=True, eq=False)
class Target:
    """Target: a primitive that gets thickness.

    Parameters
    ----------
    key : (int, int)
        Indices of its mesh, and of it in the mesh.
    mesh : Mesh
        In its own space, in metres, with the UVs of the texture to come, v upwards; without UVs if not `needs_uv`.
    tex_coord : int
        The set of these UVs: n of TEXCOORD_n.
    keeps_transform : bool
        Whether the UVs are those after the transform of the thickness texture that the material has.
    medium : Medium, optional
        What its material states to be inside.
    made_uv : bool
        Whether the UVs were made for it, and are nowhere but in the builder.
    around : Mesh, optional
        The body that it and others bound, where it is open by itself.
    """

    key: PrimitiveKey
    mesh: Mesh
    tex_coord: int = 0
    keeps_transform: bool = False
    medium: Medium | None = None
    made_uv: bool = False
    around: Mesh | None = None

    def moved(self, matrix: Array, metres: float) -> Target:
        """Target with its meshes moved by a matrix in units of the file."""
        around = None if self.around is None else transformed(self.around, matrix, metres)
        return dataclasses.replace(self, mesh=transformed(self.mesh, matrix, metres), around=around)


def find_targets(
    builder: GlbBuilder,
    metres: float = 1.0,
    *,
    needs_uv: bool = True,
    new_uv: bool = False,
    plain_uv: bool = False,
    size: int = 1024,
    only: Collection[PrimitiveKey] | None = None,
) -> list[Target]:
    """The primitives that get thickness; those without UVs get new ones in the builder.

    Parameters
    ----------
    builder : GlbBuilder
    metres : float
        Per unit of the file.
    needs_uv : bool
        Whether UVs are requested at all.
    new_uv : bool
        Make new UVs for all of them.
    plain_uv : bool
        Take UVs as they are, without the transform of the thickness texture that a material has.
    size : int
        Texels along each side of the map to come, which the gaps between new charts depend on.
    only : collection of (int, int), optional
        Mesh and primitive of each that counts. Default: all.

    Raises
    ------
    InputError
        If the file is compressed, has no triangles, or its data are wrong; if UVs are to be made and xatlas is missing.
    """
    file = builder.file()
    require_uncompressed(file)
    materials, bodies = materials_of(file), Bodies(file, metres)
    lit = {
        key: _material(materials, builder.primitive(*key))
        for key in _keys(file, materials)
        if only is None or key in only
    }
    # All that is read of the file as it is, before anything is added to it.
    # An open mesh that its material makes a thin wall has no inside.
    walls = {key for key, material in lit.items() if material is not None and material.kind == "thin wall"}
    chosen = {key: bodies.around(key) for key in lit if key not in walls or bodies.is_closed(key)}
    found: list[Target] = []
    for key, around in chosen.items():
        material, medium = lit[key], _medium(lit[key], metres)
        if not needs_uv:
            found.append(Target(key, read_primitive(file, key, metres), medium=medium))
            continue
        # That of the thickness texture, if the primitive has it.
        requested = material.thickness_transform.tex_coord if material and material.has_thickness_texture else 0
        sets = [n for n in (requested, 0) if f"TEXCOORD_{n}" in builder.primitive(*key)["attributes"] and not new_uv]
        tex_coord, keeps = next(iter(sets), None), False
        if made := tex_coord is None:
            tex_coord = add_uv(builder, key, size)
        mesh = read_primitive(builder.file() if made else file, key, metres, tex_coord)
        if not (made or plain_uv):
            mesh, keeps = _transformed(mesh, material, tex_coord)
        if around is not None:
            mesh = bodies.wound(key, mesh)
        found.append(Target(key, mesh, tex_coord, keeps, medium, made, around))
    if not found:
        text = f"only thin walls let light in, and they have no inside: {', '.join(_names(file, list(lit)))}"
        raise file.refused(text, "give one of them a volume, or a closed mesh")
    return found


def require_uncompressed(file: GltfFile) -> None:
    """Raise `InputError` if a file cannot be read without an extension that compresses its vertices."""
    required = file.tree.get("extensionsRequired", [])
    if packed := [name for name in COMPRESSIONS if name in required]:
        raise file.refused(f"the file requires {packed[0]}", "export the file without compression")


def _material(materials: list[GltfMaterial], primitive: Json) -> GltfMaterial | None:
    return materials[primitive["material"]] if "material" in primitive else None


def left_out(file: GltfFile, targets: list[Target]) -> list[str]:
    """Primitives that get no thickness, a line for each reason."""
    materials, chosen = materials_of(file), {target.key for target in targets}
    reasons: dict[str, list[PrimitiveKey]] = {}
    for key, primitive in triangle_primitives(file).items():
        if key not in chosen:
            material = _material(materials, primitive)
            sheet = material is not None and material.transmits
            reasons.setdefault("thin walls without an inside" if sheet else "opaque", []).append(key)
    return [f"{reason}: {', '.join(_names(file, keys))}" for reason, keys in reasons.items()]


def _names(file: GltfFile, keys: list[PrimitiveKey]) -> list[str]:
    return [primitive_name(file, key) for key in keys]


def _keys(file: GltfFile, materials: list[GltfMaterial]) -> list[PrimitiveKey]:
    """Triangle primitives of meshes that nodes use: those with a translucent material, or all."""
    everything = {key: primitive.get("material") for key, primitive in triangle_primitives(file).items()}
    if not everything:
        raise file.refused("no node has triangles", "give a file with a mesh")
    lit = [key for key, index in everything.items() if index is not None and materials[index].transmits]
    return lit or list(everything)


def _transformed(mesh: Mesh, material: GltfMaterial | None, tex_coord: int) -> tuple[Mesh, bool]:
    """Mesh with the UVs of the material's thickness texture, if they apply."""
    if material is None or not material.has_thickness_texture or mesh.uv is None:
        return mesh, False
    transform = material.thickness_transform
    if transform.tex_coord != tex_coord or transform == TextureTransform(tex_coord=tex_coord):
        return mesh, False
    uv = transform.apply(np.column_stack([mesh.uv[:, 0], 1.0 - mesh.uv[:, 1]]))
    if (uv < 0).any() or (uv > 1).any():
        return mesh, False  # a pattern that is repeated is no place for a map
    return dataclasses.replace(mesh, uv=np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])), True


def _medium(material: GltfMaterial | None, metres: float) -> Medium | None:
    """Medium of the material's attenuation, whatever its thickness."""
    if material is None or not np.isfinite(material.attenuation_distance):
        return None
    return Medium(absorption=extinction_at(material.attenuation_color, material.attenuation_distance) / metres)


def add_uv(builder: GlbBuilder, key: PrimitiveKey, size: int) -> int:
    """Give a primitive new UVs as its next set; vertices on seams are repeated with all their attributes.

    Raises
    ------
    InputError
        If it is a strip or fan, or compressed, or xatlas is missing.
    """
    file, primitive = builder.file(), builder.primitive(*key)
    accessors, name = Accessors(file), primitive_name(file, key)
    requested = f"new UVs for {name!r} of {str(file.path)!r}"
    if primitive.get("mode", 4) != 4:
        raise InputError(
            requested,
            "the primitive is a triangle strip or fan",
            "export the primitive as a list of triangles, or with UVs",
        )
    if COMPRESSIONS[0] in primitive.get("extensions", {}):
        raise InputError(
            requested, "the vertices of the primitive are compressed", "export the file without mesh compression"
        )
    positions = accessors.vectors(primitive["attributes"].get("POSITION"), "VEC3")
    corners = accessors.indices(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    if len(corners) % 3 or corners.max(initial=0) >= len(positions):
        raise InputError(requested, "the indices of the primitive do not form triangles", "export the file again")
    made = unwrap(Mesh(positions, corners.reshape(-1, 3).astype(np.int32), name=name), size, None)
    assert made.mesh.uv is not None
    for holder in [primitive["attributes"], *primitive.get("targets", [])]:
        for semantic, index in holder.items():
            holder[semantic] = _repeated(builder, accessors, index, made.vertex)
    number = 0
    while f"TEXCOORD_{number}" in primitive["attributes"]:
        number += 1
    uv = np.column_stack([made.mesh.uv[:, 0], 1.0 - made.mesh.uv[:, 1]]).astype(np.float32)
    primitive["attributes"][f"TEXCOORD_{number}"] = builder.add_accessor(uv)
    primitive["indices"] = builder.add_accessor(made.mesh.faces.astype(np.uint32).ravel(), INDICES)
    primitive["mode"] = 4
    return number


def _repeated(builder: GlbBuilder, accessors: Accessors, index: int, kept: npt.NDArray[Any]) -> int:
    """An accessor with the elements `kept` of another, of the same type."""
    entry = accessors.file.item("accessors", index)
    values = accessors.vectors(index, entry.get("type", ""))[kept]
    dtype = np.dtype(COMPONENTS[entry["componentType"]])
    normalized = entry.get("normalized") is True
    if normalized:
        values = np.rint(values * np.iinfo(dtype).max)
    with np.errstate(under="ignore"):
        return builder.add_accessor(values.astype(dtype), normalized=normalized, bounds="min" in entry)
