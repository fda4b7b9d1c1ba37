"""Measurement of thickness at points of a surface: the mean over rays, cast until the error is small enough."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import numpy as np

from translucent.arrays import Array
from translucent.bake.directions import Directions
from translucent.bake.inscribed import InscribedSpheres
from translucent.bake.modes import BLOCKS, RayMean, block_edges
from translucent.bake.rays import Rays
from translucent.bake.settings import LOCAL_REACH, BakeSettings
from translucent.bake.surface import Points, Surface

#: Number of rays that are traced at a time: tracing drives the planes of the faces out of the cache of a processor,
#: which costs less where it is rare. Their arrays take 20 MB in each thread.
CHUNK_RAYS = 1 << 19


class StoppedError(Exception):
    """Signal that the bake was canceled during the work."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Thickness at points, in metres (mode "local": dimensionless).

    Attributes
    ----------
    values, errors : (k,) float64
        And standard errors.
    traced : int
        Rays that Embree traced.
    cast, escaped : int
        Rays cast from points, and how many of them found no exit.
    above : int
        Points whose error is still above the tolerance.
    """

    values: Array
    errors: Array
    traced: int
    cast: int
    escaped: int
    above: int


@dataclass(frozen=True, eq=False)
class Measure:
    """Measurement of thickness at points. Any number of threads may ask at once; what they get depends on the points
    alone.

    Attributes
    ----------
    surface : Surface
    settings : BakeSettings
    rays : Rays
    directions : Directions
    mean : RayMean
    spheres : InscribedSpheres or None
    stop : threading.Event
        Once set, whoever is at work raises `StoppedError`.
    """

    surface: Surface
    settings: BakeSettings
    rays: Rays
    directions: Directions
    mean: RayMean
    spheres: InscribedSpheres | None
    stop: threading.Event = field(default_factory=threading.Event)

    @classmethod
    def of(cls, surface: Surface, settings: BakeSettings) -> Measure:
        """Prepare to measure."""
        reach = np.inf if settings.max_distance is None else settings.max_distance / surface.radius
        if settings.mode == "local" and settings.max_distance is None:
            # The diagonal of the mesh is two radii.
            reach = 2.0 * LOCAL_REACH
        return cls(
            surface,
            settings,
            Rays.of(surface, settings, reach),
            Directions.of(settings),
            RayMean.of(settings, reach, surface.radius),
            InscribedSpheres(surface) if settings.mode == "inscribed" else None,
        )

    @property
    def unit(self) -> float:
        """World value of 1 in the unit ball."""
        return 1.0 if self.settings.mode == "local" else self.surface.radius

    def at(self, points: Points) -> Measured:
        """Measure at points (k)."""
        step = max(1, CHUNK_RAYS // min(self.settings.rays, self.directions.most))
        parts = [self._chunk(points[begin : begin + step]) for begin in range(0, len(points), step)]
        values = np.concatenate([np.empty(0), *(part.values for part in parts)])
        errors = np.concatenate([np.empty(0), *(part.errors for part in parts)])
        counts = [sum(getattr(part, name) for part in parts) for name in ("traced", "cast", "escaped", "above")]
        return Measured(values, errors, *counts)

    def _chunk(self, points: Points) -> Measured:
        if self.spheres is not None:
            return self._inscribed(points, self.spheres)
        values, errors = np.zeros(len(points)), np.zeros(len(points))
        tolerance = np.inf if self.settings.tolerance is None else self.settings.tolerance / self.unit
        live, begin, end = np.arange(len(points)), 0, min(self.settings.rays, self.directions.most)
        distance, edges = np.empty((len(points), 0)), np.empty((0, min(BLOCKS, end)), dtype=np.int64)
        traced = cast = escaped = 0
        while True:
            if self.stop.is_set():
                raise StoppedError
            asked = points if len(live) == len(points) else points[live]
            directions = self.directions.at(asked, begin, end)
            found, more = self.rays.distances(asked, directions)
            traced, cast, escaped = traced + more, cast + found.size, escaped + int(np.count_nonzero(np.isinf(found)))
            distance = found if begin == 0 else np.concatenate([distance, found], axis=1)
            edges = np.concatenate([edges, block_edges(begin, end, edges.shape[1])])
            values[live], errors[live] = self.mean.estimate(distance, edges)
            above = errors[live] > tolerance
            if end == self.directions.most or not above.any():
                break
            live, distance = live[above], distance[above]
            # As many rays again: what is left of the error is then about that of one more digit of the sequence.
            begin, end = end, min(2 * end, self.directions.most)
        return Measured(values * self.unit, errors * self.unit, traced, cast, escaped, int(above.sum()))

    def _inscribed(self, points: Points, spheres: InscribedSpheres) -> Measured:
        if self.stop.is_set():
            raise StoppedError
        directions = self.directions.at(points, 0, self.directions.most)
        distance, _, face = self.rays.first(points, directions)
        diameter = spheres.diameters(points, spheres.first(points, directions, distance, face))
        values = np.minimum(diameter, self.rays.reach) * self.unit
        return Measured(values, np.zeros(len(points)), face.size, face.size, int(np.count_nonzero(face < 0)), 0)
