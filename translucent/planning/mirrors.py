"""Grounds that mirror what stands on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from translucent.arrays import Array
from translucent.scene.scene import Object, Scene

#: Roughness above which a coat mirrors a blur and no more.
MOST_ROUGHNESS = 0.4

#: Largest distance of a ground's vertices from its plane, as a share of its size.
FLAT = 1e-6

#: Share of the scene's size by which what stands on a ground may be below it, by rounding.
SUNK = 1e-5


class Mirror(NamedTuple):
    """Flat ground.

    Attributes
    ----------
    ground : Object
    normal : (3,)
        Unit vector to its outer side.
    height : float
        Of the ground along it, in metres from the world's origin.
    """

    ground: Object
    normal: Array
    height: float

    @property
    def matrix(self) -> Array:
        """(4, 4): reflection at the plane."""
        matrix = np.eye(4)
        matrix[:3, :3] -= 2.0 * np.outer(self.normal, self.normal)
        matrix[:3, 3] = 2.0 * self.height * self.normal
        return matrix


def mirror_of(scene: Scene) -> Mirror | None:
    """Ground of a scene that mirrors its bodies, if it has one: the first flat shadow catcher with a smooth coat."""
    return next((found for item in scene.objects if _is_smooth(item) and (found := _flat(item))), None)


def ground_of(scene: Scene) -> Mirror | None:
    """Ground of a scene, if it has one: the first flat shadow catcher that is opaque."""
    return next((found for item in scene.opaque if item.shadow_catcher and (found := _flat(item))), None)


def lit_side(scene: Scene) -> Array | None:
    """Normal of all that a scene shows of opaque surfaces, where that is the upper side of a ground; None elsewhere.

    Bodies stand on it, so that no ray sees it from below.
    """
    if len(scene.opaque) != 1 or (ground := ground_of(scene)) is None:
        return None
    surface, eye = ground.ground.surface, scene.camera.eye
    if surface is not None and (surface.normal_texture is not None or surface.diffuse_transmission > 0):
        return None
    level = scene.camera.fov_y is None
    above = -float(scene.camera.forward @ ground.normal) if level else float(eye @ ground.normal) - ground.height
    low, high = scene.boxes[scene.filled][:, 0], scene.boxes[scene.filled][:, 1]
    lowest = np.where(ground.normal > 0, low, high) @ ground.normal - ground.height
    return ground.normal if above > 0 and (lowest >= -SUNK * scene.diagonal).all() else None


def _is_smooth(item: Object) -> bool:
    surface = item.surface
    return (
        item.shadow_catcher
        and surface is not None
        and surface.ior != 1.0
        and surface.metallic == 0
        and surface.roughness <= MOST_ROUGHNESS
        and surface.roughness_texture is None
        and surface.normal_texture is None
    )


def _flat(item: Object) -> Mirror | None:
    """Plane of a flat object; None for others."""
    corners = (item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3])[item.mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    normal *= -1.0 if item.mirrored else 1.0
    if not (length := float(np.linalg.norm(normal))) > 0:
        return None
    heights = (corners - corners[0, 0]).reshape(-1, 3) @ (normal / length)
    if np.abs(heights).max() > FLAT * np.abs(corners - corners[0, 0]).max():
        return None
    return Mirror(item, normal / length, float(corners[0, 0] @ normal / length))
