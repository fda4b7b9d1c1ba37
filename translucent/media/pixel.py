"""The color of one pixel of an image file, as a color picker shows it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import read_bytes
from translucent.files.unpacking import open_picture
from translucent.formulas.color import srgb_to_linear

if TYPE_CHECKING:
    from PIL.Image import Image


_EIGHT_BITS = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")
_SIXTEEN_BITS = ("RGB;16B", "RGBA;16B")


def pixel_color(path: str | Path, x: int, y: int) -> Array:
    """Linear Rec.709 color of a pixel, whose file is taken as sRGB-encoded, whatever its profile says.

    Parameters
    ----------
    path : str or Path
        An image of 8 bits per channel that Pillow reads, or a PNG of 16 bits.
    x, y : int
        Column and row from 0; the top left pixel of the image as viewers show it (turned as a camera notes) is 0, 0.

    Returns
    -------
    (3,) float64
        Alpha is left out: it is no part of a straight color.

    Raises
    ------
    InputError
        If there is no such file or pixel, it is no such image, or the pixel is wholly transparent.
    """
    what = f"pixel {x},{y} of {str(path)!r}"
    image, low = _read(what, path)
    if not (0 <= x < image.width and 0 <= y < image.height):
        raise InputError(what, f"the image has {image.width} x {image.height} pixels", "count from 0 at the top left")
    if image.mode.startswith("I;16"):
        return srgb_to_linear(np.full(3, _pixel(image, x, y) / 65535.0))
    *straight, alpha = _pixel(image.convert("RGBA"), x, y)
    if alpha == 0:
        raise InputError(what, "the pixel is wholly transparent", "pick one that has a color")
    if low is None:
        return srgb_to_linear(np.array(straight) / 255.0)
    return srgb_to_linear((256.0 * np.array(straight) + _pixel(low.convert("RGBA"), x, y)[:3]) / 65535.0)


def _read(what: str, path: str | Path) -> tuple[Image, Image | None]:
    """Read an image, and a second one with the low bytes of its channels if they have 16 bits."""
    from PIL import ImageOps

    do = "give an image file and a pixel, for example photo.png@120,45"
    try:
        with open_picture(read_bytes(path, what), what, per_pixel=16, do=do) as image:
            kind = str(image.tile[0][3]) if image.tile else ""
            if not (image.mode.startswith("I;16") or image.mode in _EIGHT_BITS) or (
                "16" in kind and image.mode[0] != "I" and kind not in _SIXTEEN_BITS
            ):
                raise InputError(what, f"pixels of the kind {kind or image.mode}", "save it as an 8-bit RGB image")
            high = ImageOps.exif_transpose(image)
        if kind not in _SIXTEEN_BITS:
            return high, None
        # Pillow keeps the first byte of each number. Told that the other one comes first, it keeps the other.
        with open_picture(read_bytes(path, what), what, per_pixel=16, do=do) as image:
            image.tile = [tile._replace(args=kind.replace("16B", "16L")) for tile in image.tile]
            return high, ImageOps.exif_transpose(image)
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(what, "not an image that can be read", do) from error


def _pixel(image: Image, x: int, y: int) -> Array:
    return np.asarray(np.asarray(image.crop((x, y, x + 1, y + 1)), dtype=np.float64)[0, 0])
