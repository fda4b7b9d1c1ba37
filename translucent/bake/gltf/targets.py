"""Targets of a bake: the primitives of a glTF file that get thickness, and their meshes.

Those whose material lets light in, but for open meshes that it makes thin walls: they have no inside. Where no material
lets light in, all triangles, whose materials then will. Each is baked in the mesh's own space, as glTF states
thickness, so nodes that share a mesh share the map, whatever their scale. What is open by itself belongs to a body that
others close, see `translucent.bake.gltf.bodies`.

The UVs are those that the material reads its thickness texture at (KHR_texture_transform included, as long as it keeps
them in 0..1), else TEXCOORD_0, else new ones as the next set.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.bake.gltf.bodies import Bodies, PrimitiveKey, primitive_name, read_primitive, triangle_primitives
from translucent.bake.gltf.builder import INDICES, GlbBuilder
from translucent.bake.unwrap import unwrap
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.gltf.accessors import COMPONENTS, Accessors
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.materials import GltfMaterial, materials_of
from translucent.gltf.textures import TextureTransform
from translucent.media.medium import Medium, extinction_at

_COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


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
        Whether UVs are wanted at all.
    new_uv : bool
        Make new UVs for all of them.
    plain_uv : bool
        Take UVs as they are, without the transform of the thickness texture that a material has.
    size : int
        Texels along each side of the map to come, which the gaps between new charts depend on.
    only : collection of (int, int), optional
        Mesh and primitive of those that count. Default: all.

    Raises
    ------
    InputError
        If the file is compressed, has no triangles, or its data are wrong; if UVs are to be made and xatlas is missing.
    """
    file = builder.file()
    required = file.tree.get("extensionsRequired", [])
    if packed := [name for name in _COMPRESSIONS if name in required]:
        raise InputError(f"glTF {str(file.path)!r}", f"it requires {packed[0]}", "export it without compression")
    materials, bodies = materials_of(file), Bodies(file, metres)
    lit = {
        key: _material(materials, builder.primitive(*key))
        for key in _keys(file, materials)
        if only is None or key in only
    }
    # All that is read of the file as it is, before anything is added to it.
    chosen = {key: bodies.around(key) for key, material in lit.items() if not _is_sheet(material, key, bodies)}
    found: list[Target] = []
    for key, around in chosen.items():
        material, medium = lit[key], _medium(lit[key], metres)
        if not needs_uv:
            found.append(Target(key, read_primitive(file, key, metres), medium=medium))
            continue
        tex_coord, keeps = None if new_uv else _tex_coord(builder.primitive(*key), material), False
        if made := tex_coord is None:
            tex_coord = add_uv(builder, key, size)
        mesh = read_primitive(builder.file() if made else file, key, metres, tex_coord)
        if not (made or plain_uv):
            mesh, keeps = _transformed(mesh, material, tex_coord)
        if around is not None:
            mesh = bodies.wound(key, mesh)
        found.append(Target(key, mesh, tex_coord, keeps, medium, made, around))
    if not found:
        told = f"all that lets light in are thin walls without an inside: {', '.join(_names(file, list(lit)))}"
        raise InputError(f"glTF {str(file.path)!r}", told, "give one of them a volume, or a closed mesh")
    return found


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


def _is_sheet(material: GltfMaterial | None, key: PrimitiveKey, bodies: Bodies) -> bool:
    """True if a primitive is an open mesh that its material makes a thin wall."""
    return material is not None and material.kind == "thin wall" and not bodies.is_closed(key)


def _keys(file: GltfFile, materials: list[GltfMaterial]) -> list[PrimitiveKey]:
    """Triangle primitives of meshes that nodes use: those with a translucent material, or all."""
    everything = {key: primitive.get("material") for key, primitive in triangle_primitives(file).items()}
    if not everything:
        raise InputError(f"glTF {str(file.path)!r}", "no node has triangles", "give a file with a mesh")
    lit = [key for key, index in everything.items() if index is not None and materials[index].transmits]
    return lit or list(everything)


def _tex_coord(primitive: Json, material: GltfMaterial | None) -> int | None:
    """Set of UVs for the thickness texture, if the primitive has one."""
    wanted = material.thickness_transform.tex_coord if material and material.has_thickness_texture else 0
    return next((n for n in (wanted, 0) if f"TEXCOORD_{n}" in primitive["attributes"]), None)


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
