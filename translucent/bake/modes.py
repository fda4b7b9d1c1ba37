"""Modes of averaging the lengths d of a texel's rays: a mean M = f^-1(E[f(d)]), each with an f of its own.

Rays go along directions w around the inward normal -n, with the density p(w) of the weighting within the cone:

- cosine: p = cos(theta) / (pi sin^2(spread / 2)); uniform: p = 1 / (2 pi (1 - cos(spread / 2))).

=============  =========================================================================================
mode           value
=============  =========================================================================================
normal         d(-n)
cone           E[d] = integral p(w) d(w) dw
transmittance  the d for which Y(exp(-sigma_t d)) = E[Y(exp(-sigma_t d(w)))], with Y the luminance
local          P(d(w) >= D), the share of rays that go as far as D = max_distance inside: one minus the ambient
               occlusion within D of the surface with inverted normals (Barre-Brisebois and Bouchard 2011)
inscribed      the diameter of the largest sphere inside that touches the surface at the point: see `inscribed`
=============  =========================================================================================

Where a medium has one extinction for all channels, mode "transmittance" is d = -log(E[exp(-sigma_t d(w))]) / sigma_t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.bake.settings import BakeSettings
from translucent.formulas.color import LUMINANCE_WEIGHTS

#: Number of groups of rays whose means give the standard error.
BLOCKS = 8

#: Newton steps for the thickness of a transmittance: one for a gray medium, and each channel bends the curve once.
STEPS = 24


@dataclass(frozen=True, eq=False)
class RayMean:
    """The mean of a mode over rays, and its standard error.

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

    @classmethod
    def of(cls, settings: BakeSettings, reach: float, radius: float) -> RayMean:
        """For lengths in units of `radius` metres, with `reach` in that unit."""
        extinction = (
            settings.medium.extinction * radius if settings.mode == "transmittance" and settings.medium else None
        )
        return cls(settings.mode, reach, extinction)

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
        """As `estimate`. All transmittances are relative to that of the shortest ray, so that none vanishes."""
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
    """Mean (k,) of the counted `values` (k, n), 0 where others stand, and its standard error (k,) from blocks.

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
