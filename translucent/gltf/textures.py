"""Textures of glTF materials: the set of UVs, their transform, the sampler's wrapping, and their pictures.

Formula of KHR_texture_transform: u' = offset_u + c scale_u u + s scale_v v, v' = offset_v - s scale_u u + c scale_v v,
with c and s the cosine and sine of the rotation. It is counter-clockwise in the UVs of glTF, whose v points down, as
the words and the example of the extension have it; its GLSL listing rotates in the opposite direction, a known mistake.

Read are PNG and JPEG, from buffer views, data URIs and files beside; all over TEXCOORD_0. A picture that is missing or
broken is left out, and the factors of the material stand alone. Not read: mip levels; between texels, values are
interpolated linearly unless the sampler says nearest.

Source: Khronos, KHR_texture_transform; glTF 2.0, sections 3.8 (textures and samplers) and 3.9 (materials).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from translucent.arrays import Array
from translucent.errors import InputError, UnreadableError
from translucent.files.images import open_picture
from translucent.formulas.color import srgb_to_linear
from translucent.gltf.file import GltfFile, Json, JsonFields, LeftOut, label
from translucent.scene.texture import Texture, Wrap

TEXTURE_TRANSFORM = "KHR_texture_transform"

NEAREST, _REPEAT, _CLAMP, _MIRROR = 9728, 10497, 33071, 33648


Bytes = npt.NDArray[np.uint8]

Pixels = npt.NDArray[np.float32]

#: Largest side of a picture in pixels; larger ones are made smaller.
MAX_SIDE = 4096

#: Largest number of characters of a link in a message; a longer one is named by its index.
_LONGEST_NAME = 60

_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}


@dataclass(frozen=True)
class TextureTransform:
    """Transform from the UVs of a mesh to a texture's own coordinates.

    Parameters
    ----------
    offset, scale : (u, v)
        In units of the texture.
    rotation : float
        Radians.
    tex_coord : int
        The set of UVs: n of TEXCOORD_n.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    tex_coord: int = 0

    def apply(self, uv: npt.ArrayLike) -> Array:
        """(..., 2): coordinates of the texture for UVs (..., 2) of the mesh; v = 0 is the top of the image."""
        u, v = np.moveaxis(np.asarray(uv, dtype=np.float64) * self.scale, -1, 0)
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        return np.stack([c * u + s * v + self.offset[0], c * v - s * u + self.offset[1]], axis=-1)


def texture_transform(info: JsonFields) -> TextureTransform:
    """Transform that a texture info states, or none."""
    stated = info.extension(TEXTURE_TRANSFORM)
    return TextureTransform(
        stated.numbers("offset", (0.0, 0.0)),
        stated.number("rotation", 0.0),
        stated.numbers("scale", (1.0, 1.0)),
        stated.whole("texCoord", info.whole("texCoord", 0)),
    )


def sample(image: Array, coordinates: Array, sampler: Json) -> Array:
    """Sample an image (h, w) at coordinates (..., 2) of a texture with this sampler."""
    height, width = image.shape
    x, y = coordinates[..., 0] * width - 0.5, coordinates[..., 1] * height - 0.5
    if sampler.get("magFilter") == NEAREST:
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    left, top = np.floor(x), np.floor(y)
    columns = [_wrapped(left + i, width, sampler.get("wrapS", _REPEAT)) for i in (0, 1)]
    rows = [_wrapped(top + i, height, sampler.get("wrapT", _REPEAT)) for i in (0, 1)]
    upper, lower = ((1 - (x - left)) * image[row, columns[0]] + (x - left) * image[row, columns[1]] for row in rows)
    return np.asarray((1 - (y - top)) * upper + (y - top) * lower)


def _wrapped(index: Array, size: int, mode: object) -> npt.NDArray[np.intp]:
    """Wrap the index of a texel into the image."""
    if mode == _CLAMP:
        return np.clip(index, 0, size - 1).astype(np.intp)
    if mode == _MIRROR:
        folded = index % (2 * size)
        return np.where(folded < size, folded, 2 * size - 1 - folded).astype(np.intp)
    return (index % size).astype(np.intp)


