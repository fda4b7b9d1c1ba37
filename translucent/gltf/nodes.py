"""Nodes of a glTF file: their transforms, the primitives and variants of their meshes, and the stated thickness.

The thickness factor of a material (times the texture's G channel) is a length in the mesh's own space. Along a
direction v, a unit vector **of that space**, it is |M v| times as long in the world, with M the node's matrix. Scaling
a world direction by the lengths of M's columns instead, as several renderers do, is right only where the axes of mesh
and world coincide.

Source: KHR_materials_volume ("thickness in the coordinate space of the mesh"), KHR_materials_variants, glTF 2.0
section 3.5.

Not read: skins, morph targets, instancing extensions. Animations: `translucent.gltf.animations`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError, close_names, did_you_mean
from translucent.files.reading import shown
from translucent.files.unpacking import open_picture
from translucent.gltf.fields import JsonFields
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.materials import GltfMaterial
from translucent.gltf.textures import sample

VARIANTS = "KHR_materials_variants"


def node_transforms(file: GltfFile) -> dict[int, Array]:
    """Node-to-world transform (4x4) of every node, by its index.

    Raises
    ------
    InputError
        If the nodes form no trees, or an index or a transform is wrong.
    """
    nodes = file.items("nodes")
    transforms: dict[int, Array] = {}
    children = {child for node in nodes for child in _indices(file, node)}
    pending = [(index, np.eye(4)) for index in range(len(nodes)) if index not in children]
    while pending:
        index, above = pending.pop()
        if index in transforms:
            raise file.refused(f"node {index} has two parents")
        transforms[index] = above @ _local(file, index, nodes[index])
        pending += [(child, transforms[index]) for child in _indices(file, nodes[index])]
    if len(transforms) < len(nodes):
        raise file.refused("nodes are their own parents")
    return transforms


def primitives(file: GltfFile, mesh: Json) -> list[Json]:
    """The primitives of a mesh; raises `InputError` if they are not a list of objects."""
    found = mesh.get("primitives")
    if not (isinstance(found, list) and all(isinstance(item, dict) for item in found)):
        raise file.refused("a mesh has no list of primitives")
    for primitive in found:
        if not isinstance(primitive.get("attributes"), dict):
            raise file.refused("a primitive has no attributes")
        if "material" in primitive:
            file.item("materials", primitive["material"])
    return found


def variant_names(file: GltfFile) -> tuple[str, ...]:
    """Names of the variants of a file, in its order; raises `InputError` if they are not a list of named objects."""
    listed = JsonFields(file, "the file", file.tree).extension(VARIANTS).values.get("variants", [])
    if not (isinstance(listed, list) and all(isinstance(one, dict) for one in listed)):
        raise file.refused(f"{VARIANTS}: variants is not a list of objects")
    return tuple(str(one.get("name", f"variant {i}")) for i, one in enumerate(listed))


def variant_index(file: GltfFile, name: str | None) -> int | None:
    """Index of a variant by its name; None for None, the file's own materials.

    Raises
    ------
    InputError
        If there is no such variant.
    """
    if name is None:
        return None
    names = variant_names(file)
    if name in names:
        return names.index(name)
    asked = f"variant {name!r} of {str(file.path)!r}"
    if not names:
        raise InputError(asked, f"it has no variants ({VARIANTS})", "leave the variant out")
    near = close_names(name, names)
    do = f"use one of {', '.join(names)}"
    raise InputError(asked, "no such variant", f"{did_you_mean(near)} {do}" if near else do)


def material_index(file: GltfFile, primitive: Json, variant: int | None) -> int | None:
    """Index of the material that a primitive has in a variant, if it has any.

    Raises
    ------
    InputError
        If its mappings are not a list of materials with lists of variants.
    """
    own: int | None = primitive.get("material")
    if variant is None:
        return own
    mappings = JsonFields(file, "a primitive", primitive).extension(VARIANTS).values.get("mappings", [])
    if not (isinstance(mappings, list) and all(isinstance(one, dict) for one in mappings)):
        raise file.refused(f"{VARIANTS}: mappings is not a list of objects")
    for mapping in mappings:
        users = mapping.get("variants")
        if not isinstance(users, list):
            raise file.refused(f"{VARIANTS}: a mapping has no list of variants")
        if variant in users:
            file.item("materials", mapping.get("material"))
            return int(mapping["material"])
    return own


def variant_materials(file: GltfFile, primitive: Json) -> list[int]:
    """Materials that variants give a primitive."""
    try:
        mappings = primitive.get("extensions", {}).get(VARIANTS, {}).get("mappings", [])
        return [int(mapping["material"]) for mapping in mappings]
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise file.refused(f"{VARIANTS} is malformed") from error


def _indices(file: GltfFile, node: Json) -> list[int]:
    found = node.get("children", [])
    if not isinstance(found, list):
        raise file.refused(f"children {found!r}")
    for index in found:
        file.item("nodes", index)
    return found


def _local(file: GltfFile, index: int, node: Json) -> Array:
    """Local 4x4 matrix of a node; glTF lists matrices by columns, and quaternions as x, y, z, w."""
    try:
        if "matrix" in node:
            return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), dtype=np.float64)
        scale = np.array(node.get("scale", [1, 1, 1]), dtype=np.float64).reshape(3)
        matrix = np.eye(4)
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix[:3, :3] = turn * scale
        matrix[:3, 3] = np.array(node.get("translation", [0, 0, 0]), dtype=np.float64).reshape(3)
    except (TypeError, ValueError) as error:
        raise file.refused(f"node {index} has no valid transform") from error
    return matrix


def thickness_map(file: GltfFile, material: GltfMaterial) -> Array | None:
    """(h, w): thickness in mesh space, factor times the G channel of the texture; None if it has no texture.

    Row 0 is v = 0, the top of the image. The values are linear, as stored. 8-bit images have steps of factor / 255.

    Raises
    ------
    InputError
        If the image is missing or cannot be read.
    """
    if material.thickness_texture is None:
        return None
    texture = file.item("textures", material.thickness_texture)
    data = file.resource(file.item("images", texture.get("source")))
    asked = f"glTF {str(file.path)!r}: its thickness texture"
    try:
        with open_picture(data, asked, ("PNG", "JPEG"), per_pixel=40, do="export the file again") as image:
            # Pillow reads 16-bit gray as it is, and 16-bit RGB as 8-bit.
            deep = image.mode.startswith("I")
            levels = np.asarray(image if deep else image.convert("RGB"), dtype=np.float64)
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(asked, f"it cannot be read ({shown(error)})", "export the file again") from error
    return material.thickness * (levels / 65535.0 if deep else levels[..., 1] / 255.0)


def thickness_at(file: GltfFile, material: GltfMaterial, uv: npt.ArrayLike) -> Array:
    """(...,): thickness in mesh space at UVs of the mesh, with the texture's transform, wrapping and interpolation.

    Parameters
    ----------
    file : GltfFile
    material : GltfMaterial
        Of that file. Without a thickness texture, its thickness is the same everywhere.
    uv : array_like (..., 2)
        As glTF has them, v = 0 at the top of the image; those of the set `material.thickness_transform.tex_coord`.

    Raises
    ------
    InputError
        If the image is missing or cannot be read, or the UVs are not finite pairs.
    """
    coordinates = np.asarray(uv, dtype=np.float64)
    if coordinates.shape[-1:] != (2,) or not np.isfinite(coordinates).all():
        raise InputError(f"UVs of shape {coordinates.shape}", "not finite pairs (..., 2)", "give u and v")
    image = thickness_map(file, material)
    if image is None:
        return np.full(coordinates.shape[:-1], material.thickness)
    texture = file.item("textures", material.thickness_texture)
    sampler = file.item("samplers", texture["sampler"]) if "sampler" in texture else {}
    return sample(image, material.thickness_transform.apply(coordinates), sampler)
