"""Tone curves: from linear radiance to linear colors that a display can show, 0 to 1.

Each curve has a twin of the same name in ``shaders/lib/tone.glsl``. What comes out is still linear, and is
sRGB-encoded afterwards.

References
----------
Khronos PBR Neutral Tone Mapper, specification 2024 (KhronosGroup/ToneMapping).
AgX: Sobotka 2022 (sobotka/AgX), base look: a log2 encoding around middle gray and a sigmoid, in a narrowed gamut.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief
from translucent.arrays import Array
from translucent.errors import InputError

#: PBR Neutral: where highlights begin to be compressed, reflectance at normal incidence, and speed of desaturation.
NEUTRAL_F90 = 0.04
NEUTRAL_START = 0.8 - NEUTRAL_F90
NEUTRAL_DESATURATION = 0.15

#: AgX: stops below and above middle gray that the curve resolves, and middle gray itself.
AGX_STOPS = (-10.0, 6.5)
AGX_MIDDLE_GRAY = 0.18

#: AgX: fraction of each channel mixed into every other, which narrows the gamut towards gray.
AGX_MIX = (0.04240107095046854, 0.07843650156180276, 0.0791624274877287)

#: AgX: powers of the toe and of the shoulder, slope of the sigmoid between, and the power of the display.
AGX_TOE, AGX_SHOULDER = 3.0, 3.25
AGX_SLOPE = 2.0
AGX_DISPLAY = 2.2


def tone_none(linear: npt.ArrayLike) -> Array:
    """Tone curve "none": colors clamped to 0..1."""
    return np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)


def tone_neutral(linear: npt.ArrayLike) -> Array:
    """Khronos PBR Neutral tone curve: keeps base colors up to 0.8, and compresses highlights to white.

    Parameters
    ----------
    linear : array_like (..., 3)
        What is below 0 is taken as 0.
    """
    color = np.maximum(np.asarray(linear, dtype=np.float64), 0.0)
    x = _of_channels(np.minimum, color)
    with np.errstate(under="ignore"):
        reflected = np.where(x < 2.0 * NEUTRAL_F90, x - x * x / (4.0 * NEUTRAL_F90), NEUTRAL_F90)
        color = color - reflected
        peak = _of_channels(np.maximum, color)
        above = np.maximum(peak, NEUTRAL_START)
        compressed = 1.0 - (1.0 - NEUTRAL_START) ** 2 / (above + 1.0 - 2.0 * NEUTRAL_START)
        kept = 1.0 / (NEUTRAL_DESATURATION * (above - compressed) + 1.0)
        bright = color * (compressed / above) * kept + compressed * (1.0 - kept)
    return np.asarray(np.where(peak > NEUTRAL_START, bright, color))


def _of_channels(least: np.ufunc, color: Array) -> Array:
    """(..., 1): least, or largest, of three channels; NumPy's loops over so short an axis take four times as long."""
    return np.asarray(least(least(color[..., :1], color[..., 1:2]), color[..., 2:]))


def tone_agx(linear: npt.ArrayLike) -> Array:
    """AgX, base look: 16.5 stops, bright colors fade to white without a change of hue.

    Parameters
    ----------
    linear : array_like (..., 3)
        What is below 0 is taken as 0.
    """
    color = np.maximum(np.asarray(linear, dtype=np.float64), 0.0)
    mix = np.asarray(AGX_MIX)
    with np.errstate(under="ignore"):
        narrowed = (1.0 - mix.sum()) * color + (color @ mix)[..., None]
        low, high = AGX_STOPS
        stops = np.log2(np.clip(narrowed / AGX_MIDDLE_GRAY, 2.0**low, 2.0**high))
        encoded = agx_sigmoid((stops - low) / (high - low))
        # The inverse of the mix above: the identity and a matrix of equal rows.
        widened = (encoded - (encoded @ mix)[..., None]) / (1.0 - mix.sum())
        return np.asarray(np.clip(widened, 0.0, 1.0) ** AGX_DISPLAY)


def agx_sigmoid(share: npt.ArrayLike) -> Array:
    """AgX's curve from 0 at 0 to 1 at 1: middle gray becomes 1/2, and the slope there is 2.

    x / (1 + a |x|^p)^(1/p) on either side of middle gray, with the a that makes it end at 0 and at 1.
    """
    pivot = -AGX_STOPS[0] / (AGX_STOPS[1] - AGX_STOPS[0])
    x = np.asarray(share, dtype=np.float64) - pivot
    power, reach = np.where(x < 0, AGX_TOE, AGX_SHOULDER), np.where(x < 0, pivot, 1.0 - pivot)
    with np.errstate(under="ignore"):
        bend = ((2.0 * AGX_SLOPE * reach) ** power - 1.0) * (np.abs(x) / reach) ** power
        return np.asarray(0.5 + AGX_SLOPE * x * (1.0 + bend) ** (-1.0 / power))


_CURVES: dict[str, Callable[[npt.ArrayLike], Array]] = {
    "none": tone_none,
    "neutral": tone_neutral,
    "agx": tone_agx,
}

#: Names of the curves.
TONES = tuple(_CURVES)


def tone_curve(name: str) -> Callable[[npt.ArrayLike], Array]:
    """Tone curve of this name.

    Raises
    ------
    InputError
        If there is none.
    """
    if not isinstance(name, str) or name not in TONES:
        raise InputError(f"tone {brief(name)}", "no tone curve has this name", f"use one of {', '.join(TONES)}")
    return _CURVES[name]
