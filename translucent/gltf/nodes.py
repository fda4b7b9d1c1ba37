"""Nodes of a glTF file: their transforms and animations, the primitives and variants of their meshes, and thickness.

The thickness factor of a material (times the texture's G channel) is a length in the mesh's own space. Along a
direction v, a unit vector **of that space**, it is |M v| times as long in the world, with M the node's matrix. Scaling
a world direction by the lengths of M's columns instead, as several renderers do, is right only where the axes of mesh
and world coincide.

Source: KHR_materials_volume ("thickness in the coordinate space of the mesh"), KHR_materials_variants, glTF 2.0
section 3.5.

Not read: instancing extensions. `translucent.gltf.objects` has skins and morph targets.

Animations follow glTF 2.0, section 3.11 and appendix C (interpolation): STEP, LINEAR (spherical for rotations, along
the shorter arc) and CUBICSPLINE. Before the first key of a sampler its first value holds, after the last its last. A
warning names a time after all keys.

All animations of a file play at once, since exporters write one for each object as well as one for each take; where two
move the same property of a node, the first does, with a warning.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning, close_names, did_you_mean
from translucent.files.images import open_picture
from translucent.files.reading import shown
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, Json, JsonFields, LeftOut, label
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
        raise file.refused("some nodes are their own ancestors")
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
    requested = f"variant {name!r} of {str(file.path)!r}"
    if not names:
        raise InputError(requested, f"the file has no material variants ({VARIANTS})", "omit the variant")
    near = close_names(name, names)
    do = f"use one of {', '.join(names)}"
    raise InputError(requested, "the file has no variant of this name", f"{did_you_mean(near)} {do}" if near else do)


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
        raise file.refused(f"the children of a node are {found!r}, not a list")
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
    requested = f"glTF {str(file.path)!r}, thickness texture"
    try:
        with open_picture(data, requested, ("PNG", "JPEG"), per_pixel=40, do="export the file again") as image:
            # Pillow reads 16-bit gray as it is, and 16-bit RGB as 8-bit.
            deep = image.mode.startswith("I")
            levels = np.asarray(image if deep else image.convert("RGB"), dtype=np.float64)
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(requested, f"the file cannot be read ({shown(error)})", "export the model again") from error
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
        raise InputError(
            f"texture coordinates of shape {coordinates.shape}",
            "texture coordinates must be finite pairs (..., 2)",
            "give u and v for each vertex",
        )
    image = thickness_map(file, material)
    if image is None:
        return np.full(coordinates.shape[:-1], material.thickness)
    texture = file.item("textures", material.thickness_texture)
    sampler = file.item("samplers", texture["sampler"]) if "sampler" in texture else {}
    return sample(image, material.thickness_transform.apply(coordinates), sampler)


_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3", "weights": "SCALAR"}
_MODES = ("LINEAR", "STEP", "CUBICSPLINE")

#: Cosine between quaternions from which a straight line between them is as good as an arc.
_NEAR = 1.0 - 1e-9


def posed(file: GltfFile, seconds: float, left_out: LeftOut) -> GltfFile:
    """The file with its nodes as its animations have them at a time.

    Parameters
    ----------
    file : GltfFile
    seconds : float
        >= 0, on the clock of the keys.
    left_out : LeftOut
        Gets what moves and is not supported: what extensions point at.

    Raises
    ------
    InputError
        If the time is negative or not finite, the file has no animation, or one is wrong.
    """
    if not 0 <= seconds < math.inf:
        raise InputError(
            f"time {seconds!r}",
            "the time is negative or not finite",
            "give the seconds since the start of the animations",
        )
    animations = file.items("animations")
    if not animations:
        raise InputError(f"time {seconds:g} of {str(file.path)!r}", "the file has no animations", "omit the time")
    accessors, moved = Accessors(file), [dict(node) for node in file.items("nodes")]
    ends: list[float] = []
    taken: set[tuple[int, str]] = set()
    for number, animation in enumerate(animations):
        name = label(animations, number)
        for channel, target in _channels(file, animation, name):
            path, node = target.get("path"), target.get("node")
            if not isinstance(path, str) or path not in _KINDS or node is None:
                left_out.add(f"animated {path if isinstance(path, str) else 'properties'}", name)
                continue
            file.item("nodes", node)
            if "matrix" in moved[node] and path != "weights":
                raise file.refused(f"animation {name} moves node {label(moved, node)}, whose matrix forbids that")
            if (node, path) in taken:
                left_out.add(f"animations of a property that another animation moves ({path})", name)
                continue
            taken.add((node, path))
            value, end = _value(file, accessors, animation, channel, path, seconds, name)
            moved[node][path] = value.tolist()
            ends.append(end)
    if ends and seconds > max(ends):
        text = f"the animations end after {max(ends):g} s; the pose at {seconds:g} s is the last pose"
        warnings.warn(f"scene {file.path.name!r}: {text}", TranslucentWarning, stacklevel=4)
    return dataclasses.replace(file, tree={**file.tree, "nodes": moved})


def _channels(file: GltfFile, animation: Json, name: str) -> Iterator[tuple[Json, Json]]:
    """Channels of an animation, with their targets."""
    channels = animation.get("channels", [])
    if not (isinstance(channels, list) and all(isinstance(one, dict) for one in channels)):
        raise file.refused(f"animation {name}: channels is not a list of objects")
    for channel in channels:
        target = channel.get("target")
        if not isinstance(target, dict):
            raise file.refused(f"animation {name}: a channel has no target")
        yield channel, target


def _value(
    file: GltfFile, accessors: Accessors, animation: Json, channel: Json, path: str, seconds: float, name: str
) -> tuple[Array, float]:
    """Value of a channel, and the time of its last key."""
    samplers, index = animation.get("samplers", []), channel.get("sampler")
    if not isinstance(samplers, list) or not isinstance(index, int) or not 0 <= index < len(samplers):
        raise file.refused(f"animation {name}: the animation has no sampler {index!r}")
    sampler = samplers[index]
    if not isinstance(sampler, dict) or (mode := sampler.get("interpolation", "LINEAR")) not in _MODES:
        raise file.refused(f"animation {name}: sampler {index} has no interpolation that glTF 2.0 defines")
    times = accessors.vectors(sampler.get("input"), "SCALAR")[:, 0]
    values = accessors.vectors(sampler.get("output"), _KINDS[path])
    per_key = 3 if mode == "CUBICSPLINE" else 1
    if path == "weights" and len(times) and len(values) % (per_key * len(times)) == 0:
        values = values.reshape(per_key * len(times), -1)  # of all targets at a key
    if len(values) != per_key * len(times) or not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise file.refused(f"animation {name}: {len(values)} values for {len(times)} keys, or a value is not finite")
    if (np.diff(times) <= 0).any():
        raise file.refused(f"animation {name}: the keys are not in ascending order of time")
    found = sampled_channel(times, values.reshape(len(times), per_key, -1), seconds, mode, arc=path == "rotation")
    end = float(times[-1])
    if path != "rotation":
        return found, end
    length = float(np.linalg.norm(found))
    if not length > 0:
        raise file.refused(f"animation {name}: a rotation has the length 0")
    return found / length, end


def sampled_channel(times: Array, values: Array, seconds: float, mode: str, *, arc: bool) -> Array:
    """(w,): value at a time of keys (n,), which ascend, with values (n, 1, w); (n, 3, w) of tangents for CUBICSPLINE.

    `arc` says that values are unit quaternions, which LINEAR joins by arcs.
    """
    middle = values.shape[1] // 2
    after = int(np.searchsorted(times, seconds, side="right"))
    if after == 0 or after == len(times) or mode == "STEP":
        return np.asarray(values[max(after - 1, 0), middle])
    start, end = values[after - 1], values[after]
    span = float(times[after] - times[after - 1])
    t = (seconds - float(times[after - 1])) / span
    if mode == "CUBICSPLINE":
        t2, t3 = t * t, t * t * t
        ends = (2 * t3 - 3 * t2 + 1) * start[1] + (3 * t2 - 2 * t3) * end[1]
        return np.asarray(ends + span * ((t3 - 2 * t2 + t) * start[2] + (t3 - t2) * end[0]))
    return _slerp(start[0], end[0], t) if arc else np.asarray((1.0 - t) * start[0] + t * end[0])


def _slerp(start: Array, end: Array, t: float) -> Array:
    cosine = float(start @ end)
    if cosine < 0:  # the same rotation along the shorter arc
        end, cosine = -end, -cosine
    if cosine > _NEAR:
        return np.asarray((1.0 - t) * start + t * end)
    angle = math.acos(cosine)
    return np.asarray((math.sin((1.0 - t) * angle) * start + math.sin(t * angle) * end) / math.sin(angle))
