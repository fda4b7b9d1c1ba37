"""Ends of refracted rays: radiance of the environment, of a backdrop, and of opaque surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from translucent.arrays import Array, Mask
from translucent.reference.legs import Legs
from translucent.reference.opaque import OpaqueHits, reflected_radiance
from translucent.reference.rays import Rays
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.scene import Scene

#: Smallest cosine between a ray and the view with which it meets the backdrop.
ACROSS = 1e-2


class RayEnds:
    """Radiance at the ends of refracted rays.

    Parameters
    ----------
    light : SurfaceLight
        On the surfaces of the scene.
    aspect : float
        Width of the picture divided by its height.
    """

    def __init__(self, light: SurfaceLight, aspect: float) -> None:
        self.light, self.scene, self.aspect = light, light.scene, aspect

    def radiance(self, legs: Legs, wall: OpaqueHits) -> Array:
        """(k, 3): of the opaque surfaces that stop ray segments, or where none does of the environment."""
        seen = reflected_radiance(self.scene, legs.rays, wall, self.light.on_opaque)
        free = np.flatnonzero(np.isinf(wall.distance))
        seen[free] = self._environment(legs.where(free))
        return seen

    def _environment(self, legs: Legs) -> Array:
        """(k, 3): radiance of unblocked ray segments: the environment's light in reflections, else its background."""
        environment, rays = self.scene.environment, legs.rays
        place, ahead = places_on_backdrop(self.scene, self.aspect, rays)
        seen = environment.radiance(rays.directions, np.where(legs.bent[:, None], place, rays.backdrop))
        if environment.seen.kind == "checkerboard":
            seen[legs.bent & ~ahead] = environment.seen.mean
        return np.where(legs.reflected[:, None], environment.lighting(rays.directions), seen)


def places_on_backdrop(scene: Scene, aspect: float, rays: Rays) -> tuple[Array, Mask]:
    """Places in the picture at which rays meet a backdrop that stands across the view behind all objects, and a mask.

    Parameters
    ----------
    scene : Scene
    aspect : float
        Width of the picture divided by its height.
    rays : Rays
        (n) rays, in metres from the eye.

    Returns
    -------
    array (n, 2) and mask (n,)
        Places as in `Rays.backdrop`, and whether rays meet the backdrop at all.
    """
    camera = scene.camera
    low, high = scene.bounds - camera.eye
    farthest = float(np.maximum(low * camera.forward, high * camera.forward).sum())
    towards = rays.directions @ camera.forward
    ahead = towards > ACROSS
    path = np.maximum(farthest - rays.origins @ camera.forward, 0.0) / np.where(ahead, towards, 1.0)
    points = rays.origins + path[:, None] * rays.directions
    depth = points @ camera.forward if camera.fov_y is not None else np.ones(len(points))
    ahead &= depth > 0
    heights = 2.0 * replace(camera, window=None).half_extent((1, 1))[1] * np.where(ahead, depth, 1.0)
    across = np.stack([points @ camera.right, -(points @ camera.up)], axis=1) / heights[:, None]
    aspect = aspect if camera.window is None else camera.window.whole[0] / camera.window.whole[1]
    return across + (0.5 * aspect, 0.5), ahead
