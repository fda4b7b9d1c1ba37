"""Figures of matplotlib as SVG that takes its colors and fonts from the page around it."""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ParamSpec

from translucent.bench.page.theme import COLORS, css_variables, placeholder
from translucent.extras import require_package

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Arguments = ParamSpec("Arguments")

#: Font size of labels, in units of the SVG. Layout measures the widest of the common fonts, which comes with
#: matplotlib.
FONT_SIZE = 12.0

#: Characters of a name.
_LONGEST = 40

_FONT = "system-ui, 'Segoe UI', 'DejaVu Sans', 'Liberation Sans', sans-serif"

#: Labels stay legible on lines.
_HALO = "text { paint-order: stroke; stroke: var(--paper); stroke-width: 3px; stroke-linejoin: round; }"


def require_packages() -> None:
    """Raise `RenderError` if what draws the page is not installed."""
    for module in ("markupsafe", "jinja2", "matplotlib"):
        require_package(module, "the page of the report")


def drawing(draw: Callable[Arguments, str]) -> Callable[Arguments, str]:
    """Decorate a function that makes a figure: it draws under the page's settings, whatever the user's are."""

    @functools.wraps(draw)
    def under_settings(*args: Arguments.args, **kwargs: Arguments.kwargs) -> str:
        import matplotlib

        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_settings())
            return draw(*args, **kwargs)

    return under_settings


def shortened(text: str) -> str:
    """A name that fits into a plot; tables and tooltips have all of it."""
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def new_figure(width: float, height: float) -> tuple[Figure, Axes]:
    """An empty figure of this size in units of the SVG, with one pair of axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72), dpi=72)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.grid(True, which="major")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def to_svg(figure: Figure, name: str, description: str, tooltips: dict[str, str] | None = None) -> str:
    """The figure as an ``<svg>`` element for a page.

    Parameters
    ----------
    figure : Figure
        Drawn with `placeholder` colors.
    name : str
        Unique within the page; starts every identifier.
    description : str
        For those who cannot see it.
    tooltips : dict of str to str, optional
        What a browser shows over the artist of this gid.
    """
    from markupsafe import escape

    stream = io.StringIO()
    figure.savefig(stream, format="svg", transparent=True)
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    for color in COLORS:
        text = text.replace(placeholder(color), f"var(--{color})")
    text = re.sub(r"font: ((?:bold |600 |700 |italic )*)([\d.]+)px [^;\"]*", rf"font: \1\2px {_FONT}", text)
    text = re.sub(r'id="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r'xlink:href="#([^"]+)"', rf'href="#{name}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", text)
    for gid, tooltip in (tooltips or {}).items():
        text = text.replace(f'<g id="{name}-{gid}">', f'<g id="{name}-{gid}"><title>{escape(tooltip)}</title>')
    view = re.search(r'viewBox="[^"]*"', text)
    assert view is not None, "matplotlib always writes one"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(description)}" {view.group()}>'
    return head + text[text.index(">") + 1 :].strip()


def standalone(svg: str) -> str:
    """The ``<svg>`` element as a file of its own, with its colors, on a card that follows the reader's theme."""
    style = (
        f'<style>{css_variables()}\n{_HALO}</style><rect width="100%" height="100%" rx="8" style="fill: var(--paper)"/>'
    )
    end = svg.index(">") + 1
    return f"{svg[:end]}{style}{svg[end:]}\n"


def _settings() -> dict[str, Any]:
    """Settings that all figures share; the same record gives the same bytes."""
    ink, muted, line = placeholder("ink"), placeholder("muted"), placeholder("line")
    return {
        "font.family": "DejaVu Sans",
        "font.size": FONT_SIZE,
        "svg.fonttype": "none",
        "svg.hashsalt": "translucent",
        "text.parse_math": False,
        "text.color": ink,
        "axes.labelcolor": ink,
        "axes.edgecolor": muted,
        "axes.labelsize": FONT_SIZE,
        "axes.axisbelow": True,
        "xtick.color": muted,
        "ytick.color": muted,
        "xtick.labelcolor": ink,
        "ytick.labelcolor": ink,
        "xtick.labelsize": FONT_SIZE - 1,
        "ytick.labelsize": FONT_SIZE - 1,
        "grid.color": line,
        "grid.linewidth": 0.7,
        "axes.unicode_minus": True,
    }
