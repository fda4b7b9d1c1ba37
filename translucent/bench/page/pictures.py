"""Signed error in color: one scale for all pictures of the page, so that they can be held against each other."""

from __future__ import annotations

import base64
import io
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.bench.page.numbers import power_text
from translucent.bench.picture import Picture

#: Magnitudes at which the color changes: anything below the first has none.
STEPS = tuple(10.0**exponent for exponent in range(-7, 0))

_HATCH = 6  # pixels from one stripe to the next, where a method marks a pixel as invalid


def heat_map(picture: Picture) -> str | None:
    """The error of a picture as a ``data:`` address; None where it has none.

    Too small is blue, too large red, pale to dark in steps of ten; what is not covered is transparent, what the method
    marks as invalid is striped.
    """
    if picture.error is None:
        return None
    error = picture.error.array()
    indices = np.where(np.isfinite(error), _color_index(error), _TRANSPARENT)
    if picture.invalid is not None:
        rows, columns = np.indices(error.shape)
        stripes = np.where((rows + columns) % _HATCH < _HATCH // 2, _STRIPE, _STRIPE + 1)
        indices = np.where(picture.invalid.array(), stripes, indices)
    return data_address(_png(indices.astype(np.uint8)))


def data_address(png: str) -> str:
    """A PNG in base64 as an address."""
    return f"data:image/png;base64,{png}"


def scale_colors() -> list[tuple[str, str]]:
    """(color, least magnitude) of every step, from the most negative over none to the most positive."""
    labels = [f"−{power_text(step)}" for step in reversed(STEPS)] + ["0"] + [f"+{power_text(step)}" for step in STEPS]
    colors = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in _palette()[: 2 * len(STEPS) + 1]]
    return list(zip(colors, labels, strict=True))


_TRANSPARENT = 2 * len(STEPS) + 1
_STRIPE = _TRANSPARENT + 1


def _color_index(error: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    size = np.abs(np.where(np.isfinite(error), error, 0.0))
    return len(STEPS) + np.sign(np.nan_to_num(error)).astype(int) * np.searchsorted(STEPS, size, side="right")


@cache
def _palette() -> tuple[tuple[int, int, int], ...]:
    """Blue over white to red (a scale that color-blind readers can tell the ends of), transparent, and two stripes."""
    import matplotlib

    ends = 0.5 + 0.5 * np.linspace(0.14, 1.0, len(STEPS))
    positions = np.concatenate([1.0 - ends[::-1], [0.5], ends])
    colors = np.rint(matplotlib.colormaps["RdBu_r"](positions)[:, :3] * 255).astype(int)
    return (*(tuple(color) for color in colors.tolist()), (0, 0, 0), (90, 90, 90), (190, 190, 190))


def _png(indices: npt.NDArray[np.uint8]) -> str:
    from PIL import Image

    image = Image.fromarray(indices)  # gray, until it has a palette
    image.putpalette([channel for color in _palette() for channel in color])
    stream = io.BytesIO()
    image.save(stream, format="PNG", transparency=_TRANSPARENT, optimize=True)
    return base64.b64encode(stream.getvalue()).decode("ascii")
