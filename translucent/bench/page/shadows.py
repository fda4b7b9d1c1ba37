"""The plots of shadows and caustics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any

from translucent.bench.page.figure import FONT_SIZE, drawing, new_figure, to_svg
from translucent.bench.page.numbers import power_text
from translucent.bench.page.scaling import end_labels, short_count
from translucent.bench.page.theme import placeholder
from translucent.bench.shadows.claims import (
    CAUSTIC_ERROR,
    DIRECTIONS,
    EXACT,
    MOST_OF_DEPTH,
    PHOTONS,
    SKY_ERROR,
    USUAL,
    shadow_claims,
)
from translucent.bench.shadows.record import CONSTANT, HALF, OPAQUE, ShadowCase, ShadowRow, Shadows

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colors and symbols of the shortcuts.
_SHORTCUTS = {OPAQUE: ("vermilion", "X"), CONSTANT: ("orange", "D"), HALF: ("olive", "s")}

#: Colors and symbols of lines that are told apart by name alone.
_LINES = (("green", "o"), ("blue", "^"), ("orange", "s"))

#: Size of plots that stand beside each other, and the height of a line of names.
_SIZE, _LINE = (620, 400), 19


def shadow_section(shadows: Shadows) -> dict[str, Any] | None:
    """Values that the template shows of the part; None where nothing was measured."""
    from markupsafe import Markup

    if not shadows.measured:
        return None
    plots = {
        "How errors fall with the size of maps": (_has_sizes, size_svg),
        f"What a map of {USUAL} costs, beside one of depth alone": (_has_costs, cost_svg),
        "Shadows of environments": (lambda part: bool(part.sky), sky_svg),
        "Caustics": (lambda part: any(case.rows for case in part.caustics), caustic_svg),
    }
    return {
        "record": shadows,
        "usual": USUAL,
        "claims": [claim for claim in shadow_claims(shadows) if claim.measured],
        "plots": [(title, Markup(draw(shadows))) for title, (there, draw) in plots.items() if there(shadows)],
        "pictured": [case for case in shadows.cases if case.pictures],
    }


@drawing
def size_svg(shadows: Shadows) -> str:
    """Errors of transmittance against the width of maps; each scene is a thin line, their median a thick one."""
    figure, axes = new_figure(*_SIZE)
    ends: list[tuple[str, str, float, float]] = []
    of: Mapping[str, tuple[str, str, Callable[[ShadowRow], float | None]]] = {
        "with outlines, mean": ("blue", "^", lambda row: row.edges),
        "away from outlines, median": ("green", "o", lambda row: None if row.errors is None else row.errors.median),
    }
    for name, (color, marker, value) in of.items():
        lines = [_by_size(case, value) for case in shadows.cases]
        for line in lines:
            axes.plot(list(line), list(line.values()), color=placeholder(color), linewidth=0.8, alpha=0.35)
        sizes = sorted({size for line in lines for size in line})
        middle = [median(line[size] for line in lines if size in line) for size in sizes]
        axes.plot(sizes, middle, color=placeholder(color), marker=marker, markersize=6, linewidth=2.2)
        ends.append((name, color, sizes[-1], middle[-1]))
    last = max(size for _, _, size, _ in ends)
    for name, (color, marker) in _SHORTCUTS.items():
        found = [row.errors.median for case in shadows.cases for row in case.rows if row.method == name and row.errors]
        if found:
            y, across = median(found), placeholder(color)
            axes.plot([USUAL, last], [y, y], color=across, linestyle=(0, (2, 2)), linewidth=1.2)
            axes.plot([USUAL], [y], color=across, marker=marker, markersize=7, markerfacecolor="none")
            axes.plot([USUAL, USUAL], [min(found), max(found)], color=across, linewidth=1.2)
            ends.append((f"{name}, median", color, last, y))
    texels = [(case.texel_size, case.texels.p999) for case in shadows.cases if case.texels is not None]
    if texels:
        for size, error in texels:
            axes.plot([size], [error], color=placeholder("ink"), marker="_", markersize=9)
        ends.append(("in rays of texels, p99.9", "ink", float(texels[0][0]), max(error for _, error in texels)))
        _bar(axes, EXACT, "promised there")
    _logarithmic(axes, "texels along a side of the map", "error of transmittance")
    _powers(axes, sorted({row.size for case in shadows.cases for row in case.rows}))
    figure.subplots_adjust(left=0.115, right=0.97, bottom=0.135, top=0.97)
    end_labels(axes, ends)
    return to_svg(figure, "shadow-sizes", "Errors of shadows against the size of their maps")


@drawing
def cost_svg(shadows: Shadows) -> str:
    """Times of maps of the usual size, as multiples of drawing depth alone."""
    found = [(case, ratio) for case in shadows.cases if (ratio := _cost(case)) is not None]
    figure, axes = new_figure(_SIZE[0], max(150, 70 + _LINE * len(found)))
    for place, (_, ratio) in enumerate(reversed(found)):
        color = placeholder("green" if ratio[0] <= MOST_OF_DEPTH else "vermilion")
        axes.plot([1.0, ratio[0]], [place, place], color=color, linewidth=1.2, alpha=0.6)
        axes.plot([ratio[0]], [place], color=color, marker="o", markersize=7)
        text, beside = f"{ratio[0]:.2f}", {"xytext": (8, 0), "textcoords": "offset points", "va": "center"}
        axes.annotate(text, (ratio[0], place), size=FONT_SIZE - 1, color=color, **beside)
    axes.axvline(MOST_OF_DEPTH, color=placeholder("muted"), linestyle=(0, (4, 3)), linewidth=1.2)
    axes.set_yticks(range(len(found)), [case.title for case, _ in reversed(found)])
    axes.set_ylim(-0.7, len(found) - 0.3)
    most = max(ratio for _, (ratio, _) in found)
    axes.set_xscale("log")
    axes.set_xlim(0.93, max(most * 1.35, 1.6))
    ticks = [tick for tick in (1.0, 1.3, 2.0, 3.0, 5.0, 10.0, 20.0) if tick <= most * 1.35]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel(f"time ÷ that of a depth-only map; dashed: the bar, {MOST_OF_DEPTH:g}")
    figure.subplots_adjust(left=0.34, right=0.97, bottom=46 / figure.bbox.height, top=0.985)
    return to_svg(figure, "shadow-costs", "Times of shadow maps beside depth-only ones")


@drawing
def sky_svg(shadows: Shadows) -> str:
    """Errors of light from all around against the number of directions."""
    lines: dict[str, list[tuple[int, float]]] = {}
    for row in shadows.sky:
        lines.setdefault(row.environment, []).append((row.directions, row.error))
    figure, axes = new_figure(*_SIZE)
    ends = _lines(axes, lines)
    first = max(lines.values(), key=lambda line: line[0][1])
    counts = [count for count, _ in first]
    falling = [first[0][1] * (counts[0] / count) ** 0.5 for count in counts]
    axes.plot(counts, falling, color=placeholder("muted"), linewidth=1.0, linestyle=":")
    _bar(axes, SKY_ERROR, f"promised from {DIRECTIONS}")
    _logarithmic(axes, "directions; dotted: 1 / √n", "RMS error, share of the mean")
    _powers(axes, sorted({row.directions for row in shadows.sky}), plain=True)
    end_labels(axes, ends)
    return to_svg(figure, "shadow-sky", "Errors of shadows of environments against the number of directions")


@drawing
def caustic_svg(shadows: Shadows) -> str:
    """Errors of caustics against the number of photons, with what they may be at most."""
    figure, axes = new_figure(*_SIZE)
    lines = {case.title: [(row.photons, max(row.nrmse, 1e-3)) for row in case.rows] for case in shadows.caustics}
    ends = _lines(axes, {name: line for name, line in lines.items() if line})
    for (color, _), case in zip(_LINES, [case for case in shadows.caustics if case.rows], strict=False):
        for row in case.rows:
            reach = [max(row.nrmse, 1e-3), max(row.most, 1e-3)]
            axes.plot([row.photons] * 2, reach, color=placeholder(color), linewidth=1.2, marker="_", alpha=0.8)
    _bar(axes, CAUSTIC_ERROR, f"promised from {short_count(PHOTONS)}")
    _logarithmic(axes, "photons", "RMS error, share of the mean")
    _powers(axes, sorted({row.photons for case in shadows.caustics for row in case.rows}), plain=True)
    end_labels(axes, ends)
    return to_svg(figure, "caustics", "Errors of caustics against the number of photons")


def _by_size(case: ShadowCase, value: Callable[[ShadowRow], float | None]) -> dict[int, float]:
    found = {row.size: value(row) for row in case.rows if row.kind == "method"}
    return {size: error for size, error in found.items() if error}


def _has_sizes(shadows: Shadows) -> bool:
    return any(row.errors is not None and row.kind == "method" for case in shadows.cases for row in case.rows)


def _has_costs(shadows: Shadows) -> bool:
    return any(_cost(case) is not None for case in shadows.cases)


def _cost(case: ShadowCase) -> tuple[float, float] | None:
    ratios = (row.ratio for row in case.rows if row.kind == "method" and row.size == USUAL)
    return next(((ratio.median, ratio.noise) for ratio in ratios if ratio is not None), None)


def _lines(axes: Axes, lines: Mapping[str, Sequence[tuple[int, float]]]) -> list[tuple[str, str, float, float]]:
    """Draw lines, and where each ends with its name."""
    ends = []
    for (name, line), (color, marker) in zip(lines.items(), _LINES, strict=False):
        x, y = zip(*line, strict=True)
        axes.plot(x, y, color=placeholder(color), marker=marker, markersize=6, linewidth=1.8)
        ends.append((name, color, float(x[-1]), float(y[-1])))
    return ends


def _bar(axes: Axes, height: float, name: str) -> None:
    """A line that errors must stay below."""
    axes.axhline(height, color=placeholder("muted"), linestyle=(0, (4, 3)), linewidth=1.2)
    axes.annotate(
        name,
        (0.0, height),
        xycoords=("axes fraction", "data"),
        xytext=(4, 3),
        textcoords="offset points",
        color=placeholder("muted"),
        size=FONT_SIZE - 1,
    )


def _logarithmic(axes: Axes, across: str, up: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    axes.figure.subplots_adjust(left=0.115, right=0.97, bottom=0.135, top=0.97)


def _powers(axes: Axes, measured: Sequence[int], *, plain: bool = False) -> None:
    """The measured values on the horizontal axis; on the vertical one powers of ten, or also their parts."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    axes.xaxis.set_major_locator(FixedLocator(measured))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: short_count(x) if x >= 1e4 else f"{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    if plain:
        low, high = axes.get_ylim()
        parts = [digit * 10.0**power for power in range(-4, 1) for digit in (1, 2, 5)]
        axes.yaxis.set_major_locator(FixedLocator([part for part in parts if low <= part <= high]))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    else:
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: power_text(y)))
    axes.yaxis.set_minor_formatter(NullFormatter())
