"""Table of textures of surfaces, which shaders read wherever a ray hits one: ``shaders/transport/textured_hit.glsl``.

It lies behind the triangles in the texture of hierarchies, so that shaders need no further sampler. First there is a
record for each object, then the corners of the triangles of textured objects, in the order of the triangles. The texels
of the textures with their mipmaps follow, two in each 16 bytes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.planning.surface_textures import halvings, has_more, textures_at_hits, varies_at_hits
from translucent.scene.scene import Scene
from translucent.scene.texture import Texture

Words = npt.NDArray[np.uint32]

#: Words of 16 bytes of a record: where corners begin and what there is, then three for each of four textures.
RECORD = 13

#: Largest value of a channel.
_ONE = 65535


def surface_key(scene: Scene) -> tuple[object, ...]:
    """Key of the table of a scene: equal for scenes with equal tables."""
    objects = enumerate(scene.objects)
    return tuple((i, body.mesh, has_more(body), *textures_at_hits(body)) for i, body in objects if varies_at_hits(body))


def surface_table(
    scene: Scene, first: int, first_triangle: Callable[[Mesh], int], faces: Callable[[Mesh], npt.NDArray[np.int32]]
) -> Words:
    """(n, 4): the table of a scene, which begins at a texel.

    Parameters
    ----------
    scene : Scene
    first : int
        Texel at which it begins.
    first_triangle : callable
        Number of the first triangle of a mesh.
    faces : callable
        Faces of a mesh in the order of its triangles.
    """
    records = np.zeros((len(scene.objects), RECORD, 4), np.uint32)
    parts: list[Words] = []
    end = first + len(scene.objects) * RECORD

    def place(words: Words) -> int:
        nonlocal end
        parts.append(words)
        end += len(words)
        return end - len(words)

    corners = dict[Mesh, int]()
    texels = dict[Texture, int]()
    times = halvings(scene)
    for body, record in zip(scene.objects, records, strict=True):
        if not varies_at_hits(body):
            continue
        if body.mesh not in corners:
            corners[body.mesh] = place(_corners(body.mesh, faces(body.mesh)))
        record[0, :2] = (corners[body.mesh] - 3 * first_triangle(body.mesh)) % (1 << 32), 2 if has_more(body) else 1
        for number, texture in enumerate(textures_at_hits(body)):
            if texture is None:
                continue
            if texture not in texels:
                texels[texture] = place(_mipmaps(texture, times[texture]))
            height, width = (max(side >> times[texture], 1) for side in texture.pixels.shape[:2])
            repeats = sum(1 << i for i, wrap in enumerate(texture.wrap) if wrap == "repeat")
            own = record[1 + 3 * number : 4 + 3 * number]
            own[0] = texels[texture], width, height, repeats
            own[1:, :3] = texture.rows.astype(np.float32).view(np.uint32)
    return np.concatenate([records.reshape(-1, 4), *parts])


def _corners(mesh: Mesh, faces: npt.NDArray[np.int32]) -> Words:
    """(3 m, 4): texture coordinates and colors at the corners of triangles."""
    corners = mesh.faces[faces].reshape(-1)
    found = np.zeros((len(corners), 4), np.uint32)
    if mesh.uv is not None:
        found[:, :2] = mesh.uv[corners].astype(np.float32).view(np.uint32)
    found[:, 2:] = _packed(np.ones((len(corners), 4)) if mesh.colors is None else mesh.colors[corners])
    return found


def _packed(values: npt.NDArray[np.floating]) -> Words:
    """(..., 2): numbers (..., 4) of 0 to 1 in 16 bits each."""
    steps = np.rint(values * _ONE).astype(np.uint32)
    return np.asarray(steps[..., ::2] | steps[..., 1::2] << 16)


def _mipmaps(texture: Texture, times: int) -> Words:
    """(n, 4): texels of a texture that is halved so often, and of its mipmaps, row by row."""
    pixels = np.ones((*texture.pixels.shape[:2], 4), np.float32)
    pixels[..., : texture.pixels.shape[2]] = texture.pixels
    for _ in range(times):
        pixels = _halved(pixels)
    levels = [pixels]
    while levels[-1].shape[:2] != (1, 1):
        levels.append(_halved(levels[-1]))
    return np.concatenate([_level(level) for level in levels])


def _level(pixels: npt.NDArray[np.float32]) -> Words:
    words = _packed(pixels.reshape(-1, 4))
    return np.concatenate([words, np.zeros((len(words) % 2, 2), np.uint32)]).reshape(-1, 4)


def _halved(pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """A picture with half as many rows and columns, rounded down: means over areas."""
    for axis in (0, 1):
        count = pixels.shape[axis]
        edges = np.linspace(0.0, count, max(count >> 1, 1) + 1)
        low = np.minimum(edges.astype(np.int64), count - 1)
        sums = np.cumsum(pixels, axis=axis, dtype=np.float64)
        before = np.concatenate([np.zeros_like(sums.take([0], axis)), sums], axis=axis)
        part = np.expand_dims(edges - low, 1 - axis)[..., None]
        until = before.take(low, axis) + part * pixels.take(low, axis)
        pixels = (np.diff(until, axis=axis) / (edges[1] - edges[0])).astype(np.float32)
    return pixels
