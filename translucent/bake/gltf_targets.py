"""Which primitives of a glTF file get thickness, and their meshes as a baker takes them.

Those whose material lets light in, but for open meshes that it makes thin walls: they have no inside. Where no material
lets light in, all triangles, whose materials then will. Each is baked in the mesh's own space, as glTF states
thickness, so nodes that share a mesh share the map, whatever their scale.

The UVs are those that the material reads its thickness texture at (KHR_texture_transform included, as long as it keeps
them in 0..1), else TEXCOORD_0, else new ones as the next set.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.bake.glb_builder import INDICES, GlbBuilder
from translucent.bake.unwrap import unwrap
from translucent.errors import InputError
from translucent.gltf.accessors import COMPONENTS, Accessors
from translucent.gltf.geometry import primitive_mesh
from translucent.materials.color_distance import extinction_at
from translucent.materials.gltf import GltfMaterial, materials_of
from translucent.materials.gltf_file import GltfFile, Json
from translucent.materials.gltf_scene import primitives
from translucent.materials.gltf_texture import TextureTransform
from translucent.medium import Medium
from translucent.mesh import Mesh

#: Mesh and primitive of a file.
Place = tuple[int, int]

_TRIANGLES = (4, 5, 6)
_COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


@dataclass(frozen=True, eq=False)
class Target:
    """A primitive that gets thickness.

    Parameters
    ----------
    place : (int, int)
        Indices of its mesh, and of it in the mesh.
    mesh : Mesh
        In its own space, in metres, with the UVs of the texture to come, v upwards; without UVs if not `needs_uv`.
    tex_coord : int
        The set of these UVs: n of TEXCOORD_n.
    keeps_transform : bool
        Whether the UVs are those after the transform of the thickness texture that the material has.
    medium : Medium, optional
        What its material states to be inside.
    """

    place: Place
    mesh: Mesh
    tex_coord: int = 0
    keeps_transform: bool = False
    medium: Medium | None = None


def find_targets(
    builder: GlbBuilder, metres: float = 1.0, *, needs_uv: bool = True, new_uv: bool = False, size: int = 1024
) -> list[Target]:
    """The primitives that get thickness; those without UVs get new ones in the builder.

    Parameters
    ----------
    builder : GlbBuilder
    metres : float
        Per unit of the file.
    needs_uv : bool
        Whether UVs are wanted at all.
    new_uv : bool
        Make new UVs for all of them.
    size : int
        Texels along each side of the map to come, which the gaps between new charts depend on.

    Raises
    ------
    InputError
        If the file is compressed, has no triangles, or its data are wrong; if UVs are to be made and xatlas is missing.
    """
    file = builder.file()
    required = file.tree.get("extensionsRequired", [])
    if packed := [name for name in _COMPRESSIONS if name in required]:
        raise InputError(f"glTF {str(file.path)!r}", f"it requires {packed[0]}", "export it without compression")
    materials = materials_of(file)
    found: list[Target] = []
    walls: list[str] = []
    for place in _places(file, materials):
        primitive = builder.primitive(*place)
        material = materials[primitive["material"]] if "material" in primitive else None
        name = _name(file, place)
        if material is not None and material.kind == "thin wall":
            outline = _read(builder.file(), primitive, name, metres, None)
            if not outline.diagnosis.closed:
                walls.append(name)
                continue
        if not needs_uv:
            mesh = _read(builder.file(), primitive, name, metres, None)
            found.append(Target(place, mesh, medium=_medium(material, metres)))
            continue
        tex_coord = None if new_uv else _tex_coord(primitive, material)
        if tex_coord is None:
            tex_coord = add_uv(builder, primitive, name, size)
            material = None if material is None else dataclasses.replace(material, thickness_texture=None)
        mesh = _read(builder.file(), primitive, name, metres, tex_coord)
        mesh, keeps = _transformed(mesh, material, tex_coord)
        found.append(Target(place, mesh, tex_coord, keeps, _medium(material, metres)))
    if not found:
        told = f"all that lets light in are thin walls without an inside: {', '.join(walls)}"
        raise InputError(f"glTF {str(file.path)!r}", told, "give one of them a volume, or a closed mesh")
    return found


def _places(file: GltfFile, materials: list[GltfMaterial]) -> list[Place]:
    """Triangles of meshes that nodes use: with a material that lets light in, or all."""
    used = {node["mesh"] for node in file.items("nodes") if "mesh" in node}
    everything = {
        (index, i): primitive.get("material")
        for index, mesh in enumerate(file.items("meshes"))
        if index in used
        for i, primitive in enumerate(primitives(file, mesh))
        if primitive.get("mode", 4) in _TRIANGLES
    }
    if not everything:
        raise InputError(f"glTF {str(file.path)!r}", "no node has triangles", "give a file with a mesh")
    lit = [place for place, index in everything.items() if index is not None and materials[index].transmits]
    return lit or list(everything)


def _name(file: GltfFile, place: Place) -> str:
    mesh = file.item("meshes", place[0])
    users = [node for node in file.items("nodes") if node.get("mesh") == place[0] and node.get("name")]
    name = str(mesh.get("name") or (users[0]["name"] if users else f"mesh {place[0]}"))
    return name + (f"[{place[1]}]" if len(mesh["primitives"]) > 1 else "")


def _tex_coord(primitive: Json, material: GltfMaterial | None) -> int | None:
    """Set of UVs for the thickness texture, if the primitive has one."""
    wanted = material.thickness_transform.tex_coord if material and material.has_thickness_texture else 0
    return next((n for n in (wanted, 0) if f"TEXCOORD_{n}" in primitive["attributes"]), None)


def _read(file: GltfFile, primitive: Json, name: str, metres: float, tex_coord: int | None) -> Mesh:
    attributes = {"POSITION": primitive["attributes"].get("POSITION")}
    if tex_coord is not None:
        attributes["TEXCOORD_0"] = primitive["attributes"][f"TEXCOORD_{tex_coord}"]
    mesh = primitive_mesh(Accessors(file), {**primitive, "attributes": attributes}, name)
    assert mesh is not None  # its mode is one of triangles
    return mesh if metres == 1.0 else dataclasses.replace(mesh, vertices=mesh.vertices * metres)


def _transformed(mesh: Mesh, material: GltfMaterial | None, tex_coord: int) -> tuple[Mesh, bool]:
    """The mesh with UVs as the thickness texture that the material has sees them, where that is of use."""
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
    """What attenuation the material states, whatever its thickness is so far."""
    if material is None or not np.isfinite(material.attenuation_distance):
        return None
    return Medium(absorption=extinction_at(material.attenuation_color, material.attenuation_distance) / metres)


def add_uv(builder: GlbBuilder, primitive: Json, name: str, size: int) -> int:
    """Give a primitive new UVs as its next set; vertices on seams are repeated with all that belongs to them.

    Raises
    ------
    InputError
        If it is a strip or fan, or compressed, or xatlas is missing.
    """
    file = builder.file()
    accessors = Accessors(file)
    asked = f"new UVs for {name!r} of {str(file.path)!r}"
    if primitive.get("mode", 4) != 4:
        raise InputError(asked, "it is a strip or fan", "export it as a list of triangles, or with UVs")
    if _COMPRESSIONS[0] in primitive.get("extensions", {}):
        raise InputError(asked, "its vertices are compressed", "export it without compression")
    positions = accessors.vectors(primitive["attributes"].get("POSITION"), "VEC3")
    corners = accessors.indices(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    if len(corners) % 3 or corners.max(initial=0) >= len(positions):
        raise InputError(asked, "its indices make no triangles", "export the file again")
    made = unwrap(Mesh(positions, corners.reshape(-1, 3).astype(np.int32), name=name), size, None)
    assert made.mesh.uv is not None
    for holder in [primitive["attributes"], *primitive.get("targets", [])]:
        for key, index in holder.items():
            holder[key] = _repeated(builder, accessors, index, made.vertex)
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
