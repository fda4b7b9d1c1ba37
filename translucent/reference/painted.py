"""Colors of textures and vertices at hits, and the holes that their opacity makes in opaque objects."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Integers
from translucent.reference.hits import Hits
from translucent.scene.scene import Object
from translucent.scene.texture import Texture


def painted(body: Object, face: Integers, barycentric: Array) -> Array:
    """(k, 4): color and opacity of texture and vertices on faces (k,), at barycentric coordinates (k, 3)."""
    found = sampled(body, face, barycentric, None if body.surface is None else body.surface.color_texture)
    colors = body.mesh.colors
    return found if colors is None else found * _across(body, face, barycentric, colors)


def sampled(body: Object, face: Integers, barycentric: Array, texture: Texture | None) -> Array:
    """(k, 4): a texture's values; 1 without one."""
    values = np.ones((len(face), 4))
    if texture is not None and body.mesh.uv is not None:
        found = texture.sample(_across(body, face, barycentric, body.mesh.uv))
        values[:, : found.shape[1]] = found
    return values


def without_cut_out(body: Object, hits: Hits) -> Hits:
    """Hits of an opaque object outside its holes (`Surface.alpha_cutoff`)."""
    if body.surface is None or body.surface.alpha_cutoff <= 0:
        return hits
    return hits.where(painted(body, hits.face, hits.barycentric)[:, 3] >= body.surface.alpha_cutoff)


def _across(body: Object, face: Integers, barycentric: Array, values: Array) -> Array:
    """(k, n): vertex attributes (v, n) interpolated."""
    return np.asarray(np.einsum("kc,kcn->kn", barycentric, values[body.mesh.faces[face]]))
