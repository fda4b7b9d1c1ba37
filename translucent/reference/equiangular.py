"""The equiangular variable: equal steps of the angle as seen from a point light (Kulla & Fajardo 2012)."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array

#: Smallest distance of a light from the line, as a share of its distance from the ends. Any distance makes a valid
#: variable; with this one it keeps its digits where the light is on the line, beyond the ends.
CLOSEST = 1e-6


def equiangular(start: Array, end: Array, middle: Array, distance: Array, u: Array) -> tuple[Array, Array]:
    """Equiangular map t(u) = middle + D tan(theta), from `start` at u = 0 to `end` at u = 1, and dt/du.

    Rearranged, so that no digits are lost where the light is far away and the angles are nearly equal.

    Parameters
    ----------
    start, end : (k,) float64
        Distances along the lines in metres.
    middle, distance : (k,) float64
        Where the line is closest to the light, and how close D.
    u : (k, p) float64
        0 to 1.
    """
    p, q = start - middle, end - middle
    with np.errstate(under="ignore"):
        d = np.maximum(distance, CLOSEST * np.maximum(np.abs(p), np.abs(q)))
        angle = np.arctan2((end - start) * d, d * d + p * q)
        sine, cosine = np.sin(u * angle[:, None]), np.cos(u * angle[:, None])
        d, p = d[:, None], p[:, None]
        t = (d * d + p * p) * sine / (d * cosine - p * sine)
        away = p + t
        return start[:, None] + t, angle[:, None] * (d + away * away / d)
