"""Two-stream formulas of multiple scattering, in float64. Each has a twin in ``shaders/lib/two_stream.glsl``.

Two diffuse streams, forwards and backwards, lose K to absorption and exchange S per metre. Depths are without unit:
K d and S d for a layer of thickness d. All functions are pure and broadcast.

References
----------
Schuster 1905, "Radiation through a foggy atmosphere"; Kubelka & Munk 1931, "Ein Beitrag zur Optik der Farbanstriche";
Gate 1974, "Comparison of the photon diffusion model and Kubelka-Munk equation with the exact solution of the radiative
transport equation"; Saunderson 1942, "Calculation of the color
of pigmented plastics"; Thennadil 2008, "Relationship between the Kubelka-Munk scattering and radiative transfer
coefficients", who finds Gate's relation to hold over a larger range than those with an absorption term in S.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics


def two_stream_absorption(absorption: npt.ArrayLike) -> Array:
    """Absorption K = 2 sigma_a in 1/m: diffuse light travels twice as far as the layer is thick (Gate 1974)."""
    return 2.0 * np.asarray(absorption, dtype=np.float64)


def two_stream_scattering(scattering: npt.ArrayLike, anisotropy: npt.ArrayLike) -> Array:
    """Scattering S = 3/4 sigma_s (1 - g) in 1/m (Gate 1974): of reduced scattering, three quarters turn light around.

    For diffuse light on a wide slab of an albedo from 0.9, both fractions are within 0.03 of the true ones whatever its
    thickness, and within 0.07 from an albedo of 0.5; of light straight on, thin slabs reflect up to half less.
    """
    return 0.75 * (1.0 - np.asarray(anisotropy, dtype=np.float64)) * np.asarray(scattering, dtype=np.float64)


def two_stream_depth(absorption_depth: npt.ArrayLike, scattering_depth: npt.ArrayLike) -> Array:
    """Two-stream depth gamma d = sqrt(K (K + 2 S)) d: a deep layer lets exp(-gamma d) through."""
    k, s = np.asarray(absorption_depth, dtype=np.float64), np.asarray(scattering_depth, dtype=np.float64)
    # Two roots, so that no product overflows.
    return np.asarray(np.sqrt(k) * np.sqrt(k + 2.0 * s))


@np.errstate(under="ignore")
def two_stream_denominator(absorption_depth: npt.ArrayLike, scattering_depth: npt.ArrayLike) -> Array:
    """Denominator ((K + S) sinh(gamma d) / gamma + cosh(gamma d)) exp(-gamma d), without overflow; 1 + S d at K = 0."""
    k, s = np.asarray(absorption_depth, dtype=np.float64), np.asarray(scattering_depth, dtype=np.float64)
    both_ways = 2.0 * two_stream_depth(k, s)
    return np.asarray((k + s) * optics.mean_transmittance(both_ways) + 0.5 * (1.0 + optics.transmittance(both_ways)))


@np.errstate(under="ignore")
def two_stream_reflectance(absorption_depth: npt.ArrayLike, scattering_depth: npt.ArrayLike) -> Array:
    """Diffuse reflectance of a layer (Kubelka & Munk 1931): S sinh / ((K + S) sinh + gamma cosh).

    S d / (1 + S d) where nothing absorbs; 1 + K/S - sqrt((K/S)^2 + 2 K/S) for a layer without end. Boundaries reflect
    nothing: the layer is index-matched.

    Parameters
    ----------
    absorption_depth, scattering_depth : array_like
        K d and S d, >= 0.
    """
    s = np.asarray(scattering_depth, dtype=np.float64)
    both_ways = 2.0 * two_stream_depth(absorption_depth, s)
    return np.asarray(s * optics.mean_transmittance(both_ways) / two_stream_denominator(absorption_depth, s))


@np.errstate(under="ignore")
def two_stream_transmittance(absorption_depth: npt.ArrayLike, scattering_depth: npt.ArrayLike) -> Array:
    """Diffuse transmittance of a layer: gamma / ((K + S) sinh + gamma cosh); 1 / (1 + S d) at K = 0."""
    depth = two_stream_depth(absorption_depth, scattering_depth)
    return np.asarray(optics.transmittance(depth) / two_stream_denominator(absorption_depth, scattering_depth))


@np.errstate(under="ignore")
def multiple_reflectance(absorption_depth: npt.ArrayLike, scattering_depth: npt.ArrayLike) -> Array:
    """Reflectance of a layer without light scattered back only once, S / (2 (K + S)) (1 - exp(-2 (K + S) d)).

    To be added to single scattering that is known exactly.
    """
    k, s = np.asarray(absorption_depth, dtype=np.float64), np.asarray(scattering_depth, dtype=np.float64)
    once = s * optics.mean_transmittance(2.0 * (k + s))
    return np.maximum(two_stream_reflectance(k, s) - once, 0.0)


@np.errstate(under="ignore")
def mirrored_reflectance(reflectance: npt.ArrayLike, transmittance: npt.ArrayLike, mirrored: npt.ArrayLike) -> Array:
    """Reflectance of a layer between interfaces of internal reflectance r for diffuse light (Saunderson 1942).

    Of what the layer sends out, 1 - r leaves, and the rest comes back to it, any number of times:
    (1 - r) (R (1 - r R) + r T^2) / ((1 - r R)^2 - r^2 T^2).

    Parameters
    ----------
    reflectance, transmittance : array_like
        R and T of the bare layer, R + T <= 1.
    mirrored : array_like
        r, 0 to below 1.
    """
    back, through, r = (np.asarray(x, dtype=np.float64) for x in (reflectance, transmittance, mirrored))
    turned = back * (1.0 - r * back) + r * through * through
    return np.asarray((1.0 - r) * turned / _mirrored_denominator(back, through, r))


@np.errstate(under="ignore")
def mirrored_transmittance(reflectance: npt.ArrayLike, transmittance: npt.ArrayLike, mirrored: npt.ArrayLike) -> Array:
    """Transmittance of a layer between interfaces of internal reflectance r: (1 - r) T / ((1 - r R)^2 - r^2 T^2)."""
    back, through, r = (np.asarray(x, dtype=np.float64) for x in (reflectance, transmittance, mirrored))
    return np.asarray((1.0 - r) * through / _mirrored_denominator(back, through, r))


def _mirrored_denominator(reflectance: Array, transmittance: Array, mirrored: Array) -> Array:
    """(1 - r R)^2 - r^2 T^2, by its factors: the layer lit alike from both sides, and oppositely."""
    alike, opposite = reflectance + transmittance, reflectance - transmittance
    return np.asarray((1.0 - mirrored * alike) * (1.0 - mirrored * opposite))
