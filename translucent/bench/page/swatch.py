"""The symbols of methods, for tables."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from translucent.bench.page.theme import style_of

if TYPE_CHECKING:
    from markupsafe import Markup

#: SVG path commands by matplotlib's path codes, with how many points each takes.
_COMMANDS = {1: ("M", 1), 2: ("L", 1), 3: ("Q", 2), 4: ("C", 3), 79: ("Z", 1)}


@cache
def swatch(family: str, filled: bool = True) -> Markup:
    """The symbol of a family as a small ``<svg>``, hollow for counter-examples."""
    from markupsafe import Markup

    style = style_of(family)
    color = f"var(--{style.color})"
    fill = color if filled else "none"
    stroke = color if not filled or style.marker == "|" else "none"
    return Markup(  # only our own numbers and names
        f'<svg class="swatch" viewBox="-8 -8 16 16" aria-hidden="true"><path d="{_path(style.marker)}" '
        f'style="fill: {fill}; stroke: {stroke}; stroke-width: 1.6"/></svg>'
    )


def _path(marker: str | tuple[int, int, int]) -> str:
    from matplotlib.markers import MarkerStyle

    shape = MarkerStyle(marker)
    path = shape.get_path().transformed(shape.get_transform()).transformed(_upside_down())
    parts, i = [], 0
    codes = path.codes if path.codes is not None else [1] + [2] * (len(path.vertices) - 1)
    while i < len(codes):
        command, count = _COMMANDS[int(codes[i])]
        points = "" if command == "Z" else " ".join(f"{x:.2f} {y:.2f}" for x, y in path.vertices[i : i + count])
        parts.append(command + points)
        i += count
    return "".join(parts)


def _upside_down() -> object:
    """In SVG y counts downwards; symbols are about 1 wide, and the swatch 16."""
    from matplotlib.transforms import Affine2D

    return Affine2D().scale(11.0, -11.0)
