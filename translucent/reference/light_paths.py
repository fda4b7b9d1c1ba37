"""Light paths from lights to points of a scene: attenuation by bodies, and shadows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Mask
from translucent.formulas import optics
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.reference.hits import Hits
from translucent.reference.intervals import Intervals, body_intervals, merge, sum_signs
from translucent.reference.opaque import without_cut_out
from translucent.reference.rays import Rays
from translucent.reference.sheets import scene_crossings
from translucent.reference.tracer import Lines, Tracer
from translucent.reference.volume import Volume, volume_segments
from translucent.scene.lights import MAX_RADIANCE, DirectionalLight, PointLight, PositionalLight, SphereLight
from translucent.scene.scene import Light, Scene

#: Distance, as a share of the scene's size, within which opaque surfaces do not shadow a light or a lit point: it lies
#: on them. Light on a closed opaque body shines outwards all the same, since the other side of the body stops the rest.
CONTACT = 1e-9

#: Rounding errors of a point's largest coordinate that are in contact, too: the way meets its surface at an angle.
ROUNDED = 64.0

#: Shells in a sphere that shines, and points on each.
SHELLS, ON_SHELL = 8, 32

#: Number of paths that are followed at a time: the working arrays stay below 500 MB.
PATHS = 1 << 15


@dataclass(frozen=True, eq=False)
class Arrival:
    """Light of one source that arrives at points.

    Attributes
    ----------
    travel : (k, 3) float64
        Unit vectors in which it travels; 0 at a point light itself.
    irradiance : (k, 3) float64
        On a surface that faces it, in W/m^2; at most 1e18.
    sound : (k,) bool
        The point is not at the light itself, and no hole of a body was on the way.
    """

    travel: Array
    irradiance: Array
    sound: Mask


class LightPaths:
    """Straight light paths to points of a scene, through its bodies.

    Parameters
    ----------
    scene : Scene
        Points are in metres from the eye of its camera, along the axes of the world.
    sheets : sequence of float or None
        As `sheet_thicknesses` gives them.
    """

    def __init__(self, scene: Scene, sheets: tuple[float | None, ...]) -> None:
        self.scene, self.sheets = scene, sheets
        self.volume = Volume(scene)
        lights = [part for light in scene.lights for part in parts_of(light)]
        self.lights = tuple(_from_eye(light, scene.camera.eye) for light in lights)

    @cached_property
    def tracer(self) -> Tracer:
        """Ray caster for the objects."""
        return Tracer(self.scene)

    def arrival(self, light: Light, points: Array) -> Arrival:
        """Light of one of `lights` that arrives at points (k, 3), unscattered."""
        parts = [self._arrival(light, points[i : i + PATHS]) for i in range(0, max(len(points), 1), PATHS)]
        return Arrival(*(np.concatenate([getattr(part, name) for part in parts]) for name in Arrival.__match_args__))

    def _arrival(self, light: Light, points: Array) -> Arrival:
        travel, distance = way_of(light, points)
        transmittance, sound = self.transmittance(points, travel, distance)
        irradiance = light.irradiance_on(points, -travel)
        # So bright is only the light itself, and no sum over it converges.
        sound &= (irradiance < MAX_RADIANCE).all(axis=1)
        with np.errstate(under="ignore"):
            return Arrival(travel, irradiance * transmittance, sound)

    def transmittance(self, points: Array, travel: Array, distance: Array) -> tuple[Array, Mask]:
        """Transmittance (k, 3) of light paths in directions (k, 3) over distances (k,) to points (k, 3).

        Parameters
        ----------
        points, travel : (k, 3) float64
        distance : (k,) float64
            In metres; inf for light from infinitely far away.

        Returns
        -------
        transmittance : (k, 3) float64
            0 behind opaque surfaces.
        sound : (k,) bool
            No hole of a body was on the way.
        """
        # Far away from the scene there is nothing, and short ways keep their digits.
        _, outside = self.tracer.ball(points, -travel)
        length = np.minimum(distance, np.maximum(outside, 0.0))
        rays = Rays(points - length[:, None] * travel, travel, np.zeros((len(points), 2)))
        hits = [self._hits(index, rays, length) for index in range(len(self.scene.objects))]
        intervals, sound = self._intervals(hits, length)
        # Layers throw no shadows.
        crossings = scene_crossings(self.scene, rays, hits, self.sheets, length, None)
        segments, _ = volume_segments(self.scene, self.volume, rays, intervals, crossings)
        with np.errstate(over="ignore", under="ignore"):
            depths = segments.extinction * segments.length[:, None]
            depth = np.stack([np.bincount(segments.pixel, depths[:, c], len(points)) for c in range(3)], axis=-1)
        return np.where(self._shadowed(hits, length, points)[:, None], 0.0, optics.transmittance(depth)), sound

    def _hits(self, index: int, rays: Rays, length: Array) -> Hits:
        """Surfaces of an object behind the origins and ahead up to the end of each path; of an open one on the whole
        line.
        """
        traced = self.tracer.objects[index]
        open_body = traced.body.medium is not None and not traced.body.mesh.diagnosis.solid
        # A sheet that lies where the path ends is on it, whichever comes first by rounding.
        beyond = 0.0 if self.sheets[index] is None else SHEET_ON_OPAQUE * self.scene.diagonal
        end = np.full(len(rays), np.inf) if open_body else length + beyond
        return traced.hits(Lines(rays.origins, rays.directions, np.full(len(rays), -np.inf), end))

    def _intervals(self, hits: list[Hits], length: Array) -> tuple[Intervals, Mask]:
        """Intervals of the paths inside solids, and (k,): mask of paths on which entries and exits balance."""
        sound = np.ones(len(length), dtype=bool)
        parts = []
        for index, (body, line) in enumerate(zip(self.scene.objects, hits, strict=True)):
            if body.medium is not None and self.sheets[index] is None:
                if not body.mesh.diagnosis.solid:
                    sound &= sum_signs(line, len(length)) == 0
                # What is behind the light tells whether it is inside, also for a light on the surface.
                origin = sum_signs(line.where(line.distance < 0), len(length))
                parts.append(body_intervals(line.before(length), origin, length, index))
        nothing = body_intervals(hits[0].where(slice(0)), np.zeros_like(length, dtype=np.int64), length)
        return merge([nothing, *parts]), sound

    def _shadowed(self, hits: list[Hits], length: Array, points: Array) -> Mask:
        """(k,): whether an opaque surface blocks the path to a point (k, 3)."""
        shadowed = np.zeros(len(length), dtype=bool)
        # Far from the eye, points are rounded to more than the contact.
        margin = CONTACT * self.tracer.radius + ROUNDED * np.finfo(np.float64).eps * np.abs(points).max(axis=1)
        for body, line in zip(self.scene.objects, hits, strict=True):
            if body.medium is None:
                near = margin[line.pixel]
                between = (line.distance > near) & (line.distance < length[line.pixel] - near)
                shadowed[without_cut_out(body, line.where(between)).pixel] = True
        return shadowed


def parts_of(light: Light) -> tuple[Light, ...]:
    """Point lights that a sphere light consists of; any other light itself.

    They are on shells, each with as much light, in directions of a Fibonacci lattice: a ball looks like an even disc
    from everywhere if its density is 1 / sqrt(1 - r^2), for which asin r - r sqrt(1 - r^2) is within r.
    """
    if not isinstance(light, SphereLight):
        return (light,)
    r = np.linspace(0.0, 1.0, 2049)
    within = (np.arcsin(r) - r * np.sqrt(1.0 - r * r)) * 2.0 / np.pi
    shells = light.radius * np.interp((np.arange(SHELLS) + 0.5) / SHELLS, within, r)
    number = np.arange(ON_SHELL)
    up = 1.0 - (2.0 * number + 1.0) / ON_SHELL
    across = np.sqrt(1.0 - up * up)
    points = []
    for k, radius in enumerate(shells):
        angle = 2.0 * np.pi * (0.6180339887498949 * number + k / SHELLS)
        directions = np.stack([across * np.cos(angle), across * np.sin(angle), up], axis=1)
        points.append(np.asarray(light.position) + radius * directions)
    intensity = np.asarray(light.intensity) / (SHELLS * ON_SHELL)
    return tuple(PointLight(point, intensity) for point in np.concatenate(points))


def _from_eye(light: Light, eye: Array) -> Light:
    """The light with its position, where it has one, relative to the eye."""
    return replace(light, position=np.subtract(light.position, eye)) if isinstance(light, PositionalLight) else light


def way_of(light: Light, points: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) in which light travels to points (k, 3), and how far (k,)."""
    if isinstance(light, DirectionalLight):
        return np.broadcast_to(np.asarray(light.direction), points.shape), np.full(len(points), np.inf)
    way = points - np.asarray(light.position)
    with np.errstate(under="ignore"):
        distance = np.linalg.norm(way, axis=1)
    return way / np.where(distance > 0, distance, 1.0)[:, None], distance
