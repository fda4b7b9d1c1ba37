"""Light that a slab of scattering medium between two polished interfaces sends to both sides, exactly; float64.

By doubling a thin layer. What similarity counts as unscattered, light that is scattered ahead, is not in what a slab
scatters.

References
----------
van de Hulst 1980, "Multiple light scattering", chapter 4; Wiscombe 1977, "The delta-M method", for phase functions
that are sharper than the quadrature.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from translucent.arrays import Array
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import interface_nodes
from translucent.formulas.phase import ISOTROPIC, PhaseFunction

#: Quadrature points, on each side of the critical cosine.
NODES = 12

#: Powers of two of the optical depths that are tabulated, with that many between; and of the layer that is doubled.
_LEAST, _MOST, _BETWEEN, _START = -5, 6, 2, -24


@dataclass(frozen=True, eq=False)
class SlabFluxes:
    """Fractions of light that has entered a slab, and leaves it scattered, on the same side and on the other one.

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
    own, across = np.zeros((2, len(depths), len(cosine)))
    for chain in range(_BETWEEN):
        depth = 2.0 ** (_START + chain / _BETWEEN)
        # A layer so thin that light is scattered no more than once.
        turned, kept = _phases(cosine, (moments[:-1] - peak) / (1.0 - peak))
        back, on = (0.5 * scattered * depth * part * weight / cosine[:, None] for part in (turned, kept))
        on = on + np.diag(1.0 - extinction * depth / cosine)
        for power in range(_START, _MOST + 1):
            number = (power - _LEAST) * _BETWEEN + chain
            if 0 <= number < len(depths):
                straight = np.diag(optics.transmittance(depths[number] / cosine))
                whole = _between_interfaces(back, on, mirrored, leaves)
                unscattered = _between_interfaces(np.zeros_like(back), straight, mirrored, leaves)
                for found, every, some in zip((own, across), whole, unscattered, strict=True):
                    found[number] = np.maximum(every - some, 0.0) / (cosine * weight)
            again = np.linalg.inv(np.eye(len(cosine)) - back @ back)
            back, on = back + on @ again @ back @ on, on @ again @ on
    return SlabFluxes(depths, cosine, own, across, leaves / leaves.sum())


def _phases(cosine: Array, moments: Array) -> tuple[Array, Array]:
    """Phase function (n, n) averaged around the normal, 1 on average: backwards and forwards."""
    order = np.arange(len(moments))
    values = np.polynomial.legendre.legvander(cosine, len(moments) - 1)
    weighted = values * (2 * order + 1) * moments
    return (weighted * (-1.0) ** order) @ values.T, weighted @ values.T


def _between_interfaces(back: Array, on: Array, mirrored: Array, leaves: Array) -> tuple[Array, Array]:
    """Flux that leaves on the same side and on the other one, (n,) each, for radiance down at each cosine.

    Light from both sides at once, alike or opposite, meets one mirror only.
    """
    one, found = np.eye(len(leaves)), []
    for matrix in (back + on, back - on):
        found.append((np.linalg.solve((one - matrix * mirrored).T, leaves)) @ matrix)
    return 0.5 * (found[0] + found[1]), 0.5 * (found[0] - found[1])
