"""Formulas of light at interfaces between media, in float64. Each has a twin in ``shaders/lib/interface.glsl``.

All functions are pure and broadcast. Directions (..., 3) are unit vectors in which light travels; a normal looks to the
side that the light comes from; ``ior`` is the index of the other side relative to this one. The fraction that a smooth
boundary reflects is `optics.fresnel_dielectric`, the cosine inside `optics.refracted_cosine`.

References
----------
Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates"; Walter et
al. 2007, "Microfacet models for refraction through rough surfaces"; Heitz 2014, "Understanding the masking-shadowing
function in microfacet-based BRDFs"; Khronos Group 2024, KHR_materials_dispersion.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics

#: Index of refraction of clear coats (KHR_materials_clearcoat).
CLEARCOAT_IOR = 1.5


@np.errstate(under="ignore")
def reflected_direction(direction: npt.ArrayLike, normal: npt.ArrayLike) -> Array:
    """Direction d - 2 (d.n) n of reflected light, (..., 3); the normal may look to either side."""
    d, n = np.asarray(direction, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    return np.asarray(d - 2.0 * np.sum(d * n, axis=-1, keepdims=True) * n)


@np.errstate(under="ignore")
def refracted_direction(direction: npt.ArrayLike, normal: npt.ArrayLike, ior: npt.ArrayLike) -> Array:
    """Direction of the light behind an interface (Snell), (..., 3); zero under total internal reflection.

    It is zero where `optics.fresnel_dielectric` of the same cosine is 1, but for grazing incidence on a denser medium,
    which has a direction and carries nothing.

    Parameters
    ----------
    direction, normal : array_like (..., 3)
        Unit vectors; their scalar product is not above 0.
    ior : array_like (...)
        Relative index of refraction, above 0; 1 leaves the direction as it is.
    """
    d, n = np.asarray(direction, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    relative = np.asarray(ior, dtype=np.float64)[..., None]
    c = -np.sum(d * n, axis=-1, keepdims=True)
    ior_squared_minus_1 = (relative - 1.0) * (relative + 1.0)
    k = ior_squared_minus_1 + c * c
    total = (k <= 0.0) & (ior_squared_minus_1 != 0.0)
    below = c + np.sqrt(np.maximum(k, 0.0))
    # (n^2 - 1) / (c + sqrt(k)) is sqrt(k) - c without its cancellation where the index is near 1.
    turn = np.where(ior_squared_minus_1 == 0.0, 0.0, ior_squared_minus_1 / np.where(below > 0.0, below, 1.0))
    return np.where(total, 0.0, (d - turn * n) / relative)


def channel_iors(ior: npt.ArrayLike, dispersion: npt.ArrayLike) -> Array:
    """Indices of refraction for red, green and blue, (..., 3), none below 1 (KHR_materials_dispersion).

    Parameters
    ----------
    ior : array_like
        Of green light (587.6 nm), >= 1.
    dispersion : array_like
        20 / V with the Abbe number V = (n_d - 1) / (n_F - n_C), >= 0: water and diamond 0.36; 0 is none.
    """
    n = np.asarray(ior, dtype=np.float64)
    # Half of n_F - n_C = (n_d - 1) / V.
    half_spread = 0.025 * (n - 1.0) * np.asarray(dispersion, dtype=np.float64)
    return np.stack(np.broadcast_arrays(np.maximum(n - half_spread, 1.0), n, n + half_spread), axis=-1)


@np.errstate(under="ignore")
def ggx_distribution(cos_half: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Density D of microfacet normals in 1/sr: alpha^2 / (pi ((alpha^2 - 1) cos^2 + 1)^2) (Walter et al. 2007, eq. 33).

    Parameters
    ----------
    cos_half : array_like
        Cosine between the microfacets' and the surface's normal, 0..1.
    alpha : array_like
        Square of the perceptual roughness, above 0: a smooth surface has no density.
    """
    c, a = np.asarray(cos_half, dtype=np.float64), np.asarray(alpha, dtype=np.float64)
    base = (1.0 - c) * (1.0 + c) + a * a * c * c
    return np.asarray((a / base) ** 2 / np.pi)


