"""Straight light at points of a scene: attenuated by bodies, with colored shadows, of lights and of an environment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Mask
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.reference.hits import Hits, Lines, Rays, SceneTracer
from translucent.reference.intervals import Intervals, body_intervals, merge, sum_signs
from translucent.reference.surfaces import scene_crossings, sheet_thicknesses, without_cut_out
from translucent.reference.volume import Volume, volume_segments
from translucent.scene.lights import MAX_RADIANCE, DirectionalLight, PointLight, PositionalLight, SphereLight
from translucent.scene.scene import Light, Scene
from translucent.scene.shadow_directions import shadow_directions

#: Distance, as a fraction of the scene's size, within which opaque surfaces do not shadow a light or a lit point: it
#: lies on them. Light on a closed opaque body shines outwards all the same, since the other side of the body stops the
#: rest.
CONTACT = 1e-9

#: Rounding errors of a point's largest coordinate that are in contact, too: the path hits its surface at an angle.
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
        The point is not at the light itself, and no hole of a body was on the path.
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
    def tracer(self) -> SceneTracer:
        """Ray caster for the objects."""
        return SceneTracer(self.scene)

    def arrival(self, light: Light, points: Array) -> Arrival:
        """Light of one of `lights` that arrives at points (k, 3), unscattered."""
        parts = [self._arrival(light, points[i : i + PATHS]) for i in range(0, max(len(points), 1), PATHS)]
        return Arrival(*(np.concatenate([getattr(part, name) for part in parts]) for name in Arrival.__match_args__))

    def _arrival(self, light: Light, points: Array) -> Arrival:
        travel, distance = direction_and_distance(light, points)
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
            No hole of a body was on the path.
        """
        # Far away from the scene there is nothing, and short paths keep their digits.
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
                # What is behind the light decides whether it is inside, also for a light on the surface.
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


def direction_and_distance(light: Light, points: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) in which light travels to points (k, 3), and how far (k,)."""
    if isinstance(light, DirectionalLight):
        return np.broadcast_to(np.asarray(light.direction), points.shape), np.full(len(points), np.inf)
    direction = points - np.asarray(light.position)
    with np.errstate(under="ignore"):
        distance = np.linalg.norm(direction, axis=1)
    return direction / np.where(distance > 0, distance, 1.0)[:, None], distance


class SurfaceLight:
    """Light that reaches surfaces straight on, through media and sheets and past opaque objects.

    Parameters
    ----------
    paths : LightPaths
        Through the scene. Points are in metres from the eye of its camera, along the axes of the world.
    scattered : callable, optional
        Irradiance (k, 3) by all but the straight light of lights, for points (k, 3) and unit normals (k, 3) of opaque
        objects in the world, and the irradiance (k, 3) by what is visible of the environment.
    """

    def __init__(self, paths: LightPaths, scattered: Callable[[Array, Array, Array], Array] | None = None) -> None:
        self.paths, self.scene, self._scattered = paths, paths.scene, scattered
        # A sheet with a diffuse base does not shadow that base.
        self._before = 2.0 * SHEET_ON_OPAQUE * paths.scene.diagonal

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        sky = self._sky(points, normals, 0.0)
        if self._scattered is not None:
            sky = self._scattered(points + self.scene.camera.eye, normals, sky)
        return self._with_lights(sky, points, normals, 0.0)

    def on_interfaces(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) on layers, and on diffuse bases of interfaces; parameters as for `on_opaque`."""
        return self._with_lights(self._sky(points, normals, self._before), points, normals, self._before)

    def to_interfaces(self, light: Light, points: Array) -> Array:
        """(k, 3): transmittance of the paths from one of `LightPaths.lights` to points (k, 3) of interfaces."""
        return self.passed(points, *direction_and_distance(light, points), self._before)

    def _sky(self, points: Array, normals: Array, before: float) -> Array:
        irradiance = self.scene.environment.irradiance_on(normals)
        return (
            irradiance * self._sky_fraction(points, normals, before) if self.scene.environment_shadows else irradiance
        )

    def _with_lights(self, irradiance: Array, points: Array, normals: Array, before: float) -> Array:
        """(k, 3): irradiance (k, 3) with the straight light of lights."""
        for light in self.paths.lights:
            arriving = np.array(light.irradiance_on(points, normals))
            lit = np.flatnonzero(arriving.any(axis=1))
            with np.errstate(under="ignore"):
                arriving[lit] *= self.straight(light, points[lit], before)
                irradiance = irradiance + arriving
        return np.asarray(irradiance)

    def straight(self, light: Light, points: Array, before: float) -> Array:
        """(k, 3): transmittance of straight paths from one of `LightPaths.lights` that end `before` points (k, 3)."""
        return self.passed(points, *direction_and_distance(light, points), before)

    def _sky_fraction(self, points: Array, normals: Array, before: float) -> Array:
        """(k, 3): fraction of the environment's irradiance that is left, by its `shadow_directions`."""
        sky = shadow_directions(self.scene.environment, self.scene.environment_shadows)
        left, total = np.zeros((2, *points.shape))
        for towards, irradiance in zip(*sky, strict=True):
            cosine = np.maximum(normals @ towards, 0.0)
            lit = np.flatnonzero(cosine) if irradiance.any() else np.empty(0, np.int64)
            travel = np.broadcast_to(-towards, (len(lit), 3))
            with np.errstate(under="ignore"):
                arriving = cosine[lit, None] * irradiance
                total[lit] += arriving
                left[lit] += arriving * self.passed(points[lit], travel, np.full(len(lit), np.inf), before)
        return np.where(total > 0, left / np.where(total > 0, total, 1.0), 1.0)

    def passed(self, points: Array, travel: Array, distance: Array, before: float = 0.0) -> Array:
        """(k, 3): transmittance of paths in directions (k, 3) over distances (k,) that end `before` points (k, 3)."""
        passed = np.ones(points.shape)
        for begin in range(0, len(points), PATHS):
            some = slice(begin, begin + PATHS)
            ends, left = points[some] - before * travel[some], np.maximum(distance[some] - before, 0.0)
            passed[some], _ = self.paths.transmittance(ends, travel[some], left)
        return passed


def light_transmittance(scene: Scene, light: int, points: npt.ArrayLike) -> Array:
    """Transmittance of the straight paths from a light to points: exp(-sum sigma_t d), 0 behind opaque surfaces.

    What dims the light that reaches opaque objects. Interfaces neither bend nor dim it, and layers (`Surface.opacity`)
    let it pass. A surface that a point or the light lies on, to 1e-9 of the scene's size, does not shadow it.

    Parameters
    ----------
    scene : Scene
    light : int
        Index into `Scene.lights`.
    points : array_like (k, 3)
        In world coordinates.

    Returns
    -------
    (k, 3) float64
        By color, 0 to 1.

    Raises
    ------
    InputError
        If there is no such light, or the points are no finite array (k, 3).
    """
    if not 0 <= light < len(scene.lights):
        raise InputError(
            f"light {light} of a scene", f"the scene has {len(scene.lights)} lights", "count lights from 0"
        )
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise InputError(
            "points in a scene",
            f"the array has shape {places.shape}, or contains numbers that are not finite",
            "give an array of shape (k, 3) in metres",
        )
    paths = LightPaths(scene, sheet_thicknesses(scene))
    from_eye = places - scene.camera.eye
    return SurfaceLight(paths).passed(from_eye, *direction_and_distance(paths.lights[light], from_eye))
