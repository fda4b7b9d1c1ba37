"""Quadrature of the reflectance of rough interfaces; `translucent.formulas.bsdf` stores its results."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas.bsdf import TABLE_SIZE

#: Gauss-Legendre points in the polar and in the azimuthal angle, in `albedo`.
POINTS = (24, 16)

#: Bisections for where the reflected direction leaves the hemisphere above the surface.
BISECTIONS = 40

#: Smaller cosines are taken for this one: seen exactly from the side, a surface has no visible normals.
MIN_COSINE = 1e-4


def integrated_table() -> npt.NDArray[np.float32]:
    """`brdf_table`, integrated in a quarter of a second."""
    steps = np.linspace(0.0, 1.0, TABLE_SIZE)
    return np.concatenate([albedo(steps[None], row[:, None]) for row in np.split(steps, 8)]).astype(np.float32)


def albedo(cosine: npt.ArrayLike, roughness: npt.ArrayLike) -> Array:
    """Scale and bias (..., 2) of the reflectance under uniform light, by quadrature to 1e-4.

    Parameters
    ----------
    cosine : array_like (...)
        Of the angle between the normal and the direction to the eye, 0 to 1.
    roughness : array_like (...)
        0 to 1. At 0 the surface is a mirror: scale 1 - (1 - cosine)^5, bias (1 - cosine)^5.

    Notes
    -----
    The mean over the visible normals h (Heitz 2018, "Sampling the GGX Distribution of Visible Normals") of F G2 / G1:
    what is left of the integrand is smooth, without the peak of D.
    """
    n_v, rough = np.broadcast_arrays(np.asarray(cosine, dtype=np.float64), np.asarray(roughness, dtype=np.float64))
    n_v, alpha = np.maximum(n_v, MIN_COSINE)[..., None, None], (rough * rough)[..., None, None]
    polar, angle, weights = _points(n_v, alpha)
    v_h, n_l = _reflected(n_v, alpha, polar, angle)
    with np.errstate(under="ignore"):
        fresnel = (1.0 - v_h) ** 5
        passed = weights * _shadowing(n_v, n_l, alpha)
        return np.stack([np.sum(passed * (1.0 - fresnel), axis=(-2, -1)), np.sum(passed * fresnel, axis=(-2, -1))], -1)


def _points(n_v: Array, alpha: Array) -> tuple[Array, Array, Array]:
    """Polar and azimuthal angle of points on the hemisphere above the disk of visible normals, and weights.

    The half of it that is mirrored in the plane of incidence is left out.
    """
    t, t_weight = np.polynomial.legendre.leggauss(POINTS[0])
    u, u_weight = np.polynomial.legendre.leggauss(POINTS[1])
    angle = 0.5 * np.pi * u
    # Where light would be reflected into the surface nothing is left of it. Up to there the integrand has no kink.
    low, high = (np.full(np.broadcast_shapes(n_v.shape, alpha.shape, angle.shape), end) for end in (0.0, 0.5 * np.pi))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        above = _reflected(n_v, alpha, middle, angle)[1] > 0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    polar = 0.5 * high * (t + 1.0)[:, None]
    return polar, angle, high * t_weight[:, None] * np.sin(polar) * np.cos(polar) * 0.5 * u_weight


def _reflected(n_v: Array, alpha: Array, polar: Array, angle: Array) -> tuple[Array, Array]:
    """Cosines of the visible normal with the view, and of the reflected direction with the normal, 0 where below."""
    x, _, z = _visible_normal(n_v, alpha, np.sin(polar), angle)
    v_h = np.minimum(np.sqrt(1.0 - n_v * n_v) * x + n_v * z, 1.0)
    return v_h, np.maximum(2.0 * v_h * z - n_v, 0.0)


def _visible_normal(n_v: Array, alpha: Array, radius: Array, angle: Array) -> Array:
    """(3, ...): normals of microfacets, as seen from a direction in the plane of x and z (Heitz 2018, listing 1)."""
    sine = np.sqrt(1.0 - n_v * n_v)
    length = np.hypot(alpha * sine, n_v)
    view_x, view_z = alpha * sine / length, n_v / length
    # A hemisphere stretched to roughness 1, seen from the stretched direction: its projection is the unit disk with
    # the lower part of it squeezed.
    across = radius * np.cos(angle)  # along y
    up = radius * np.sin(angle)
    share = 0.5 * (1.0 + view_z)
    up = (1.0 - share) * np.sqrt(np.maximum(1.0 - across * across, 0.0)) + share * up
    out = np.sqrt(np.maximum(1.0 - across * across - up * up, 0.0))
    x, y, z = -view_z * up + view_x * out, across, view_x * up + view_z * out
    normal = np.stack(np.broadcast_arrays(alpha * x, alpha * y, np.maximum(z, 0.0)), axis=0)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=0), np.finfo(np.float64).tiny))


def _shadowing(n_v: Array, n_l: Array, alpha: Array) -> Array:
    """G2 / G1(v): the share of light from visible facets that no other facet blocks; 0 below the surface."""
    seen, lit = _tail(n_v, alpha), _tail(n_l, alpha)
    total = n_l * seen + n_v * lit
    return np.asarray(n_l * (seen + n_v) / np.where(total > 0, total, 1.0))


def _tail(cosine: Array, alpha: Array) -> Array:
    """(1 + 2 Lambda) cosine = sqrt(cosine^2 + alpha^2 (1 - cosine^2)), Smith's Lambda for GGX."""
    return np.sqrt(cosine * cosine * (1.0 - alpha * alpha) + alpha * alpha)
