"""Slabs of scattering medium in diffuse light, exactly: by adding and doubling layers on a quadrature over cosines.

van de Hulst 1980, "Multiple light scattering", chapter 4; isotropic scattering, polished interfaces on both sides.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas import optics

Array = npt.NDArray[np.float64]

NODES = 24


def cosines(ior: float) -> tuple[Array, Array]:
    """Nodes and weights on 0 to 1, apart on both sides of the critical cosine."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    x, weight = 0.5 * (x + 1), 0.5 * weight
    if ior == 1:
        return x, weight
    edge = np.sqrt(1 - 1 / ior**2)
    return np.concatenate([edge * x, edge + (1 - edge) * x]), np.concatenate([edge * weight, (1 - edge) * weight])


def bare(albedo: float, depth: float, mu: Array, weight: Array) -> tuple[Array, Array]:
    """Matrices that turn incident radiance at the nodes into reflected and transmitted radiance."""
    # So thin that light is scattered no more than once, 2^-doublings of the whole.
    doublings = max(int(np.ceil(np.log2(depth / mu.min()))) + 14, 0)
    thin = depth / 2**doublings
    rate = thin / mu[:, None]
    source = 0.5 * albedo * weight
    # To second order in the thickness: emitted at half depth, dimmed both ways.
    half = np.exp(-0.5 * thin / mu)
    once = rate * source * half[:, None] * half
    back, on = once.copy(), once + np.diag(np.exp(-thin / mu))
    one = np.eye(len(mu))
    for _ in range(doublings):
        between = np.linalg.inv(one - back @ back)
        back, on = back + on @ between @ back @ on, on @ between @ on
    return back, on


def shares(albedo: float, depth: float, ior: float) -> tuple[float, float]:
    """Of the diffuse light that enters at the top, what leaves there and at the bottom after it has been scattered."""
    if albedo == 0:
        return 0.0, 0.0
    mu, weight = cosines(ior)
    mirror = optics.fresnel_dielectric(mu, 1 / ior) if ior > 1 else np.zeros_like(mu)
    flux = mu * weight
    found = []
    with np.errstate(under="ignore"):
        unscattered = np.zeros((len(mu), len(mu))), np.diag(np.exp(-depth / mu))
        for back, on in (bare(albedo, depth, mu, weight), unscattered):
            # Radiance inward at both faces, which are mirrors: d1 = in + m (back d1 + on d2), d2 = m (on d1 + back d2).
            n = len(mu)
            m = mirror[:, None]
            system = np.eye(2 * n) - np.block([[m * back, m * on], [m * on, m * back]])
            entered = np.concatenate([1 - mirror, np.zeros(n)])
            d1, d2 = np.split(np.linalg.solve(system, entered), 2)
            leaving = back @ d1 + on @ d2, on @ d1 + back @ d2
            found.append([float((flux * (1 - mirror) * up).sum() / (flux * (1 - mirror)).sum()) for up in leaving])
    (r, t), (r0, t0) = found
    return r - r0, t - t0
