"""Convolution of pictures of all directions with lobes, and their irradiance.

A lobe around a direction is a zonal kernel on the sphere: it depends on the angle alone. Between two rows of an
equirectangular picture it is a circular convolution over longitude, so the picture is blurred exactly, pixel by pixel,
in the frequencies of longitude: a matrix of rows by rows for each of them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from translucent.arrays import Array
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
    lobe = np.maximum(cosines_between(*IRRADIANCE_SIZE), 0.0)
    return EnvironmentMap(np.pi * convolved(sized(source, IRRADIANCE_SIZE), lobe))


def sized(source: EnvironmentMap, size: tuple[int, int]) -> Array:
    """Resample a picture to this height and width: the means of smaller pixels, lookups between larger ones."""
    height, width = size
    if source.size[0] >= width and source.size[1] >= height:
        return source.reduced(height, width)
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return source.at(np.stack(np.meshgrid(u, v), axis=-1))


@lru_cache(maxsize=2)
def cosines_between(height: int, width: int) -> Array:
    """(height, height, width / 2 + 1): cosine of the angle from a pixel to one of another row and some columns on."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    across = np.cos(2.0 * np.pi * np.arange(width // 2 + 1) / width)
    cosine, sine = np.cos(theta), np.sin(theta)
    return np.asarray(np.outer(cosine, cosine)[..., None] + np.outer(sine, sine)[..., None] * across)


def convolved(pixels: Array, lobe: Array) -> Array:
    """(h, w, 3): mean of the pixels around each, weighted by a lobe (h, h, w / 2 + 1) of rows and columns on."""
    import scipy.fft  # late: a window opens without it

    height, width = pixels.shape[:2]
    # A lobe is even in longitude: its Fourier transform is a cosine transform, and real.
    spectrum = scipy.fft.dct(lobe, type=1, axis=2)
    solid_angles = row_solid_angles(height, width)
    balance = _balanced(spectrum[..., 0] * solid_angles)
    spectrum *= (balance[:, None] * balance * solid_angles)[..., None]
    blurred = np.einsum("ijf,jfc->ifc", spectrum, scipy.fft.rfft(pixels, axis=1), optimize=True)
    return np.asarray(np.maximum(scipy.fft.irfft(blurred, n=width, axis=1), 0.0))


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