@np.errstate(under="ignore")
def ggx_visibility(cos_light: npt.ArrayLike, cos_view: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Height-correlated masking and shadowing G2 / (4 cos_light cos_view) of GGX (Heitz 2014, eq. 99).

    A rough boundary reflects F D V times the light that arrives, with `optics.fresnel_dielectric` at the
    microfacet. Exactly edge-on from both sides, where nothing is visible, V is 0.

    Parameters
    ----------
    cos_light, cos_view : array_like
        Cosines between the surface's normal and the directions to the light and to the viewer, 0..1.
    alpha : array_like
        As for `ggx_distribution`.
    """
    light, view, a = (np.asarray(x, dtype=np.float64) for x in (cos_light, cos_view, alpha))
    sum_ = view * _smith_root(light, a) + light * _smith_root(view, a)
    return np.where(sum_ > 0.0, 0.5 / np.where(sum_ > 0.0, sum_, 1.0), 0.0)


def _smith_root(cosine: Array, alpha: Array) -> Array:
    """sqrt(cos^2 + alpha^2 sin^2) = cos (1 + 2 Lambda)."""
    return np.sqrt(cosine * cosine + alpha * alpha * (1.0 - cosine) * (1.0 + cosine))


@np.errstate(under="ignore")
def smith_lambda(cosine: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Smith's Lambda of GGX, (sqrt(1 + alpha^2 tan^2) - 1) / 2 (Heitz 2014, eq. 72).

    From a direction, the fraction 1 / (1 + Lambda) of the microfacets that face it is visible; of these,
    (1 + Lambda_1) / (1 + Lambda_1 + Lambda_2) is also visible from another direction on the same side.

    Parameters
    ----------
    cosine : array_like
        Cosine between the surface's normal and the direction, 0..1; below 1e-6 it counts as that.
    alpha : array_like
        As for `ggx_distribution`; 0 is a polished surface.
    """
    up, a = np.maximum(np.asarray(cosine, np.float64), 1e-6), np.asarray(alpha, np.float64)
    slope = a * a * (1.0 - up) * (1.0 + up)
    # Multiplied out, so that nothing cancels where the surface is smooth.
    return np.asarray(0.5 * slope / (up * (np.sqrt(up * up + slope) + up)))


@np.errstate(under="ignore")
def ggx_visible_normal(towards: npt.ArrayLike, alpha: npt.ArrayLike, shares: npt.ArrayLike) -> Array:
    """Random normal of a GGX microfacet that is visible from a direction (Heitz 2018, listing 1).

    Parameters
    ----------
    towards : array_like (..., 3)
        Unit vector to the viewer, in a frame whose z axis is the surface's normal; z >= 0.
    alpha : array_like (...)
        As for `ggx_distribution`.
    shares : array_like (..., 2)
        Two random numbers, 0..1.

    Returns
    -------
    normal : (..., 3) float64
        Unit vector in the same frame.
    """
    view, a, u = (np.asarray(x, np.float64) for x in (towards, alpha, shares))
    stretched = _unit(np.stack([a * view[..., 0], a * view[..., 1], np.maximum(view[..., 2], 1e-6)], axis=-1))
    across = np.hypot(stretched[..., 0], stretched[..., 1])
    tilted = (across > 1e-6)[..., None]
    level = np.stack([-stretched[..., 1], stretched[..., 0], np.zeros_like(across)], axis=-1)
    first = np.where(tilted, level / np.where(tilted, across[..., None], 1.0), (1.0, 0.0, 0.0))
    second = np.cross(stretched, first)
    radius, angle = np.sqrt(u[..., 0]), 2.0 * np.pi * u[..., 1]
    x, visible = radius * np.cos(angle), 0.5 * (1.0 + stretched[..., 2])
    y = (1.0 - visible) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + visible * radius * np.sin(angle)
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    facet = x[..., None] * first + y[..., None] * second + z[..., None] * stretched
    return _unit(np.stack([a * facet[..., 0], a * facet[..., 1], np.maximum(facet[..., 2], 1e-6)], axis=-1))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@np.errstate(under="ignore")
def slab_transmittance(reflectance: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """Transmittance of a thin wall: (1 - r)^2 a / (1 - r^2 a^2), a = exp(-tau) (Stokes 1862).

    All reflections between the two parallel boundaries are added up as powers, not amplitudes: the wall is many
    wavelengths thick. The light leaves in the direction in which it came. Together with `slab_reflectance` this is 1 at
    tau = 0.

    Parameters
    ----------
    reflectance : array_like
        r of one boundary, the same from both sides, 0..1.
    optical_depth : array_like
        tau of one passage, along the refracted ray: sigma_t d / cosine inside.
    """
    r = np.asarray(reflectance, dtype=np.float64)
    passage = optics.transmittance(optical_depth)
    # 1 - r a as (1 - r) + r (1 - a), so that nothing cancels near grazing incidence.
    kept = (1.0 - r) + r * optics.opacity(optical_depth)
    shared = np.where(r < 1.0, (1.0 - r) / np.where(r < 1.0, kept, 1.0), 0.0)
    return np.asarray(shared * (1.0 - r) / (1.0 + r * passage) * passage)


@np.errstate(under="ignore")
def slab_reflectance(reflectance: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """Reflectance of a thin wall: r + r (1 - r)^2 a^2 / (1 - r^2 a^2); as for `slab_transmittance`."""
    through = slab_transmittance(reflectance, optical_depth)
    return np.asarray(np.asarray(reflectance, np.float64) * (1.0 + optics.transmittance(optical_depth) * through))
