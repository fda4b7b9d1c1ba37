"""Pictures of light on grounds, and of its errors, for the record."""

from __future__ import annotations

import base64
import io

import numpy as np
import numpy.typing as npt
from PIL import Image

from translucent.arrays import Array, Mask
from translucent.bench.truth import INVISIBLE


def png_of(picture: npt.NDArray[np.uint8]) -> str:
    """PNG file in base64 of a picture (h, w, 3)."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="PNG", optimize=True)
    return base64.b64encode(stream.getvalue()).decode("ascii")


def signed(differences: Array, seen: Mask) -> Array:
    """(h, w): differences (h, w, 3) of the channel that is farthest off; NaN where nothing is seen."""
    worst = np.abs(differences).argmax(axis=-1)[..., None]
    found = np.take_along_axis(differences, worst, axis=-1)[..., 0]
    return np.where(seen, np.where(np.abs(found) < INVISIBLE, 0.0, found), np.nan)
