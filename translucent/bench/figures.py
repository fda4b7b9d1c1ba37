"""Look of the page: numbers as text, colors and symbols of method families, figures as SVG, and their labels."""

from __future__ import annotations

import functools
import io
import math
import re
from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple, ParamSpec

import numpy as np

from translucent.arrays import Array
from translucent.errors import printable
from translucent.extras import require_package

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Arguments = ParamSpec("Arguments")

#: CSS variables by name: the color on a light page, and on a dark one. The families' are those of Okabe & Ito 2008,
#: darkened or lightened until their contrast with the page is 3 : 1 or more.
COLORS = {
    "paper": ("#ffffff", "#14171a"),
    "panel": ("#f4f5f6", "#1e2226"),
    "ink": ("#1a1d20", "#e8eaec"),
    "muted": ("#596067", "#a3abb3"),
    "line": ("#d3d7db", "#3a4148"),
    "good": ("#006e50", "#45d3a8"),
    "bad": ("#b34700", "#ff9352"),
    "green": ("#009e73", "#2fc79b"),
    "vermilion": ("#d55e00", "#ff8a3d"),
    "pink": ("#c0679a", "#e79bc6"),
    "orange": ("#b87e00", "#f2b632"),
    "blue": ("#0072b2", "#5db2ec"),
    "sky": ("#2b93cf", "#a5dcff"),
    "olive": ("#857a00", "#efe342"),
}


class Style(NamedTuple):
    """Style of a family: the name of its color, and a symbol of matplotlib, as (points, 1, turn) a star."""

    color: str
    marker: str | tuple[int, int, int]


FAMILIES = {
    "depth only": Style("muted", "|"),
    "SignedDepth": Style("green", "o"),
    "BackFaceDepth": Style("orange", "s"),
    "ThinLayer": Style("pink", "D"),
    "FragmentLists": Style("ink", "P"),
    "DepthPeeling": Style("blue", "^"),
    "KBuffer": Style("sky", "v"),
    "RayMarched": Style("olive", "*"),
    "TracedInterfaces": Style("green", "d"),
    "ScreenInterfaces": Style("sky", "<"),
    "FrontInterface": Style("orange", ">"),
    "Diffusion": Style("green", "8"),
    "ScatteringLayer": Style("blue", (4, 1, 0)),
    "SingleScattering": Style("pink", (6, 1, 0)),
    "layer without inner mirrors": Style("vermilion", "1"),
    "Burley's normalized diffusion": Style("orange", "x"),
    "Frostbite's translucency": Style("olive", "+"),
    "constant thickness": Style("vermilion", "X"),
    "sphere assumption": Style("vermilion", "p"),
    "cpu backend": Style("muted", "h"),
    "RayMarched on the CPU": Style("muted", "H"),
}

_OTHERS = (Style("ink", "<"), Style("vermilion", ">"), Style("blue", "d"), Style("olive", "8"))

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Font size of labels, in units of the SVG. Layout measures the widest of the common fonts, which comes with
#: matplotlib.
FONT_SIZE = 12.0
_FONT = "system-ui, 'Segoe UI', 'DejaVu Sans', 'Liberation Sans', sans-serif"

#: Characters of a name.
_LONGEST = 40

#: Labels stay legible on lines.
_HALO = "text { paint-order: stroke; stroke: var(--paper); stroke-width: 3px; stroke-linejoin: round; }"

#: SVG path commands by matplotlib's path codes, with the number of points of each.
_COMMANDS = {1: ("M", 1), 2: ("L", 1), 3: ("Q", 2), 4: ("C", 3), 79: ("Z", 1)}

#: Distance from the axes to the names of the lines, in pixels.
_LEADER = 14.0

#: Costs of a candidate for a label, in pixels of distance from its point that would be as bad.
_OUTSIDE, _ON_LABEL, _ON_POINT, _ACROSS_LABEL = 1e5, 1e4, 400.0, 30.0
_ROUNDS = 4


