"""Writing of a medium into the materials of a glTF file; everything else in the file keeps its meaning.

Per target material: KHR_materials_transmission (factor 1, unless it is already above 0), KHR_materials_volume
(color at a distance, thickness) and KHR_materials_ior. metallicFactor becomes 0, since metal transmits nothing, and
doubleSided is dropped, since it has no effect on the boundary of a volume. Names, other extensions, textures,
animations and binary data stay. The formulas, their source and what glTF cannot hold: see `translucent.gltf.materials`.
Material variants (KHR_materials_variants) keep the materials that they name.
"""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from translucent.arguments import checked
from translucent.errors import InputError, TranslucentWarning
from translucent.gltf.file import GltfFile, Json, check_gltf_output, read_gltf, write_gltf
from translucent.gltf.materials import (
    DEFAULT_IOR,
    DIFFUSE_TRANSMISSION,
    DRAFTS,
    IOR,
    SCATTER,
    TRANSMISSION,
    VOLUME,
    Draft,
    draft_extension,
    materials_of,
    volume_extensions_of,
)
from translucent.gltf.nodes import primitives, variant_materials
from translucent.media.medium import Medium, color_at


def volume_extensions(medium: Medium, distance: float | None, thickness: float, ior: float) -> Json:
    """glTF material extensions for this medium.

    Parameters
    ----------
    medium : Medium
        Its extinction is written as absorption.
    distance : float, optional
        Where the color is stated, in metres; None: where the densest channel lets 1/e pass. See `color_at`.
    thickness : float
        thicknessFactor, in mesh space, > 0.
    ior : float
        Index of refraction, >= 1.
    """
    color, metres = color_at(medium, distance)
    volume: Json = {"thicknessFactor": float(thickness)}
    if medium.extinction.any():
        volume |= {"attenuationColor": color.tolist(), "attenuationDistance": metres}
    return {TRANSMISSION: {"transmissionFactor": 1}, VOLUME: volume, IOR: {"ior": ior}}


@checked
def write_medium(
    path_in: str | Path,
    path_out: str | Path,
    medium: Medium,
    *,
    distance: float | None = None,
    object_name: str | None = None,
    thickness: float | None = None,
    keep_ior: bool = False,
    draft_extensions: Draft | None = None,
    allow_outside: bool = False,
) -> list[int]:
    """Give a medium to the objects of a glTF file, and write the file atomically.

    Parameters
    ----------
    path_in, path_out : path
        .gltf or .glb, in any combination; they may be the same.
    medium : Medium
        Emission is lost, and without `draft_extensions` scattering and anisotropy, with a `TranslucentWarning`.
    distance : float, optional
        Where the color is stated, in metres: what the medium was made with. None: where the densest channel lets 1/e
        pass.
    object_name : str, optional
        Name of nodes or meshes. A material that others use, too, is duplicated. None: what light enters already, or
        all objects where that is none.
    thickness : float, optional
        thicknessFactor in the mesh's own units, > 0. None: what the material has, else the smallest side of the
        object's box (of the largest of several).
    keep_ior : bool
        Leave each material its index of refraction instead of writing that of the medium.
    draft_extensions : {"scatter", "volume-scatter"}, optional
        Write scattering by a draft: KHR_materials_scatter, the newer one, or KHR_materials_volume_scatter.
    allow_outside : bool
        Whether files that it links to may lie outside its folder; a .glb holds a copy of them.

    Returns
    -------
    list of int
        Indices of the materials that hold the medium.

    Raises
    ------
    InputError
        If the file cannot be read, no object has that name, or a material excludes a volume.
    RenderError
        If the file cannot be written.
    """
    if thickness is not None and not 0 < thickness < math.inf:
        raise InputError(
            f"thickness {thickness!r}", "the thickness must be finite and above 0", "use a length such as 0.02"
        )
    filling = Filling(medium, distance, object_name, thickness, keep_ior)
    return write_media(path_in, path_out, [filling], draft_extensions=draft_extensions, allow_outside=allow_outside)


