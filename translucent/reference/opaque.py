"""Opaque objects: ends of rays, and reflected radiance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers
from translucent.reference.hits import Hits, world_normals
from translucent.reference.rays import Rays
from translucent.scene.scene import Object, Scene

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
    """

    distance: Array
    item: Integers
    face: Integers

    def where(self, chosen: Integers) -> OpaqueHits:
        """Selection of rays by indices."""
        return OpaqueHits(self.distance[chosen], self.item[chosen], self.face[chosen])


def nearest_opaque(scene: Scene, hits: Sequence[Hits], pixels: int) -> OpaqueHits:
    """Find the first opaque surface ahead of each origin; of several at one distance, that of the first object.

    Parameters
    ----------
    scene : Scene
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them.
    pixels : int
        Number of rays.
    """
    nearest = OpaqueHits(np.full(pixels, np.inf), np.full(pixels, -1), np.full(pixels, -1))
    for i, body in enumerate(scene.objects):
        if body.medium is None:
            closer = hits[i].before(nearest.distance)
            pixel, first = np.unique(closer.pixel, return_index=True)
            nearest.distance[pixel], nearest.item[pixel] = closer.distance[first], i
            nearest.face[pixel] = closer.face[first]
    return nearest


def reflected_radiance(scene: Scene, rays: Rays, nearest: OpaqueHits, irradiance: Irradiance) -> Array:
    """Diffusely reflected radiance of opaque surfaces towards the origins, (n, 3); 0 on rays without one.

    Lambert: color / pi times the irradiance on the side that is seen, as `SurfaceLight.on_opaque` gives it.
    """
    radiance = np.zeros((len(rays), 3))
    for i, body in enumerate(scene.objects):
        seen = np.flatnonzero(nearest.item == i)
        if seen.size:
            radiance[seen] = _lambert(body, nearest.face[seen], nearest.distance[seen], rays.where(seen), irradiance)
    return radiance


def _lambert(body: Object, face: Integers, distance: Array, rays: Rays, irradiance: Irradiance) -> Array:
    """(k, 3): radiance that one object reflects along rays that meet it at `distance`."""
    normals = world_normals(body, face)
    away = np.einsum("ki,ki->k", normals, rays.directions) > 0
    normals[away] *= -1.0
    # From the eye, as the rays are, so that the way to a light keeps its digits far from the world's origin.
    points = rays.origins + distance[:, None] * rays.directions
    with np.errstate(under="ignore"):
        return np.asarray(body.base_color / np.pi * irradiance(points, normals))
