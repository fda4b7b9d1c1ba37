"""Formulas of light in a medium, in float64. Each has a twin of the same name in ``shaders/lib/optics.glsl``.

All functions are pure and broadcast over arrays. Symbols: extinction sigma_t in 1/m, distance d in m,
optical depth tau = sigma_t d without unit, transmittance T = exp(-tau), emission q in radiance per metre.

References
----------
Beer 1852; Henyey & Greenstein 1941; Max 1995, "Optical models for direct volume rendering";
Porter & Duff 1984; Born & Wolf 1999 (Fresnel, section 1.5.2); Drobot 2017 (thin layer).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

#: Smallest cosine in the thin-layer formula (Drobot 2017): a sheet viewed edge-on is 1000 times as thick.
MIN_THIN_LAYER_COSINE = 0.001


def transmittance(optical_depth: npt.ArrayLike) -> Array:
    """Transmittance, the fraction of light that passes, T = exp(-tau) (Beer-Lambert); underflows to exactly 0."""
    with np.errstate(under="ignore"):
        return np.exp(-np.asarray(optical_depth, dtype=np.float64))


def opacity(optical_depth: npt.ArrayLike) -> Array:
    """Opacity, the fraction of light that is lost, alpha = 1 - exp(-tau), without cancellation at small tau."""
    with np.errstate(under="ignore"):
        return -np.expm1(-np.asarray(optical_depth, dtype=np.float64))


def log_one_minus(x: npt.ArrayLike) -> Array:
    """Logarithm log(1 - x), without cancellation at small x; -inf at x = 1."""
    with np.errstate(divide="ignore"):
        return np.log1p(-np.asarray(x, dtype=np.float64))


def extinction_from_color(color: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    """Extinction that leaves `color` of white light after `distance`: sigma_t = -log(t_c) / d, in 1/m.

    Parameters
    ----------
    color : array_like
        Transmitted linear color, 0 < t_c <= 1; t_c = 1 gives exactly 0.
    distance : array_like
        Distance in metres, > 0.

    Notes
    -----
    Conditioning: a relative error e in t_c is an absolute error e / d in sigma_t, that is e / -log(t_c) relative.
    A color near white therefore says little about sigma_t.
    """
    # Adding 0 turns the -0 of a white channel into 0.
    return -np.log(np.asarray(color, dtype=np.float64)) / np.asarray(distance, dtype=np.float64) + 0.0


def mean_transmittance(optical_depth: npt.ArrayLike) -> Array:
    """Mean transmittance (1 - exp(-x)) / x over a path of optical depth x; 1 at x = 0."""
    x = np.asarray(optical_depth, dtype=np.float64)
    safe = np.where(x == 0, 1.0, x)
    return np.where(x == 0, 1.0, opacity(safe) / safe)


@np.errstate(under="ignore")
def emitted_radiance(emission: npt.ArrayLike, extinction: npt.ArrayLike, distance: npt.ArrayLike) -> Array:
    """Radiance that a homogeneous, emitting interval adds: q / sigma_t (1 - exp(-sigma_t d)); q d at sigma_t = 0.

    Max 1995, eq. 11 with a constant source term.
    """
    d = np.asarray(distance, dtype=np.float64)
    return np.asarray(emission, dtype=np.float64) * d * mean_transmittance(np.asarray(extinction, dtype=np.float64) * d)


def opacity_for_step(opacity_at_reference: npt.ArrayLike, step_ratio: npt.ArrayLike) -> Array:
    """Opacity of a step that is `step_ratio` times the reference step: 1 - (1 - alpha)^ratio (opacity correction)."""
    alpha, ratio = np.asarray(opacity_at_reference, dtype=np.float64), np.asarray(step_ratio, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore", under="ignore"):
        # A step of no length loses nothing, even where 1 - alpha = 0 makes it 0 log(0).
        return np.where(ratio == 0, 0.0, -np.expm1(ratio * log_one_minus(alpha)))


@np.errstate(under="ignore")
def composite_over(front: npt.ArrayLike, front_opacity: npt.ArrayLike, behind: npt.ArrayLike) -> Array:
    """Composite of front over behind for associated (premultiplied) colors: F + (1 - alpha) B (Porter & Duff 1984)."""
    return np.asarray(front, np.float64) + (1.0 - np.asarray(front_opacity, np.float64)) * np.asarray(
        behind, np.float64
    )


@np.errstate(under="ignore")
def fresnel_dielectric(cos_incident: npt.ArrayLike, ior: npt.ArrayLike) -> Array:
    """Unpolarized Fresnel reflectance of a smooth dielectric interface; 1 under total internal reflection.

    Parameters
    ----------
    cos_incident : array_like
        Cosine of the angle of incidence, 0..1.
    ior : array_like
        Index of refraction behind the boundary relative to the one in front of it.
    """
    c = np.asarray(cos_incident, dtype=np.float64)
    n = np.asarray(ior, dtype=np.float64)
    # Each amplitude is a difference of nearly equal terms where n is near 1; multiplied out, it holds n^2 - 1.
    ior_squared_minus_1 = (n - 1.0) * (n + 1.0)
    k = ior_squared_minus_1 + c * c
    root = np.sqrt(np.maximum(k, 0.0))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        # The squares (n^2 c + root)^2 and (c + root)^2 as sums with k, so that a grazing ray gives exactly 1.
        twice = 2.0 * c * root
        parallel = ior_squared_minus_1 * (c * c * (n * n + 1.0) - 1.0) / (n * n * (n * n * c * c + twice) + k)
        normal = ior_squared_minus_1 / (c * c + twice + k)
        reflectance = np.minimum(0.5 * (parallel * parallel + normal * normal), 1.0)
    # A boundary between equal media does not exist, also not edge-on, where the formula is 0/0.
    return np.where(ior_squared_minus_1 == 0.0, 0.0, np.where(k <= 0.0, 1.0, reflectance))


def refracted_cosine(cos_incident: npt.ArrayLike, ior: npt.ArrayLike) -> Array:
    """Cosine of the refracted angle (Snell): sqrt(n^2 - 1 + c^2) / n; 0 under total internal reflection."""
    c = np.asarray(cos_incident, dtype=np.float64)
    n = np.asarray(ior, dtype=np.float64)
    with np.errstate(under="ignore"):
        return np.sqrt(np.maximum((n - 1.0) * (n + 1.0) + c * c, 0.0)) / n


def thin_layer_thickness(thickness: npt.ArrayLike, cos_view: npt.ArrayLike, ior: npt.ArrayLike = 1.0) -> Array:
    """Path through a thin sheet: t / max(0.001, n.v) (Drobot 2017), with the refracted cosine where ior > 1.

    Parameters
    ----------
    thickness : array_like
        Thickness t of the sheet in metres.
    cos_view : array_like
        n.v, cosine between the sheet's normal and the direction to the viewer; below 0.001 it counts as 0.001.
    ior : array_like
        Index of refraction; 1 means index-matched: the ray goes straight through.
    """
    cosine = refracted_cosine(np.maximum(np.asarray(cos_view, np.float64), 0.0), ior)
    return np.asarray(thickness, np.float64) / np.maximum(cosine, MIN_THIN_LAYER_COSINE)
