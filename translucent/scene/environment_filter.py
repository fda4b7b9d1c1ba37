"""Environments blurred as rough surfaces reflect them and as matt ones receive them.

A lobe around a direction is a zonal kernel on the sphere: it depends on the angle alone. Between two rows of an
equirectangular picture it is a circular convolution over longitude, so the picture is blurred exactly, pixel by pixel,
in the frequencies of longitude: a matrix of rows by rows for each of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy.fft

from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap, row_solid_angles

Array = npt.NDArray[np.float64]

#: Blurred pictures between roughness 0 and 1, and their rows and columns.
LEVELS = 8
LEVEL_SIZE = (128, 256)

#: Rows and columns of the irradiance, which changes slowly.
IRRADIANCE_SIZE = (64, 128)

#: Rounds of `_balanced`: each halves what is out of balance.
BALANCING_ROUNDS = 50

#: Pictures whose blurred ones are kept.
KEPT = 8


@dataclass(frozen=True, eq=False)
class FilteredEnvironment:
    """What an environment sends to surfaces, before its rotation and exposure. Row 0 is straight up (+Y).

    Attributes
    ----------
    sharp : EnvironmentMap
        As a mirror reflects it, in full resolution.
    levels : (n, h, w, 3) float32
        As rough surfaces reflect it around each direction: its mean over a GGX lobe.
    roughness : (n,) float64
        Of the levels: 1/n, 2/n, ... 1. The alpha of GGX is its square.
    irradiance : (h, w, 3) float32
        On a surface with each normal: the integral of radiance times cosine.
    """

    sharp: EnvironmentMap
    levels: npt.NDArray[np.float32]
    roughness: Array
    irradiance: npt.NDArray[np.float32]


def filtered(environment: Environment) -> FilteredEnvironment:
    """The environment blurred for surfaces: made once for each picture, in less than a second.

    The lobe is that of the split-sum approximation (Karis 2013, "Real Shading in Unreal Engine 4", section on image
    based lighting): seen along the normal and the reflected direction at once (n = v = r), GGX half vectors h, whose
    density is D(h) n.h / (4 v.h) = D(h) / 4 around r, weighted with n.l. It is a mean: a uniform environment stays what
    it is, and so does the integral over all directions.
    """
    return _filtered(environment.light_map)


@lru_cache(maxsize=KEPT)
def irradiance_map(source: EnvironmentMap) -> EnvironmentMap:
    """Irradiance by normal as a picture: the integral over all directions of radiance times cosine; made once.

    Its lookups differ from the integral by a thousandth of the contrast, and within 1.4 degrees of a pole, where all
    that is known are the pixels around it, by a hundredth.
    """
    lobe = np.maximum(_cosines(*IRRADIANCE_SIZE), 0.0)
    return EnvironmentMap(np.pi * _convolved(_sized(source, IRRADIANCE_SIZE), lobe))


@lru_cache(maxsize=KEPT)
def _filtered(source: EnvironmentMap) -> FilteredEnvironment:
    roughness = np.arange(1, LEVELS + 1) / LEVELS
    color = source.pixels[0, 0]
    if (source.pixels == color).all():  # which blurring leaves as it is
        levels = np.full((LEVELS, *LEVEL_SIZE, 3), color, dtype=np.float32)
    else:
        pixels, cosines = _sized(source, LEVEL_SIZE), _cosines(*LEVEL_SIZE)
        with np.errstate(under="ignore"):
            levels = np.stack([_convolved(pixels, ggx_lobe(cosines, alpha)) for alpha in roughness**2]).astype(
                np.float32
            )
    return FilteredEnvironment(source, levels, roughness, irradiance_map(source).pixels.astype(np.float32))


def ggx_lobe(cosine: npt.ArrayLike, alpha: float) -> Array:
    """Weight of light from an angle of this cosine to the reflected direction, up to a factor: D(h) n.l, n = v = r.

    The half vector has half the angle: (n.h)^2 = (1 + cos) / 2. Walter et al. 2007, eq. 33, for D.
    """
    c = np.asarray(cosine, dtype=np.float64)
    falloff = 1.0 + 0.5 * (1.0 + c) * (alpha * alpha - 1.0)
    return np.maximum(c, 0.0) / (falloff * falloff)


def _sized(source: EnvironmentMap, size: tuple[int, int]) -> Array:
    """The picture in this height and width: the means of smaller pixels, lookups between larger ones."""
    height, width = size
    if source.size[0] >= width and source.size[1] >= height:
        return source.reduced(height, width)
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return source.at(np.stack(np.meshgrid(u, v), axis=-1))


@lru_cache(maxsize=2)
def _cosines(height: int, width: int) -> Array:
    """(height, height, width / 2 + 1): cosine of the angle from a pixel to one of another row and some columns on."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    across = np.cos(2.0 * np.pi * np.arange(width // 2 + 1) / width)
    cosine, sine = np.cos(theta), np.sin(theta)
    return np.asarray(np.outer(cosine, cosine)[..., None] + np.outer(sine, sine)[..., None] * across)


def _convolved(pixels: Array, lobe: Array) -> Array:
    """(h, w, 3): mean of the pixels around each, weighted by a lobe (h, h, w / 2 + 1) of rows and columns on."""
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