@dataclass(frozen=True)
class Filling:
    """Medium of some objects, with the choices of `write_medium`."""

    medium: Medium
    distance: float | None = None
    object_name: str | None = None
    thickness: float | None = None
    keep_ior: bool = False


def write_media(
    path_in: str | Path,
    path_out: str | Path,
    fillings: Sequence[Filling],
    *,
    draft_extensions: Draft | None = None,
    allow_outside: bool = False,
) -> list[int]:
    """Give media to objects of a glTF file one after the other, and write the file atomically, as `write_medium`."""
    check_gltf_output(Path(path_out))
    if draft_extensions is not None and draft_extensions not in DRAFTS:
        known = f"use {' or '.join(map(repr, DRAFTS))}, or None"
        raise InputError(f"draft_extensions {draft_extensions!r}", "no draft extension has this name", known)
    file = read_gltf(path_in, allow_outside)
    entered = {material.index for material in materials_of(file) if material.transmission > 0}
    tree = copy.deepcopy(file.tree)
    edited = GltfFile(file.path, tree, file.chunks, file.allow_outside)
    held: set[int] = set()
    for filling in fillings:
        targets = _own_materials(edited, filling.object_name, entered)
        for index, sizes in targets.items():
            _fill(edited, index, filling, sizes)
            if draft_extensions is not None:
                _state_scattering(edited, index, filling.medium, draft_extensions)
        held |= targets.keys()
    used = tree.setdefault("extensionsUsed", [])
    if not isinstance(used, list):
        raise file.refused(f"extensionsUsed is {used!r}, not a list")
    stated = {name for material in tree["materials"] for name in material.get("extensions", {})}
    used += [name for name in (TRANSMISSION, VOLUME, IOR, *DRAFTS.values()) if name in stated and name not in used]
    media = [filling.medium for filling in fillings]
    if any(medium.emits or (medium.scatters and draft_extensions is None) for medium in media):
        lost = "glTF stores only absorption: scattering is written as absorption, and emission is left out"
        if draft_extensions is not None:
            lost = "glTF cannot store emission of volumes: emission is left out"
        warnings.warn(lost, TranslucentWarning, stacklevel=4)
    write_gltf(edited, path_out)
    return sorted(held)


def _own_materials(file: GltfFile, object_name: str | None, entered: set[int]) -> dict[int, list[float]]:
    """Indices of materials used only by the named objects, each with the sizes of its objects.

    Without a name: materials that light enters, or all of them where it enters none.
    """
    meshes = file.items("meshes")
    mine = set(range(len(meshes))) if object_name is None else _meshes_named(file, object_name)
    if not mine:
        raise file.refused("the file has no mesh", "give a model with a mesh")
    used = {primitive.get("material") for index in mine for primitive in primitives(file, meshes[index])}
    chosen = used & entered if object_name is None else set()
    every = [(index, primitive) for index, mesh in enumerate(meshes) for primitive in primitives(file, mesh)]
    taken = {primitive.get("material") for index, primitive in every if index not in mine}
    taken |= {material for _, primitive in every for material in variant_materials(file, primitive)}
    copies: dict[Any, int] = {}
    sizes: dict[int, list[float]] = {}
    materials = file.tree.setdefault("materials", [])
    for index in sorted(mine):
        for primitive in primitives(file, meshes[index]):
            old = primitive.get("material")
            if chosen and old not in chosen:
                continue
            if old is None or old in taken:
                if old not in copies:
                    copies[old] = len(materials)
                    materials.append(_copy(file, old, object_name))
                primitive["material"] = copies[old]
            sizes.setdefault(primitive["material"], []).append(_smallest_side(file, primitive))
    return sizes


