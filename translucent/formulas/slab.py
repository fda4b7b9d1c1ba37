"""Slabs of scattering medium by adding and doubling thin layers: between two interfaces, and on a card; float64.

`slab_fluxes` is what a slab between two polished interfaces sends to both sides, exactly. What similarity counts as
unscattered, light that is scattered ahead, is not in what such a slab scatters. `reflectance_on_card` is of many slabs
at once, in diffuse white light: each has a polished upper side and lies on a diffuse card in optical contact, as a coat
of paint on a contrast chart does. What is scattered isotropically is exact there but for the quadrature; else give the
reduced coefficients. Bare layers of any anisotropy, one by one: `translucent.reference.slabs`.

References
----------
van de Hulst 1980, "Multiple light scattering", chapter 4; Wiscombe 1977, "The delta-M method", for phase functions
that are sharper than the quadrature.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface, interface_nodes
from translucent.formulas.phase import ISOTROPIC, PhaseFunction

#: Quadrature points, on each side of the critical cosine.
NODES = 12

#: Powers of two of the optical depths that are tabulated, with that many between; and of the layer that is doubled.
_LEAST, _MOST, _BETWEEN, _START = -5, 6, 2, -24


@dataclass(frozen=True, eq=False)
class SlabFluxes:
    """Fractions of the light inside a slab that leave scattered, on the same side and on the other side.

    Attributes
    ----------
    depths : (t,) float64
        Reduced optical depths of the slabs.
    cosines : (n,) float64
        Of the light with the normal, inside.
    own, across : (t, n) float64
    uniform : (n,) float64
        Weights of the cosines in light that is uniform outside.
    """

    depths: Array
    cosines: Array
    own: Array
    across: Array
    uniform: Array


@lru_cache(maxsize=64)
@np.errstate(under="ignore")
def slab_fluxes(albedo: float, ior: float, phase: PhaseFunction = ISOTROPIC) -> SlabFluxes:
    """Table of slabs.

    Parameters
    ----------
    albedo : float
        The reduced one of single scattering, 0 to 1.
    ior : float
        Index inside relative to outside, >= 1.
    phase : PhaseFunction
    """
    ahead = phase.mean_cosine
    # Optical depth, and the part of it that is scattered, for a reduced depth of 1; less the peak ahead.
    scattered = albedo / (1.0 - ahead)
    moments = phase.moments(2 * NODES + 1)
    scattered, peak = scattered * (1.0 - moments[-1]), moments[-1]
    extinction = 1.0 - albedo + scattered
    cosine, weight = interface_nodes(ior, NODES)
    mirrored = optics.fresnel_dielectric(cosine, 1.0 / ior) if ior > 1.0 else np.zeros_like(cosine)
    leaves = cosine * weight * (1.0 - mirrored)
    depths = 2.0 ** (np.arange(_LEAST * _BETWEEN, _MOST * _BETWEEN + 1) / _BETWEEN)
    # Layers so thin that light is scattered no more than once; each is doubled.
    depth = depths[:_BETWEEN, None, None] * 2.0 ** (_START - _LEAST)
    turned, kept = _phases(cosine, (moments[:-1] - peak) / (1.0 - peak))
    back, on = (0.5 * scattered * depth * part * weight / cosine[:, None] for part in (turned, kept))
    one = np.eye(len(cosine))
    on = on + one * (1.0 - extinction * depth / cosine)
    layers = []
    for _ in range(_START, _MOST + 1):
        layers.append((back, on))
        between = on @ np.linalg.inv(one - back @ back)
        back, on = back + between @ back @ on, between @ on
    backs, ons = (np.concatenate(part)[: len(depths)] for part in zip(*layers[_LEAST - _START :], strict=True))
    straight = optics.transmittance(depths[:, None] / cosine)
    fluxes = []
    # Light from both sides at once, alike or opposite, meets one mirror only.
    for sign in (1.0, -1.0):
        matrix = backs + sign * ons
        every = np.linalg.solve(one - np.swapaxes(matrix, 1, 2) * mirrored[:, None], leaves[:, None])
        unscattered = leaves / (1.0 - sign * straight * mirrored) * sign * straight
        fluxes.append((np.swapaxes(every, 1, 2) @ matrix)[:, 0] - unscattered)
    own, across = (np.maximum(0.5 * (fluxes[0] + sign * fluxes[1]), 0.0) / (cosine * weight) for sign in (1.0, -1.0))
    return SlabFluxes(depths, cosine, own, across, leaves / leaves.sum())


def _phases(cosine: Array, moments: Array) -> tuple[Array, Array]:
    """Phase function (n, n) averaged around the normal, 1 on average: backwards and forwards."""
    order = np.arange(len(moments))
    values = np.polynomial.legendre.legvander(cosine, len(moments) - 1)
    weighted = values * (2 * order + 1) * moments
    return (weighted * (-1.0) ** order) @ values.T, weighted @ values.T


#: Cosines of slabs on a card, on each side of the critical one. With twice as many, results change by less than 1e-3.
CARD_NODES = 8

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
    x, weight = np.polynomial.legendre.leggauss(CARD_NODES)
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
