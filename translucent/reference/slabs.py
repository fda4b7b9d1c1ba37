"""Slabs of scattering medium in diffuse light, exactly: by adding and doubling layers on a quadrature over cosines.

References
----------
van de Hulst 1980, "Multiple light scattering", chapter 4; Wiscombe 1977, "The delta-M method", for phase functions that
are sharper than the quadrature; polished interfaces on both sides.
"""

from __future__ import annotations

import numpy as np
from scipy.special import eval_legendre

from translucent.arrays import Array
from translucent.formulas import optics

#: Cosines, on each side of the critical one; Legendre moments of the phase function go up to twice as many.
NODES = 24


def cosines(ior: float) -> tuple[Array, Array]:
    """Nodes and weights on 0 to 1, apart on both sides of the critical cosine."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    x, weight = 0.5 * (x + 1), 0.5 * weight
    if ior == 1:
        return x, weight
    edge = np.sqrt(1 - 1 / ior**2)
    return np.concatenate([edge * x, edge + (1 - edge) * x]), np.concatenate([edge * weight, (1 - edge) * weight])


def bare(albedo: float, depth: float, mu: Array, weight: Array, anisotropy: float = 0.0) -> tuple[Array, Array]:
    """Reflection and transmission matrices of a layer without interfaces, for radiances at the cosines of a quadrature.

    Parameters
    ----------
    albedo, depth : float
        Of single scattering, and the optical depth.
    mu, weight : (n,)
        See `cosines`.
    anisotropy : float
        g of Henyey and Greenstein, whose forward peak counts as unscattered (Wiscombe 1977).
    """
    peak = anisotropy ** (2 * NODES)
    depth, albedo = (1 - albedo * peak) * depth, albedo * (1 - peak) / (1 - albedo * peak)
    # So thin that light is scattered no more than once, 2^-doublings of the whole.
    doublings = max(int(np.ceil(np.log2(depth / mu.min()))) + 14, 0)
    thin = depth / 2**doublings
    rate = thin / mu[:, None]
    # To second order in the thickness: emitted at half depth, dimmed both ways.
    half = np.exp(-0.5 * thin / mu)
    turned, kept = (
        rate * (0.5 * albedo * weight) * phase * half[:, None] * half for phase in _phases(mu, anisotropy, peak)
    )
    back, on = turned, kept + np.diag(np.exp(-thin / mu))
    one = np.eye(len(mu))
    for _ in range(doublings):
        between = np.linalg.inv(one - back @ back)
        back, on = back + on @ between @ back @ on, on @ between @ on
    return back, on


def _phases(mu: Array, anisotropy: float, peak: float) -> tuple[Array, Array]:
    """Phase function (n, n) without its peak, averaged around the normal and 1 on average: backwards and forwards."""
    if anisotropy == 0:
        return np.ones((len(mu), len(mu))), np.ones((len(mu), len(mu)))
    order = np.arange(2 * NODES)
    moments = (2 * order + 1) * (anisotropy**order - peak) / (1 - peak)
    values = eval_legendre(order, mu[:, None])
    return (values * moments * (-1.0) ** order) @ values.T, (values * moments) @ values.T


def scattered_fractions(albedo: float, depth: float, ior: float, anisotropy: float = 0.0) -> tuple[float, float]:
    """Reflectance and transmittance of a slab for diffuse light that has entered, scattered light alone."""
    if albedo == 0:
        return 0.0, 0.0
    (r, t), (r0, t0) = total_fractions(albedo, depth, ior, anisotropy), unscattered_fractions(depth, ior)
    return r - r0, t - t0


@np.errstate(under="ignore")
def total_fractions(albedo: float, depth: float, ior: float, anisotropy: float = 0.0) -> tuple[float, float]:
    """Reflectance and transmittance of a slab for diffuse light that has entered at the top."""
    mu, weight = cosines(ior)
    return _between_interfaces(mu, weight, ior, *bare(albedo, depth, mu, weight, anisotropy))


@np.errstate(under="ignore")
def unscattered_fractions(depth: float, ior: float) -> tuple[float, float]:
    """Reflectance and transmittance of a slab for diffuse light that has entered, unscattered light alone."""
    mu, weight = cosines(ior)
    return _between_interfaces(mu, weight, ior, np.zeros((len(mu), len(mu))), np.diag(np.exp(-depth / mu)))


@np.errstate(under="ignore")
def entering_transmittance(depth: float, ior: float) -> float:
    """Fraction of diffuse light that has entered at the top and reaches the bottom unscattered."""
    mu, weight = cosines(ior)
    flux = mu * weight * ((1 - optics.fresnel_dielectric(mu, 1 / ior)) if ior > 1 else 1.0)
    return float((flux * np.exp(-depth / mu)).sum() / flux.sum())


def _between_interfaces(mu: Array, weight: Array, ior: float, back: Array, on: Array) -> tuple[float, float]:
    mirror = optics.fresnel_dielectric(mu, 1 / ior) if ior > 1 else np.zeros_like(mu)
    flux = mu * weight * (1 - mirror)
    # Radiance inward at both faces, which are mirrors: d1 = in + m (back d1 + on d2), d2 = m (on d1 + back d2).
    n, m = len(mu), mirror[:, None]
    system = np.eye(2 * n) - np.block([[m * back, m * on], [m * on, m * back]])
    d1, d2 = np.split(np.linalg.solve(system, np.concatenate([1 - mirror, np.zeros(n)])), 2)
    up, down = (flux * (back @ d1 + on @ d2)).sum(), (flux * (on @ d1 + back @ d2)).sum()
    return float(up / flux.sum()), float(down / flux.sum())
