"""Aims of the photons of lights: rectangles around the bodies as each light sees them, none of which overlap."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from translucent.arrays import Array
from translucent.formulas.light import ALL_AROUND
from translucent.planning.bodies import indices
from translucent.scene.lights import DirectionalLight, PositionalLight
from translucent.scene.scene import Light, Object, Scene

#: Factor by which a rectangle is larger than what it holds: of rounding.
_MARGIN = 1.001

#: Largest tangent of the angle off its axis at which a point light sees bodies for which rectangles are aimed at;
#: beyond, as for a light among them, photons leave in all directions.
_WIDEST = 3.0


@dataclass(frozen=True, eq=False)
class PhotonAim:
    """Aim of a light at a rectangle; lengths in metres from the center of the media.

    Attributes
    ----------
    light : (4,) float64
        Position, and 1; or the direction in which light travels, and 0.
    middle, right, up : (3,) float64
        Of the rectangle, and half its sides; these are 0 where photons leave in all directions.
    flux : (3,) float64
        Of a directional light through the rectangle, or of a lamp as bright in all directions, in W; of a lamp
        that aims at a rectangle, to be multiplied by the cosine over the squared distance.
    weight : float
        Share of the photons, up to a factor.
    cone : (4,) float64
        In which the light shines, as `translucent.formulas.light.cone_attenuation` takes it.
    inside : tuple of int
        Numbers of the bodies that the light is in.
    photons : int
        How many leave.
    """

    light: Array
    middle: Array
    right: Array
    up: Array
    flux: Array
    weight: float
    cone: Array = field(default_factory=lambda: np.array(ALL_AROUND))
    inside: tuple[int, ...] = ()
    photons: int = 0


def photon_aims(scene: Scene, center: Array, photons: int) -> list[PhotonAim]:
    """Aims of all lights at the bodies whose interfaces may turn light, with about so many photons in all.

    Parameters
    ----------
    scene : Scene
    center : (3,) float64
        From which positions count, in metres.
    photons : int
        Divided by the power that aims carry; each has one at least.
    """
    turning = indices(scene, lambda body: body.has_interface or _displaces(scene, body))
    clouds = [_corners(scene.objects[number], center) for number in turning]
    aims = [aim for light in scene.lights for aim in _aims(scene, light, clouds, center) if aim.weight > 0.0]
    total = sum(aim.weight for aim in aims)
    return [replace(aim, photons=max(round(photons * aim.weight / total), 1)) for aim in aims]


def _displaces(scene: Scene, body: Object) -> bool:
    """True if a body without an interface of its own may have one where it displaces another."""
    if scene.overlap != "priority" or body.medium is None or body.sheet_thickness is not None:
        return False
    return any(other.has_interface and other.priority <= body.priority for other in scene.bodies if other is not body)


def _corners(body: Object, center: Array) -> Array:
    """(n, 3): corners of the faces of a body."""
    used = np.unique(body.mesh.faces)
    return np.asarray(body.mesh.vertices[used] @ body.matrix[:3, :3].T + (body.matrix[:3, 3] - center))


def _aims(scene: Scene, light: Light, clouds: list[Array], center: Array) -> list[PhotonAim]:
    low, high = np.min([c.min(axis=0) for c in clouds], axis=0), np.max([c.max(axis=0) for c in clouds], axis=0)
    middle = 0.5 * (low + high)
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction)
        across = _across(direction)
        from_light, aims = np.array([*direction, 0.0]), []
        for low, high in _apart([_bounds((corners - middle) @ across.T) for corners in clouds]):
            at, right, up, area = _rectangle(low, high, middle, across)
            flux = np.asarray(light.irradiance) * area
            aims.append(PhotonAim(from_light, at, right, up, flux, float(flux.mean())))
        return aims
    assert isinstance(light, PositionalLight)
    return _point_aims(scene, light, clouds, middle, np.asarray(light.position) - center)


def _point_aims(scene: Scene, light: PositionalLight, clouds: list[Array], middle: Array, at: Array) -> list[PhotonAim]:
    inside = tuple(
        i
        for i, item in enumerate(scene.objects)
        if item.medium is not None and item.sheet_thickness is None and abs(item.winding_number(light.position)) > 0.75
    )
    intensity, away = np.asarray(light.intensity), float(np.linalg.norm(middle - at))
    position = np.array([*at, 1.0])
    seen = None if inside or away == 0.0 else _seen(clouds, middle, at, away)
    if seen is None:
        flux, none = 4.0 * np.pi * intensity, np.zeros(3)
        weight = float(flux.mean()) * light.mean_share
        return [PhotonAim(position, middle, none, none, flux, weight, light.cone, inside)]
    aims, across = [], _across((middle - at) / away)
    for low, high in _apart(seen):
        aimed, right, up, area = _rectangle(low, high, middle, across)
        flux = intensity * area
        weight = float(flux.mean()) * away / float(np.linalg.norm(aimed - at)) ** 3
        aims.append(PhotonAim(position, aimed, right, up, flux, weight, light.cone, inside))
    return aims


def _seen(clouds: list[Array], middle: Array, at: Array, away: float) -> list[Array] | None:
    """Bounds (2, 2) of bodies, as seen from `at` on the plane across the way to their `middle`; None if they are all
    around.
    """
    axis, across, found = (middle - at) / away, _across((middle - at) / away), []
    for corners in clouds:
        ahead = (corners - at) @ axis
        if not (ahead > 0.0).all():
            return None
        tangents = (corners - at) @ across.T / ahead[:, None]
        if float(np.abs(tangents).max()) > _WIDEST:
            return None
        found.append(_bounds(tangents * away))
    return found


def _bounds(places: Array) -> Array:
    """(2, 2): smallest and largest of places (n, 2), with a margin."""
    low, high = places.min(axis=0), places.max(axis=0)
    half, mean = 0.5 * _MARGIN * (high - low), 0.5 * (low + high)
    return np.stack([mean - half, mean + half])


def _apart(boxes: list[Array]) -> list[Array]:
    """The boxes (2, 2), those that overlap joined, until none do: light through one is not that through another."""
    found: list[Array] = []
    waiting = list(boxes)
    while waiting:
        box = waiting.pop()
        met = [i for i, other in enumerate(found) if (box[0] < other[1]).all() and (other[0] < box[1]).all()]
        if not met:
            found.append(box)
            continue
        parts = np.stack([box, *(found[i] for i in met)])
        found = [other for i, other in enumerate(found) if i not in met]
        waiting.append(np.stack([parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)]))
    return found


def _across(axis: Array) -> Array:
    """(2, 3): unit vectors across an axis and each other."""
    right = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, axis)])


def _rectangle(low: Array, high: Array, middle: Array, across: Array) -> tuple[Array, Array, Array, float]:
    """Middle, half sides, and area of a rectangle that reaches from `low` to `high` (2,) along two vectors (2, 3)."""
    half, mean = 0.5 * (high - low), 0.5 * (low + high)
    return middle + mean @ across, half[0] * across[0], half[1] * across[1], float(np.prod(high - low))
