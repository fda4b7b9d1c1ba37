"""Light that enters a body as rays, and how far its first scattering events are beside where it enters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.grid import BodyGrid

#: Largest shift of first events along the surface, in distances between samples; and number of samples that shifted
#: light is interpolated from.
MOST_SHIFTED, INTERPOLATED = 3, 3

#: Bounds of the factor by which rays of one light cover more of the surface than where they enter.
LEAST_SPREAD, MOST_SPREAD = 0.5, 2.0


@dataclass(frozen=True, eq=False)
class EnteringRays:
    """Rays of one light, or of the environment, that enter a body, at each sample that they reach.

    Attributes
    ----------
    samples : (k,) int
        Numbers of the samples that it reaches.
    directions : (k, 3) float64
        Inside, unit vectors.
    entering, mirrored : (k, 3) float64
        Flux that enters, and flux that the surface reflects, in W/m^2.
    from_one : bool
        True if all come from one light: neighboring rays have about the same direction.
    """

    samples: Integers
    directions: Array
    entering: Array
    mirrored: Array
    from_one: bool = False


def joined_rays(rays: Sequence[EnteringRays], *, from_one: bool = False) -> EnteringRays:
    """All rays of several lights, or of the parts of one."""
    nothing = EnteringRays(np.zeros(0, np.int64), *np.zeros((3, 0, 3)))
    parts = zip(*((ray.samples, ray.directions, ray.entering, ray.mirrored) for ray in (nothing, *rays)), strict=True)
    samples, directions, entering, mirrored = map(np.concatenate, parts)
    return EnteringRays(samples, directions, entering, mirrored, from_one)


def two_directions(mean: Array, square: Array, normals: Array) -> tuple[Array, Array]:
    """(k, 3), (k, 3): directions of two rays of the same flux in place of many, at a surface with normals (k, 3).

    First events depend on the cosine with the normal most of all: its mean and its mean square are those of all rays,
    as of a quadrature with two nodes, and so is the mean direction along the surface. Rays from several sides are on
    either side of that.

    Parameters
    ----------
    mean : (k, 3) float64
        Mean direction of all rays.
    square : (k,) float64
        Mean square of their cosine.
    normals : (k, 3) float64
    """
    tiny = np.finfo(np.float64).tiny
    cosine = -(mean * normals).sum(axis=1)
    deviation = np.sqrt(np.maximum(square - cosine**2, 0.0))
    nodes = np.clip([cosine - deviation, cosine + deviation], 0.0, 1.0)[..., None]
    aside, level = np.sqrt(1.0 - nodes**2), _across(mean, normals)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    along = level / np.maximum(length, tiny)
    part = length / np.maximum(np.maximum(aside.mean(axis=0), length), tiny)
    across = np.sqrt(1.0 - part**2) * np.cross(normals, along)
    # What is left of it in the mean of both, which are not equally steep, is left at neighbors the other way.
    across[::2] *= -1.0
    flat, steep = (aside[i] * (part * along + side * across) - nodes[i] * normals for i, side in ((0, 1.0), (1, -1.0)))
    return flat, steep


def two_of_many(rays: EnteringRays, normals: Array, mean: sparse.csr_array | None = None) -> EnteringRays:
    """Two rays at each sample in place of all rays of one light there; see `two_directions`.

    Parameters
    ----------
    rays : EnteringRays
    normals : (s, 3)
    mean : (s, s) csr_array, optional
        Over neighbors, for random rays.
    """
    flux = rays.entering.sum(axis=1, keepdims=True)
    cosine = (rays.directions * normals[rays.samples]).sum(axis=1, keepdims=True)
    columns = np.concatenate([flux, flux * cosine**2, flux * rays.directions, rays.entering, rays.mirrored], axis=1)
    sums = [np.bincount(rays.samples, column, len(normals)) for column in columns.T]
    every = np.stack(sums, axis=1) if mean is None else mean @ np.stack(sums, axis=1)
    samples = np.flatnonzero(every[:, 0])
    found = np.asarray(every[samples], np.float64)
    towards, square = found[:, 2:5] / found[:, :1], found[:, 1] / found[:, 0]
    entering, mirrored = 0.5 * found[:, 5:8], 0.5 * found[:, 8:]
    parts = [EnteringRays(samples, to, entering, mirrored) for to in two_directions(towards, square, normals[samples])]
    return joined_rays(parts, from_one=rays.from_one)


@dataclass(frozen=True, eq=False)
class LateralShift:
    """Shift of the first events of one light along the surface, from where its rays enter to where they are scattered.

    A layer in one dimension scatters light below the place where it enters. Light at a slant has gone on along the
    surface by about a free path, out of a brighter part into a darker one: where light grazes a rounded body none of it
    enters, and all that is scattered there comes from beside.

    Attributes
    ----------
    step : (s, s) csr_array
        Maps a flux at the samples to the flux one distance between samples further along the rays.
    level : (k,) float64
        Distances between samples along the surface for each metre of path.
    chord : (k,) float64
        Metres after which rays leave the body without an interface; else inf.
    """

    step: sparse.csr_array
    level: Array
    chord: Array

    @classmethod
    def of(cls, grid: BodyGrid, ray: EnteringRays, ior: float) -> LateralShift:
        """Shift of the rays of one light, which enter a body of one index; it stays if another medium comes in."""
        if (known := _shifts.get(ray)) is not None:
            return known
        spacing = np.sqrt(grid.area)
        along = _across(ray.directions, grid.face_normals[ray.samples])
        level = np.linalg.norm(along, axis=1)
        matched = ior == 1.0
        chord = grid.chords(ray.samples, ray.directions) if matched else np.full(len(level), np.inf)
        found = _shifts[ray] = cls(_step(grid, ray.samples, along), level / spacing, chord)
        return found

    def moved(self, values: Sequence[Array], samples: Integers) -> Array:
        """(n, s): values of n quantities (`MOST_SHIFTED` + 1, k), shifted by each number of steps, at samples (k,)."""
        count, total = self.step.shape[0], np.zeros((self.step.shape[0], len(values)))
        for number in range(MOST_SHIFTED, -1, -1):
            own = np.stack([np.bincount(samples, value[number], count) for value in values], axis=1)
            total = self.step @ total + own if number < MOST_SHIFTED else own
        return total.T


#: Shifts of rays that are in use.
_shifts: WeakKeyDictionary[EnteringRays, LateralShift] = WeakKeyDictionary()


def shifted_fractions(places: Floats, *weights: Floats) -> list[Floats]:
    """(`MOST_SHIFTED` + 1, k) each: fractions of events at `places` (q, k) shifted by each number of steps.

    The first are of events that all count alike, the next of events with weights (q, k).
    """
    # Each place is shared between the two numbers around it: what goes on from each number to the next one.
    onward = [np.clip(places - np.float32(number), 0.0, 1.0) for number in range(MOST_SHIFTED)]
    every = [np.mean(part, axis=0) for part in onward]
    sums = [(np.ones_like(every[0]), every)]
    sums += [(weight.sum(axis=0), [np.einsum("qk,qk->k", weight, part) for part in onward]) for weight in weights]
    return [-np.diff([whole, *parts, np.zeros_like(whole)], axis=0) for whole, parts in sums]


def moved_along(values: Sequence[Array], samples: Integers, count: int, shift: LateralShift | None) -> Array:
    """(n, count): sums of n quantities (k,) of rays at samples (k,), or of those (`MOST_SHIFTED` + 1, k) of a shift."""
    if shift is not None:
        return shift.moved(values, samples)
    return np.stack([np.bincount(samples, value, count) for value in values])


def _across(directions: Array, normals: Array) -> Array:
    """(k, 3): parts of directions (k, 3) along the surface with normals (k, 3)."""
    return np.asarray(directions - np.einsum("ki,ki->k", directions, normals)[:, None] * normals)


def _step(grid: BodyGrid, samples: Integers, along: Array) -> sparse.csr_array:
    """(s, s): map of a flux at the samples to the flux one distance between samples further along the rays.

    Rays at samples (k,) go `along` the surface (k, 3), several at one sample on average; samples without a ray take the
    direction of neighbors. Each sample interpolates the flux that far back. Rays that spread along the surface
    bring less.
    """
    count, spacing = len(grid.points), float(np.sqrt(grid.area))
    along = np.stack([np.bincount(samples, part, count) for part in along.T], axis=1)
    of = np.where(np.bincount(samples, minlength=count) > 0, np.arange(count), -1)
    for _ in range(MOST_SHIFTED + 1):
        without = np.flatnonzero(of < 0)
        beside = of[grid.nearest[without]]
        of[without] = beside[np.arange(len(without)), (beside >= 0).argmax(axis=1)]
    receivers = np.flatnonzero(of >= 0)
    normals, travel = grid.face_normals[receivers], np.zeros((count, 3))
    towards = _across(along[of[receivers]], normals)
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    travel[receivers] = towards
    around = min(INTERPOLATED, count)
    apart, found = grid.tree.query(grid.points[receivers] - spacing * towards, around)
    apart, found = apart.reshape(-1, around), found.reshape(-1, around)
    facing = np.einsum("rni,ri->rn", grid.face_normals[found], normals) > 0.0
    weight = facing / (apart**2 + (0.1 * spacing) ** 2)
    spread = np.clip(1.0 + spacing * grid.divergence(travel)[receivers], LEAST_SPREAD, MOST_SPREAD)
    weight /= np.maximum(weight.sum(axis=1) * spread, np.finfo(np.float64).tiny)[:, None]
    starts = np.zeros(count + 1, np.int64)
    starts[receivers + 1] = around
    return sparse.csr_array((weight.ravel(), found.ravel(), np.cumsum(starts)), (count, count))
