"""Shadow catchers: grounds that are left out of a transparent frame, but for their shadows."""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: Largest distance of a flat object's vertices from its plane, as a share of its size.
FLAT = 1e-6

AnyScene = TypeVar("AnyScene", bound=Scene)


def page_radiance(scene: Scene) -> float:
    """Largest radiance, up to 1, that diffuse shadow catchers can show all over a scene.

    Raises
    ------
    InputError
        If light does not fall evenly on a shadow catcher, so that a shadow on it would look like that.
    """
    lit = [_irradiance(scene, item).min() / np.pi for item in scene.objects if item.shadow_catcher]
    return float(min(1.0, *lit)) if lit else 1.0


def before_page(scene: AnyScene, radiance: float) -> AnyScene:
    """Scene before a background of even radiance, which unshadowed parts of its shadow catchers match."""
    page = scene.environment.with_background(Environment.constant((radiance,) * 3))
    objects = [_painted(scene, item, radiance) if item.shadow_catcher else item for item in scene.objects]
    return dataclasses.replace(scene, environment=page, objects=objects)


def _painted(scene: Scene, item: Object, radiance: float) -> Object:
    color = np.clip(radiance * np.pi / _irradiance(scene, item), 0.0, 1.0)
    one_sided = item.surface is not None and not item.surface.double_sided
    return dataclasses.replace(item, surface=Surface(color=color, ior=1.0, roughness=1.0, double_sided=not one_sided))


def _irradiance(scene: Scene, item: Object) -> Array:
    """(3,): irradiance on the outer side of a shadow catcher that nothing shadows."""
    what = f"a transparent frame with the shadow catcher {item.mesh.name!r}"
    corners = (item.mesh.vertices @ item.matrix[:3, :3].T)[item.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = normals.sum(axis=0) * (-1.0 if item.mirrored else 1.0)
    if not (length := float(np.linalg.norm(normal))) > 0:
        raise InputError(what, "it has no area", "give it a flat mesh")
    normal /= length
    heights = corners.reshape(-1, 3) @ normal
    if np.ptp(heights) > FLAT * float(np.abs(corners - corners[0, 0]).max()):
        raise InputError(what, "it is not flat", "give it a flat mesh, or render without transparency")
    if any(not isinstance(light, DirectionalLight) for light in scene.lights):
        do = "use DirectionalLight, or render without transparency"
        raise InputError(what, "a light falls unevenly on it", do)
    irradiance = scene.environment.irradiance_on(normal)
    for light in scene.lights:
        irradiance = irradiance + light.irradiance_on(np.zeros(3), normal)
    if not (irradiance > 0).all():
        raise InputError(what, "no light of one of the colors falls on it", "light it from above")
    return np.asarray(irradiance)