class Textures:
    """Textures of a file; equal ones are one value.

    Parameters
    ----------
    file : GltfFile
    left_out : LeftOut
        Gets what the textures do not hold.
    """

    def __init__(self, file: GltfFile, left_out: LeftOut) -> None:
        self._file = file
        self._left_out = left_out
        self._pictures: dict[int, Bytes | None] = {}
        self._made: dict[tuple[object, ...], Texture] = {}

    def read(
        self, name: str, holder: Json, key: str, *, srgb: bool = False, normal_scale: float = 1.0, strength: float = 1.0
    ) -> Texture | None:
        """Texture of `holder` under `key`; None if it is absent or cannot be read.

        Parameters
        ----------
        name : str
            Of the material, as messages call it.
        holder : dict
        key : str
        srgb : bool
            Whether the picture's colors are encoded by sRGB.
        normal_scale : float
            Of a normal map, by which the normals' x and y are multiplied.
        strength : float
            Fraction of the picture, 0 to 1, that is mixed into white.

        Raises
        ------
        InputError
            If it points at nothing, its picture is too large, or a value is wrong.
        """
        if key not in holder:
            return None
        where = f"{key} of material {name}"
        info = JsonFields(self._file, where, holder).section(key)
        entry, transform = self._file.item("textures", info.values.get("index")), texture_transform(info)
        if transform.tex_coord != 0:
            self._left_out.add(f"textures with TEXCOORD_{transform.tex_coord}", name)
            return None
        if "source" not in entry:
            self._left_out.add("textures that are neither PNG nor JPEG", name)
            return None
        sampler = self._file.item("samplers", entry["sampler"]) if "sampler" in entry else {}
        if sampler.get("magFilter") == NEAREST:
            self._left_out.add("nearest-neighbor filtering of textures (drawn smooth)", name)
        wraps = tuple(self._wrap(where, sampler, axis) for axis in ("wrapS", "wrapT"))
        made = (entry["source"], srgb, normal_scale, strength, wraps, transform)
        if (picture := self._picture(entry["source"], name)) is None:
            return None
        if made not in self._made:
            pixels = _scaled_normals(_linear(picture, srgb=srgb), normal_scale)
            if strength != 1.0:  # mixed with white
                pixels = (1.0 + strength * (pixels - 1.0)).astype(np.float32)
            self._made[made] = _texture(pixels, wraps, transform)
        return self._made[made]

    def _wrap(self, where: str, sampler: Json, axis: str) -> str:
        code = sampler.get(axis, 10497)
        if not isinstance(code, int) or code not in _WRAPS:
            raise self._file.refused(f"{where}: the value {code!r} of {axis} is not defined in glTF 2.0")
        return _WRAPS[code]

    def _picture(self, index: int, name: str) -> Bytes | None:
        """Picture of an image (h, w, 4), as encoded, large ones made smaller; each is read once. None if unreadable."""
        entry = self._file.item("images", index)
        if index not in self._pictures:
            try:
                data = self._file.resource(entry)
            except UnreadableError:
                if "uri" not in entry:
                    raise  # the buffer is missing, with all else that it holds
                self._pictures[index] = None
            else:
                self._pictures[index] = self._read(data, index, name)
        if self._pictures[index] is None:
            images, uri = self._file.items("images"), entry.get("uri")
            linked = isinstance(uri, str) and len(uri) <= _LONGEST_NAME and not uri.startswith("data:")
            picture = repr(uri) if linked else f"image {label(images, index)}"
            self._left_out.add("textures that are missing or broken", f"{picture} of material {name}")
        return self._pictures[index]

    def _read(self, data: bytes, index: int, name: str) -> Bytes | None:
        where = f"image {label(self._file.items('images'), index)} of material {name}"
        if (image := self._decoded(where, data)) is None:
            return None
        if max(image.size) > MAX_SIDE:
            self._left_out.add(f"full resolution of textures larger than {MAX_SIDE} pixels along a side", name)
            image.thumbnail((MAX_SIDE, MAX_SIDE), Image.Resampling.BOX)
        return np.asarray(image)

    def _decoded(self, where: str, data: bytes) -> Image.Image | None:
        """Decoded picture; None if it is broken or of an unknown format."""
        requested = f"glTF {str(self._file.path)!r}: {where}"
        try:
            with open_picture(data, requested, ("PNG", "JPEG"), per_pixel=12) as opened:
                if opened.mode.startswith("I"):  # 16 bits of gray, which `convert` would clip
                    return Image.fromarray((np.asarray(opened) // 257).astype(np.uint8)).convert("RGBA")
                return opened.convert("RGBA")
        except UnreadableError:
            return None
        except InputError:
            raise
        except Exception:  # noqa: BLE001 - each of Pillow's decoders raises its own kinds; the picture is left out
            return None


def _linear(picture: Bytes, *, srgb: bool) -> Pixels:
    """(h, w, 4): linear values; opacity is never encoded."""
    levels = np.arange(256) / 255
    decoded = (srgb_to_linear(levels) if srgb else levels).astype(np.float32)
    pixels = decoded[picture]
    pixels[..., 3] = levels.astype(np.float32)[picture[..., 3]]
    return pixels


def _scaled_normals(pixels: Pixels, scale: float) -> Pixels:
    """Normal map with slopes scaled by a factor and renormalized."""
    if scale == 1.0:
        return pixels
    largest = max(abs(scale), 1.0)  # only directions count
    normals = (2.0 * pixels[..., :3] - 1.0) * (scale / largest, scale / largest, 1.0 / largest)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit = normals / np.where(length > 0, length, 1.0)
    return np.concatenate([0.5 + 0.5 * unit, pixels[..., 3:]], axis=-1).clip(0.0, 1.0).astype(np.float32)


def _texture(pixels: Pixels, wraps: tuple[str, ...], transform: TextureTransform) -> Texture:
    """Texture from a picture, with v converted from downwards to upwards."""
    turn, (scale_u, scale_v), (offset_u, offset_v) = transform.rotation, transform.scale, transform.offset
    c, s = math.cos(turn), math.sin(turn)
    scale, offset = np.array([scale_u, scale_v]), np.array([offset_u + s * scale_v, 1.0 - offset_v - c * scale_v])
    if "mirror" in wraps:
        pixels, scale, offset = _with_mirror_images(pixels, wraps), 0.5 * scale, 0.5 * offset
    across: Wrap = "clamp" if wraps[0] == "clamp" else "repeat"
    down: Wrap = "clamp" if wraps[1] == "clamp" else "repeat"
    return Texture(pixels, scale, offset, math.degrees(turn), (across, down))


def _with_mirror_images(pixels: Pixels, wraps: tuple[str, ...]) -> Pixels:
    """Picture with its mirror images appended, so that repeating it acts as mirrored wrapping."""
    right = {"mirror": pixels[:, ::-1], "repeat": pixels, "clamp": np.repeat(pixels[:, -1:], pixels.shape[1], axis=1)}
    wide = np.concatenate([pixels, right[wraps[0]]], axis=1)
    above = {"mirror": wide[::-1], "repeat": wide, "clamp": np.repeat(wide[:1], len(wide), axis=0)}
    return np.concatenate([above[wraps[1]], wide], axis=0)