def _copy(file: GltfFile, index: object, object_name: str | None) -> Json:
    """Duplicate a material under the object's name, or make a new one if there was none."""
    if index is None:
        return {"name": object_name or "medium", "pbrMetallicRoughness": {"roughnessFactor": 0}}
    made = copy.deepcopy(file.item("materials", index))
    made["name"] = f"{made.get('name', 'material')} ({object_name or 'medium'})"
    return made


def _meshes_named(file: GltfFile, name: str) -> set[int]:
    """Meshes of the nodes with this name, or with this name themselves; meshes that other nodes use are duplicated."""
    nodes, meshes = file.items("nodes"), file.items("meshes")
    named = [node for node in nodes if "mesh" in node and node.get("name") == name]
    if not named:
        found = {index for index, mesh in enumerate(meshes) if mesh.get("name") == name}
        if not found:
            known = {str(n.get("name", file.item("meshes", n["mesh"]).get("name", ""))) for n in nodes if "mesh" in n}
            raise InputError(
                f"object {name!r}",
                f"no mesh in {str(file.path)!r} has this name",
                f"use one of {', '.join(sorted(known - {''})) or 'none: its objects have no names'}",
            )
        return found
    copies: dict[int, int] = {}
    for node in named:
        old = node["mesh"]
        mesh = file.item("meshes", old)
        if any(other.get("mesh") == old and other.get("name") != name for other in nodes):
            if old not in copies:
                copies[old] = len(meshes)
                meshes.append(copy.deepcopy(mesh))
            node["mesh"] = copies[old]
        else:
            copies[old] = old
    return set(copies.values())


def _smallest_side(file: GltfFile, primitive: Json) -> float:
    """Smallest side of a primitive's box, which glTF states with its positions."""
    accessor = file.item("accessors", primitive["attributes"].get("POSITION"))
    try:
        return min(float(high) - float(low) for low, high in zip(accessor["min"], accessor["max"], strict=True))
    except (KeyError, TypeError, ValueError) as error:
        raise file.refused("the positions have no min and max") from error


def _fill(file: GltfFile, index: int, filling: Filling, sizes: list[float]) -> None:
    """Write the medium into one material, whose objects have these smallest sides."""
    material = file.item("materials", index)
    extensions = volume_extensions_of(index, material)
    before = extensions.get(VOLUME, {})
    factor = before.get("thicknessFactor", 0) or max(sizes) if filling.thickness is None else filling.thickness
    if not factor > 0:
        requested = f"material {index} {material.get('name', '')!r}"
        raise InputError(
            requested,
            "the objects are flat, so they have no default thickness",
            "give a thickness, or choose another object",
        )
    ior = extensions.get(IOR, {}).get("ior", DEFAULT_IOR) if filling.keep_ior else filling.medium.ior
    made = volume_extensions(filling.medium, filling.distance, factor, ior)
    kept = {key: value for key, value in before.items() if key not in ("attenuationColor", "attenuationDistance")}
    made[VOLUME] = kept | made[VOLUME]
    made[IOR] = extensions.get(IOR, {}) | made[IOR]
    if filling.keep_ior and IOR not in extensions:
        del made[IOR]
    passing = extensions.get(TRANSMISSION, {})
    if passing.get("transmissionFactor", 0) > 0:
        del made[TRANSMISSION]
    else:
        made[TRANSMISSION] = passing | made[TRANSMISSION]
    extensions.update(made)
    material.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 0
    material.pop("doubleSided", None)


def _state_scattering(file: GltfFile, index: int, medium: Medium, draft: Draft) -> None:
    """Write scattering into a material, by a draft extension."""
    material = file.item("materials", index)
    extensions, made = material["extensions"], draft_extension(medium, draft)
    if SCATTER in made and DIFFUSE_TRANSMISSION in extensions:
        requested = f"material {index} {material.get('name', '')!r}"
        do = "give the object another material, or write the draft 'volume-scatter'"
        raise InputError(requested, f"{DIFFUSE_TRANSMISSION} excludes {SCATTER}", do)
    for name in DRAFTS.values():
        extensions.pop(name, None)
    extensions.update(made)
