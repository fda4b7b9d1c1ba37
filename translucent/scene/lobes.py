"""Convolution of pictures of all directions with lobes, and their irradiance.

A lobe around a direction is a zonal kernel on the sphere: it depends on the angle alone. Between two rows of an
equirectangular picture it is a circular convolution over longitude, so the picture is blurred exactly, pixel by pixel,
in the frequencies of longitude: a matrix of rows by rows for each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from translucent.arrays import Array, Integers
from translucent.scene.environment_map import EnvironmentMap, row_solid_angles

#: Rows and columns of the irradiance map, which changes slowly.
IRRADIANCE_SIZE = (64, 128)

#: Rounds of `_balanced`: each halves the imbalance.
BALANCING_ROUNDS = 50

#: Number of pictures whose blurred versions are cached.
KEPT = 8


@lru_cache(maxsize=KEPT)
def irradiance_map(source: EnvironmentMap) -> EnvironmentMap:
    """Irradiance map by normal: the integral over all directions of radiance times cosine; made once.

    Its lookups differ from the integral by a thousandth of the contrast, and within 1.4 degrees of a pole, where all
    that is known are the pixels around it, by a hundredth.
    """
    pixels = sized(source, IRRADIANCE_SIZE)
    return EnvironmentMap(np.pi * convolved(pixels, lambda cosines: np.maximum(cosines, 0.0)))


def sized(source: EnvironmentMap, size: tuple[int, int]) -> Array:
    """Resample a picture to this height and width: the means of smaller pixels, lookups between larger ones."""
    height, width = size
    if source.size[0] >= width and source.size[1] >= height:
        return source.reduced(height, width)
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return source.at(np.stack(np.meshgrid(u, v), axis=-1))


def convolved(pixels: Array, lobe: Callable[[Array], Array]) -> Array:
    """(h, w, 3): mean of the pixels around each, weighted by a lobe, a function of the cosine of the angle."""
    height, width = pixels.shape[:2]
    spectrum = _spectrum(height, width, lobe)
    solid_angles = row_solid_angles(height, width)
    balance = _balanced(spectrum[..., 0] * solid_angles)
    spectrum *= (balance[:, None] * balance * solid_angles)[..., None]
    blurred = np.einsum("ijf,jfc->ifc", spectrum, np.fft.rfft(pixels, axis=1), optimize=True)
    return np.ascontiguousarray(np.maximum(np.fft.irfft(blurred, n=width, axis=1), 0.0))


def _spectrum(height: int, width: int, lobe: Callable[[Array], Array]) -> Array:
    """(height, height, width / 2 + 1): Fourier transforms in longitude of a lobe, for pairs of rows.

    They are the same for two rows in turn and for their mirror images in the equator, so a quarter of them is made.
    """
    first, second, cosines = _cosines_between(height, width)
    weights = lobe(cosines)
    # A lobe is even in longitude: its transform is real.
    found = np.fft.rfft(np.concatenate([weights, weights[:, -2:0:-1]], axis=1), axis=1).real
    spectrum = np.empty((height, height, width // 2 + 1))
    for i, j in ((first, second), (height - 1 - first, height - 1 - second)):
        spectrum[i, j] = spectrum[j, i] = found
    return spectrum


@lru_cache(maxsize=2)
def _cosines_between(height: int, width: int) -> tuple[Integers, Integers, Array]:
    """Pairs of rows (n,), (n,), a quarter of all, and (n, width / 2 + 1): cosine of the angle from a pixel of the first
    row to one of the second and some columns on.
    """
    upper = np.tri(height, dtype=bool)
    first, second = np.nonzero(upper.T & upper[::-1])  # i <= j, and i + j < height
    theta = np.pi * (np.arange(height) + 0.5) / height
    across = np.cos(2.0 * np.pi * np.arange(width // 2 + 1) / width)
    cosine, sine = np.cos(theta), np.sin(theta)
    around = (sine[first] * sine[second])[:, None] * across
    return first, second, (cosine[first] * cosine[second])[:, None] + around


def _balanced(weights: Array) -> Array:
    """(h,): factors s of rows and columns after which s_i w_ij s_j has rows of sum 1.

    A lobe in steps of whole pixels has not quite the same integral around each of them. With one factor for rows and
    columns it stays symmetric, so that a pixel's light is as much after as before; dividing rows by their sums would
    keep uniform light only. Symmetric scaling: Knight, Ruiz & Ucar 2014.
    """
    balance = np.ones(len(weights))
    for _ in range(BALANCING_ROUNDS):
        balance = np.sqrt(balance / (weights @ balance))
    return balance
