"""Random paths of light that no interface bends: straight lines between events in media.

Free paths by delta tracking (Woodcock et al. 1965; Novak et al. 2018), each light at each event with its
exact transmittance, directions by the phase function itself, and Russian roulette (Arvo & Kirk 1990).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers
from translucent.reference.boxes import Lines
from translucent.reference.compositing import _layers
from translucent.reference.light_paths import LightPaths
from translucent.reference.phase import scattered_directions
from translucent.reference.rays import Rays
from translucent.reference.render import CrossedMedia, crossed_media, seen_behind
from translucent.reference.surface_light import SurfaceLight
from translucent.reference.volume import points_on

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
            g = self._anisotropy(met.weights[lives])
            rays = replace(rays, directions=scattered_directions(rays.directions, g, self.rng))
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

    def _anisotropy(self, weights: Array) -> Array:
        """(k,): of one of the media at each place, chosen by how much they scatter."""
        shares = np.cumsum(weights * self.scattering, axis=1)
        chosen = (shares < self.rng.random((len(weights), 1)) * shares[:, -1:]).sum(axis=1)
        return np.asarray(self.volume.anisotropy[np.minimum(chosen, len(self.scattering) - 1)])

    def _roulette(self, throughput: Array) -> tuple[Integers, Array]:
        """Russian roulette: mask of paths that go on, and the weight that each would then carry."""
        chance = np.minimum(throughput / ROULETTE, 1.0)
        lives = np.flatnonzero(self.rng.random(len(throughput)) < chance)
        return lives, throughput / np.where(chance > 0, chance, 1.0)
