"""Whole pictures from files as linear values, for measuring in them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from translucent.arrays import Array
from translucent.formulas.color import srgb_to_linear
from translucent.media.pixel import read_encoded
from translucent.scene.environment_files import read_linear

#: Suffixes of linear pictures.
LINEAR = (".exr", ".hdr", ".pic")

#: Suffixes of pictures that are rounded by blocks.
LOSSY = (".jpg", ".jpeg", ".webp")


class Picture(NamedTuple):
    """Linear values (h, w, 3), the largest level of the file, such as 255, 0 of a linear one, which has none; and
    whether the file rounds whole blocks of pixels, as JPEG does, so that noise does not spread the error of that.
    """

    linear: Array
    levels: int
    blocks: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """Linear values at which a pixel may be black, and saturated: the last level but one, as JPEG rounds twice."""
        if not self.levels:
            return 0.0, math.inf
        low, high = srgb_to_linear(np.array([1.0, self.levels - 1.0]) / self.levels)
        return float(low), float(high)


def read_picture(path: str | Path) -> Picture:
    """Read a picture, turned as its camera notes: .exr and .hdr are linear, all others sRGB-encoded.

    Raises
    ------
    InputError
        If there is no such file, or it is no picture.
    """
    if Path(path).suffix.lower() in LINEAR:
        return Picture(read_linear(Path(path)), 0)
    encoded = read_encoded(path, f"picture {str(path)!r}")
    levels = int(np.iinfo(encoded.dtype).max)
    table = srgb_to_linear(np.arange(levels + 1) / levels).astype(np.float32)
    return Picture(table[encoded], levels, Path(path).suffix.lower() in LOSSY)
