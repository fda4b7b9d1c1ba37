"""Surroundings that beams see when they leave a scene: its environment's light in reflections, else its background."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from translucent.arrays import Array
from translucent.cpu.beams import Beams
from translucent.cpu.footprints import ellipses
from translucent.cpu.vectors import dot
from translucent.formulas.footprint import ALPHA_OF_DEVIATION, LEAST_BREADTH, MOST_LOOKUPS
from translucent.reference.rays import Rays
from translucent.reference.refracted import places_on_backdrop
from translucent.scene.environment import Environment, FilteredEnvironment, equirectangular_uv, filtered
from translucent.scene.environment_map import bilinear
from translucent.scene.scene import Scene


class Surroundings:
    """Environment of a scene, as beams see it.

    Parameters
    ----------
    scene : Scene
    aspect : float
        Width of the picture divided by its height.
    """

    def __init__(self, scene: Scene, aspect: float) -> None:
        self.scene, self.aspect, self.environment = scene, aspect, scene.environment

    @cached_property
    def _maps(self) -> FilteredEnvironment:
        """Maps of the environment's light, from that of a mirror to that of a surface of roughness 1."""
        return filtered(self.environment)

    def radiance(self, beams: Beams, rays: Rays) -> Array:
        """(n, 3): radiance along beams that nothing stops, which are `rays` in metres from the eye.

        `Rays.backdrop` is where rays that have met no interface are in the picture.
        """
        environment = self.environment
        if environment.seen is environment and environment.kind != "checkerboard":
            return self._light(environment, beams)
        seen = self._background(environment.seen, beams, rays)
        mirrored = np.flatnonzero(beams.reflected)
        if mirrored.size:
            seen[mirrored] = self._light(environment, beams.where(mirrored))
        return seen

    def blurred(self, beams: Beams, directions: Array, roughness: float | Array) -> Array:
        """(n, 3): light of the environment in directions (n, 3), as mirrors of a roughness (n,) would blur it."""
        blur = np.broadcast_to(roughness, len(beams)) ** 4
        hazy = replace(beams, directions=directions, blur=blur, footprint=beams.footprint[:, :0])
        return self._light(self.environment, hazy)

    def _light(self, environment: Environment, beams: Beams) -> Array:
        blur = beams.blur
        # A gradient is smooth already.
        if environment.map is None or environment.map is not self.environment.map:
            return environment.lighting(beams.directions)
        if beams.footprint.size:
            return self._averaged(environment, beams)
        if not blur.any():
            return environment.lighting(beams.directions)
        return environment.scale * blurred_lookups(
            self._maps, equirectangular_uv(beams.directions, environment.turn), np.minimum(blur**0.25, 1.0)
        )

    def _averaged(self, environment: Environment, beams: Beams) -> Array:
        """(n, 3): light averaged over the footprints of beams."""
        axis, breadth = ellipses(beams.footprint[:, 1])
        longer = np.sqrt(dot(axis, axis))
        lookups = np.clip(np.ceil(longer / np.maximum(breadth, LEAST_BREADTH)), 1, MOST_LOOKUPS).astype(np.int64)
        breadth = np.maximum(breadth, longer / lookups)
        with np.errstate(under="ignore"):
            roughness = np.minimum(beams.blur + (ALPHA_OF_DEVIATION * breadth) ** 2, 1.0) ** 0.25
            # Between the map as it is and the first that is blurred, shares are of the variance.
            sharpest = 1.0 / len(self._maps.levels)
            narrow = (beams.blur == 0.0) & (roughness < sharpest)
            roughness = np.where(narrow, sharpest * (roughness / sharpest) ** 4, roughness)
        own = np.repeat(np.arange(len(beams)), lookups)
        first = np.cumsum(lookups) - lookups
        along = (np.arange(len(own)) - first[own] + 0.5) / lookups[own] - 0.5
        aside = np.sqrt(12.0) * along[:, None] * axis[own]
        uv = equirectangular_uv(beams.directions[own] + aside, environment.turn)
        seen = np.add.reduceat(blurred_lookups(self._maps, uv, roughness[own]), first)
        return environment.scale * seen / lookups[:, None]

    def _background(self, seen: Environment, beams: Beams, rays: Rays) -> Array:
        if seen.kind != "checkerboard":
            return self._light(seen, beams)
        place, ahead = places_on_backdrop(self.scene, self.aspect, rays)
        bent = beams.met > 0
        found = seen.radiance(rays.directions, np.where(bent[:, None], place, rays.backdrop))
        found[bent & ~ahead] = seen.mean
        return found


def blurred_lookups(maps: FilteredEnvironment, uv: Array, roughness: Array) -> Array:
    """(n, 3): lookups at places (n, 2) for roughnesses (n,) from 0 to 1, to which equal steps lead from map to map."""
    level = roughness * len(maps.levels)
    below = np.minimum(level.astype(np.int64), len(maps.levels) - 1)
    share = (level - below)[:, None]
    found = share * bilinear(maps.levels, below, uv)
    sharp, rough = np.flatnonzero(below == 0), np.flatnonzero(below > 0)
    found[sharp] += (1.0 - share[sharp]) * maps.sharp.at(uv[sharp])
    found[rough] += (1.0 - share[rough]) * bilinear(maps.levels, below[rough] - 1, uv[rough])
    return np.asarray(found)