def require_packages() -> None:
    """Raise `RenderError` if what draws the page is not installed."""
    for module in ("markupsafe", "jinja2", "matplotlib"):
        require_package(module, "the page of the report")


def page_templates(package: str, folder: str = "") -> Environment:
    """Templates of a package's page, which escape all values and fail on unknown names.

    Raises
    ------
    RenderError
        If jinja2 is not installed.
    """
    jinja2 = require_package("jinja2", "the page")

    def load(name: str) -> str:
        return files(package).joinpath(folder, name).read_text(encoding="utf-8")

    found: Environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(load),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return found


def error_text(value: float | None) -> str:
    """Two significant digits: ``3.9e-8``, ``0.21``; ``0`` is exactly that, a dash is not measured."""
    if value is None:
        return "–"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    if 0.00995 <= abs(value) < 999.5:
        return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def limit_text(value: float) -> str:
    """A limit, which is a round number: ``1e-4``."""
    return f"{value:.0e}".replace("e-0", "e-")


def signed_error_text(value: float | None) -> str:
    """Error as in `error_text`, with its sign."""
    return f"+{error_text(value)}" if value is not None and value > 0 else error_text(value)


def ratio_text(value: float | None) -> str:
    """A multiple: ``1.12``, ``16.3``, ``240``."""
    if value is None:
        return "–"
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def ms_text(value: float | None) -> str:
    """Milliseconds to three significant digits."""
    if value is None:
        return "–"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.{min(6, max(0, 2 - math.floor(math.log10(abs(value)))))}f}"


def fraction_text(value: float | None) -> str:
    """A fraction in percent; ``0`` is exactly that."""
    if value is None:
        return "–"
    if value == 0:
        return "0"
    return "< 0.01 %" if value < 1e-4 else f"{100 * value:.2f} %" if value < 0.09995 else f"{100 * value:.1f} %"


def signed_fraction_text(value: float) -> str:
    """A fraction in percent with its sign: ``+3.2 %``."""
    return f"{100 * value:+.1f} %".replace("-", "−")


def change_text(value: float) -> str:
    """A difference of fractions with its sign: ``+0.012``."""
    return f"{value:+.3f}".replace("-", "−")


def count_text(value: float | None) -> str:
    """A whole number, in groups of three."""
    return "–" if value is None else f"{value:,.0f}".replace(",", "\u202f")


def rounded_text(value: float) -> str:
    """A whole number to two significant digits: ``121 399`` is ``120 000``."""
    return count_text(float(f"{value:.1e}"))


def power_text(value: float) -> str:
    """A tick of a logarithmic axis: ``10⁻⁶``, and 0.1 to 1000 written out."""
    exponent = round(math.log10(value))
    return f"{value:g}" if -1 <= exponent <= 3 else "10" + str(exponent).translate(_SUPERSCRIPTS)


def short_count(x: float) -> str:
    """``4``, ``100k``, ``1M``."""
    for unit, name in ((1e6, "M"), (1e3, "k")):
        if x >= unit:
            return f"{x / unit:.3g}{name}"
    return f"{x:g}"


def style_of(family: str) -> Style:
    """The style of a family; families that this page does not know share the remaining ones by their names."""
    return FAMILIES.get(family) or _OTHERS[sum(family.encode()) % len(_OTHERS)]


