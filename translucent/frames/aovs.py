"""Pictures of a frame's AOVs (arrays besides its radiance): thickness in false colors, transmittance, validity."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from translucent.arrays import Mask, Pixels
from translucent.errors import InputError
from translucent.formulas.color import linear_to_srgb

Arrays = Mapping[str, npt.NDArray[Any]]

#: sRGB colors of text and of its background, of pixels without a medium, and of invalid pixels.
INK, PAPER, EMPTY, WRONG = (225, 225, 225), (24, 24, 24), (52, 52, 52), (255, 110, 60)
SEEN = (90, 165, 225)

#: Units of thickness: the largest one that the thickness exceeds is used.
UNITS = ((1e3, "km"), (1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))

#: Steps between marks of a scale, times a power of ten, and how many marks to aim at.
STEPS = (1.0, 2.0, 5.0, 10.0)
MARKS = 6


def aov_pictures(arrays: Arrays, truth: Arrays | None = None) -> dict[str, Pixels]:
    """Pictures (h, w, 3) by name of the arrays of a frame; those with a legend are somewhat higher than it.

    Raises
    ------
    InputError
        If the truth has another size.
    """
    transmittance = np.clip(np.asarray(arrays["transmittance"], dtype=np.float64), 0.0, 1.0)
    thickness, coverage, valid = arrays["thickness"], arrays["coverage"], arrays["valid"]
    pictures = {
        "thickness": lengths_picture(thickness, coverage, valid),
        "transmittance": np.rint(linear_to_srgb(transmittance) * 255.0).astype(np.uint8),
        "validity": validity_picture(coverage, valid),
    }
    if "normals" in arrays:
        pictures["normals"] = normals_picture(arrays["normals"])
    if truth is not None:
        (height, width), (rows, columns) = thickness.shape, truth["thickness"].shape
        if (height, width) != (rows, columns):
            found = f"the truth has {columns}x{rows} pixels, and the frame has {width}x{height}"
            raise InputError("truth of a frame", found, "render the frame and the truth at the same size")
        off = np.abs(thickness.astype(np.float64) - truth["thickness"])
        pictures["error"] = lengths_picture(off, coverage | truth["coverage"], valid)
    return pictures


def normals_picture(normals: npt.NDArray[Any]) -> Pixels:
    """Picture of normals in the customary colors: red, green and blue for x, y and z, from -1 to 1."""
    pixels = np.rint((0.5 + 0.5 * np.asarray(normals, dtype=np.float64)) * 255.0).astype(np.uint8)
    pixels[~normals.any(axis=-1)] = EMPTY
    return pixels


def lengths_picture(lengths: npt.NDArray[Any], coverage: Mask, valid: Mask) -> Pixels:
    """Picture of lengths in false colors from 0 to the largest, with a scale in a metric unit below."""
    visible = coverage & valid & np.isfinite(lengths)
    most = float(lengths[visible].max(initial=0.0))
    with np.errstate(under="ignore"):
        fraction = np.where(visible, lengths, 0.0).astype(np.float64) / (most or 1.0)
    pixels = false_colors()[np.rint(fraction * 255).astype(np.intp)]
    pixels[~visible] = EMPTY
    pixels[~valid] = WRONG
    if not visible.any():
        return _with_legend(pixels, [(EMPTY, "no medium")])
    factor, unit = next((entry for entry in UNITS if most >= entry[0]), UNITS[-1])
    return np.concatenate([pixels, _scale(pixels.shape[1], most / factor, unit)], axis=0)


def validity_picture(coverage: Mask, valid: Mask) -> Pixels:
    """Picture of covered and of invalid pixels, with their counts below."""
    classes = (
        (EMPTY, "no medium", ~coverage & valid),
        (SEEN, "valid", coverage & valid),
        (WRONG, "not valid", ~valid),
    )
    pixels = np.zeros((*valid.shape, 3), dtype=np.uint8)
    for color, _, where in classes:
        pixels[where] = color
    return _with_legend(
        pixels, [(color, f"{name}: {np.count_nonzero(where)} pixels") for color, name, where in classes]
    )


@lru_cache(maxsize=1)
def false_colors() -> Pixels:
    """(256, 3) sRGB: from dark violet over blue and green to pale yellow.

    Lightness of Oklab (Ottosson 2020, "A perceptual color space for image processing") grows linearly, so that larger
    is brighter, in gray and to the color-blind, too.
    """
    t = np.linspace(0.0, 1.0, 256)
    hue, chroma = np.radians(310.0 - 200.0 * t), 0.10 - 0.06 * t + 0.10 * t * t  # all of them within sRGB
    lab = np.stack([0.22 + 0.71 * t, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)
    cones = (lab @ _CONES_OF_OKLAB.T) ** 3
    colors = np.asarray(np.rint(linear_to_srgb(np.clip(cones @ _RGB_OF_CONES.T, 0.0, 1.0)) * 255.0), dtype=np.uint8)
    colors.setflags(write=False)
    return colors


_CONES_OF_OKLAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_RGB_OF_CONES = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def marks(most: float) -> list[float]:
    """Round numbers from 0 to `most`, about six of them."""
    power = 10.0 ** np.floor(np.log10(most / MARKS))
    step = next(step for step in STEPS if MARKS * step * power >= most * (1.0 - 1e-9)) * power
    return [float(i * step) for i in range(int(most / step * (1.0 + 1e-9)) + 1)]


def _scale(width: int, most: float, unit: str) -> Pixels:
    """Color scale from 0 to `most` of a unit, with marks."""
    font = _font(width)
    margin, line = int(font.size), int(1.4 * font.size)
    strip = Image.new("RGB", (width, margin // 2 + line + 2 * line), PAPER)
    draw = ImageDraw.Draw(strip)
    title = f"thickness in {unit}"
    left, right = margin, max(width - margin - 1, margin + 1)
    ramp = false_colors()[np.linspace(0, 255, right - left + 1).astype(np.intp)]
    strip.paste(Image.fromarray(np.tile(ramp[None], (line, 1, 1))), (left, margin // 2))
    end = -1.0
    for value in marks(most):
        x, text = left + value / most * (right - left), f"{value:.4g}"
        half = draw.textlength(text, font=font) / 2
        draw.line([(x, margin // 2 + line), (x, margin // 2 + line + line // 4)], fill=INK)
        if (start := min(max(x - half, 0.0), width - 2 * half)) > end:
            draw.text((start, margin // 2 + line + line // 4), text, fill=INK, font=font)
            end = start + 2 * half + margin / 2
    draw.text(((width - draw.textlength(title, font=font)) / 2, margin // 2 + 2 * line), title, fill=INK, font=font)
    return np.asarray(strip)


def _with_legend(pixels: Pixels, entries: list[tuple[tuple[int, int, int], str]]) -> Pixels:
    """Picture with a legend below, a row for each color."""
    width = pixels.shape[1]
    font = _font(width)
    line = int(1.5 * font.size)
    strip = Image.new("RGB", (width, line * len(entries) + line // 2), PAPER)
    draw = ImageDraw.Draw(strip)
    for i, (color, text) in enumerate(entries):
        top = line // 4 + i * line
        draw.rectangle([line // 4, top + line // 6, line, top + line - line // 6], fill=color)
        draw.text((int(1.3 * line), top), text, fill=INK, font=font)
    return np.concatenate([pixels, np.asarray(strip)], axis=0)


def _font(width: int) -> Any:
    return ImageFont.load_default(size=float(np.clip(width // 40, 8, 28)))
