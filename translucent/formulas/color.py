"""Colour encodings and the ways to write a colour. Bare triples are linear Rec.709; hex strings and names are sRGB.

`srgb_to_linear`, `linear_to_srgb`, `luminance` and `exposure_scale` have twins in ``shaders/lib/color.glsl``.
The transfer curve is IEC 61966-2-1; the luminance weights are ITU-R BT.709.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError

Array = npt.NDArray[np.float64]
ColorLike = str | npt.ArrayLike

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)

#: What to do about a color that a shell has dropped.
QUOTE_HINT = "a shell takes #... for a comment: quote it, '#7b1e3a', or leave the # out"

_BARE_HEX = re.compile(r"\s*[0-9a-fA-F]{6}\s*")
_FUNCTION = re.compile(r"\s*(srgb|linear)\s*\(([^()]*)\)\s*", re.IGNORECASE)
_PIXEL = re.compile(r"(.+)@\s*(\d+)\s*,\s*(\d+)\s*")


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
    """Relative luminance Y of linear Rec.709 colours, over the last axis."""
    return np.asarray(np.asarray(linear, dtype=np.float64) @ np.asarray(LUMINANCE_WEIGHTS))


def exposure_scale(stops: npt.ArrayLike) -> Array:
    """Factor of an exposure correction: 2^stops."""
    return np.exp2(np.asarray(stops, dtype=np.float64))


def parse_color(color: str | npt.ArrayLike) -> Array:
    """Linear Rec.709 triple of a colour.

    Parameters
    ----------
    color : str or array_like (3,)
        ``"#7b1e3a"``, ``"7b1e3a"`` and CSS names are sRGB-encoded; ``"srgb(r, g, b)"`` and ``"linear(r, g, b)"`` take
        numbers 0..1; ``"photo.png@120,45"`` is a pixel of an image (column, row, from the top left; sRGB-encoded); a
        bare triple is linear. Nothing is guessed.

    Returns
    -------
    (3,) float64

    Raises
    ------
    InputError
        If the text is no colour, a channel is not finite, or there is no such image or pixel.
    """
    if isinstance(color, str):
        return _parse_text(color)
    try:
        triple = np.array(color, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"color {color!r}", "not three numbers", "give a linear (r, g, b) triple or a hex string"
        ) from None
    if triple.shape != (3,):
        raise InputError(f"color {color!r}", f"shape {triple.shape}, not (3,)", "give one number each for r, g and b")
    return _finite(triple, str(color))


def _parse_text(text: str) -> Array:
    from PIL import ImageColor  # 30 ms to import, and only text needs it

    if match := _FUNCTION.fullmatch(text):
        try:
            triple = np.array([float(part) for part in match[2].split(",")])
        except ValueError:
            triple = np.zeros(0)
        if triple.shape != (3,):
            raise InputError(f"color {text!r}", "not three numbers", "write for example linear(0.18, 0.62, 0.35)")
        triple = _finite(triple, text)
        return srgb_to_linear(triple) if match[1].lower() == "srgb" else triple
    if match := _PIXEL.fullmatch(text):
        from translucent.media.pixel import pixel_color

        return pixel_color(match[1], int(match[2]), int(match[3]))
    if not text.strip():
        raise InputError(f"color {text!r}", "empty", QUOTE_HINT)
    try:
        rgb = ImageColor.getrgb(f"#{text.strip()}" if _BARE_HEX.fullmatch(text) else text.strip())
    except ValueError:
        raise InputError(
            f"color {text!r}",
            "neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
            "write for example '#7b1e3a', 'salmon' or 'linear(0.18,0.62,0.35)'",
        ) from None
    return srgb_to_linear(np.array(rgb[:3]) / 255.0)


def _finite(triple: Array, text: str) -> Array:
    if not np.isfinite(triple).all():
        raise InputError(f"color {text}", "a channel is not finite", "give numbers")
    return triple


def to_hex(linear: npt.ArrayLike) -> str:
    """Nearest sRGB hex string of a linear colour, channels clamped to 0..1."""
    encoded = np.clip(linear_to_srgb(np.clip(np.asarray(linear, dtype=np.float64), 0, 1)), 0, 1)
    return "#" + "".join(f"{round(v * 255):02x}" for v in encoded)
