"""Light that a ball of glass throws on the ground beneath it: an integral over where rays meet the ball."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

#: Reflections inside the ball after which what is left is less than float32 resolves.
_ORDERS = 12


def fresnel(cosine: Array, ior: float) -> Array:
    """Reflectance of unpolarized light that comes from outside."""
    beyond = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    across = (cosine - ior * beyond) / (cosine + ior * beyond)
    along = (ior * cosine - beyond) / (ior * cosine + beyond)
    return np.asarray(0.5 * (across**2 + along**2))


def ball_light(
    below: float, ior: float, *, lamp: float | None = None, absorption: float = 0.0, rays: int = 200_000
) -> tuple[Array, Array]:
    """Flux, and how far from the axis it lands, of light that meets a ball of radius 1 from straight above.

    Parameters
    ----------
    below : float
        Distance of the ground from the center of the ball.
    ior : float
    lamp : float, optional
        Height above the center of a lamp of 1 W/sr; default: a sun of 1 W/m^2.
    absorption : float
        In 1/m.
    rays : int

    Returns
    -------
    flux, distance : (n,) float64
        Of all parts of all rays: mirrored, passing at once, mirrored inside once,
        and so on. A distance is inf where one does not land.
    """
    return ball_parts(below, ior, lamp=lamp, absorption=absorption, rays=rays)[:2]


def ball_parts(
    below: float, ior: float, *, lamp: float | None = None, absorption: float = 0.0, rays: int = 200_000
) -> tuple[Array, Array, Array]:
    """As `ball_light`; and the cosine of each part's angle to the axis, downwards."""
    share = (np.arange(rays) + 0.5) / rays
    if lamp is None:
        off, width = np.sqrt(share), np.full(rays, np.pi / rays)
        start, way = np.stack([off, np.sqrt(1.0 - off**2)]), np.stack([np.zeros(rays), -np.ones(rays)])
    else:
        fall = share * (1.0 - np.sqrt(1.0 - lamp**-2))  # 1 - cosine of the angle to the axis
        width = np.full(rays, 2.0 * np.pi * (1.0 - np.sqrt(1.0 - lamp**-2)) / rays)
        way = np.stack([np.sqrt(fall * (2.0 - fall)), fall - 1.0])
        along = -lamp * way[1]
        start = np.stack([np.zeros(rays), np.full(rays, lamp)])
        start = start + (along - np.sqrt(np.maximum(along**2 - lamp**2 + 1.0, 0.0))) * way
    cosine = np.clip(-(start * way).sum(axis=0), 1e-12, 1.0)
    mirrored = fresnel(cosine, ior)
    beyond = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    back = way + 2.0 * cosine * start
    parts = [(width * mirrored, _landing(start, back, below), -back[1])]
    inside = (way + (cosine - ior * beyond) * start) / ior
    flux, chord = width * (1.0 - mirrored), 2.0 * beyond
    for _ in range(_ORDERS):
        start = start + chord * inside
        with np.errstate(under="ignore"):
            flux = flux * np.exp(-absorption * chord)
        out = ior * inside + (cosine - ior * beyond) * start
        with np.errstate(under="ignore"):
            parts.append((flux * (1.0 - mirrored), _landing(start, out, below), -out[1]))
            flux = flux * mirrored
        inside = inside - 2.0 * beyond * start
    flux, distance, cosine = (np.concatenate(column) for column in zip(*parts, strict=True))
    return flux, distance, cosine


def _landing(start: Array, way: Array, below: float) -> Array:
    falls = way[1] < -1e-9
    path = (-below - start[1]) / np.where(falls, way[1], -1.0)
    return np.where(falls, np.abs(start[0] + path * way[0]), np.inf)


def flux_within(flux: Array, distance: Array, radii: npt.ArrayLike) -> Array:
    """Flux that lands no farther from the axis than each of the radii."""
    return np.array([flux[distance <= radius].sum(axis=0) for radius in np.atleast_1d(radii)])