def css_variables() -> str:
    """The rules that give the page, and a figure of its own, their colors in both themes."""
    light, dark = (" ".join(f"--{name}: {pair[theme]};" for name, pair in COLORS.items()) for theme in (0, 1))
    return (
        f":root {{ color-scheme: light dark; {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )


def placeholder(name: str) -> str:
    """A color in place of a CSS variable while matplotlib draws; `to_svg` puts the variable there."""
    return f"#0102{list(COLORS).index(name) + 16:02x}"


@functools.cache
def swatch(family: str, filled: bool = True) -> Markup:
    """The symbol of a family as a small ``<svg>``, hollow for counter-examples."""
    from markupsafe import Markup
    from matplotlib.markers import MarkerStyle
    from matplotlib.transforms import Affine2D

    style = style_of(family)
    color = f"var(--{style.color})"
    fill = color if filled else "none"
    stroke = color if not filled or style.marker == "|" else "none"
    shape = MarkerStyle(style.marker)
    # In SVG y counts downwards; symbols are about 1 wide, and the swatch 16.
    path = shape.get_path().transformed(shape.get_transform()).transformed(Affine2D().scale(11.0, -11.0))
    parts, i = [], 0
    codes = path.codes if path.codes is not None else [1] + [2] * (len(path.vertices) - 1)
    while i < len(codes):
        command, count = _COMMANDS[int(codes[i])]
        points = "" if command == "Z" else " ".join(f"{x:.2f} {y:.2f}" for x, y in path.vertices[i : i + count])
        parts.append(command + points)
        i += count
    return Markup(  # only our own numbers and names
        f'<svg class="swatch" viewBox="-8 -8 16 16" aria-hidden="true"><path d="{"".join(parts)}" '
        f'style="fill: {fill}; stroke: {stroke}; stroke-width: 1.6"/></svg>'
    )


def drawing(draw: Callable[Arguments, str]) -> Callable[Arguments, str]:
    """Decorate a function that makes a figure: it draws under the page's settings, whatever the user's are."""

    @functools.wraps(draw)
    def under_settings(*args: Arguments.args, **kwargs: Arguments.kwargs) -> str:
        import matplotlib

        ink, muted, line = placeholder("ink"), placeholder("muted"), placeholder("line")
        settings = {
            "font.family": "DejaVu Sans",
            "font.size": FONT_SIZE,
            "svg.fonttype": "none",
            "svg.hashsalt": "translucent",  # the same record gives the same bytes
            "text.parse_math": False,
            "axes.edgecolor": muted,
            "axes.labelsize": FONT_SIZE,
            "axes.axisbelow": True,
            "grid.color": line,
            "grid.linewidth": 0.7,
            "axes.unicode_minus": True,
        }
        settings |= dict.fromkeys(("text.color", "axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor"), ink)
        settings |= dict.fromkeys(("xtick.color", "ytick.color"), muted)
        settings |= dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), FONT_SIZE - 1)
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(settings)
            return draw(*args, **kwargs)

    return under_settings


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
        Text that a browser shows over the artist of this gid.
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
        title = escape(printable(tooltip))
        text = text.replace(f'<g id="{name}-{gid}">', f'<g id="{name}-{gid}"><title>{title}</title>')
    view = re.search(r'viewBox="[^"]*"', text)
    assert view is not None, "matplotlib always writes one"
    label = escape(printable(description))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{label}" {view.group()}>'
    return head + text[text.index(">") + 1 :].strip()


def standalone(svg: str) -> str:
    """The ``<svg>`` element as a file of its own, with its colors, on a card that follows the reader's theme."""
    style = (
        f'<style>{css_variables()}\n{_HALO}</style><rect width="100%" height="100%" rx="8" style="fill: var(--paper)"/>'
    )
    end = svg.index(">") + 1
    return f"{svg[:end]}{style}{svg[end:]}\n"


def shortened(text: str) -> str:
    """Name shortened for a plot."""
    text = printable(text)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def end_labels(axes: Axes, ends: Sequence[tuple[str, str, float, float]]) -> None:
    """Names to the right of where lines end, apart from each other, with a leader to each.

    Parameters
    ----------
    axes : Axes
    ends : sequence of (name, color, x, y)
    """
    figure = axes.get_figure(root=True)
    assert figure is not None, "made with one"
    texts = [
        axes.text(
            0, 0, shortened(name), ha="left", va="center", color=placeholder(color), size=FONT_SIZE, clip_on=False
        )
        for name, color, *_ in ends
    ]
    widest = max(text.get_window_extent().width for text in texts)
    figure.subplots_adjust(right=1.0 - (widest + _LEADER + 6.0) / figure.bbox.width)
    area = axes.get_window_extent()
    points = axes.transData.transform([(x, y) for *_, x, y in ends])
    heights = spread(points[:, 1], FONT_SIZE + 4.0, area.y0 + 6, area.y1 - 6)
    back = axes.transData.inverted()
    for (_, color, *_), text, point, height in zip(ends, texts, points, heights, strict=True):
        end = np.array([area.x1 + _LEADER, height])
        line = back.transform(np.array([point + (6.0, 0.0), end - (3.0, 0.0)]))
        axes.plot(*line.T, color=placeholder(color), linewidth=0.8, alpha=0.7, clip_on=False)
        text.set_position(tuple(back.transform(end)))


