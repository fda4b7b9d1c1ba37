"""Visibility of errors: color differences in CIELAB, and their meaning in words."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bench.row import ColorDifference, Row

#: A difference of color in CIELAB 1976 that is just noticed, side by side (Mahy, Van Eycken & Oosterlinck 1994,
#: "Evaluation of uniform color spaces developed after the adoption of CIELAB and CIELUV").
JUST_NOTICEABLE = 2.3

#: Linear Rec.709 with the white point D65 to CIE XYZ (IEC 61966-2-1).
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])

#: Below the cube of this CIELAB is linear (CIE 15).
_KNEE = 6.0 / 29.0


@np.errstate(under="ignore")  # what is left behind a dense medium
def lab(linear: npt.ArrayLike) -> Array:
    """(..., 3): CIELAB 1976 of linear Rec.709 colors (..., 3) in 0..1, with white as L* = 100."""
    share = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0) @ (_XYZ / _XYZ.sum(axis=1, keepdims=True)).T
    f = np.where(share > _KNEE**3, np.cbrt(share), share / (3.0 * _KNEE**2) + 4.0 / 29.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


@np.errstate(under="ignore")
def color_difference(shown: npt.ArrayLike, right: npt.ArrayLike) -> ColorDifference:
    """Color difference of linear colors (n, 3), one or more: Euclidean distances in CIELAB 1976."""
    distance = np.linalg.norm(lab(shown) - lab(right), axis=-1)
    median, p999 = np.quantile(distance, (0.5, 0.999))
    return ColorDifference(float(median), float(p999), float(distance.max()))


def seen_words(row: Row) -> str:
    """Words on whether the difference from the truth is visible; empty where it was not measured."""
    found = row.color_difference
    if found is None:
        return ""
    bar = f"{JUST_NOTICEABLE} is just noticed"
    if found.max <= JUST_NOTICEABLE:
        return f"nobody would see the difference: no pixel is off by more than {_delta(found.max)} in CIELAB, and {bar}"
    if found.p999 <= JUST_NOTICEABLE:
        return (
            f"hardly anybody would see the difference: one pixel in a thousand is off by more than "
            f"{_delta(found.p999)} in CIELAB, up to {_delta(found.max)}, and {bar}"
        )
    if found.median <= JUST_NOTICEABLE:
        return f"the difference would be seen in places: up to {_delta(found.p999)} in CIELAB, and {bar}"
    off = f"half of the pixels are off by {_delta(found.median)} in CIELAB"
    return f"the difference would be seen at a glance: {off}, and {bar}"


def _delta(value: float) -> str:
    return f"{value:.2g}" if value < 9.95 else f"{value:.0f}"
