"""The picture of a `MapCheck`: with the map, with the true thickness, and the difference of the two."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from translucent.arrays import Pixels
from translucent.files.paths import write_atomically
from translucent.formulas.color import linear_to_srgb

if TYPE_CHECKING:
    from PIL import Image

    from translucent.bake.check import MapCheck


#: Colors of the error: too thin, right, too thick (sRGB 0..255).
THIN, RIGHT, THICK = (30, 90, 200), (245, 245, 245), (200, 50, 30)

#: Largest number of rows of a picture.
MOST_ROWS = 12

#: Color of pixels without the body.
NO_BODY = (70, 70, 74)
_CAPTION = 26  # pixels


def write_picture(checks: list[MapCheck], path: Path) -> None:
    """Write the checks below each other as a PNG, which appears complete or not at all.

    Raises
    ------
    RenderError
        If it cannot be written.
    """
    write_atomically(path, partial(picture(checks).save, format="PNG"))


def picture(checks: list[MapCheck]) -> Image.Image:
    """Rows of the first checks: the look with the map, the true look, and the error of thickness with its scale."""
    return stacked([_row(check) for check in checks[:MOST_ROWS]])


def stacked(rows: list[Image.Image]) -> Image.Image:
    """Rows below each other."""
    from PIL import Image

    whole = Image.new("RGB", (max(row.width for row in rows), sum(row.height for row in rows)))
    top = 0
    for row in rows:
        whole.paste(row, (0, top))
        top += row.height
    return whole


def _row(check: MapCheck) -> Image.Image:
    scale = check.thickness.p99 or 1.0
    return labeled(
        ("with the map", look(check.baked.radiance)),
        ("true thickness along the view", look(check.true.radiance)),
        (f"map - true: blue -{scale:.2g} m .. red +{scale:.2g} m", _difference(check, scale)),
    )


def labeled(*panels: tuple[str, Pixels]) -> Image.Image:
    """Pictures of one size beside each other, each below its caption."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = panels[0][1].shape[:2]
    row = Image.new("RGB", (width * len(panels), height + _CAPTION), (20, 20, 22))
    draw, font = ImageDraw.Draw(row), ImageFont.load_default(14)
    for number, (caption, pixels) in enumerate(panels):
        row.paste(Image.fromarray(pixels), (number * width, _CAPTION))
        draw.text((number * width + 6, 5), caption, fill=(230, 230, 230), font=font)
    return row


def look(radiance: npt.NDArray[np.floating]) -> Pixels:
    """(h, w, 3): linear radiance as sRGB."""
    linear = np.clip(np.asarray(radiance, dtype=np.float64), 0.0, 1.0)
    return np.rint(linear_to_srgb(linear) * 255.0).astype(np.uint8)


def _difference(check: MapCheck, scale: float) -> Pixels:
    error = (np.asarray(check.baked.thickness, np.float64) - check.true.thickness) / scale
    share = np.clip(np.abs(error), 0.0, 1.0)[..., None]
    ends = np.where(error[..., None] < 0, THIN, THICK)
    colors = np.asarray(RIGHT) * (1 - share) + ends * share
    shown = check.baked.coverage & check.true.coverage & check.true.valid
    return np.rint(np.where(shown[..., None], colors, NO_BODY)).astype(np.uint8)