def spread(positions: Array, gap: float, low: float, high: float) -> Array:
    """Positions on a line, as near as possible to those `positions`, in order, at least `gap` apart, within bounds."""
    from scipy.optimize import isotonic_regression

    if not len(positions):
        return positions
    order = np.argsort(positions, kind="stable")
    offsets = gap * np.arange(len(order))
    settled = isotonic_regression(np.clip(positions[order], low, high) - offsets).x
    found = np.empty(len(order))
    found[order] = np.clip(settled, low, max(low, high - offsets[-1])) + offsets
    return found


def place_labels(points: Array, sizes: Array, bounds: tuple[float, float, float, float], radii: Array) -> Array:
    """Centers of labels, each near its point.

    Every label in turn goes where the costs are least among candidates around its point at growing distances; a few
    rounds of that settle crowds.

    Parameters
    ----------
    points, sizes : (n, 2)
        In pixels: the points, and width and height of their labels.
    bounds : (left, bottom, right, top)
        That labels stay within.
    radii : (n,)
        Of the symbols at the points.

    Returns
    -------
    (n, 2)
    """
    count = len(points)
    centers = np.full((count, 2), np.inf)
    spots = np.repeat(2.0 * radii[:, None], 2, axis=1)
    crowding = [np.sum(np.hypot(*(points - point).T) < 60.0) for point in points]
    for _ in range(_ROUNDS):
        for i in np.argsort(crowding, kind="stable")[::-1]:
            candidates = _candidates(points[i], sizes[i], radii[i])
            known = (np.arange(count) != i) & np.isfinite(centers[:, 0])
            beyond = np.maximum(np.abs(candidates - points[i]) - sizes[i] / 2, 0.0)
            costs = np.hypot(*beyond.T) + 0.05 * np.arange(len(candidates))
            costs += _ON_LABEL * _overlaps(candidates, sizes[i] + 2.0, centers[known], sizes[known]).sum(axis=1)
            costs += _ON_POINT * _overlaps(candidates, sizes[i], points, spots).sum(axis=1)
            middles = 0.5 * (candidates + points[i])  # where a leader would cross another label
            costs += _ACROSS_LABEL * _overlaps(middles, np.array([2.0, 2.0]), centers[known], sizes[known]).sum(axis=1)
            low, high = candidates - sizes[i] / 2, candidates + sizes[i] / 2
            outside = (low < bounds[:2]).any(axis=1) | (high > bounds[2:]).any(axis=1)
            centers[i] = candidates[np.argmin(costs + _OUTSIDE * outside)]
    return centers


def _candidates(point: Array, size: Array, radius: float) -> Array:
    """Centers for a label around a point, the nearest first, at each distance the right and upper ones first."""
    angles = np.deg2rad([0, 45, -45, 90, -90, 135, -135, 180, 22, -22, 67, -67, 112, -112, 157, -157])
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # A label touches the circle of its distance with the side or corner that faces the point.
    reach = np.sign(np.round(directions, 3)) * size / 2
    distances = radius + np.array([2.0, 8.0, 16.0, 26.0, 38.0, 52.0, 70.0, 95.0])
    return np.concatenate([point + directions * distance + reach for distance in distances])


def _overlaps(centers: Array, size: Array, others: Array, other_sizes: Array) -> Array:
    """(centers, others): 1 where two rectangles overlap."""
    apart = np.abs(centers[:, None, :] - others[None, :, :])
    return np.asarray((apart < (size + other_sizes[None]) / 2).all(axis=2), dtype=np.float64)
