"""Draw docs/swatches.svg: slabs of all named media on a white and on a black card. Run: python tools/swatch_card.py"""

from __future__ import annotations

from pathlib import Path

import translucent as tl
from translucent.media.preset import SLABS, Preset

FILE = Path(__file__).parents[1] / "docs" / "swatches.svg"

ROWS, CELL, NAME, GAP = 19, 22, 168, 8
CARDS = {"white": "#ffffff", "black": "#000000"}
COLUMN = NAME + 2 * (len(SLABS) * CELL + GAP) + 2 * GAP


def swatch_card() -> str:
    """The drawing, as SVG."""
    presets = list(tl.presets().values())
    columns = -(-len(presets) // ROWS)
    width, height = columns * COLUMN + GAP, (ROWS + 1) * (CELL + GAP) + GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif">',
        f'<rect width="{width}" height="{height}" fill="#dddddd"/>',
    ]
    for column in range(columns):
        x = GAP + column * COLUMN + NAME
        for at, card in zip((x, x + len(SLABS) * CELL + GAP), CARDS, strict=True):
            lines.append(f'<text x="{at}" y="{CELL}" font-size="11">on {card}</text>')
    for i, one in enumerate(presets):
        column, row = divmod(i, ROWS)
        lines += _row(one, GAP + column * COLUMN, (row + 1) * (CELL + GAP))
    return "\n".join([*lines, "</svg>", ""])


def _row(one: Preset, x: int, y: int) -> list[str]:
    lines = [f'<text x="{x}" y="{y + 15}" font-size="12">{one.name.replace("_", " ")}</text>']
    x += NAME
    for card, row in one.slab_colors().items():
        width = len(row) * CELL
        lines.append(f'<rect x="{x - 2}" y="{y - 2}" width="{width + 4}" height="{CELL + 4}" fill="{CARDS[card]}"/>')
        for k, (thickness, color) in enumerate(row.items()):
            rect = f'<rect x="{x + k * CELL}" y="{y}" width="{CELL}" height="{CELL}" fill="{color}">'
            lines.append(f"{rect}<title>{one.name}, {thickness} on {card}: {color}</title></rect>")
        x += width + GAP
    return lines


if __name__ == "__main__":
    FILE.write_text(swatch_card(), encoding="utf-8")
