"""Where the photons of lights aim: for each light and body a rectangle around the body as the light sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array
from translucent.planning.bodies import indices
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Scene

#: Factor by which a rectangle is larger than what it holds: of rounding.
_MARGIN = 1.001

#: Largest tangent of the angle at which a point light sees a body for which a rectangle is aimed at; beyond, as for a
#: light in a body, photons leave in all directions.
_WIDEST = 3.0


@dataclass(frozen=True, eq=False)
class PhotonAim:
    """Aim of a light at a body; lengths in metres from the center of the media.

    Attributes
    ----------
    object : int
        Number of the body in the scene.
    light : (4,) float64
        Position, and 1; or the direction in which light travels, and 0.
    middle, right, up : (3,) float64
        Of the rectangle, and half its sides; these are 0 where photons leave in all directions.
    flux : (3,) float64
        Of a directional light through the rectangle, or of a point light in all directions, in W; of a point light
        that aims at a rectangle, to be multiplied by the cosine over the squared distance.
    weight : float
        Share of the photons, up to a factor.
    inside : tuple of int
        Numbers of the bodies that the light is in.
    photons : int
        How many leave.
    """

    object: int
    light: Array
    middle: Array
    right: Array
    up: Array
    flux: Array
    weight: float
    inside: tuple[int, ...]
    photons: int = 0


def photon_aims(scene: Scene, center: Array, photons: int) -> list[PhotonAim]:
    """Aims of all lights at all bodies whose interfaces may turn light, with about so many photons in all.

    Parameters
    ----------
    scene : Scene
    center : (3,) float64
        From which positions count, in metres.
    photons : int
        Divided by the power that aims carry; each has one at least.
    """
    turning = indices(scene, lambda body: body.has_interface or _displaces(scene, body))
    aims = [_aim(scene, light, number, center) for light in scene.lights for number in turning]
    aims = [aim for aim in aims if aim.weight > 0.0]
    total = sum(aim.weight for aim in aims)
    return [replace(aim, photons=max(round(photons * aim.weight / total), 1)) for aim in aims]


def _displaces(scene: Scene, body: Object) -> bool:
    """Whether a body without an interface of its own has one where it displaces others."""
    return scene.overlap == "priority" and body.medium is not None and body.sheet_thickness is None


def _aim(scene: Scene, light: Light, number: int, center: Array) -> PhotonAim:
    body = scene.objects[number]
    # Few bodies have many vertices that no face uses.
    corners = body.mesh.vertices[np.unique(body.mesh.faces)] @ body.matrix[:3, :3].T + (body.matrix[:3, 3] - center)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction)
        right, up = _across(direction)
        middle, right, up = _rectangle(corners - middle, middle, right, up)
        flux = np.asarray(light.irradiance) * _area(right, up)
        return PhotonAim(number, np.array([*direction, 0.0]), middle, right, up, flux, float(flux.mean()), ())
    assert isinstance(light, PointLight)
    at = np.asarray(light.position) - center
    inside = tuple(
        i
        for i, item in enumerate(scene.objects)
        if item.medium is not None and item.sheet_thickness is None and abs(item.winding_number(light.position)) > 0.75
    )
    intensity, away = np.asarray(light.intensity), float(np.linalg.norm(middle - at))
    position, none = np.array([*at, 1.0]), np.zeros(3)
    if away > 0.0:
        axis = (middle - at) / away
        right, up = _across(axis)
        ahead = (corners - at) @ axis
        if (ahead > 0.0).all():
            seen = (corners - at) * (away / ahead)[:, None] + at - middle
            aimed, right, up = _rectangle(seen, middle, right, up)
            if max(float(np.linalg.norm(right)), float(np.linalg.norm(up))) < _WIDEST * away:
                flux = intensity * _area(right, up)
                weight = float(flux.mean()) / away / away
                return PhotonAim(number, position, aimed, right, up, flux, weight, inside)
    flux = 4.0 * np.pi * intensity
    return PhotonAim(number, position, middle, none, none, flux, float(flux.mean()), inside)


def _across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors across an axis and each other."""
    right = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    right = right / np.linalg.norm(right)
    return right, np.cross(right, axis)


def _rectangle(offsets: Array, middle: Array, right: Array, up: Array) -> tuple[Array, Array, Array]:
    """Middle and half sides of the rectangle around offsets (n, 3) from `middle`, with sides along two unit vectors."""
    across = offsets @ np.stack([right, up], axis=1)
    low, high = across.min(axis=0), across.max(axis=0)
    half = 0.5 * _MARGIN * (high - low)
    shift = 0.5 * (low + high)
    return middle + shift[0] * right + shift[1] * up, half[0] * right, half[1] * up


def _area(right: Array, up: Array) -> float:
    return 4.0 * float(np.linalg.norm(right)) * float(np.linalg.norm(up))
