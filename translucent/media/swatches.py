"""Colors to look at: strips for terminals and notebooks."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np
import numpy.typing as npt

from translucent.formulas.color import to_hex
from translucent.media.conversion import FACTORS, color_at_distance

Array = npt.NDArray[np.float64]


def terminal_strip(colors: npt.ArrayLike) -> str:
    """One line of swatches of linear colors (n, 3), for terminals with 24-bit color."""
    cells = []
    for color in np.asarray(colors, dtype=np.float64):
        text = to_hex(color)
        red, green, blue = (int(text[i : i + 2], 16) for i in (1, 3, 5))
        cells.append(f"\x1b[48;2;{red};{green};{blue}m        \x1b[0m")
    return "".join(cells)


def html_strip(extinction: npt.ArrayLike, distance: float | None = None) -> str:
    """Swatches of white light after 0.1 to 10 times a distance in a medium, each with its distance and hex color.

    Parameters
    ----------
    extinction : array_like (3,)
        1/m.
    distance : float, optional
        Metres. Default: where 1/e is left of the channels' mean exponent; 1 m for a medium without extinction.
    """
    sigma = np.asarray(extinction, dtype=np.float64)
    if distance is None:
        mean = float(sigma.mean())
        distance = min(1.0 / mean, 1e300) if mean > 1e-300 else 1.0
    return html_swatches(
        (color_at_distance(sigma, factor * distance), f"{factor * distance:.4g} m") for factor in FACTORS
    )


def html_swatches(swatches: Iterable[tuple[npt.ArrayLike, str]]) -> str:
    """Linear colors (3,) side by side, each with its label and its hex color below."""
    cells = []
    for color, label in swatches:
        text = to_hex(color)
        cells.append(
            f'<div style="text-align:center;font:11px monospace"><div style="width:7em;height:3em;background:{text}">'
            f"</div>{escape(label)}<br>{text}</div>"
        )
    return f'<div style="display:flex">{"".join(cells)}</div>'
