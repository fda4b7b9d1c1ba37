"""Colors: read from text and pictures, and shown as swatches in terminals and notebooks."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.images import open_picture
from translucent.files.reading import read_bytes
from translucent.formulas.color import srgb_to_linear, to_hex

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageFile import ImageFile


def terminal_strip(colors: npt.ArrayLike) -> str:
    """One line of swatches of linear colors (n, 3), for terminals with 24-bit color."""
    cells = []
    for color in np.asarray(colors, dtype=np.float64):
        text = to_hex(color)
        red, green, blue = (int(text[i : i + 2], 16) for i in (1, 3, 5))
        cells.append(f"\x1b[48;2;{red};{green};{blue}m        \x1b[0m")
    return "".join(cells)


def html_swatches(swatches: Iterable[tuple[npt.ArrayLike, str]]) -> str:
    """HTML of linear colors (3,) side by side, each with its label and its hex color below."""
    cells = []
    for color, label in swatches:
        text = to_hex(color)
        cells.append(
            f'<div style="text-align:center;font:11px monospace"><div style="width:7em;height:3em;background:{text}">'
            f"</div>{escape(label)}<br>{text}</div>"
        )
    return f'<div style="display:flex">{"".join(cells)}</div>'


def html_card(card: str, swatches: Iterable[tuple[npt.ArrayLike, str]]) -> str:
    """HTML of linear colors (3,) that lie on a white or a black card, each with its label and its hex color below."""
    text = {"white": "black", "black": "white"}[card]
    return (
        f'<div style="display:inline-block;background:{card};color:{text};border:1px solid gray;padding:4px 8px;'
        f'margin:4px 8px 4px 0;font:11px monospace">on {card}{html_swatches(swatches)}</div>'
    )


_EIGHT_BITS = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")
#: Exif's tag of how a camera was held.
_ORIENTATION = 0x0112
#: Where a PNG file states the bits of a channel: its header is its first chunk.
_PNG_DEPTH = 24


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
    image, channels = _read(what, path, "give an image file and a pixel, for example photo.png@120,45")
    if not (0 <= x < image.width and 0 <= y < image.height):
        raise InputError(
            what,
            f"the image has {image.width} x {image.height} pixels",
            "count pixels from 0, starting at the top left corner",
        )
    if image.mode.startswith("I;16"):
        return srgb_to_linear(np.full(3, _pixel(image, x, y) / 65535.0))
    *straight, alpha = _pixel(image.convert("RGBA"), x, y)
    if alpha == 0:
        raise InputError(what, "the pixel is fully transparent", "choose a pixel that has a color")
    if channels:
        return srgb_to_linear(np.array([_pixel(channel, x, y) for channel in channels]) / 65535.0)
    return srgb_to_linear(np.array(straight) / 255.0)


def read_encoded(path: str | Path, what: str) -> npt.NDArray[Any]:
    """All pixels of an image, (h, w, 3) uint8 or uint16 as the file has them; files and errors as for `pixel_color`.

    Parameters
    ----------
    path : str or Path
    what : str
        What was requested, for errors.
    """
    image, channels = _read(what, path, "give an image file", per_pixel=40)
    if image.mode.startswith("I;16"):
        return np.repeat(np.asarray(image, dtype=np.uint16)[..., None], 3, axis=-1)
    if channels:
        return np.stack([np.asarray(channel, dtype=np.uint16) for channel in channels], axis=-1)
    return np.asarray(image.convert("RGB"))


def _read(what: str, path: str | Path, do: str, per_pixel: int = 16) -> tuple[Image, list[Image]]:
    """Read an image, and each of its three channels if they have 16 bits, all turned as a camera notes."""
    from PIL import ImageOps

    data = read_bytes(path, what)
    try:
        with open_picture(data, what, per_pixel=per_pixel, do=do) as image:
            deep = _is_deep(image, data)
            if not (image.mode.startswith("I;16") or image.mode in _EIGHT_BITS) or (deep and image.format != "PNG"):
                kind = f"{image.mode} of 16 bits" if deep else image.mode
                raise InputError(
                    what, f"the pixel format {kind} is not supported", "save the picture as an 8-bit RGB image"
                )
            upright, turn = ImageOps.exif_transpose(image), image.getexif().get(_ORIENTATION, 1)
            if upright.mode == "P":  # with what Pillow warns of
                upright = upright.convert("RGBA")
        return upright, _deep_channels(what, data, turn) if deep else []
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(what, "the file is not a readable image", do) from error


def _is_deep(image: ImageFile, data: bytes) -> bool:
    """True if an image has colors of 16 bits per channel; Pillow keeps 8 of them."""
    from PIL import TiffImagePlugin

    if image.mode not in ("RGB", "RGBA"):
        return False
    if isinstance(image, TiffImagePlugin.TiffImageFile):
        return bool(max(image.tag_v2.get(TiffImagePlugin.BITSPERSAMPLE, (8,))) > 8)
    return image.format == "PNG" and data[_PNG_DEPTH] == 16


def _deep_channels(what: str, data: bytes, turn: int) -> list[Image]:
    """Red, green and blue of a PNG of 16 bits, each as a gray image, turned as Exif's orientation says."""
    import pyspng
    from PIL import ImageOps
    from PIL.Image import fromarray

    try:
        values = pyspng.load(data)
    except RuntimeError as error:
        raise InputError(
            what, f"the pixel format is not supported ({error})", "save the picture as an 8-bit RGB image"
        ) from None
    channels = [fromarray(values[..., i]) for i in range(3)]
    for channel in channels:
        channel.getexif()[_ORIENTATION] = turn
        ImageOps.exif_transpose(channel, in_place=True)
    return channels


