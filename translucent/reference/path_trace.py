"""Monte Carlo path tracing through media and interfaces: all light that reaches the eye, with error bars.

At each interface a path takes one branch, chosen by its fraction of the light: by Fresnel and Snell at polished
interfaces, by a walk among visible microfacets at rough ones, as `translucent.reference.interactions` says. Free paths
are found by delta tracking of what media scatter (Woodcock et al. 1965). Absorption and emission are integrated along
each segment (Novak et al. 2018, section 5), so that paths without scattering have no noise of it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.frames.frame import Frame
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.reference.compositing import _layers, composite, emission_of_mixtures
from translucent.reference.hits import Hits, Lines, Rays, pixel_rays
from translucent.reference.interactions import Interactions, LiveRays, StraightLight, joined
from translucent.reference.interfaces import FirstInterfaces, Inside, Optics
from translucent.reference.intervals import Intervals, body_intervals, merge
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.refracted import RayEnds, check_surfaces
from translucent.reference.render import scene_hits, shade_hits
from translucent.reference.surfaces import (
    OpaqueHits,
    lambert_surfaces,
    nearest_opaque,
    scene_crossings,
    sheet_thicknesses,
)
from translucent.reference.volume import (
    Segments,
    Volume,
    multiplicities,
    points_on,
    scattered_directions,
    turned,
    volume_segments,
)
from translucent.scene.camera import Camera, check_size
from translucent.scene.scene import Scene

#: Fraction of light below which paths end by Russian roulette, or go on with this fraction.
ROULETTE = 0.1

#: Number of interfaces after which paths end by Russian roulette whatever they carry, and their chance to go on each
#: time. Light that total reflection holds in a lossless body loses nothing, and might never leave.
MANY_INTERFACES, GOES_ON = 256, 0.95

#: Number of mean free paths after which surfaces are searched for anew: few rays in dense media get as far.
FREE_PATHS = 3.0


@dataclass(frozen=True, eq=False)
class _Flight:
    """Straight flights of paths up to the next surface, or as far as surfaces were searched for; all arrays (k,).

    Attributes
    ----------
    hits : list of Hits
        Of each object.
    wall : OpaqueHits
    interfaces : Interfaces
    end : (k,) float64
        Distance in metres of the first of these, or of the end of the search.
    leaves : (k,) bool
        Nothing of the scene lies beyond the end.
    """

    hits: list[Hits]
    wall: OpaqueHits
    interfaces: FirstInterfaces
    end: Array
    leaves: Mask


class InterfacePaths:
    """Tracer of random paths, for channels of light with the same indices of refraction and scattering.

    Parameters
    ----------
    surface : SurfaceLight
    ends : RayEnds
    own : Optics
        For one of the channels.
    channels : (c,) int64
    max_events : int, optional
        Light scattered more often is left out.
    rng : Generator
    """

    def __init__(
        self,
        surface: SurfaceLight,
        ends: RayEnds,
        own: Optics,
        channels: Integers,
        max_events: int | None,
        rng: np.random.Generator,
    ) -> None:
        light = surface.paths
        self.light, self.scene, self.ends, self.own, self.rng = light, light.scene, ends, own, rng
        self.surface = surface
        self.channels, self.max_events = channels, max_events
        self.scattering = light.volume.scattering[:, channels[0]]
        self.absorbing = Volume(light.scene)
        self.absorbing.extinction = light.volume.extinction - light.volume.scattering
        self.straight = StraightLight(light, own)

    def radiance(self, rays: Rays) -> Array:
        """(n, c): radiance of a path along each ray."""
        count = len(rays)
        self.found, self.start = np.zeros((count, 3)), np.zeros(count)
        self.events, self.interfaces_hit = np.zeros((2, count), dtype=np.int64)
        carried = np.zeros((count, 3))
        carried[:, self.channels] = 1.0
        never = np.zeros(count, dtype=bool)
        live = LiveRays(rays, np.arange(count), carried, self._at_origins(rays), never, never)
        while len(live):
            live = self._step(live)
        return self.found[:, self.channels]

    def _at_origins(self, rays: Rays) -> Inside:
        low, _ = self.light.tracer.ball(rays.origins, rays.directions)
        behind = np.flatnonzero(low < 0.0)
        everywhere = np.full(len(behind), np.inf)
        lines = Lines(rays.origins[behind], rays.directions[behind], -everywhere, np.zeros(len(behind)))
        found, inside = self.own.at_origins(self.light.tracer.hits(lines), len(behind)), self.own.outside(len(rays))
        inside.windings[behind], inside.since[behind] = found.windings, found.since
        return inside

    def _step(self, live: LiveRays) -> LiveRays:
        """Follow paths to their next events, and return the paths that continue."""
        flight = self._fly(live)
        live, event, weights = self._through_media(live, flight)
        collided = np.isfinite(event)
        walled = ~collided & (flight.wall.distance <= flight.end)
        hit = ~collided & (flight.interfaces.distance <= flight.end)
        self._add_ends(live, flight, np.flatnonzero(~collided & ~hit & ~walled & flight.leaves))
        further = np.flatnonzero(~collided & ~hit & ~walled & ~flight.leaves)
        return joined(
            (
                self._moved(live.where(further), flight.end[further], flight.interfaces.there.where(further)),
                self._interact(live, flight, np.flatnonzero(hit & ~walled)),
                self._reflect(live, flight, np.flatnonzero(walled)),
                self._scatter(live, flight, event, weights),
            )
        )

    def _fly(self, live: LiveRays) -> _Flight:
        rays, tracer = live.rays, self.light.tracer
        _, far = tracer.ball(rays.origins, rays.directions)
        far = np.maximum(far, 0.0)
        reach = np.minimum(far, FREE_PATHS * self._mean_free_path(live.inside))
        hits = tracer.hits(Lines(rays.origins, rays.directions, self.start[live.owner], reach))
        wall = nearest_opaque(self.scene, hits, len(live))
        interfaces = self.own.first_interfaces([line.before(wall.distance) for line in hits], live.inside)
        end = np.minimum(np.minimum(interfaces.distance, wall.distance), reach)
        return _Flight(hits, wall, interfaces, end, reach >= far)

    def _mean_free_path(self, inside: Inside) -> Array:
        """(k,): lower bound of the mean free path in the media that paths start in."""
        dense = np.zeros(len(inside.windings))
        if self.scattering.any():
            dense = self.light.volume.majorant(self._filling(inside), self.scattering)
        return np.where(dense > 0, 1.0 / np.where(dense > 0, dense, 1.0), np.inf)

    def _filling(self, inside: Inside) -> Array:
        filling, solids = np.zeros(inside.windings.shape), np.array(self.own.solids, dtype=np.int64)
        filling[:, solids] = multiplicities(self.scene, solids, inside.windings[:, solids].T).T
        return filling

    def _through_media(self, live: LiveRays, flight: _Flight) -> tuple[LiveRays, Array, Array]:
        """Attenuate paths up to their events, and add emitted radiance; also distances and media of the events."""
        rays, count = live.rays, len(live)
        segments, filling = self._segments(live, flight)
        event, weights = self._collisions(rays, segments, filling)
        segments, filling = self._cut(rays, segments, filling, event)
        segments = emission_of_mixtures(self.absorbing, rays, segments, filling)
        emitted, depth = composite(segments, count)
        self._add(live, emitted)
        with np.errstate(under="ignore"):
            return replace(live, throughput=live.throughput * optics.transmittance(depth)), event, weights

    def _segments(self, live: LiveRays, flight: _Flight) -> tuple[Segments, Array]:
        rays, end = live.rays, flight.end
        none = np.empty(0, np.int64)
        parts = [Intervals(none, np.empty(0), np.empty(0), none, none)]
        for i in self.own.solids:
            origin = live.inside.windings[:, i].astype(np.int64)
            parts.append(body_intervals(flight.hits[i].before(end), origin, end, i))
        sheets = [None if i in self.own.walls else metres for i, metres in enumerate(self.own.sheets)]
        # A sheet that lies on an interface is hit on one side of it only.
        at_interface = flight.interfaces.distance <= end
        until = np.where(at_interface, end - SHEET_ON_OPAQUE * self.scene.diagonal, end)
        crossings = scene_crossings(self.scene, rays, flight.hits, sheets, until, self.surface.on_interfaces)
        return volume_segments(self.scene, self.absorbing, rays, merge(parts), crossings)

    def _collisions(self, rays: Rays, segments: Segments, filling: Array) -> tuple[Array, Array]:
        """Distances (k,) at which media scatter paths, inf where none does, and weights (k, objects) of media there."""
        distance, weights = np.full(len(rays), np.inf), np.zeros((len(rays), filling.shape[1]))
        majorants = self.light.volume.majorant(filling, self.scattering)
        for layer in _layers(segments.pixel):
            layer = layer[np.isinf(distance[segments.pixel[layer]]) & (majorants[layer] > 0)]
            t = segments.t_enter[layer]
            while len(layer):
                t = t + self.rng.exponential(size=len(t)) / majorants[layer]
                inside = t < segments.t_exit[layer]
                layer, t = layer[inside], t[inside]
                path = segments.pixel[layer]
                here = self.light.volume.at(filling[layer], points_on(rays, path, t))
                real = self.rng.random(len(layer)) * majorants[layer] < here @ self.scattering
                distance[path[real]], weights[path[real]] = t[real], here[real]
                layer, t = layer[~real], t[~real]
        return distance, weights

    def _cut(self, rays: Rays, segments: Segments, filling: Array, event: Array) -> tuple[Segments, Array]:
        """Segments up to the events, with their means of absorption and emission."""
        if not np.isfinite(event).any():
            return segments, filling
        until = event[segments.pixel]
        kept = np.flatnonzero(segments.t_enter < until)
        cut = until[kept] < segments.t_exit[kept]
        parts = (getattr(segments, name)[kept] for name in Segments.__match_args__)
        pixel, t_enter, t_exit, length, extinction, emission, counts = parts
        filling, until = filling[kept], until[kept]
        t_exit, length = np.where(cut, until, t_exit), np.where(cut, until - t_enter, length)
        if self.absorbing.varied.size:
            ends = (points_on(rays, pixel[cut], t[cut]) for t in (t_enter, t_exit))
            mean = self.absorbing.between(filling[cut], *ends)
            extinction[cut], emission[cut] = mean @ self.absorbing.extinction, mean @ self.absorbing.emission
        return Segments(pixel, t_enter, t_exit, length, extinction, emission, counts), filling

    def _add(self, live: LiveRays, radiance: Array) -> None:
        # Each path is at one place at a time, so no owner comes twice.
        with np.errstate(under="ignore"):
            self.found[live.owner] += live.throughput * radiance

    def _add_ends(self, live: LiveRays, flight: _Flight, chosen: Integers) -> None:
        wall = flight.wall.where(chosen)
        self._add(live.where(chosen), self.ends.radiance(live.where(chosen), wall))

    def _moved(self, live: LiveRays, distance: Array, inside: Inside, start: float = 0.0) -> LiveRays:
        self.start[live.owner] = start
        with np.errstate(under="ignore"):
            points = live.rays.origins + distance[:, None] * live.rays.directions
        return replace(live, rays=replace(live.rays, origins=points), inside=inside)

    def _interact(self, live: LiveRays, flight: _Flight, hit: Integers) -> LiveRays:
        """Interact paths with interfaces, and return the paths that continue."""
        interfaces = flight.interfaces.where(hit)
        live = self._moved(live.where(hit), interfaces.distance, interfaces.here, self.own.tolerance)
        if not len(live):
            return live
        outcome = Interactions(self.own, live, interfaces, self.surface, self.rng, self.straight).outcome()
        self._add(live, outcome.radiance)
        live = self._one_branch(joined(outcome.branches))
        self.interfaces_hit[live.owner] += 1
        return self._roulette(live)

    def _reflect(self, live: LiveRays, flight: _Flight, hit: Integers) -> LiveRays:
        """Reflect paths diffusely from opaque objects (Lambert), and add light of lights and emission there."""
        if not hit.size:
            return live.where(hit)
        wall = flight.wall.where(hit)
        inside = self._inside_at(live.inside, flight, flight.wall.distance, hit)
        live = self._moved(live.where(hit), wall.distance, inside, self.own.tolerance)
        normals, color, emitted = lambert_surfaces(self.scene, live.rays.directions, wall)
        self._add(live, emitted + color / np.pi * self.straight.on_surfaces(live, normals, self.own.tolerance))
        up, turn = np.sqrt(self.rng.random(len(live))), 2.0 * np.pi * self.rng.random(len(live))
        directions = turned(normals, up, turn)
        always = np.ones(len(live), dtype=bool)
        rays = replace(live.rays, directions=directions)
        self.interfaces_hit[live.owner] += 1
        with np.errstate(under="ignore"):
            throughput = live.throughput * color
        return self._roulette(replace(live, rays=rays, throughput=throughput, bent=always, reflected=always))

    def _one_branch(self, live: LiveRays) -> LiveRays:
        """One branch of each path, chosen by its throughput: a polished sheet has two."""
        live = live.where(np.argsort(live.owner, kind="stable"))
        carried = live.throughput.max(axis=1)
        first = np.flatnonzero(np.diff(live.owner, prepend=-1) != 0)
        total = np.add.reduceat(carried, first)
        double = np.diff(first, append=len(live)) == 2
        fraction = np.where(total > 0, carried[first] / np.where(total > 0, total, 1.0), 1.0)
        second = double & (self.rng.random(len(first)) >= fraction)
        chosen = first + second
        chance = np.where(double, np.where(second, 1.0 - fraction, fraction), 1.0)
        live = live.where(chosen)
        return replace(live, throughput=live.throughput / chance[:, None])

    def _scatter(self, live: LiveRays, flight: _Flight, event: Array, weights: Array) -> LiveRays:
        """Scatter paths at their events in media, and add the light of lights there."""
        some = np.flatnonzero(np.isfinite(event))
        if self.max_events is not None:
            some = some[self.events[live.owner[some]] < self.max_events]
        inside = self._inside_at(live.inside, flight, event, some)
        live, weights = self._moved(live.where(some), event[some], inside), weights[some]
        if not len(live):
            return live
        self.events[live.owner] += 1
        self._add(live, self.straight.scattered(live, weights, int(self.channels[0])))
        chosen = self._chosen_phases(weights)
        rays = replace(
            live.rays, directions=scattered_directions(live.rays.directions, self.light.volume.phases, chosen, self.rng)
        )
        always = np.ones(len(live), dtype=bool)
        return self._roulette(replace(live, rays=rays, bent=always, reflected=always))

    def _inside_at(self, inside: Inside, flight: _Flight, event: Array, some: Integers) -> Inside:
        """Interior lists at the events: paths may have crossed surfaces without an interface."""
        hits = [line.before(np.where(np.isfinite(event), event, 0.0)) for line in flight.hits]
        return self.own.crossed(hits, inside).where(some)

    def _chosen_phases(self, weights: Array) -> Integers:
        """(k,): numbers of the phase functions of one of the media at each place, chosen by how much they scatter."""
        fractions = np.cumsum(weights * self.scattering, axis=1)
        chosen = (fractions < self.rng.random((len(weights), 1)) * fractions[:, -1:]).sum(axis=1)
        return np.asarray(self.light.volume.phase[np.minimum(chosen, len(self.scattering) - 1)])

    def _roulette(self, live: LiveRays) -> LiveRays:
        """Paths that survive Russian roulette, with the light of the others (Arvo & Kirk 1990)."""
        chance = np.minimum(live.throughput.max(axis=1) / ROULETTE, 1.0)
        chance = np.where(self.interfaces_hit[live.owner] > MANY_INTERFACES, np.minimum(chance, GOES_ON), chance)
        # Without a direction light is lost.
        lives = (self.rng.random(len(live)) < chance) & live.rays.directions.any(axis=1)
        live = live.where(lives)
        return replace(live, throughput=live.throughput / chance[lives, None])


#: Number of paths that are followed together: the working arrays stay below 500 MB.
BENT_BATCH = 1 << 16

#: Largest optical depth of a scene without a limit on events: light is scattered about as often as its square.
MAX_DEPTH = 1e4


def path_trace(
    scene: Scene,
    size: tuple[int, int],
    paths: int = 64,
    seed: int = 0,
    max_events: int | None = None,
    *,
    spread: bool = False,
) -> tuple[Frame, Array]:
    """Path trace a scene, with multiple scattering of all lights, of the environment and of emission.

    Where interfaces change light (`Object.has_interface`), each path is reflected or refracted by chance: by Fresnel
    between the media of its interior list (Schmidt & Budge 2002), at rough interfaces by a walk among GGX microfacets
    that loses nothing (Heitz et al. 2016). Sheets, tints, diffuse bases, dispersion and smooth normals are what they
    are for `render`, without a limit of bounces. Radiance is basic radiance L / n^2, as there.

    Point and directional lights are followed straight on, and through the microfacets of rough interfaces. What
    polished interfaces bend of them no path finds: caustics, and light in media behind such interfaces. The plan tells
    where this leaves out something. Light of the environment is all there.

    Paths go on from opaque surfaces, which reflect diffusely, so that these and bodies light each other. Diffuse bases
    reflect as they do for `render`, and a backdrop fixed to the picture lights like the mean of its squares. A sphere
    light counts as points. Light inside a medium has no finite variance: there the error bars say little. Nor do they
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
    spread : bool
        Paths begin all over each pixel, as a camera with a box filter takes it; else along the centers of pixels.

    Returns
    -------
    frame : Frame
        Of float64 arrays; all but the radiance is exact.
    standard_error : (h, w, 3) float64
        Of the radiance.

    Raises
    ------
    InputError
        If an argument is not in its range, a body is open, a sheet scatters, a surface is one that it does not know,
        the media are too deep, or radiance is ambient.
    """
    began = time.perf_counter()
    width, height = check_size(size)
    _check(scene, paths, max_events)
    light = LightPaths(scene, sheet_thicknesses(scene))
    with np.errstate(over="ignore"):
        depth = 2.0 * light.tracer.radius * float(light.volume.extinction.max())
    if max_events is None and depth > MAX_DEPTH:
        raise InputError(
            "path tracing",
            f"the media have an optical depth of {depth:.0e}, in which a path has very many events",
            "limit the events of a path with max_events",
        )
    rays = pixel_rays(scene.camera, (width, height))
    surface = SurfaceLight(light)
    arrays = shade_hits(scene, rays, scene_hits(scene, (width, height)), light.sheets, surface)
    rng = np.random.default_rng(seed)
    radiance, error = np.zeros((2, len(rays), 3))
    optics = [Optics(scene, light.sheets, channel) for channel in range(3)]
    ends = RayEnds(surface, width / height)
    for channels in _alike(np.concatenate([light.volume.scattering, np.stack([own.iors for own in optics], axis=1)])):
        tracer = InterfacePaths(surface, ends, optics[channels[0]], channels, max_events, rng)
        radiance[:, channels], error[:, channels] = (
            _estimate_over_pixels(tracer, scene.camera, (width, height), paths)
            if spread
            else _estimate(tracer, rays, paths)
        )
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
            limits=(Note(NoteKind.NOISE, "the radiance has noise"),),
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
            (
                "ambient radiance stands for multiple scattering and for the environment, which path tracing "
                "computes itself"
            ),
            "omit the ambient radiance",
        )
    if paths < 2:
        raise InputError(
            f"path tracing with {paths} paths",
            "at least two paths are needed to estimate the noise",
            "use a value such as 64",
        )
    if max_events is not None and max_events < 0:
        raise InputError(
            f"max_events {max_events}",
            "the number of events must be 0 or above",
            "use 1 for single scattering, or None for no limit",
        )
    check_surfaces(scene, "use tl.reference.render with refraction=False", random=True)
    for body in scene.bodies:
        if body.sheet_thickness is None and not body.mesh.diagnosis.solid:
            raise InputError(f"path tracing {body.mesh.name!r}", "the mesh is not closed", "use tl.reference.render")
        if body.sheet_thickness is not None and body.medium is not None and body.medium.scatters:
            raise InputError(f"path tracing {body.mesh.name!r}", "the sheet scatters light", "use tl.reference.render")


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
    text = "caustics and refracted light of lights without a size are missing"
    return (Note(NoteKind.LIGHTS_LEFT_OUT, text),)


def _alike(columns: Array) -> list[Integers]:
    """Groups of channels with equal columns (n, 3): one path serves all of a group."""
    _, group = np.unique(columns, axis=1, return_inverse=True)
    return [np.flatnonzero(group.ravel() == number) for number in np.unique(group)]


def _estimate(tracer: InterfacePaths, rays: Rays, paths: int) -> tuple[Array, Array]:
    """Mean (n, c) over the paths of each ray, and its standard error."""
    mean, spread = np.zeros((2, len(rays), len(tracer.channels)))
    each = max(BENT_BATCH // paths, 1)
    for begin in range(0, len(rays), each):
        some = np.arange(begin, min(begin + each, len(rays)))
        found = tracer.radiance(rays.where(np.repeat(some, paths))).reshape(len(some), paths, -1)
        mean[some] = found.mean(axis=1)
        with np.errstate(under="ignore"):
            spread[some] = found.std(axis=1, ddof=1)
    return mean, spread / np.sqrt(paths)


def _estimate_over_pixels(
    tracer: InterfacePaths, camera: Camera, size: tuple[int, int], paths: int
) -> tuple[Array, Array]:
    """Mean (n, c) over paths that begin at random places of each pixel, and its standard error."""
    mean, squares = np.zeros((2, size[0] * size[1], len(tracer.channels)))
    for count in range(1, paths + 1):
        right, down = tracer.rng.random((2, size[1], size[0])) - 0.5
        rays = pixel_rays(camera, size, (right, down))
        each = (np.arange(i, min(i + BENT_BATCH, len(rays))) for i in range(0, len(rays), BENT_BATCH))
        found = np.concatenate([tracer.radiance(rays.where(some)) for some in each])
        off = found - mean
        mean += off / count
        with np.errstate(under="ignore"):
            squares += off * (found - mean)  # Welford 1962
    return mean, np.sqrt(squares / (paths - 1) / paths)
