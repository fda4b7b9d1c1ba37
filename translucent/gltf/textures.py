"""Lookup of glTF textures: the set of UVs, their transform (KHR_texture_transform), and the sampler's wrapping.

Formula: u' = offset_u + c scale_u u + s scale_v v, v' = offset_v - s scale_u u + c scale_v v, with c and s the cosine
and sine of the rotation. It is counter-clockwise in the UVs of glTF, whose v points down, as the words and the example
of the extension have it; its GLSL listing turns the other way, which is known to be a mistake.

Source: Khronos, KHR_texture_transform; glTF 2.0, section 3.8.4 (samplers).
Not read: mip levels; between texels, values are interpolated linearly unless the sampler says nearest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.gltf.file import Json

TEXTURE_TRANSFORM = "KHR_texture_transform"

_NEAREST, _REPEAT, _CLAMP, _MIRROR = 9728, 10497, 33071, 33648


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


def sample(image: Array, coordinates: Array, sampler: Json) -> Array:
    """Sample an image (h, w) at coordinates (..., 2) of a texture with this sampler."""
    height, width = image.shape
    x, y = coordinates[..., 0] * width - 0.5, coordinates[..., 1] * height - 0.5
    if sampler.get("magFilter") == _NEAREST:
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
