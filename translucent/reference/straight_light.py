"""Light of lamps that reaches places in media on a straight way, past all interfaces that bend it."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.reference.boxes import Lines
from translucent.reference.interfaces import Inside, Optics
from translucent.reference.legs import Legs
from translucent.reference.light_paths import LightPaths
from translucent.scene.lights import PointLight
from translucent.scene.scene import Light


class StraightLight:
    """Light of point and directional lights, as far as no interface bends it.

    A path that is bent meets such a light with probability 0, so that nothing random finds it.

    Parameters
    ----------
    light : LightPaths
    own : Optics
    """

    def __init__(self, light: LightPaths, own: Optics) -> None:
        self.light, self.own = light, own
        self.transmission = np.array([surface.transmission for surface in own.surfaces])
        self.color = np.array([surface.color for surface in own.surfaces], dtype=np.float64)

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
        for light in self.light.lights:
            share = self.share(light, rays.origins, legs.inside)
            some = np.flatnonzero(share.any(axis=1))
            arrival = self.light.arrival(light, rays.origins[some])
            cosine = -np.einsum("ki,ki->k", arrival.travel, rays.directions[some])
            phase = volume.source(weights[some], cosine)[:, channel] / np.where(total[some] > 0, total[some], 1.0)
            with np.errstate(under="ignore"):
                radiance[some] += share[some] * arrival.irradiance * phase[:, None]
        return radiance

    def share(self, light: Light, points: Array, inside: Inside) -> Array:
        """(k, 3): share of a light that passes all interfaces on the straight way to points `inside` bodies.

        What absorbs it on the way is another matter.
        """
        if isinstance(light, PointLight):
            way = np.asarray(light.position) - points
            distance = np.linalg.norm(way, axis=1)
            directions = way / np.where(distance > 0, distance, 1.0)[:, None]
        else:
            directions, distance = np.tile(-np.asarray(light.direction), (len(points), 1)), np.full(len(points), np.inf)
        lines = Lines(points, directions, np.zeros(len(points)), distance)
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
