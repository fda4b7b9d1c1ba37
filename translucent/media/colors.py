"""Colors as users write them: hex strings, CSS names, functions, pixels of images, and bare triples.

Bare triples are linear Rec.709; hex strings and names are sRGB-encoded.
"""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.color import srgb_to_linear
from translucent.media.pixel import pixel_color

ColorLike = str | npt.ArrayLike

#: Advice about a color that a shell has dropped.
QUOTE_HINT = "a shell takes #... for a comment: quote it, '#7b1e3a', or leave the # out"

_BARE_HEX = re.compile(r"\s*[0-9a-fA-F]{6}\s*")
_FUNCTION = re.compile(r"\s*(srgb|linear)\s*\(([^()]*)\)\s*", re.IGNORECASE)
_PIXEL = re.compile(r"(.+)@\s*(\d+)\s*,\s*(\d+)\s*")


def parse_color(color: str | npt.ArrayLike) -> Array:
    """Parse a color into a linear Rec.709 triple.

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
        If the text is no color, a channel is not finite, or there is no such image or pixel.
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


def reflectance(color: ColorLike, name: str) -> Array:
    """Read-only color (3,) of an opaque object of this name; raises `InputError` unless it is one."""
    where = f"color of {name!r}"
    try:
        values = np.array(parse_color(color) if isinstance(color, str) else color, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        values = np.zeros(0)
    if values.shape != (3,) or not ((values >= 0) & (values <= 1)).all():
        raise InputError(f"{where} {color!r}", "not three numbers in 0 to 1", "give for example (0.6, 0.6, 0.6)")
    values.setflags(write=False)
    return values
