"""Swatches of colors for terminals and notebooks."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np
import numpy.typing as npt

from translucent.formulas.color import to_hex


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
