"""Encodings of colors: linear Rec.709 and sRGB.

`srgb_to_linear`, `linear_to_srgb`, `luminance` and `exposure_scale` have twins in ``shaders/lib/color.glsl``.
The transfer curve is IEC 61966-2-1; the luminance weights are ITU-R BT.709.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)


def srgb_to_linear(encoded: npt.ArrayLike) -> Array:
    """Linear value of an sRGB-encoded one; the exact piecewise curve, mirrored below 0."""
    v = np.asarray(encoded, dtype=np.float64)
    a = np.abs(v)
    return np.copysign(np.where(a <= 0.04045, a / 12.92, ((a + 0.055) / 1.055) ** 2.4), v)


@np.errstate(under="ignore")  # of what is all but black
def linear_to_srgb(linear: npt.ArrayLike) -> Array:
    """sRGB-encoded value of a linear one; the exact piecewise curve, mirrored below 0."""
    v = np.asarray(linear, dtype=np.float64)
    a = np.abs(v)
    return np.copysign(np.where(a <= 0.0031308, a * 12.92, 1.055 * a ** (1 / 2.4) - 0.055), v)


def luminance(linear: npt.ArrayLike) -> Array:
    """Relative luminance Y of linear Rec.709 colors, over the last axis."""
    return np.asarray(np.asarray(linear, dtype=np.float64) @ np.asarray(LUMINANCE_WEIGHTS))


def exposure_scale(stops: npt.ArrayLike) -> Array:
    """Factor of an exposure correction: 2^stops."""
    return np.exp2(np.asarray(stops, dtype=np.float64))


def to_hex(linear: npt.ArrayLike) -> str:
    """Nearest sRGB hex string of a linear color, channels clamped to 0..1."""
    encoded = np.clip(linear_to_srgb(np.clip(np.asarray(linear, dtype=np.float64), 0, 1)), 0, 1)
    return "#" + "".join(f"{round(v * 255):02x}" for v in encoded)
