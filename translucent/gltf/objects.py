"""Objects of a glTF scene: the primitives that its nodes place, with their materials."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from translucent.arrays import Array
from translucent.geometry.mesh import MIN_DIAGONAL, Mesh
from translucent.gltf.accessors import Accessors
from translucent.gltf.fields import label, refused
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.geometry import primitive_mesh
from translucent.gltf.left_out import LeftOut
from translucent.gltf.scene_media import primitives
from translucent.gltf.surfaces import VERTEX_COLORED, Finish, finish_reader
from translucent.gltf.variants import material_index, variant_index
from translucent.media.medium import Medium
from translucent.scene.scene import Object
from translucent.scene.surface import TEXTURE_FIELDS, Surface

#: Thickness of a thin wall as a share of the scene's diagonal: too little to see, enough to count as covered.
WALL_SHARE = 1e-5

#: Medium of a partly transparent layer: empty.
_CLEAR = Medium()

#: Message about alphaMode BLEND.
BLENDED = (
    "alphaMode BLEND, drawn as thin sheets that cover a share of what is behind, sorted by object as in viewers; they "
    "cast no shadows, and rays that bend do not meet them"
)

#: Smallest share of metal in a texture that is not taken for noise.
_METAL = 0.1


def scene_objects(
    file: GltfFile,
    transforms: dict[int, Array],
    metres: float,
    left_out: LeftOut,
    draft_extensions: bool = False,
    variant: str | None = None,
) -> list[Object]:
    """Objects of a scene, one per node and primitive, with their materials.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    metres : float
        Per unit of the file.
    left_out : LeftOut
        Gets what the objects do not hold.
    variant : str, optional
        Name of the variant whose materials they have.
    draft_extensions : bool
        Whether extensions that are drafts count.

    Raises
    ------
    InputError
        If there is no object or no such variant, or something about one is wrong.
    """
    finish_of = finish_reader(file, metres, left_out, draft_extensions)
    scale = np.diag([metres, metres, metres, 1.0])
    objects: list[Object] = []
    finishes: list[Finish] = []
    for mesh, material, node in _placed_meshes(file, transforms, left_out, variant_index(file, variant)):
        finish, surface = _fitted(finish_of(material), mesh, left_out)
        if finish.hidden:
            left_out.add("objects hidden by their alpha", repr(mesh.name))
            continue
        objects.append(Object(mesh, None, scale @ transforms[node], color=finish.color, surface=surface))
        finishes.append(finish)
    if not objects:
        raise refused(file, "its scene has no triangles", "give a file with a mesh")
    boxes = np.stack([item.bounds for item in objects])
    diagonal = float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)))
    wall = max(WALL_SHARE * diagonal, MIN_DIAGONAL)
    return [_with_medium(item, finish, wall) for item, finish in zip(objects, finishes, strict=True)]


def _fitted(finish: Finish, mesh: Mesh, left_out: LeftOut) -> tuple[Finish, Surface | None]:
    """Finish of a material on a mesh, and the part of its surface that the mesh supports."""
    if finish.surface is None and mesh.colors is not None:
        finish = VERTEX_COLORED
    if finish.unlit and mesh.colors is not None and (mesh.colors[:, :3] < 1).any():
        left_out.add("vertex colors of unlit objects", repr(mesh.name))
    if (surface := _fitting(finish.surface, mesh, left_out)) is None:
        return finish, None
    if finish.blends:
        finish = _blended(finish, surface, mesh, left_out)
    if finish.medium is not None and not finish.hidden:
        surface = _without_holes(surface, finish, mesh, left_out)
    if finish.translucent and _has_metal(surface, mesh):
        left_out.add("metal parts of translucent objects", repr(mesh.name))
    return finish, surface


def _blended(finish: Finish, surface: Surface, mesh: Mesh, left_out: LeftOut) -> Finish:
    """Finish of a material with alphaMode BLEND on a mesh: opaque where its alpha is 1 all over, and hidden where it is
    0.
    """
    least = finish.opacity * _alpha(surface, mesh)
    if finish.translucent:
        if least < 1:
            left_out.add("alphaMode BLEND of translucent objects", finish.name)
        return finish
    if finish.opacity == 0:
        return dataclasses.replace(finish, hidden=True)
    if least == 1:
        return dataclasses.replace(finish, blends=False)
    left_out.add(BLENDED, finish.name)
    return finish


def _without_holes(surface: Surface, finish: Finish, mesh: Mesh, left_out: LeftOut) -> Surface:
    """Surface of a solid without holes, since a solid cannot have any."""
    if surface.alpha_cutoff > _alpha(surface, mesh):
        what = "holes of solids by alphaMode MASK, drawn closed (a solid with a hole has no inside)"
        left_out.add(what, finish.name)
    return dataclasses.replace(surface, alpha_cutoff=0.0)


def _alpha(surface: Surface, mesh: Mesh) -> float:
    """Smallest alpha of texture and vertices."""
    pixels = None if surface.color_texture is None else surface.color_texture.pixels
    least = 1.0 if pixels is None or pixels.shape[2] < 4 else float(pixels[..., 3].min())
    return least * (1.0 if mesh.colors is None else float(mesh.colors[:, 3].min()))


def _with_medium(item: Object, finish: Finish, wall: float) -> Object:
    if item.surface is not None and finish.blends and not finish.translucent:
        surface = dataclasses.replace(item.surface, opacity=finish.opacity)
        return dataclasses.replace(item, medium=_CLEAR, sheet_thickness=wall, surface=surface)
    if finish.wall_ior is not None:
        return dataclasses.replace(item, medium=finish.wall_medium(wall), sheet_thickness=wall)
    return dataclasses.replace(item, medium=finish.medium)


def _fitting(surface: Surface | None, mesh: Mesh, left_out: LeftOut) -> Surface | None:
    """Surface without its textures if the mesh has no coordinates for them."""
    if surface is None or mesh.uv is not None or not any(surface.textures):
        return surface
    left_out.add("textures of meshes without TEXCOORD_0", repr(mesh.name))
    without: dict[str, Any] = dict.fromkeys(TEXTURE_FIELDS)
    return dataclasses.replace(surface, **without)


def _has_metal(surface: Surface, mesh: Mesh) -> bool:
    """True if a vertex is on metal; a metallicFactor alone does not tell, since its default is 1 for glass, too."""
    if surface.metallic == 0 or surface.roughness_texture is None or mesh.uv is None:
        return False
    return bool((surface.roughness_texture.sample(mesh.uv)[:, 2] > _METAL).any())


def _placed_meshes(
    file: GltfFile, transforms: dict[int, Array], left_out: LeftOut, variant: int | None
) -> Iterator[tuple[Mesh, int | None, int]]:
    """Mesh, material and node of every primitive that a node places; each mesh is read once."""
    nodes = file.items("nodes")
    accessors = Accessors(file)
    placed = {node: nodes[node]["mesh"] for node in transforms if "mesh" in nodes[node]}
    users = Counter(index for index in placed.values() if isinstance(index, int))
    known: dict[tuple[int, int], Mesh | None] = {}
    for node, index in placed.items():
        entry = file.item("meshes", index)
        if not transforms[node][:3, :3].any():
            # "This provides a mechanism to animate visibility" (glTF 2.0, section on transformations).
            left_out.add("objects hidden by a scale of 0", label(nodes, node))
            continue
        for i, primitive in enumerate(listed := primitives(file, entry)):
            if (index, i) not in known:
                name = _mesh_name(nodes[node], entry, index, shared=users[index] > 1) + (
                    f"[{i}]" if len(listed) > 1 else ""
                )
                known[index, i] = primitive_mesh(accessors, primitive, name)
                _note_losses(primitive, name, known[index, i], left_out)
            if (mesh := known[index, i]) is not None:
                yield mesh, material_index(file, primitive, variant), node


def _mesh_name(node: Json, entry: Json, index: int, *, shared: bool) -> str:
    """Name of an object: that of the only node that uses its mesh, or of the mesh, or of its first node."""
    names = [node.get("name"), entry.get("name")]
    for name in names[::-1] if shared else names:
        if isinstance(name, str) and name:
            return name
    return f"mesh {index}"


def _note_losses(primitive: Json, name: str, mesh: Mesh | None, left_out: LeftOut) -> None:
    if mesh is None:
        left_out.add("points and lines", repr(name))
        return
    if primitive.get("targets"):
        left_out.add("morph targets", repr(name))
