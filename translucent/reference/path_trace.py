"""Monte Carlo path tracing through media and interfaces: all light that finds its way, with error bars.

`translucent.reference.path_trace` follows light where nothing bends it, and
`translucent.reference.interface_paths` where something does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.reference.compositing import _layers
from translucent.reference.interface_paths import InterfacePaths
from translucent.reference.interfaces import Optics
from translucent.reference.light_paths import LightPaths
from translucent.reference.phase import scattered_directions
from translucent.reference.rays import Rays, pixel_rays
from translucent.reference.refracted import RayEnds
from translucent.reference.refraction import bends, check_untextured
from translucent.reference.render import CrossedMedia, crossed_media, scene_hits, seen_behind, shade_hits
from translucent.reference.sheets import sheet_thicknesses
from translucent.reference.surface_light import SurfaceLight
from translucent.reference.tracer import Lines
from translucent.reference.volume import points_on
from translucent.scene.camera import check_size
from translucent.scene.scene import Scene

#: Weight below which paths end by Russian roulette, or go on with this weight.
ROULETTE = 0.1


@dataclass(frozen=True, eq=False)
class _Events:
    """Collisions of paths with media: index of each path, place, and medium there."""

    path: Integers
    points: Array
    weights: Array


class StraightPaths:
    """Tracer of random paths, for channels that all media treat alike.

    Parameters
    ----------
    light : LightPaths
    channels : (c,) int64
    max_events : int, optional
        Light scattered more often is left out.
    rng : Generator
    """

    def __init__(self, light: LightPaths, channels: Integers, max_events: int | None, rng: np.random.Generator) -> None:
        self.light, self.scene, self.volume = light, light.scene, light.volume
        self.surface = SurfaceLight(light)
        self.channels, self.max_events, self.rng = channels, max_events, rng
        self.extinction, self.scattering = (
            table[:, channels[0]] for table in (light.volume.extinction, light.volume.scattering)
        )

    def radiance(self, rays: Rays) -> Array:
        """(n, c): radiance of a path along each ray."""
        self.found = np.zeros((len(rays), len(self.channels)))
        throughput, owner = np.ones(len(rays)), np.arange(len(rays))
        events = 0
        while len(owner):
            media = self._media(rays)
            met = self._fly(rays, media, throughput, owner)
            self._add_behind(rays, media, throughput, owner, met, scattered=events > 0)
            if events == self.max_events:
                break
            events += 1
            throughput, owner = throughput[met.path] * self._albedo(met.weights), owner[met.path]
            rays = replace(rays.where(met.path), origins=met.points)
            self._add_lights(rays, met.weights, throughput, owner)
            lives, throughput = self._roulette(throughput)
            rays, throughput, owner = rays.where(lives), throughput[lives], owner[lives]
            chosen = self._chosen_phases(met.weights[lives])
            rays = replace(rays, directions=scattered_directions(rays.directions, self.volume.phases, chosen, self.rng))
        return self.found

    def _media(self, rays: Rays) -> CrossedMedia:
        everywhere = np.full(len(rays), np.inf)
        hits = self.light.tracer.hits(Lines(rays.origins, rays.directions, -everywhere, everywhere))
        return crossed_media(self.surface, rays, hits, self.light.sheets)

    def _fly(self, rays: Rays, media: CrossedMedia, throughput: Array, owner: Integers) -> _Events:
        """Follow the rays to their first events; adds the emission of media on the way."""
        flying = np.ones(len(rays), dtype=bool)
        found = [_Events(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, len(self.extinction))))]
        segments = media.segments
        for layer in _layers(segments.pixel):
            layer = layer[flying[segments.pixel[layer]]]
            t, majorant = segments.t_enter[layer], self._majorants(media, layer)
            some = majorant > 0
            layer, t, majorant = layer[some], t[some], majorant[some]
            while len(layer):
                t = t + self.rng.exponential(size=len(t)) / majorant
                inside = t < segments.t_exit[layer]
                layer, t, majorant = layer[inside], t[inside], majorant[inside]
                path = segments.pixel[layer]
                points = points_on(rays, path, t)
                weights = self.volume.at(media.filling[layer], points)
                emission = (weights @ self.volume.emission)[:, self.channels]
                self._add(owner[path], emission * (throughput[path] / majorant)[:, None])
                real = self.rng.random(len(layer)) * majorant < weights @ self.extinction
                found.append(_Events(path[real], points[real], weights[real]))
                flying[path[real]] = False
                layer, t, majorant = layer[~real], t[~real], majorant[~real]
        return _Events(*(np.concatenate([getattr(part, name) for part in found]) for name in _Events.__match_args__))

    def _majorants(self, media: CrossedMedia, layer: Integers) -> Array:
        """(k,): majorants of the extinction in segments; a medium that only emits is met about once, too."""
        filling, segments = media.filling[layer], media.segments
        emits = (filling @ self.volume.emission > 0).any(axis=1)
        once = np.where(emits, 1.0 / segments.length[layer], 0.0)
        return np.maximum(self.volume.majorant(filling, self.extinction), once)

    def _add_behind(
        self, rays: Rays, media: CrossedMedia, throughput: Array, owner: Integers, met: _Events, scattered: bool
    ) -> None:
        through = np.ones(len(rays), dtype=bool)
        through[met.path] = False
        behind = seen_behind(self.surface, rays, media.wall)
        if scattered:
            open_to = np.isinf(media.wall.distance)
            behind[open_to] = self.scene.environment.lighting(rays.directions[open_to])
        self._add(owner[through], behind[through][:, self.channels] * throughput[through, None])

    def _add_lights(self, rays: Rays, weights: Array, throughput: Array, owner: Integers) -> None:
        """Add light that reaches the origins of `rays` and is scattered towards the eye."""
        total = weights @ self.scattering
        for light in self.light.lights:
            arrival = self.light.arrival(light, rays.origins)
            cosine = -np.einsum("ki,ki->k", arrival.travel, rays.directions)
            phase = self.volume.source(weights, cosine)[:, self.channels[0]] / np.where(total > 0, total, 1.0)
            with np.errstate(under="ignore"):
                self._add(owner, arrival.irradiance[:, self.channels] * (phase * throughput)[:, None])

    def _add(self, owner: Integers, radiance: Array) -> None:
        # A path has at most one such event at a time, so no index comes twice.
        self.found[owner] += radiance

    def _albedo(self, weights: Array) -> Array:
        """(k,): share of the light that an event scatters."""
        return np.asarray((weights @ self.scattering) / (weights @ self.extinction))

    def _chosen_phases(self, weights: Array) -> Integers:
        """(k,): numbers of the phase functions of one of the media at each place, chosen by how much they scatter."""
        shares = np.cumsum(weights * self.scattering, axis=1)
        chosen = (shares < self.rng.random((len(weights), 1)) * shares[:, -1:]).sum(axis=1)
        return np.asarray(self.volume.phase[np.minimum(chosen, len(self.scattering) - 1)])

    def _roulette(self, throughput: Array) -> tuple[Integers, Array]:
        """Russian roulette: mask of paths that go on, and the weight that each would then carry."""
        chance = np.minimum(throughput / ROULETTE, 1.0)
        lives = np.flatnonzero(self.rng.random(len(throughput)) < chance)
        return lives, throughput / np.where(chance > 0, chance, 1.0)


#: Number of paths that are followed together, straight and bent ones: the working arrays stay below 500 MB.
BATCH, BENT_BATCH = 1 << 14, 1 << 16

#: Largest optical depth of a scene without a limit on events: light is scattered about as often as its square.
MAX_DEPTH = 1e4

#: Channels that one path stands for, how many paths are followed together, and their radiance (n, c) along rays.
_Tracer: TypeAlias = tuple[Integers, int, Callable[[Rays], Array]]


def path_trace(
    scene: Scene, size: tuple[int, int], paths: int = 64, seed: int = 0, max_events: int | None = None
) -> tuple[Frame, Array]:
    """Path trace a scene, with multiple scattering of all lights, of the environment and of emission.

    Where interfaces change light (`Object.has_interface`), each path is reflected or refracted by chance: by Fresnel
    between the media of its record (Schmidt & Budge 2002), at rough interfaces by a walk among GGX microfacets that
    loses nothing (Heitz et al. 2016). Sheets, tints, paint, dispersion and smooth normals are what they are for
    `render`, without a limit of bounces. Radiance is basic radiance L / n^2, as there.

    Point and directional lights are followed straight on, and through the microfacets of rough interfaces. What
    polished interfaces bend of them no path finds: caustics, and light in media behind such interfaces. The plan tells
    where this leaves out something. Light of the environment is all there.

    Opaque surfaces and paint send back what they do for `render`, and a backdrop fixed to the picture lights like the
    mean of its squares. Light inside a medium has no finite variance: there the error bars say little. Nor do they
    with few paths before rare bright reflections.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed or sheets, and no sheet scatters.
    size : (width, height)
        In pixels.
    paths : int
        Of each pixel and channel, from 2; the error falls with their square root.
    seed : int
        Of the random numbers.
    max_events : int, optional
        Light scattered more often is left out; 1 is single scattering. Default: no limit.

    Returns
    -------
    frame : Frame
        Of float64 arrays; all but the radiance is exact.
    standard_error : (h, w, 3) float64
        Of the radiance.

    Raises
    ------
    InputError
        If an argument is not in its range, a body is open, a sheet scatters, an interface has textures, the media are
        too deep, or radiance is ambient.
    """
    began = time.perf_counter()
    width, height = check_size(size)
    _check(scene, paths, max_events)
    light = LightPaths(scene, sheet_thicknesses(scene))
    with np.errstate(over="ignore"):
        depth = 2.0 * light.tracer.radius * float(light.volume.extinction.max())
    if max_events is None and depth > MAX_DEPTH:
        raise InputError(
            "path tracing", f"media up to {depth:.0e} deep, in which light is lost for ages", "give max_events"
        )
    rays = pixel_rays(scene.camera, (width, height))
    arrays = shade_hits(scene, rays, scene_hits(scene, (width, height)), light.sheets, SurfaceLight(light))
    rng = np.random.default_rng(seed)
    radiance, error = np.zeros((2, len(rays), 3))
    for tracer in _tracers(light, width / height, max_events, rng):
        radiance[:, tracer[0]], error[:, tracer[0]] = _estimate(tracer, rays, paths)
    arrays["radiance"] = radiance
    reason = (
        f"asked for: {paths} paths for each pixel, scattered {'without limit' if max_events is None else max_events}"
    )
    frame = Frame(
        **{name: array.reshape(height, width, *array.shape[1:]) for name, array in arrays.items()},
        plan=RenderPlan(
            scene,
            SignedDepth(),
            (PassSpec(PassName.PATH_TRACE, reason),),
            limits=(Note(NoteKind.NOISE, "radiance has noise"),),
            unmodelled=_left_out(scene),
        ),
        seconds={"total": time.perf_counter() - began},
        provenance={"backend": "reference", "numpy": np.__version__},
        scene=scene,
    )
    return frame, error.reshape(height, width, 3)


def _check(scene: Scene, paths: int, max_events: int | None) -> None:
    if scene.scatters_ambient:
        raise InputError(
            "path tracing with ambient radiance",
            "it stands for what paths find by themselves: light of the environment, and light scattered often",
            "leave ambient out",
        )
    if paths < 2:
        raise InputError(f"path tracing with {paths} paths", "no spread without two", "use for example 64")
    if max_events is not None and max_events < 0:
        raise InputError(f"max_events {max_events}", "below 0", "use 1 for single scattering, None for no limit")
    check_untextured(scene, "use tl.reference.render with refraction=False")
    for body in scene.bodies:
        if body.sheet_thickness is None and not body.mesh.diagnosis.solid:
            raise InputError(f"path tracing {body.mesh.name!r}", "not closed", "use tl.reference.render")
        if body.sheet_thickness is not None and body.medium is not None and body.medium.scatters:
            raise InputError(f"path tracing {body.mesh.name!r}", "a sheet that scatters", "use tl.reference.render")


def _left_out(scene: Scene) -> tuple[Note, ...]:
    """Notes on light that no path finds."""
    polished = [
        body
        for body in scene.bodies
        if body.has_interface
        and body.medium is not None
        and body.medium.ior != 1.0
        and (body.surface is None or body.surface.roughness == 0.0 or body.sheet_thickness is not None)
    ]
    if not scene.lights or not polished:
        return ()
    text = "light that polished interfaces refract or reflect on its way from lights: in media, and as caustics"
    return (Note(NoteKind.LIGHTS_LEFT_OUT, text),)


def _straight(scene: Scene) -> bool:
    """True if paths turn at nothing but events in media."""
    return not bends(scene) and all(body.sheet_thickness is None for body in scene.bodies)


def _tracers(light: LightPaths, aspect: float, max_events: int | None, rng: np.random.Generator) -> Iterator[_Tracer]:
    """Tracers of all channels, one for each group whose light takes the same ways."""
    scene, volume = light.scene, light.volume
    if _straight(scene):
        for channels in _alike(np.concatenate([volume.extinction, volume.scattering])):
            straight = StraightPaths(light, channels, max_events, rng)
            yield channels, BATCH, straight.radiance
        return
    optics = [Optics(scene, light.sheets, channel) for channel in range(3)]
    for channels in _alike(np.concatenate([volume.scattering, np.stack([own.iors for own in optics], axis=1)])):
        surface = SurfaceLight(light)
        bent = InterfacePaths(surface, RayEnds(surface, aspect), optics[channels[0]], channels, max_events, rng)
        yield channels, BENT_BATCH, bent.radiance


def _alike(columns: Array) -> list[Integers]:
    """Groups of channels, of the columns (n, 3), that are equal: one path stands for all of them."""
    _, group = np.unique(columns, axis=1, return_inverse=True)
    return [np.flatnonzero(group.ravel() == number) for number in np.unique(group)]


def _estimate(tracer: _Tracer, rays: Rays, paths: int) -> tuple[Array, Array]:
    """Mean (n, c) over the paths of each ray, and its standard error."""
    channels, batch, radiance = tracer
    mean, spread = np.zeros((2, len(rays), len(channels)))
    each = max(batch // paths, 1)
    for begin in range(0, len(rays), each):
        some = np.arange(begin, min(begin + each, len(rays)))
        found = radiance(rays.where(np.repeat(some, paths))).reshape(len(some), paths, len(channels))
        mean[some] = found.mean(axis=1)
        with np.errstate(under="ignore"):
            spread[some] = found.std(axis=1, ddof=1)
    return mean, spread / np.sqrt(paths)
