"""Writing of thickness maps into a glTF file: thicknessFactor = max, and max * G / 255 is the thickness in mesh space.

Per primitive: a material of its own, KHR_materials_volume with factor and texture, and KHR_materials_transmission with
factor 1 where no light came in so far. Then metallicFactor becomes 0, too, since metal transmits nothing. doubleSided
is dropped, since it has no effect on the boundary of a volume and validators warn of it. Everything else stays: other
textures and their channels, extensions, extras, nodes, animations, cameras, lights, unknown chunks.

Lost: standard errors and what is finer than max / 255, which the record states as the quantum. The texture is a new
image with R = B = 0; an image that the material had before stays in the file.

Source: Khronos, KHR_materials_volume, KHR_materials_transmission, KHR_texture_transform.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.bake.baked import BakedMap
from translucent.bake.encoding import Encoding
from translucent.bake.gltf.bodies import PrimitiveKey
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.targets import Target
from translucent.bake.record import Record, describe, shared, unit_of, write_record
from translucent.errors import InputError
from translucent.files.images import write_png
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.materials import EXCLUDED, TRANSMISSION, VOLUME
from translucent.gltf.textures import TEXTURE_TRANSFORM
from translucent.gltf.write_file import write_gltf
from translucent.media.medium import Medium, color_at

#: Largest level of an 8-bit channel.
LEVELS = 255

_DIFFUSE = "KHR_materials_diffuse_transmission"
_LINEAR, _MIPMAPS, _REPEAT, _CLAMP = 9729, 9987, 10497, 33071


def write_maps(
    model: GltfFile | GlbBuilder,
    path: Path,
    results: Mapping[PrimitiveKey, BakedMap],
    *,
    targets: Mapping[PrimitiveKey, Target] | None = None,
    metres: float = 1.0,
    medium: Medium | None = None,
    about: Record | None = None,
) -> Record:
    """Write a .glb with these maps, and its record beside it.

    Parameters
    ----------
    model : GltfFile or GlbBuilder
    path : Path
        A .glb file.
    results : mapping of (mesh, primitive) to BakedMap
    targets : mapping, optional
        Which UVs the maps belong to. Default: TEXCOORD_0.
    metres : float
        Per unit of the file.
    medium : Medium, optional
        For materials that state no attenuation.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError
        If no map has any thickness, or they are of the mode that has no unit, or a material excludes a volume.
    RenderError
        If a file cannot be written.
    """
    builder = model if isinstance(model, GlbBuilder) else GlbBuilder(model)
    told: list[Record] = []
    for key, result in results.items():
        if unit_of(result.settings.mode) != "m":
            raise InputError(f"output {str(path)!r}", f"mode {result.settings.mode!r} has no unit", "bake lengths")
        encoding = Encoding.of(result.values, LEVELS)
        one = {"place": list(key), **describe(result, encoding)}
        if result.values.max() > 0:
            target = (targets or {}).get(key) or Target(key, result.mesh)
            one |= _give(builder, target, result, encoding, metres, medium)
        else:
            one["warnings"] = ["no thickness: its material is left as it is"]
        told.append(one)
    if not any("material" in one for one in told):
        raise InputError(f"output {str(path)!r}", "the thickness is 0 everywhere", "give a model with an inside")
    write_gltf(builder.file(), path)
    return write_record(path, {**(about or {}), **shared(told), "maps": told})


def _give(
    builder: GlbBuilder,
    target: Target,
    result: BakedMap,
    encoding: Encoding,
    metres: float,
    medium: Medium | None,
) -> Record:
    """Write a map into the material of one primitive; returns its entry in the record."""
    index = builder.own_material(*target.key)
    material = builder.tree["materials"][index]
    extensions = material.setdefault("extensions", {})
    if excluded := [name for name in EXCLUDED if name in extensions]:
        asked = f"material {index} {material.get('name', '')!r}"
        raise InputError(asked, f"{excluded[0]} excludes a volume", "give the object another material")
    _let_light_in(material, extensions)
    volume = extensions.setdefault(VOLUME, {})
    if medium is not None and "attenuationDistance" not in volume and medium.extinction.any():
        color, distance = color_at(medium, None)
        volume |= {"attenuationColor": color.tolist(), "attenuationDistance": distance / metres}
    factor = encoding.scale * encoding.levels / metres
    volume["thicknessFactor"] = factor
    texture = _add_texture(builder, result, encoding)
    volume["thicknessTexture"] = _texture_info(volume.get("thicknessTexture", {}), texture, target)
    for name in (VOLUME, TRANSMISSION):
        if name in extensions:
            builder.use_extension(name)
    return {"material": index, "texture": texture, "thickness_factor": factor, "tex_coord": target.tex_coord}


def _let_light_in(material: Json, extensions: Json) -> None:
    diffuse = extensions.get(_DIFFUSE, {}).get("diffuseTransmissionFactor", 0)
    if not (extensions.get(TRANSMISSION, {}).get("transmissionFactor", 0) > 0 or diffuse > 0):
        extensions.setdefault(TRANSMISSION, {})["transmissionFactor"] = 1
        material.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 0
    material.pop("doubleSided", None)


def _texture_info(old: Json, texture: int, target: Target) -> Json:
    """Texture info of the new texture; the transform of the old one stays if the map was baked for it."""
    extensions = {
        k: v for k, v in old.get("extensions", {}).items() if k != TEXTURE_TRANSFORM or target.keeps_transform
    }
    kept = {key: value for key, value in old.items() if key not in ("index", "texCoord", "extensions")}
    info = {**kept, "index": texture}
    if target.keeps_transform:
        info |= {"texCoord": old["texCoord"]} if "texCoord" in old else {}
    elif target.tex_coord:
        info["texCoord"] = target.tex_coord
    return {**info, "extensions": extensions} if extensions else info


def _add_texture(builder: GlbBuilder, result: BakedMap, encoding: Encoding) -> int:
    """Index of a new texture with the map in its G channel."""
    view = builder.add_view(_png(encoding.encode(result.values)))
    name = f"{result.mesh.name} thickness"
    image = builder.add("images", {"name": name, "bufferView": view, "mimeType": "image/png"})
    wanted = {"magFilter": _LINEAR, "minFilter": _MIPMAPS, **wrapping(result.mesh)}
    samplers = builder.tree.setdefault("samplers", [])
    sampler = samplers.index(wanted) if wanted in samplers else builder.add("samplers", wanted)
    return builder.add("textures", {"name": name, "sampler": sampler, "source": image})


def wrapping(mesh: Mesh) -> Json:
    """Wrapping mode of a sampler for a map of this mesh.

    Clamped, it does not mix the map's left and right sides; UVs beyond 0..1 mean that the map repeats.
    """
    wrap = _CLAMP if mesh.uv is not None and mesh.uv.min() >= 0 and mesh.uv.max() <= 1 else _REPEAT
    return {"wrapS": wrap, "wrapT": wrap}


def _png(levels: npt.NDArray[Any]) -> bytes:
    color = np.zeros((*levels.shape, 3), np.uint8)
    color[..., 1] = levels
    stream = io.BytesIO()
    write_png(stream, color)
    return stream.getvalue()
