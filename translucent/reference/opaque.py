"""Opaque objects: ends of rays, base colors at hits, and reflected radiance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers
from translucent.reference.hits import Hits, world_normals
from translucent.reference.rays import Rays
from translucent.scene.scene import Object, Scene
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


#: Irradiance (k, 3) on surfaces at points (k, 3), in metres from the eye, with unit normals (k, 3).
Irradiance = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class OpaqueHits:
    """Nearest opaque surface on each ray, seen from either side.

    Attributes
    ----------
    distance : (n,) float64
        In metres along the ray, >= 0; inf where there is none.
    item : (n,) int64
        Index into `Scene.objects`; -1 where there is none.
    face : (n,) int64
        Index into the mesh's faces.
    barycentric : (n, 3) float64, optional
        Weights of the face's corners; None: surfaces are even, and show neither textures nor colors of vertices.
    """

    distance: Array
    item: Integers
    face: Integers
    barycentric: Array | None = None

    def where(self, chosen: Integers) -> OpaqueHits:
        """Selection of rays by indices."""
        across = None if self.barycentric is None else self.barycentric[chosen]
        return OpaqueHits(self.distance[chosen], self.item[chosen], self.face[chosen], across)


def nearest_opaque(scene: Scene, hits: Sequence[Hits], pixels: int) -> OpaqueHits:
    """Find the first opaque surface ahead of each origin, past holes; of several at one distance, that of the first
    object.

    Parameters
    ----------
    scene : Scene
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them.
    pixels : int
        Number of rays.
    """
    across = np.zeros((pixels, 3))
    nearest = OpaqueHits(np.full(pixels, np.inf), np.full(pixels, -1), np.full(pixels, -1), across)
    for i, body in enumerate(scene.objects):
        if body.medium is None:
            closer = without_cut_out(body, hits[i].before(nearest.distance))
            pixel, first = np.unique(closer.pixel, return_index=True)
            nearest.distance[pixel], nearest.item[pixel] = closer.distance[first], i
            nearest.face[pixel], across[pixel] = closer.face[first], closer.barycentric[first]
    return nearest


def reflected_radiance(scene: Scene, rays: Rays, nearest: OpaqueHits, irradiance: Irradiance) -> Array:
    """Diffusely reflected radiance of opaque surfaces towards the origins, and emission, (n, 3); 0 on rays without one.

    Lambert: color / pi times the irradiance on the side that is seen, as `SurfaceLight.on_opaque` gives it.
    """
    radiance = np.zeros((len(rays), 3))
    for i, body in enumerate(scene.objects):
        seen = np.flatnonzero(nearest.item == i)
        if seen.size:
            radiance[seen] = _lambert(body, nearest.where(seen), rays.where(seen), irradiance)
    return radiance


def _lambert(body: Object, hits: OpaqueHits, rays: Rays, irradiance: Irradiance) -> Array:
    """(k, 3): radiance that one object reflects and emits along rays that meet it."""
    normals = world_normals(body, hits.face)
    away = np.einsum("ki,ki->k", normals, rays.directions) > 0
    normals[away] *= -1.0
    # From the eye, as the rays are, so that the way to a light keeps its digits far from the world's origin.
    points = rays.origins + hits.distance[:, None] * rays.directions
    color, emitted = np.broadcast_to(body.base_color, points.shape), np.zeros(3)
    if hits.barycentric is not None:
        color = color * painted(body, hits.face, hits.barycentric)[:, :3]
        if body.surface is not None and body.surface.glows:
            texture = sampled(body, hits.face, hits.barycentric, body.surface.emissive_texture)
            emitted = np.asarray(body.surface.emissive) * texture[:, :3]
    with np.errstate(under="ignore"):
        return np.asarray(color / np.pi * irradiance(points, normals) + emitted)
