"""Photons from the lights of a scene through its interfaces onto opaque objects, in float64: the truth of caustics.

They follow the paths of `translucent.reference.path_trace` from the other end: interfaces scatter the same fractions of
light in both directions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.reference.hits import Lines, Rays, SceneTracer, world_normals
from translucent.reference.interactions import LiveRays
from translucent.reference.interfaces import Optics
from translucent.reference.light_paths import LightPaths, SurfaceLight, parts_of
from translucent.reference.path_trace import BENT_BATCH, InterfacePaths, _alike, _Flight
from translucent.reference.refracted import RayEnds, check_surfaces
from translucent.reference.surfaces import sheet_thicknesses
from translucent.scene.camera import check_size
from translucent.scene.lights import DirectionalLight, PositionalLight
from translucent.scene.scene import Light, Scene

#: Fraction of the distance to a photon within which nothing hides it from the eye: it lies on a surface itself.
_CONTACT = 1e-7


@dataclass(frozen=True, eq=False)
class LandedPhotons:
    """Photons that were refracted or reflected by interfaces and landed on opaque objects.

    Attributes
    ----------
    points : (n, 3) float64
        In metres from the eye, along the axes of the world.
    normals : (n, 3) float64
        Of the faces there, to the side on which they have landed.
    power : (n, 3) float64
        In W.
    objects : (n,) int64
        Numbers of what they have landed on.
    """

    points: Array
    normals: Array
    power: Array
    objects: Integers


def trace_photons(scene: Scene, photons: int = 100_000, seed: int = 0) -> LandedPhotons:
    """Follow photons from each light to the first opaque surface (Jensen 1996).

    They aim at a ball around all bodies. Interfaces reflect or refract them by chance, media absorb on the path what
    they absorb, and end what they scatter. Photons that meet no interface are left out, as they are no caustics.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed or sheets.
    photons : int
        Of each light, and of each group of channels that are bent or scattered alike.
    seed : int
        Of the random numbers.

    Raises
    ------
    InputError
        If a body is open, a surface is one that it does not know, or there are no photons.
    """
    if photons < 1:
        raise InputError(f"{photons} photons", "the number of photons must be above 0", "use a value such as 100_000")
    check_surfaces(scene, "use photons of the renderer", random=True)
    for body in scene.bodies:
        if body.sheet_thickness is None and not body.mesh.diagnosis.solid:
            raise InputError(
                f"photons through {body.mesh.name!r}",
                "the mesh is not closed",
                "close the mesh, or declare it a thin-walled sheet",
            )
    rng = np.random.default_rng(seed)
    sheets = sheet_thicknesses(scene)
    # Nothing but the photons themselves carries what lights emit.
    light = LightPaths(replace(scene, lights=(), environment_shadows=0), sheets)
    surface = SurfaceLight(light)
    optics = [Optics(scene, sheets, channel) for channel in range(3)]
    parts = []
    for channels in _alike(np.concatenate([light.volume.scattering, np.stack([own.iors for own in optics], axis=1)])):
        paths = PhotonPaths(surface, RayEnds(surface, 1.0), optics[channels[0]], channels, 0, rng)
        for source in scene.lights:
            points = parts_of(source)
            each = max(photons // len(points), 1)
            emitted = [_emitted(scene, point, each, rng) for point in points]
            rays, power = Rays.joined([of for of, _ in emitted]), np.concatenate([of for _, of in emitted])
            for first in range(0, len(rays), BENT_BATCH):
                some = slice(first, first + BENT_BATCH)
                parts.append(paths.land(rays.where(some), power[some]))
    return _joined(parts)


def _joined(parts: list[LandedPhotons]) -> LandedPhotons:
    none = np.zeros((0, 3))
    parts = [LandedPhotons(none, none, none, np.zeros(0, np.int64)), *parts]
    return LandedPhotons(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in LandedPhotons.__match_args__)
    )


class PhotonPaths(InterfacePaths):
    """Photon tracer for channels that share their paths."""

    def land(self, rays: Rays, power: Array) -> LandedPhotons:
        """Landed photons along rays, from photons with this power (n, 3)."""
        self.redirected = np.zeros(len(rays), dtype=bool)
        self.power = power
        self.parts: list[LandedPhotons] = []
        self.radiance(rays)
        return _joined(self.parts)

    def _interact(self, live: LiveRays, flight: _Flight, hit: Integers) -> LiveRays:
        interfaces = flight.interfaces.where(hit)
        solid = interfaces.before != interfaces.after
        stepped = np.zeros(len(self.redirected), dtype=bool)
        stepped[live.owner[hit]] = solid & (self.own.iors[interfaces.before] != self.own.iors[interfaces.after])
        found = super()._interact(live, flight, hit)
        self.redirected[found.owner] |= stepped[found.owner] | found.reflected
        return found

    def _add_ends(self, live: LiveRays, flight: _Flight, chosen: Integers) -> None:
        """Photons that leave the scene land nowhere."""

    def _reflect(self, live: LiveRays, flight: _Flight, hit: Integers) -> LiveRays:
        """Land photons on opaque objects, where they end."""
        kept = hit[self.redirected[live.owner[hit]]]
        none, live, wall = live.where(hit[:0]), live.where(kept), flight.wall.where(kept)
        normals = np.zeros((len(live), 3))
        for item in np.unique(wall.item):
            own = wall.item == item
            normals[own] = world_normals(self.scene.objects[item], wall.face[own])
        normals[np.einsum("ki,ki->k", normals, live.rays.directions) > 0] *= -1.0
        with np.errstate(under="ignore"):
            points = live.rays.origins + wall.distance[:, None] * live.rays.directions
            power = self.power[live.owner] * live.throughput
        self.parts.append(LandedPhotons(points, normals, power, wall.item))
        return none


def _emitted(scene: Scene, light: Light, photons: int, rng: np.random.Generator) -> tuple[Rays, Array]:
    """Rays of a light's photons towards the ball around all bodies, and their power (k, 3)."""
    some = np.arange(photons)
    points = np.concatenate([body.world_vertices for body in scene.bodies])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = float(np.linalg.norm(points - middle, axis=1).max()) * (1.0 + 1e-9)
    middle = middle - scene.camera.eye
    rows = max(int(np.sqrt(photons)), 1)
    # One in each cell of a grid, but for the last ones.
    u = np.where(some < rows * rows, (some % rows + rng.random(len(some))) / rows, rng.random(len(some)))
    v = np.where(some < rows * rows, (some // rows + rng.random(len(some))) / rows, rng.random(len(some)))
    turn = np.stack([np.cos(2.0 * np.pi * v), np.sin(2.0 * np.pi * v)], axis=1)
    none = np.zeros((len(some), 2))
    if isinstance(light, DirectionalLight):
        direction = np.asarray(light.direction)
        across = radius * np.sqrt(u)[:, None] * turn @ _across(direction)
        tracer = SceneTracer(scene)
        origins = middle + across - 2.0 * (tracer.radius + radius) * direction
        power = np.asarray(light.irradiance) * np.pi * radius**2 / photons
        return Rays(origins, np.tile(direction, (len(some), 1)), none), np.tile(power, (len(some), 1))
    assert isinstance(light, PositionalLight)
    at = np.asarray(light.position) - scene.camera.eye
    away = float(np.linalg.norm(middle - at))
    # All directions from among the bodies.
    spread = 2.0 if away <= radius else (radius / away) ** 2 / (1.0 + np.sqrt(1.0 - (radius / away) ** 2))
    axis = (middle - at) / away if away > radius else np.array([0.0, 0.0, 1.0])
    fall = spread * u
    directions = (1.0 - fall)[:, None] * axis + np.sqrt(fall * (2.0 - fall))[:, None] * turn @ _across(axis)
    power = light.intensity_along(directions) * 2.0 * np.pi * spread / photons
    return Rays(np.tile(at, (len(some), 1)), directions, none), power


def _across(axis: Array) -> Array:
    """(2, 3): unit vectors across an axis and each other."""
    right = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(axis, right)])


