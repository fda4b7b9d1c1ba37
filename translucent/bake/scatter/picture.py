"""The picture of checks of scattered light: with the bake, with the light that diffuses, and their difference."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from translucent.bake.check_picture import MOST_ROWS, NO_BODY, labeled, look, stacked
from translucent.bake.scatter.check import ScatterCheck, ScatterLook
from translucent.files.paths import write_atomically

if TYPE_CHECKING:
    from PIL import Image

#: Factor of the difference.
MAGNIFIED = 10.0


def write_scatter_picture(checks: dict[str, ScatterCheck], path: Path) -> None:
    """Write the checks below each other as a PNG, a row for each environment.

    Raises
    ------
    RenderError
        If it cannot be written.
    """
    rows = [_row(name, look) for check in checks.values() for name, look in check.items()]
    write_atomically(path, partial(stacked(rows[:MOST_ROWS]).save, format="PNG"))


def _row(name: str, found: ScatterLook) -> Image.Image:
    # Bright bodies are shown darker, both alike.
    scale = max(float(np.quantile(found.true[found.seen], 0.99)), 1.0)
    shown = [np.where(found.seen[..., None], look(part / scale), NO_BODY) for part in (found.baked, found.true)]
    difference = MAGNIFIED * np.abs(found.baked - found.true) / scale
    return labeled(
        (f"{name}: baked", shown[0].astype(np.uint8)),
        ("light that diffuses, as in pictures", shown[1].astype(np.uint8)),
        (f"difference, {MAGNIFIED:g} times", look(difference)),
    )
