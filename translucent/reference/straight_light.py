"""Light of lamps that reaches places on a straight way, past all interfaces that bend it."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.reference.boxes import Lines
from translucent.reference.interfaces import Inside, Optics
from translucent.reference.legs import Legs
from translucent.reference.light_paths import LightPaths
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light


class StraightLight:
    """Light of point, spot and directional lights, as far as no interface bends it.

    A path that polished interfaces bend meets such a light with probability 0, so that nothing random finds it.

    Parameters
    ----------
    light : LightPaths
    own : Optics
    """

    def __init__(self, light: LightPaths, own: Optics) -> None:
        self.light, self.own = light, own
        self.transmission = np.array([surface.transmission for surface in own.surfaces])
        self.color = np.array([surface.color for surface in own.surfaces], dtype=np.float64)

    def at_interfaces(self, points: Array) -> Array:
        """(lights, k, 3): unit vectors from points (k, 3) to all lights."""
        found = [_way(light, points)[0] for light in self.light.lights]
        return np.array(found).reshape(len(found), len(points), 3)

    def scattered(self, legs: Legs, weights: Array, channel: int) -> Array:
        """(k, 3): radiance that media scatter from lights at the origins of `legs` back along them, for each unit that
        they scatter.

        Parameters
        ----------
        legs : Legs
        weights : (k, n) float64
            What fills the places, as `Volume.at` gives it.
        channel : int
            One of those whose media scatter alike.
        """
        volume, rays = self.light.volume, legs.rays
        radiance = np.zeros((len(legs), 3))
        total = weights @ volume.scattering[:, channel]
        for number, to_light in enumerate(self.at_interfaces(rays.origins)):
            arriving = self.irradiance(number, rays.origins, legs.inside)
            cosine = np.einsum("ki,ki->k", to_light, rays.directions)
            phase = volume.source(weights, cosine)[:, channel] / np.where(total > 0, total, 1.0)
            with np.errstate(under="ignore"):
                radiance += arriving * phase[:, None]
        return radiance

    def irradiance(self, number: int, points: Array, inside: Inside, start: float = 0.0) -> Array:
        """Irradiance (k, 3) of one light, straight on, at points (k, 3) `inside` bodies.

        Parameters
        ----------
        number : int
            Index into `LightPaths.lights`.
        points : (k, 3) float64
        inside : Inside
        start : float
            Distance in metres from the points within which no surface counts: that they lie on.
        """
        light, found = self.light.lights[number], np.zeros((len(points), 3))
        share = self._share(light, points, inside, start)
        some = np.flatnonzero(share.any(axis=1))
        with np.errstate(under="ignore"):
            found[some] = share[some] * self.light.arrival(light, points[some]).irradiance
        return found

    def _share(self, light: Light, points: Array, inside: Inside, start: float) -> Array:
        """(k, 3): share of a light that passes all interfaces; what absorbs it on the way is another matter."""
        directions, distance = _way(light, points)
        lines = Lines(points, directions, np.full(len(points), start), distance)
        hits, share = self.light.tracer.hits(lines), np.ones((len(points), 3))
        while True:
            interfaces = self.own.first_interfaces(hits, inside)
            met = np.flatnonzero(np.isfinite(interfaces.distance))
            if not met.size:
                return share
            before, after, item = (column[met] for column in (interfaces.before, interfaces.after, interfaces.item))
            sheet = before == after
            bends = self.own.iors[before] != self.own.iors[np.where(sheet, item, after)]
            tint = np.where((sheet | (item == after))[:, None], self.color[item], 1.0)
            share[met] *= np.where(bends[:, None], 0.0, self.transmission[item, None] * tint)
            passed = np.full(len(points), np.inf)
            passed[met] = np.where(bends, np.inf, interfaces.distance[met] + self.own.tolerance)
            hits = [line.where(line.distance > passed[line.pixel]) for line in hits]
            inside = interfaces.there


def _way(light: Light, points: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) from points (k, 3) to a light, and how far it is (k,)."""
    if not isinstance(light, PositionalLight):
        return np.tile(-np.asarray(light.direction), (len(points), 1)), np.full(len(points), np.inf)
    way = np.asarray(light.position) - points
    distance = np.linalg.norm(way, axis=1)
    return way / np.where(distance > 0, distance, 1.0)[:, None], distance