def photon_irradiance(scene: Scene, size: tuple[int, int], landed: LandedPhotons) -> Array:
    """Irradiance (h, w, 3) in W/m^2 of photons on the opaque surfaces that a picture shows, were there nothing else.

    The power of a photon is divided by the area that its pixel covers of the plane in which it lies.
    """
    width, height = check_size(size)
    camera, points = scene.camera, landed.points
    across, up, ahead = points @ camera.right, points @ camera.up, points @ camera.forward
    half_width, half_height = camera.half_extent((width, height))
    perspective = camera.fov_y is not None
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = ahead if perspective else np.ones_like(ahead)
        column = 0.5 * (across / spread / half_width + 1.0) * width
        row = 0.5 * (1.0 - up / spread / half_height) * height
        pixel = 4.0 * half_width * half_height / (width * height)
        towards = points / spread[:, None] if perspective else np.tile(camera.forward, (len(points), 1))
        facing = -np.einsum("ki,ki->k", landed.normals, towards)
        density = facing / (pixel * spread**2)
    visible = (spread > 0) & (facing > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    visible[visible] = _visible(scene, points[visible])
    picture = np.zeros((height, width, 3))
    at = row[visible].astype(np.int64), column[visible].astype(np.int64)
    with np.errstate(under="ignore"):
        np.add.at(picture, at, landed.power[visible] * density[visible, None])
    return picture


def _visible(scene: Scene, points: Array) -> Array:
    """(k,): whether no opaque object is between the eye, or the picture's plane, and points (k, 3) from the eye."""
    if scene.camera.fov_y is None:
        distance = points @ scene.camera.forward
        directions = np.tile(scene.camera.forward, (len(points), 1))
    else:
        distance = np.linalg.norm(points, axis=1)
        directions = points / distance[:, None]
    origins = points - distance[:, None] * directions
    visible = np.ones(len(points), dtype=bool)
    tracer = SceneTracer(scene)
    for traced in tracer.objects:
        if traced.body.medium is None:
            lines = Lines(origins, directions, np.zeros(len(points)), distance * (1.0 - _CONTACT))
            visible[np.unique(traced.hits(lines).pixel)] = False
    return visible
