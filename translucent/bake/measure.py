"""Thickness at points of a surface: the mean over rays, cast until its standard error is small enough.

Each mode takes a mean M = f^-1(E[f(d)]) of the lengths d of rays along directions w around the inward normal -n, with
the density p(w) of the weighting within the cone:

- cosine: p = cos(theta) / (pi sin^2(spread / 2)); uniform: p = 1 / (2 pi (1 - cos(spread / 2))).

=============  =========================================================================================
mode           value
=============  =========================================================================================
normal         d(-n)
cone           E[d] = integral p(w) d(w) dw
transmittance  the d for which Y(exp(-sigma_t d)) = E[Y(exp(-sigma_t d(w)))], with Y the luminance
local          P(d(w) >= D), the fraction of rays that go as far as D = max_distance inside: one minus the ambient
               occlusion within D of the surface with inverted normals (Barre-Brisebois and Bouchard 2011)
inscribed      the diameter of the largest sphere inside that touches the surface at the point: see
               `translucent.bake.inscribed`
=============  =========================================================================================

Where a medium has one extinction for all channels, mode "transmittance" is d = -log(E[exp(-sigma_t d(w))]) / sigma_t.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.bake.inscribed import InscribedSpheres
from translucent.bake.rays import Directions, InwardRays, Points, PreparedMesh
from translucent.bake.settings import LOCAL_REACH, BakeSettings
from translucent.formulas.color import LUMINANCE_WEIGHTS

#: Number of groups of rays whose means give the standard error.
BLOCKS = 8

#: Newton steps for the thickness of a transmittance: one for a gray medium, and each channel bends the curve once.
STEPS = 24


#: Number of rays that are traced at a time: tracing drives the planes of the faces out of the cache of a processor,
#: which costs less where it is rare. Their arrays take 20 MB in each thread.
CHUNK_RAYS = 1 << 19


@dataclass(frozen=True, eq=False)
class RayMean:
    """Thickness of a mode as a mean over rays, and its standard error.

    Parameters
    ----------
    mode : str
        Any but "inscribed".
    reach : float
        D, in the unit of the lengths; infinite where there is none.
    extinction : (3,) float64 or None
        sigma_t per unit of length, for mode "transmittance".
    """

    mode: str
    reach: float
    extinction: Array | None

    def estimate(self, distance: Array, edges: Integers) -> tuple[Array, Array]:
        """Value (k,) and standard error (k,) of lengths (k, n), infinite where a ray has escaped.

        A ray that escaped counts as `reach`, or, where that is infinite, not at all; a point from which all have
        escaped gets 0.

        The standard error is the root of the variance that the mean would have if its `BLOCKS` blocks, consecutive
        pieces of the Sobol sequence, were independent: the sum of (s_i - m c_i)^2, with s_i the sum of f and c_i the
        number of rays in a block, times b / (b - 1) / (sum of c_i)^2. The blocks of a scrambled net avoid one another,
        so their mean is no less certain than that, and for smooth shapes much more so: an upper estimate. f^-1 is
        taken as linear.

        Parameters
        ----------
        distance : (k, n) float64
        edges : (rounds, b) int64
            Where the b blocks of each round of rays begin.
        """
        if distance.shape[1] == 1:
            length = np.minimum(distance[:, 0], self.reach)
            return np.where(np.isfinite(length), length, 0.0), np.zeros(len(length))
        if self.mode != "local" and self.extinction is None and self.reach == np.inf and np.isfinite(distance).all():
            return _ratio(distance, None, edges)
        counted = np.isfinite(distance) if self.reach == np.inf else np.ones(distance.shape, dtype=bool)
        length = np.where(counted, np.minimum(distance, self.reach), 0.0)
        if self.mode == "local":
            return _ratio((distance >= self.reach).astype(np.float64), counted, edges)
        if self.extinction is None:
            return _ratio(length, counted, edges)
        return self._transmittance(np.where(counted, length, np.inf), counted, edges)

    def _transmittance(self, length: Array, counted: npt.NDArray[np.bool_], edges: Integers) -> tuple[Array, Array]:
        """Value and standard error in mode "transmittance"; see `estimate`. All transmittances are relative to that of
        the shortest ray, so that none vanishes.
        """
        assert self.extinction is not None
        shortest = length.min(axis=1)
        shortest = np.where(np.isfinite(shortest), shortest, 0.0)
        with np.errstate(under="ignore"):
            weights = np.asarray(LUMINANCE_WEIGHTS) * np.exp(
                -np.outer(shortest, self.extinction - self.extinction.min())
            )
            weights /= weights.sum(axis=1, keepdims=True)
            more = np.where(counted, length - shortest[:, None], 0.0)
            bright = np.zeros_like(more)
            for weight, sigma in zip(weights.T, self.extinction, strict=True):
                bright += weight[:, None] * np.exp(-sigma * more)
            mean, error = _ratio(np.where(counted, bright, 0.0), counted, edges)
            found, slope = self._thickness_for(np.where(mean > 0, mean, 1.0), weights, more.max(axis=1))
        return shortest + found, error / slope

    def _thickness_for(self, bright: Array, weights: Array, most: Array) -> tuple[Array, Array]:
        """Root x of sum_c w_c exp(-sigma_c x) = `bright`, within 0 to `most`, and the slope there, above 0."""
        assert self.extinction is not None
        tiny = np.finfo(np.float64).tiny
        found, slope = np.zeros_like(bright), np.ones_like(bright)
        # In the logarithm the curve is convex and falls, so Newton's steps from 0 never pass the root.
        for step in range(STEPS + 1):
            parts = weights * np.exp(-found[:, None] * self.extinction)
            value = np.maximum(parts[:, 0] + parts[:, 1] + parts[:, 2], tiny)
            parts = parts * self.extinction
            slope = np.maximum(parts[:, 0] + parts[:, 1] + parts[:, 2], tiny)
            if step < STEPS:
                found = np.clip(found + value * np.log(value / bright) / slope, 0.0, most)
        return found, slope


def block_edges(begin: int, end: int, blocks: int) -> Integers:
    """(1, blocks): starts of the blocks of rays `begin` to `end`, as equal as can be."""
    return (begin + np.arange(blocks) * (end - begin) // blocks)[None]


def _ratio(values: Array, counted: npt.NDArray[np.bool_] | None, edges: Integers) -> tuple[Array, Array]:
    """Mean (k,) of the counted `values` (k, n), which are 0 elsewhere, and its standard error (k,) from blocks.

    None: all are counted.
    """
    blocks = edges.shape[1]
    sums = _block_sums(values, edges)
    all_counted = np.ones((1, values.shape[1]))
    counts = _block_sums(all_counted if counted is None else counted.astype(np.float64), edges)
    total = np.maximum(counts.sum(axis=1), 1.0)
    mean = sums.sum(axis=1) / total
    with np.errstate(under="ignore"):
        spread = ((sums - mean[:, None] * counts) ** 2).sum(axis=1)
        return mean, np.sqrt(spread * blocks / max(blocks - 1, 1)) / total


def _block_sums(values: Array, edges: Integers) -> Array:
    """(k, blocks): sums over the blocks, each over all rounds."""
    sums = np.add.reduceat(values, edges.ravel(), axis=1)
    return np.asarray(sums.reshape(len(values), *edges.shape).sum(axis=1))


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


class Measure:
    """Measurement of thickness at points.

    Any number of threads may ask at once; what they get depends on the points alone. Once `stop` is set, whoever is at
    work raises `StoppedError`.

    Parameters
    ----------
    surface : PreparedMesh
    settings : BakeSettings
    """

    def __init__(self, surface: PreparedMesh, settings: BakeSettings) -> None:
        self.surface, self.settings = surface, settings
        self.stop = threading.Event()
        # The diagonal of the mesh is two radii.
        reach = 2.0 * LOCAL_REACH if settings.mode == "local" else np.inf
        if settings.max_distance is not None:
            reach = settings.max_distance / surface.radius
        extinction = None
        if settings.mode == "transmittance" and settings.medium is not None:
            extinction = settings.medium.extinction * surface.radius
        self.rays, self.directions = InwardRays(surface, settings, reach), Directions.of(settings)
        self.mean = RayMean(settings.mode, reach, extinction)
        self.spheres = InscribedSpheres(surface) if settings.mode == "inscribed" else None

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
            requested = points if len(live) == len(points) else points[live]
            directions = self.directions.at(requested, begin, end)
            found, more = self.rays.distances(requested, directions)
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
