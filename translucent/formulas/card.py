"""Slabs of scattering medium on a card, in diffuse white light: many at once, by adding and doubling layers.

A slab has a polished upper side and lies on a diffuse card in optical contact, as a coat of paint on a contrast chart
does. What is scattered isotropically is exact but for the quadrature; else give the reduced coefficients. Bare layers
between two interfaces, of any anisotropy and one by one: `translucent.reference.slabs`.

References
----------
van de Hulst 1980, "Multiple light scattering", chapter 4.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface

#: Cosines, on each side of the critical one. With twice as many, results change by less than 1e-3.
NODES = 8

#: A layer of 2^-THIN optical depths along the shallowest ray scatters light no more than once.
THIN = 14

#: Largest optical depth: deeper slabs differ by less than 1e-3, and doubling would lose as much where nothing absorbs.
DEEPEST = 1e4


@np.errstate(under="ignore")
def reflectance_on_card(albedo: npt.ArrayLike, depth: npt.ArrayLike, ior: float, card: npt.ArrayLike) -> Array:
    """Reflectance of a slab on a card for diffuse white light, without the specular reflection of the slab.

    Parameters
    ----------
    albedo, depth : array_like
        Of single scattering, 0 to 1, and the optical depth, >= 0; they broadcast.
    ior : float
        Index of refraction of the slab, >= 1.
    card : array_like
        Diffuse reflectance of the card, 0 to 1; it broadcasts with the others.

    Returns
    -------
    array
        0 to 1: from a clear slab on a white card, the fraction of light that enters.
    """
    albedos, depths = np.broadcast_arrays(np.asarray(albedo, dtype=np.float64), np.asarray(depth, dtype=np.float64))
    mu, weight = _cosines(ior)
    bare = _layers(albedos.ravel(), np.minimum(depths.ravel(), DEEPEST), mu, weight)
    back, on = (matrix.reshape(*albedos.shape, len(mu), len(mu)) for matrix in bare)
    turned = np.asarray(card, dtype=np.float64)[..., None, None] * np.broadcast_to(2.0 * mu * weight, back.shape[-2:])
    one = np.eye(len(mu))
    back = back + on @ np.linalg.solve(one - turned @ back, turned @ on)
    mirror = optics.fresnel_dielectric(mu, 1.0 / ior) if ior > 1.0 else np.zeros_like(mu)
    # Uniform radiance from outside stays uniform inside the cone that it refracts to, but for Fresnel reflection.
    entered = np.broadcast_to((1.0 - mirror)[:, None], (*back.shape[:-1], 1))
    down = np.linalg.solve(one - mirror[:, None] * back, entered)
    flux = mu * weight * (1.0 - mirror)
    return np.asarray(diffuse_interface(ior).entering * ((back @ down)[..., 0] @ flux) / flux.sum())


def _cosines(ior: float) -> tuple[Array, Array]:
    """Nodes and weights on 0 to 1, apart on both sides of the critical cosine."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    x, weight = 0.5 * (x + 1.0), 0.5 * weight
    if ior == 1.0:
        return x, weight
    edge = float(np.sqrt(1.0 - 1.0 / ior**2))
    return np.concatenate([edge * x, edge + (1.0 - edge) * x]), np.concatenate([edge * weight, (1.0 - edge) * weight])


def _layers(albedo: Array, depth: Array, mu: Array, weight: Array) -> tuple[Array, Array]:
    """Matrices (n, m, m) that turn radiance at the nodes into reflected and transmitted radiance, of bare layers."""
    doublings = np.ceil(np.log2(np.maximum(depth, 1e-300) / mu.min())).astype(int).clip(-THIN) + THIN
    thin = (depth / 2.0**doublings)[:, None, None]
    # To second order in the thickness: emitted at half depth, dimmed both ways.
    half = np.exp(-0.5 * thin / mu)
    back = thin / mu[:, None] * (0.5 * albedo[:, None, None] * weight) * np.swapaxes(half, 1, 2) * half
    on, one = back + np.eye(len(mu)) * np.exp(-thin / mu), np.eye(len(mu))
    for step in range(doublings.max(initial=0)):
        left = doublings > step
        r, t = back[left], on[left]
        between = t @ np.linalg.inv(one - r @ r)
        back[left], on[left] = r + between @ r @ t, between @ t
    return back, on
