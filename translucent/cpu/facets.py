"""Microfacets of rough interfaces from points that are spread evenly over the samples of a pixel.

Their normals are those of GGX as they are visible (Heitz 2018, "Sampling the GGX distribution of visible normals"). The
points are Sobol's, moved for each pixel by an offset of its own (Cranley & Patterson 1976).
"""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.cpu.vectors import dot, unit

#: Interfaces of a ray that have points of their own; those behind take them again, with other offsets.
INTERFACES = 8


class Spread:
    """Points of one sample of all pixels.

    Parameters
    ----------
    number : int
        Of the sample, from 0.
    samples : int
        At least 2.

    Attributes
    ----------
    samples : int
    blurred : float
        Share of the variance of microfacets that is left to the blur of the environment: few samples would show noise,
        and many need no blur (as in Krivanek & Colbert 2008, "Real-time shading with filtered importance sampling").
    """

    def __init__(self, number: int, samples: int) -> None:
        self.samples, self.blurred = samples, samples**-0.25
        self._points = _sobol(samples)[number]

    def at(self, pixel: Integers, interface: Integers) -> tuple[Array, Array]:
        """Two numbers (k,) in 0 to 1 for a pixel (k,) at the interface (k,) of its ray, counted from 0."""
        column = 2 * (interface % INTERFACES)
        key = (pixel.astype(np.uint32) * np.uint32(2 * INTERFACES) + column.astype(np.uint32)) ^ (
            (interface // INTERFACES).astype(np.uint32) * np.uint32(0x9E3779B9)
        )
        return (
            np.asarray((self._points[column] + _hashed(key)) % 1.0),
            np.asarray((self._points[column + 1] + _hashed(key ^ np.uint32(0x85EBCA6B))) % 1.0),
        )


def visible_normals(directions: Array, normals: Array, alpha: Array, points: tuple[Array, Array]) -> Array:
    """Normals (k, 3) of microfacets that light meets in directions (k, 3), around the normals (k, 3) of a surface."""
    first, second = _frame(normals)
    towards = np.stack([-dot(directions, first), -dot(directions, second), -dot(directions, normals)], axis=1)
    stretch = np.stack([alpha, alpha, np.ones_like(alpha)], axis=1)
    seen = unit(towards * stretch)
    one, other = _frame(seen)
    radius, angle = np.sqrt(points[0]), 2.0 * np.pi * points[1]
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    # Of the half of the disk that the hemisphere hides, the part that it does not (Heitz 2018, listing 1).
    share = 0.5 * (1.0 + seen[:, 2])
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    facet = (x[:, None] * one + y[:, None] * other + z[:, None] * seen) * stretch
    facet[:, 2] = np.maximum(facet[:, 2], 0.0)
    facet = unit(facet)
    return np.asarray(facet[:, :1] * first + facet[:, 1:2] * second + facet[:, 2:] * normals)


def _frame(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors (k, 3) across each normal (Duff et al. 2017, "Building an orthonormal basis, revisited")."""
    x, y, z = normals.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


@lru_cache(maxsize=4)
def _sobol(samples: int) -> Array:
    """(samples, 2 INTERFACES): scrambled, so that they are not those of the pixel's own samples."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns of numbers other than powers of 2, which are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(qmc.Sobol(2 * INTERFACES, scramble=True, seed=1).random(samples))


def _hashed(key: npt.NDArray[np.uint32]) -> Array:
    """(k,): numbers in 0 to 1 that look random (Wellons 2018, "lowbias32")."""
    with np.errstate(over="ignore"):
        key = (key ^ (key >> np.uint32(16))) * np.uint32(0x7FEB352D)
        key = (key ^ (key >> np.uint32(15))) * np.uint32(0x846CA68B)
        key = key ^ (key >> np.uint32(16))
    return key.astype(np.float64) * 2.0**-32