def _pixel(image: Image, x: int, y: int) -> Array:
    return np.asarray(np.asarray(image.crop((x, y, x + 1, y + 1)), dtype=np.float64)[0, 0])


ColorLike = str | npt.ArrayLike

#: Advice about a color that a shell has dropped.
QUOTE_HINT = "in a shell, quote the color: '#7b1e3a' (# begins a comment)"

_BARE_HEX = re.compile(r"\s*[0-9a-fA-F]{6}\s*")
_FUNCTION = re.compile(r"\s*(srgb|linear)\s*\(([^()]*)\)\s*", re.IGNORECASE)
_BYTES = re.compile(r"\s*\(?\s*(\d{1,3})\s*[, ]\s*(\d{1,3})\s*[, ]\s*(\d{1,3})\s*\)?\s*")
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
            f"color {color!r}", "a color needs three numbers", "give a linear (r, g, b) triple or a hex string"
        ) from None
    if triple.shape != (3,):
        raise InputError(
            f"color {color!r}",
            f"the color has shape {triple.shape}, and not (3,)",
            "give one number for each of r, g and b",
        )
    return _finite(triple, str(color))


def _parse_text(text: str) -> Array:
    from PIL import ImageColor  # 30 ms to import, and only text needs it

    if match := _FUNCTION.fullmatch(text):
        try:
            triple = np.array([float(part) for part in match[2].split(",")])
        except ValueError:
            triple = np.zeros(0)
        if triple.shape != (3,):
            raise InputError(
                f"color {text!r}",
                "the parentheses must contain three numbers",
                "write a color such as linear(0.18, 0.62, 0.35)",
            )
        triple = _finite(triple, text)
        return srgb_to_linear(triple) if match[1].lower() == "srgb" else triple
    if match := _PIXEL.fullmatch(text):
        return pixel_color(match[1], int(match[2]), int(match[3]))
    if not text.strip():
        raise InputError(f"color {text!r}", "the text is empty", QUOTE_HINT)
    try:
        rgb = ImageColor.getrgb(f"#{text.strip()}" if _BARE_HEX.fullmatch(text) else text.strip())
    except ValueError:
        if (eight := _BYTES.fullmatch(text)) is not None:
            found = "these are three numbers from 0 to 255"
            raise InputError(f"color {text!r}", found, f"write {hex_of_bytes(map(float, eight.groups()))!r}") from None
        raise InputError(
            f"color {text!r}",
            "the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
            "write a color such as '#7b1e3a', 'salmon' or 'linear(0.18,0.62,0.35)'",
        ) from None
    return srgb_to_linear(np.array(rgb[:3]) / 255.0)


def _finite(triple: Array, text: str) -> Array:
    if not np.isfinite(triple).all():
        raise InputError(f"color {text}", "a channel of the color is not a finite number", "give three finite numbers")
    return triple


def hex_of_bytes(values: Iterable[float]) -> str:
    """Hex color of three numbers of 0 to 255; empty if they are none, or all within 0 to 1."""
    channels = list(values)
    if len(channels) != 3 or not all(0 <= one <= 255 and one == int(one) for one in channels) or max(channels) <= 1:
        return ""
    return "#" + "".join(f"{int(one):02x}" for one in channels)


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
        raise InputError(
            f"{where} {color!r}", "the value must be three numbers in 0 to 1", "use a value such as (0.6, 0.6, 0.6)"
        )
    values.setflags(write=False)
    return values
