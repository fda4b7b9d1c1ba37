"""Formulas of lights, in float64. Each has a twin of the same name in ``shaders/lib/light.glsl``.

References
----------
KHR_lights_punctual (Khronos 2020), "Inner and outer cone angles".
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

#: Cone of a light that shines alike in all directions; see `light_cone`.
ALL_AROUND = (0.0, 0.0, 0.0, 1.0)


def light_cone(direction: npt.ArrayLike, inner: float, outer: float) -> Array:
    """(4,): a cone as `cone_attenuation` takes it.

    The unit `direction` (3,) times k, with k^2 = 1 / (2 (cos inner - cos outer)), and
    (1 - cos outer) / (cos inner - cos outer); half angles in radians, 0 <= inner < outer <= pi / 2.
    """
    # Neither difference of cosines loses digits, however narrow the cone is.
    fall = 2.0 * np.sin(0.5 * (outer + inner)) * np.sin(0.5 * (outer - inner))
    return np.array([*np.asarray(direction) * np.sqrt(0.5 / fall), 2.0 * np.sin(0.5 * outer) ** 2 / fall])


def cone_attenuation(travel: npt.ArrayLike, cone: npt.ArrayLike) -> Array:
    """Fraction of a light's intensity in the unit directions `travel` (..., 3): (...).

    KHR_lights_punctual: the square of (cos - cos outer) / (cos inner - cos outer), within 0 to 1. Cosines come from
    chords, 1 - cos = |travel - direction|^2 / 2, which have their digits in narrow cones, too.
    """
    cone = np.asarray(cone, dtype=np.float64)
    axis = cone[..., :3]
    with np.errstate(under="ignore"):
        apart = np.linalg.norm(axis, axis=-1, keepdims=True) * np.asarray(travel, dtype=np.float64) - axis
        level = np.clip(cone[..., 3] - np.einsum("...i,...i->...", apart, apart), 0.0, 1.0)
        return np.asarray(level * level)


def sphere_point(shares: npt.ArrayLike) -> Array:
    """Points (..., 3) in a sphere of radius 1 that look like an even disc from everywhere, given numbers (..., 3).

    They are the projection of points that cover the sphere in four dimensions evenly, if the numbers are random.
    """
    shares = np.asarray(shares, np.float64)
    across, turn, other = np.sqrt(shares[..., 0]), 2.0 * np.pi * shares[..., 1], 2.0 * np.pi * shares[..., 2]
    along = np.sqrt(1.0 - shares[..., 0]) * np.cos(other)
    return np.stack([across * np.cos(turn), across * np.sin(turn), along], axis=-1)


def nearest_on_disc(disc: npt.ArrayLike, direction: npt.ArrayLike) -> Array:
    """Unit vectors (..., 3) to the point of a disc nearest to each direction, for highlights (Karis 2013).

    Parameters
    ----------
    disc : array_like (..., 4)
        Unit vector to its middle, and its radius over its distance, below 1.
    direction : array_like (..., 3)
        Unit vectors.
    """
    disc, direction = np.asarray(disc, np.float64), np.asarray(direction, np.float64)
    middle = disc[..., :3]
    with np.errstate(under="ignore"):
        aside = np.maximum((middle * direction).sum(axis=-1, keepdims=True), 0.0) * direction - middle
        length = np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-9)
        found = middle + aside * np.minimum(disc[..., 3:] / length, 1.0)
        return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def disc_peak(alpha: npt.ArrayLike, radius: npt.ArrayLike, cos_view: npt.ArrayLike) -> Array:
    """Fraction (...) of a highlight's peak that is left when it is spread over a disc of a radius over its distance.

    The distribution of microfacets (GGX) keeps its integral around the half vectors that mirror the disc.
    """
    alpha = np.asarray(alpha, np.float64)
    half_way = 0.5 * np.asarray(radius, np.float64) / np.sqrt(np.asarray(cos_view, np.float64))
    with np.errstate(under="ignore"):
        return np.asarray(alpha * alpha / (alpha * alpha + half_way * (0.5 * np.pi * alpha + half_way)))


def highlight_disc(towards: npt.ArrayLike, disc: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """(..., 4): disc of a light as microfacets mirror it, as in `nearest_on_disc`.

    Polished ones mirror all of it; for rough ones it is the point where the light is, one of several in the disc.

    Parameters
    ----------
    towards : array_like (..., 3)
        Unit vectors to the light.
    disc : array_like (..., 4)
        Unit vectors to the middle of the disc, and its radius over its distance, below 1; 0 for none.
    alpha : array_like (...)
        Of the microfacets.
    """
    towards, disc, alpha = (np.asarray(value, np.float64) for value in (towards, disc, alpha))
    radius = disc[..., 3]
    with np.errstate(all="ignore"):
        rough = np.where(radius > 0.0, np.clip(8.0 * alpha / radius - 1.0, 0.0, 1.0), 1.0)[..., None]
        middle = (1.0 - rough) * disc[..., :3] + rough * towards
        middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
        return np.concatenate([middle, (1.0 - rough) * radius[..., None]], axis=-1)
