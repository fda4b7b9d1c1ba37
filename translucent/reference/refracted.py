"""Radiance along rays that refract and split at interfaces: exact Fresnel and Snell, in float64.

At every interface a ray becomes two, reflected and refracted, until they carry less than `faintest` or have hit as many
interfaces as requested; what is dropped is counted. With rough interfaces one of the two is chosen by chance, so that
the radiance has noise. Between interfaces media absorb and emit as they do along straight rays.

All radiance is basic radiance L / n^2, which does not change where light enters a denser medium; emission counts as it
would in a medium that is index-matched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.sampling import sample_shifts
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.planning.methods import Method
from translucent.reference.compositing import composite, emission_of_mixtures
from translucent.reference.hits import Hits, Lines, Rays, pixel_rays
from translucent.reference.interactions import Interactions, LiveRays, joined
from translucent.reference.interfaces import FirstInterfaces, Optics
from translucent.reference.intervals import Intervals, body_intervals, merge, sum_signs, unbalanced
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.scattering import scattered_once
from translucent.reference.surfaces import (
    OpaqueHits,
    nearest_opaque,
    reflected_radiance,
    scene_crossings,
    sheet_thicknesses,
)
from translucent.reference.volume import volume_segments
from translucent.scene.scene import Scene

#: Smallest cosine between a ray and the view with which it hits the backdrop.
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

    def radiance(self, live: LiveRays, wall: OpaqueHits) -> Array:
        """(k, 3): radiance of the opaque surfaces that stop ray segments, or of the environment."""
        radiance = reflected_radiance(self.scene, live.rays, wall, self.light.on_opaque)
        free = np.flatnonzero(np.isinf(wall.distance))
        radiance[free] = self._environment(live.where(free))
        return radiance

    def _environment(self, live: LiveRays) -> Array:
        """(k, 3): radiance of unblocked ray segments: the environment's light in reflections, else its background."""
        environment, rays = self.scene.environment, live.rays
        place, ahead = places_on_backdrop(self.scene, self.aspect, rays)
        radiance = environment.radiance(rays.directions, np.where(live.bent[:, None], place, rays.backdrop))
        if environment.seen.kind == "checkerboard":
            radiance[live.bent & ~ahead] = environment.seen.mean
        return np.where(live.reflected[:, None], environment.lighting(rays.directions), radiance)


def places_on_backdrop(scene: Scene, aspect: float, rays: Rays) -> tuple[Array, Mask]:
    """Places in the picture at which rays hit a backdrop that stands across the view behind all objects, and a mask.

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
        Places as in `Rays.backdrop`, and whether rays hit the backdrop at all.
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


#: Smallest fraction of each color that a ray must carry to be followed, by default.
FAINTEST = 1e-5

#: Number of rays of the picture that are followed together: the working arrays stay below 500 MB.
BATCH = 1 << 13


@dataclass(frozen=True, eq=False)
class RefractedLight:
    """Radiance along refracted rays.

    Attributes
    ----------
    radiance : (n, 3) float64
    residual : (n, 3) float64
        Fraction of each ray not not followed to its end; times the largest radiance in the scene it bounds the error.
    valid : (n,) bool
        No part of the ray went through a hole of a body, or missed the tolerance of scattered light.
    """

    radiance: Array
    residual: Array
    valid: Mask


class RefractedRays:
    """Tracer of the camera's rays that refract at interfaces.

    Parameters
    ----------
    light : SurfaceLight
        On the surfaces of a scene.
    aspect : float
        Width of the picture divided by its height.
    bounces : int
        Interfaces that a ray may hit.
    scatter : bool
        Add light that media scatter once, to `tolerance`. Lights reach into media straight on.
    rng : Generator, optional
        Chooses between reflection and refraction. Without it both are followed, and all interfaces are polished.
    faintest : float
        Smallest fraction of each color that a ray must carry to be followed.
    """

    def __init__(
        self,
        light: SurfaceLight,
        aspect: float,
        bounces: int,
        scatter: bool = False,
        tolerance: float = 1e-6,
        rng: np.random.Generator | None = None,
        faintest: float = FAINTEST,
    ) -> None:
        self.faintest = faintest
        self.light, self.scene, self.sheets, self.bounces = light, light.scene, light.paths.sheets, bounces
        self.scatter, self.tolerance, self.rng = scatter, tolerance, rng
        self.ends = RayEnds(light, aspect)
        self.tracer, self.volume = light.paths.tracer, light.paths.volume
        scene = self.scene
        dispersed = any(body.surface is not None and body.surface.dispersion > 0 for body in scene.bodies)
        self.channels = [Optics(scene, self.sheets, channel) for channel in ((0, 1, 2) if dispersed else (None,))]

    def see(self, rays: Rays) -> RefractedLight:
        """Trace rays of the camera."""
        found = RefractedLight(np.zeros((len(rays), 3)), np.zeros((len(rays), 3)), np.ones(len(rays), dtype=bool))
        for channel, own in enumerate(self.channels):
            carried = np.eye(3)[channel] if len(self.channels) > 1 else np.ones(3)
            for begin in range(0, len(rays), BATCH):
                owner = np.arange(begin, min(begin + BATCH, len(rays)))
                _BranchTree(self, own, found).grow(rays.where(owner), owner, carried)
        return found


class _BranchTree:
    """Ray tree from interface to interface, for light with the same indices of refraction."""

    def __init__(self, refracted: RefractedRays, own: Optics, found: RefractedLight) -> None:
        self.refracted, self.own, self.found, self.scene = refracted, own, found, refracted.scene

    def grow(self, rays: Rays, owner: Integers, carried: Array) -> None:
        """Follow rays of the camera along all their branches; each starts with the light `carried` (3,)."""
        everywhere = np.full(len(rays), np.inf)
        behind = self.refracted.tracer.hits(Lines(rays.origins, rays.directions, -everywhere, np.zeros(len(rays))))
        never = np.zeros(len(rays), dtype=bool)
        inside = self.own.at_origins(behind, len(rays))
        live = LiveRays(rays, owner, np.tile(carried, (len(rays), 1)), inside, never, never)
        for level in range(self.refracted.bounces + 1):
            live, interfaces = self._fly(live, 0.0 if level == 0 else self.own.tolerance)
            if not len(live):
                return
            outcome = Interactions(self.own, live, interfaces, self.refracted.light, self.refracted.rng).outcome()
            self._add(live, outcome.radiance)
            live = joined(outcome.branches)
            lost = np.asarray(
                (live.throughput < self.refracted.faintest).all(axis=1) | ~live.rays.directions.any(axis=1)
            )
            self._drop(live.where(lost))
            live = live.where(~lost)
        self._drop(live)

    def _drop(self, live: LiveRays) -> None:
        np.add.at(self.found.residual, live.owner, live.throughput)

    def _add(self, live: LiveRays, radiance: Array) -> None:
        with np.errstate(under="ignore"):
            np.add.at(self.found.radiance, live.owner, live.throughput * radiance)

    def _fly(self, live: LiveRays, start: float) -> tuple[LiveRays, FirstInterfaces]:
        """Add radiance of media and ray ends; return rays that reach interfaces, moved there, with those interfaces."""
        rays = live.rays
        reach = np.full(len(live), start), np.full(len(live), np.inf)
        hits = self.refracted.tracer.hits(Lines(rays.origins, rays.directions, *reach))
        wall = nearest_opaque(self.scene, hits, len(live))
        interfaces = self.own.first_interfaces([line.before(wall.distance) for line in hits], live.inside)
        live = self._through_media(live, hits, interfaces.distance, wall.distance)
        ends = np.isinf(interfaces.distance)
        self._add(live.where(ends), self.refracted.ends.radiance(live.where(ends), wall.where(np.flatnonzero(ends))))
        hit = np.flatnonzero(~ends)
        interfaces, live = interfaces.where(hit), live.where(hit)
        with np.errstate(under="ignore"):
            points = live.rays.origins + interfaces.distance[:, None] * live.rays.directions
        return replace(live, rays=replace(live.rays, origins=points)), interfaces

    def _goes_astray(self, body: int, hits: Hits, origin: Integers, interface: Array, wall: Array) -> Mask:
        """(n,): ray segments that show a hole of a body: they enter it and never leave."""
        closed = self.scene.objects[body].mesh.diagnosis.solid
        outside = closed | (origin + sum_signs(hits.before(wall), len(origin)) == 0)
        rightly = np.isfinite(interface) | (np.isfinite(wall) & outside)
        return np.asarray(~rightly & unbalanced(hits, origin))

    def _through_media(self, live: LiveRays, hits: Sequence[Hits], interface: Array, wall: Array) -> LiveRays:
        """Attenuate ray segments by the media, and add emitted and scattered radiance."""
        scene, volume, rays = self.scene, self.refracted.volume, live.rays
        end = np.minimum(interface, wall)
        none = np.empty(0, np.int64)
        parts = [Intervals(none, np.empty(0), np.empty(0), none, none)]
        for i in self.own.solids:
            origin = live.inside.windings[:, i].astype(np.int64)
            parts.append(body_intervals(hits[i].before(end), origin, end, i))
            self.found.valid[live.owner[self._goes_astray(i, hits[i], origin, interface, wall)]] = False
        sheets = [None if i in self.own.walls else metres for i, metres in enumerate(self.refracted.sheets)]
        # A sheet that lies on an interface is hit on one side of it only.
        until = np.where(interface < wall, interface - SHEET_ON_OPAQUE * scene.diagonal, wall)
        crossings = scene_crossings(scene, rays, hits, sheets, until, self.refracted.light.on_interfaces)
        segments, filling = volume_segments(scene, volume, rays, merge(parts), crossings)
        segments = emission_of_mixtures(volume, rays, segments, filling)
        emitted, depth = composite(segments, len(live))
        if self.refracted.scatter:
            light = scattered_once(self.refracted.light.paths, rays, segments, filling, self.refracted.tolerance)
            emitted = emitted + light.radiance
            self.found.valid[live.owner[~light.valid]] = False
        self._add(live, emitted)
        with np.errstate(under="ignore"):
            return replace(live, throughput=live.throughput * optics.transmittance(depth))


#: Default number of interfaces that a ray may hit.
BOUNCES = 8

#: Default number of rays per pixel before rough interfaces.
PATHS = 64

#: Smallest fraction of each color that one of several rays over a pixel must carry to be followed: behind a row of
#: lenses that leaves out 0.07 % of the light, in half of the time that the default of one ray takes.
FAINTEST_OF_MANY = 1e-4

#: Number of rays that are averaged together: the working arrays stay below 500 MB.
RAYS_TOGETHER = 1 << 16


def bends(scene: Scene) -> bool:
    """True if any interface of the scene changes light, so that not all rays are straight."""
    return any(body.has_interface for body in scene.bodies)


def refracted_light(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None = None,
    tolerance: float = 1e-6,
    bounces: int = BOUNCES,
    paths: int = PATHS,
    seed: int = 0,
) -> tuple[RefractedLight, Array]:
    """Radiance of a picture's pixels along refracted rays, row by row from the top left.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    method : Method, optional
        As for `render`.
    tolerance : float
        Relative error of light that media scatter once.
    bounces : int
        Interfaces that a ray may hit, from 0.
    paths : int
        Rays of each pixel, from 2, if some interface is rough; else one sees all.
    seed : int
        Of the random numbers.

    Returns
    -------
    light : RefractedLight
    standard_error : (n, 3) float64
        Of the radiance; 0 if all interfaces are polished.

    Raises
    ------
    InputError
        If an argument is not in its range, or a surface is one that the reference does not know.
    """
    _check(scene, bounces, paths)
    rays, rough = pixel_rays(scene.camera, size), _is_rough(scene)
    rng = np.random.default_rng(seed) if rough else None
    refracted = _refracted(scene, size, method, tolerance, bounces, rng, FAINTEST)
    return _mean(refracted, rays, paths) if rough else (refracted.see(rays), np.zeros((len(rays), 3)))


def light_over_pixels(
    scene: Scene,
    size: tuple[int, int],
    pixels: Mask,
    paths: int,
    tolerance: float = 1e-6,
    bounces: int = BOUNCES,
    seed: int = 0,
) -> tuple[Array, Mask]:
    """Radiance of pixels as a camera with a box filter takes it: the mean over rays that are spread over each.

    They are the points of samples, moved in each pixel by an offset of its own (Cranley & Patterson 1976,
    "Randomization of number theoretic methods for multiple integration"). So the mean has no bias, with any number of
    rays, and with two seeds its errors have nothing to do with each other. Rays that carry less than `FAINTEST_OF_MANY`
    of each color are not followed.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    pixels : (h, w) bool
        True where light is requested.
    paths : int
        Rays of each.
    tolerance, bounces, seed
        As of `refracted_light`.

    Returns
    -------
    radiance : (k, 3) float64
        Of the pixels, row by row.
    valid : (k,) bool
        All rays of a pixel are.
    """
    check_surfaces(scene, "use refracted_light along the centers")
    rng = np.random.default_rng(seed)
    moves = rng.random((2, *pixels.shape))
    chosen = np.flatnonzero(pixels)
    rays = []
    for shift in sample_shifts(paths):
        right, down = (shift[:, None, None] + moves) % 1.0 - 0.5
        rays.append(pixel_rays(scene.camera, size, (right, down)).where(chosen))
    refracted = _refracted(scene, size, None, tolerance, bounces, rng if _is_rough(scene) else None, FAINTEST_OF_MANY)
    found = refracted.see(Rays.joined(rays))
    with np.errstate(under="ignore"):
        radiance = found.radiance.reshape(paths, -1, 3).mean(axis=0)
    return radiance, np.asarray(found.valid.reshape(paths, -1).all(axis=0))


def _is_rough(scene: Scene) -> bool:
    return any(body.surface is not None and body.surface.roughness > 0 for body in scene.bodies)


def _refracted(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None,
    tolerance: float,
    bounces: int,
    rng: np.random.Generator | None,
    faintest: float,
) -> RefractedRays:
    light = SurfaceLight(LightPaths(scene, sheet_thicknesses(scene, method)))
    scatter = bool(scene.lights) and light.paths.volume.scatters
    return RefractedRays(light, size[0] / size[1], bounces, scatter, tolerance, rng, faintest)


def _mean(refracted: RefractedRays, rays: Rays, paths: int) -> tuple[RefractedLight, Array]:
    """Mean over several rays for each of `rays`, and its standard error."""
    each = max(RAYS_TOGETHER // paths, 1)
    parts, spreads = [], []
    for begin in range(0, len(rays), each):
        some = np.arange(begin, min(begin + each, len(rays)))
        found = refracted.see(rays.where(np.repeat(some, paths)))
        radiance, residual = (array.reshape(len(some), paths, 3) for array in (found.radiance, found.residual))
        valid = found.valid.reshape(len(some), paths).all(axis=1)
        with np.errstate(under="ignore"):
            parts.append((radiance.mean(axis=1), residual.mean(axis=1), valid))
            spreads.append(radiance.std(axis=1, ddof=1))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return RefractedLight(*columns), np.concatenate(spreads) / np.sqrt(paths)


def _check(scene: Scene, bounces: int, paths: int) -> None:
    if bounces < 0:
        raise InputError(f"{bounces} bounces", "the number of bounces must be 0 or above", "use a value such as 8")
    if paths < 2:
        raise InputError(
            f"{paths} paths through rough interfaces",
            "at least two paths are needed to estimate the noise",
            "use a value such as 64",
        )
    check_surfaces(scene, "use refraction=False")


def check_surfaces(scene: Scene, instead: str, *, random: bool = False) -> None:
    """Raise unless the reference knows the surfaces of all interfaces.

    Errors say what to do `instead`. `random`: paths are followed by chance, which know films on rough interfaces of
    solids, and polished coats on these.
    """
    for body in scene.bodies:
        surface, what = body.surface, f"reference of {body.mesh.name!r}"
        if body.covers or not body.has_interface or surface is None:
            continue
        unknown = ("normal_texture", "emissive_texture", "occlusion_texture")
        if found := [name for name in unknown if getattr(surface, name) is not None]:
            raise InputError(
                what, f"the surface of the object has a {found[0]}", f"use a surface without this texture, or {instead}"
            )
        if body.has_holes:
            raise InputError(
                what,
                "the surface of the object has holes by an alpha mask",
                f"use a surface without an alpha mask, or {instead}",
            )
        if surface.iridescence or surface.clearcoat:
            rough = surface.clearcoat_roughness if surface.clearcoat else 0.0
            walks = random and body.sheet_thickness is None
            if max(0.0 if walks else surface.roughness, rough) > 0.0:
                raise InputError(
                    what, "the object has a rough thin film or clear coat", f"use a polished one, or {instead}"
                )
