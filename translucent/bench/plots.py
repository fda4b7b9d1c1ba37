"""Plots of the page: cost against error, cost along an axis, and errors of shadows and caustics, from the record."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from translucent.arrays import Array
from translucent.bench.claims import CAUSTIC_ERROR, DIRECTIONS, EXACT, MOST_OF_DEPTH, PHOTONS, SKY_ERROR, USUAL
from translucent.bench.figures import (
    FONT_SIZE,
    drawing,
    end_labels,
    error_text,
    new_figure,
    place_labels,
    placeholder,
    power_text,
    ratio_text,
    require_packages,
    short_count,
    shortened,
    standalone,
    style_of,
    to_svg,
)
from translucent.bench.judgement import ERROR_FLOOR, error_of
from translucent.bench.record import (
    CONSTANT,
    HALF,
    OPAQUE,
    CaseRecord,
    MethodRow,
    Quantity,
    Report,
    Series,
    ShadowCase,
    ShadowRow,
    Shadows,
)
from translucent.errors import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Units of errors, for axes.
UNITS: Mapping[Quantity, str] = {
    "thickness": "in thickness, share of the diagonal",
    "transmittance": "in transmittance, 0 to 1",
    "radiance": "in radiance, share of its mean",
}

#: Quantity that each axis counts.
AXES = {
    "triangles": "triangles",
    "pixels": "pixels of the frame",
    "layers": "surfaces on each ray",
    "media": "different media",
}

#: Error at which smaller ones, and those of zero, are drawn.
_ZERO = 1e-9
_SYMBOL = 9.0
_STARS = ("*", (4, 1, 0), (6, 1, 0))  # their points are thin

#: Errors down to which plots go at least: the rounding of float32, or the noise of a path traced truth.
_LEAST, _LEAST_BY_PATHS = 1e-7, 5e-3

#: Families that the overview leaves out: the backend without OpenGL, which is off the scale, and marching, which
#: bodies that only absorb do not need.
_LEFT_OUT = {"cpu backend", "RayMarched on the CPU", "RayMarched"}

#: Colors and symbols of the shortcuts of shadows, and of lines that only their names identify.
_SHORTCUTS = {OPAQUE: ("vermilion", "X"), CONSTANT: ("orange", "D"), HALF: ("olive", "s")}
_LINES = (("green", "o"), ("blue", "^"), ("orange", "s"))

#: Size of plots that stand beside each other, and the height of a line of names.
_SIZE, _LINE = (620, 400), 19

#: Margins of these plots.
_MARGINS = {"left": 0.115, "right": 0.97, "bottom": 0.135, "top": 0.97}


def plotted(case: CaseRecord) -> list[MethodRow]:
    """The rows that have a time and an error: family by family, the one with the cheapest method first.

    Within a family, one method with growing settings stands together.
    """
    rows = [row for row in case.rows if row.ratio is not None and error_of(row, case.quantity) is not None]
    families: dict[str, float] = {}
    for row in rows:
        families[row.family] = min(families.get(row.family, math.inf), _cost(row))
    return sorted(rows, key=lambda row: (families[row.family], row.family, *_setting(row), _cost(row), row.method))


def overview_svg(report: Report) -> str | None:
    """Cost against error on the first closed, concave scene that only absorbs, with the names of the methods; None if
    no scene has numbers.
    """
    require_packages()
    cases = [
        dataclasses.replace(case, rows=tuple(row for row in case.rows if row.family not in _LEFT_OUT))
        for case in report.cases
    ]
    cases = [case for case in cases if plotted(case)]
    if not cases:
        return None
    requested = [case for case in cases if case.closed and case.absorption_only and not case.convex]
    case = (requested or cases)[0]
    names = {row.method: row.method for row in case.rows}
    device = "software rasterizer" if report.provenance.software else report.provenance.renderer
    title = f"{case.title}, {case.size[0]} × {case.size[1]}, {device}"
    return standalone(pareto_svg(case, names, "overview", (900, 520), title))


@drawing
def pareto_svg(
    case: CaseRecord, names: Mapping[str, str], name: str, size: tuple[float, float] = (760, 520), title: str = ""
) -> str:
    """The plot of a case as an ``<svg>`` element.

    Parameters
    ----------
    case : CaseRecord
        With at least one row of `plotted`.
    names : mapping of str to str
        The labels of methods: numbers of the table beside the plot, or names.
    name : str
        Of the figure, unique within the page.
    size : (width, height)
    title : str
        Above the plot.
    """
    rows = plotted(case)
    figure, axes = new_figure(*size)
    points = np.array([(max(_cost(row), 1e-3), max(error_of(row, case.quantity) or 0.0, _ZERO)) for row in rows])
    _scale(axes, points, _LEAST if case.truth_noise is None else _LEAST_BY_PATHS)
    axes.set_xlabel("time ÷ time of a depth-only pass over the same triangles")
    axes.set_ylabel(f"RMS error {UNITS[case.quantity]}")
    floor = next((row.wall.median for row in case.rows if row.kind == "floor" and row.wall is not None), None)
    _guides(axes, floor)
    _frontier(axes, rows, points)
    series: dict[tuple[str, str], list[int]] = {}
    for i, row in enumerate(rows):  # in the order of their settings
        series.setdefault((row.family, _setting(row)[0]), []).append(i)
    for (family, _), members in series.items():
        axes.plot(*points[members].T, color=placeholder(style_of(family).color), linewidth=1.0, alpha=0.6, zorder=3)
    for i, (row, point) in enumerate(zip(rows, points, strict=True)):
        _symbol(axes, row, point, f"point{i}")
    above = (34.0 if floor else 10.0) + (28.0 if title else 0.0)
    figure.subplots_adjust(left=72 / size[0], right=1 - 12 / size[0], bottom=56 / size[1], top=1 - above / size[1])
    figure.text(12 / size[0], 1 - 20 / size[1], printable(title), weight="bold", size=FONT_SIZE + 2, va="center")
    _labels(axes, rows, points, names)
    tooltips = {
        f"point{i}": f"{row.method}: {ratio_text(_cost(row))} x depth-only, RMS error "
        f"{error_text(error_of(row, case.quantity))}"
        for i, row in enumerate(rows)
    }
    return to_svg(figure, name, f"Cost against error: {case.title}", tooltips)


def _setting(row: MethodRow) -> tuple[str, float]:
    """The name of a method without its first number, and that number."""
    number = re.search(r"\d+", row.method)
    if number is None:
        return row.method, math.inf
    return row.method[: number.start()] + "#" + row.method[number.end() :], float(number.group())


def _cost(row: MethodRow) -> float:
    return row.ratio.median if row.ratio is not None else math.inf


def _scale(axes: Axes, points: Array, least: float) -> None:
    """Logarithmic axes with room for labels, over a decade at least, and down to an error."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = points.min(axis=0), points.max(axis=0)
    left, right = min(low[0], 1.0) / 1.35, max(high[0], 2.0) * 1.5
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(left, right)
    axes.set_ylim(min(low[1], least) / 2.5, max(high[1], 1e-2) * 3)
    steps = (1, 1.5, 2, 3, 5) if right / left < 30 else (1, 2, 5) if right / left < 1000 else (1,)
    axes.xaxis.set_major_locator(FixedLocator(_decades(-3, 7, steps, left, right)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}×"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(10, numticks=12))
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"≤ {power_text(_ZERO)}" if value <= _ZERO else power_text(value))
    )
    axes.yaxis.set_minor_formatter(NullFormatter())


def _decades(first: int, last: int, steps: Sequence[float], low: float, high: float) -> list[float]:
    """Round numbers within bounds: these steps of each power of ten."""
    return [d * s for d in 10.0 ** np.arange(first, last) for s in steps if low <= d * s <= high]


def _guides(axes: Axes, floor: float | None) -> None:
    """Draw guide lines: the time of the floor, the float32 error, and an axis of milliseconds."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    bottom = axes.get_ylim()[0]
    axes.axvline(1.0, color=placeholder("muted"), linewidth=1.2, linestyle=(0, (4, 3)))
    if bottom < ERROR_FLOOR:
        axes.axhspan(bottom, ERROR_FLOOR, color=placeholder("panel"), zorder=0, linewidth=0)
        note = "as exact as float32 paths are"
        axes.text(0.008, 0.012, note, transform=axes.transAxes, color=placeholder("muted"), size=FONT_SIZE - 1)
    if floor is None:
        return
    above = axes.secondary_xaxis("top", functions=(lambda x: x * floor, lambda ms: ms / floor))
    low, high = (floor * limit for limit in axes.get_xlim())
    above.xaxis.set_major_locator(FixedLocator(_decades(-5, 8, (1, 2, 5) if high / low < 1000 else (1,), low, high)))
    above.xaxis.set_minor_locator(NullLocator())
    above.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} ms"))
    above.spines["top"].set_color(placeholder("line"))
    above.tick_params(color=placeholder("line"), labelcolor=placeholder("muted"))


def _frontier(axes: Axes, rows: Sequence[MethodRow], points: Array) -> None:
    """Draw the Pareto frontier as steps."""
    on = np.array([row.pareto for row in rows], dtype=bool)
    if not on.any():
        return
    chosen = points[on][np.argsort(points[on][:, 0], kind="stable")]
    x = np.append(chosen[:, 0], axes.get_xlim()[1])
    y = np.minimum.accumulate(chosen[:, 1])
    top = axes.get_ylim()[1]
    x, y = np.insert(x, 0, x[0]), np.concatenate([[top], y, y[-1:]])
    axes.step(x, y, where="post", color=placeholder("ink"), linewidth=1.4, alpha=0.55, zorder=2)
    axes.fill_between(x, y, top, step="post", color=placeholder("line"), alpha=0.18, zorder=0, linewidth=0)


def _symbol(axes: Axes, row: MethodRow, point: Array, gid: str) -> None:
    """Draw the symbol of a row: filled for methods, hollow for counter-examples, ringed on the frontier."""
    style = style_of(row.family)
    color, paper = placeholder(style.color), placeholder("paper")
    filled = row.kind in ("method", "cpu")
    if row.pareto:
        ring = {"markersize": _SYMBOL + 8, "markerfacecolor": "none", "markeredgecolor": placeholder("ink")}
        axes.plot(*point, "o", **ring, zorder=4)
    axes.plot(
        *point,
        linestyle="none",
        marker=style.marker,
        markersize=_SYMBOL + (3 if style.marker in _STARS else 0),
        markerfacecolor=color if filled else paper,
        markeredgecolor=paper if filled else color,
        markeredgewidth=0.6 if filled else 1.6,
        zorder=5,
        gid=gid,
    )


def _labels(axes: Axes, rows: Sequence[MethodRow], coordinates: Array, names: Mapping[str, str]) -> None:
    """The label of every row, beside its symbol, with a line to it where it had to go farther."""
    renderer = axes.figure.canvas.get_renderer()
    points = axes.transData.transform(coordinates)
    centered = {"ha": "center", "va": "center", "size": FONT_SIZE - 1, "zorder": 6}
    texts = [
        axes.text(0.0, 0.0, shortened(names[row.method]), weight="bold" if row.pareto else "normal", **centered)
        for row in rows
    ]
    boxes = [text.get_window_extent(renderer) for text in texts]
    sizes = np.array([(box.width, min(box.height, FONT_SIZE + 2)) for box in boxes])
    area = axes.get_window_extent(renderer)
    radii = np.array([_SYMBOL / 2 + (5 if row.pareto else 1) for row in rows])
    centers = place_labels(points, sizes, (area.x0 + 2, area.y0 + 2, area.x1 - 2, area.y1 - 2), radii)
    back = axes.transData.inverted()
    for text, point, center, size in zip(texts, points, centers, sizes, strict=True):
        text.set_position(back.transform(center))
        nearest = np.clip(point, center - size / 2, center + size / 2)
        if np.hypot(*(nearest - point)) > _SYMBOL + 6:
            leader = back.transform(np.array([point, nearest]))
            axes.plot(*leader.T, color=placeholder("muted"), linewidth=0.7, zorder=3)


def scaling_groups(scaling: Sequence[Series]) -> dict[str, list[Series]]:
    """The series of each axis that has any numbers, in the order of `AXES`."""
    groups = {axis: [s for s in scaling if s.axis == axis and any(p.wall for p in s.points)] for axis in AXES}
    return {axis: series for axis, series in groups.items() if series}


@drawing
def scaling_svg(axis: str, group: Sequence[Series]) -> str:
    """Milliseconds of each method along one axis, both logarithmic."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    figure, axes = new_figure(*_SIZE)
    ends: list[tuple[str, str, float, float]] = []
    for series in group:
        x, y = np.array([(p.x, p.wall.median) for p in series.points if p.wall is not None]).T
        style = style_of(series.family)
        dashes = (0, (4, 3)) if series.family == "depth only" else "-"
        style_of_line = {"color": placeholder(style.color), "marker": style.marker, "markersize": 6, "linewidth": 1.5}
        axes.plot(x, y, linestyle=dashes, **style_of_line)
        ends.append((series.method, style.color, float(x[-1]), float(y[-1])))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(AXES[axis])
    axes.set_ylabel("ms, median")
    measured = sorted({p.x for s in group for p in s.points})
    kept: list[int] = []  # thinned out where they would touch
    reach = max(np.log(measured[-1] / measured[0]), 1e-9)
    for value in measured:
        if not kept or np.log(value / kept[-1]) / reach > 0.12:
            kept.append(value)
    axes.xaxis.set_major_locator(FixedLocator(kept))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: short_count(value)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    low, high = axes.get_ylim()
    if high / low < 30:  # a decade alone would have one tick
        axes.yaxis.set_major_locator(FixedLocator(_decades(-4, 7, (1, 2, 5), low, high)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    figure.subplots_adjust(**_MARGINS)
    end_labels(axes, ends)
    return to_svg(figure, f"scaling-{axis}", f"Milliseconds against {AXES[axis]}")


def shadow_plots(shadows: Shadows) -> dict[str, str]:
    """The plots of shadows and caustics that have any numbers, by their titles."""
    rows = [row for case in shadows.cases for row in case.rows if row.kind == "method"]
    plots = {
        "How errors fall with the size of maps": (any(row.errors for row in rows), size_svg),
        f"What a map of {USUAL} costs, beside one of depth alone": (bool(_costs(shadows)), cost_svg),
        "Shadows of environments": (bool(shadows.sky), sky_svg),
        "Caustics": (any(case.rows for case in shadows.caustics), caustic_svg),
    }
    return {title: draw(shadows) for title, (there, draw) in plots.items() if there}


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
    sizes = sorted({row.size for case in shadows.cases for row in case.rows})
    _logarithmic(axes, "texels along a side of the map", "error of transmittance", sizes, plain=False)
    figure.subplots_adjust(**_MARGINS)
    end_labels(axes, ends)
    return to_svg(figure, "shadow-sizes", "Errors of shadows against the size of their maps")


@drawing
def cost_svg(shadows: Shadows) -> str:
    """Times of maps of the usual size, as multiples of drawing depth alone."""
    found = _costs(shadows)
    figure, axes = new_figure(_SIZE[0], max(150, 70 + _LINE * len(found)))
    for place, (_, ratio) in enumerate(reversed(found)):
        color = placeholder("green" if ratio <= MOST_OF_DEPTH else "vermilion")
        axes.plot([1.0, ratio], [place, place], color=color, linewidth=1.2, alpha=0.6)
        axes.plot([ratio], [place], color=color, marker="o", markersize=7)
        text, beside = f"{ratio:.2f}", {"xytext": (8, 0), "textcoords": "offset points", "va": "center"}
        axes.annotate(text, (ratio, place), size=FONT_SIZE - 1, color=color, **beside)
    axes.axvline(MOST_OF_DEPTH, color=placeholder("muted"), linestyle=(0, (4, 3)), linewidth=1.2)
    axes.set_yticks(range(len(found)), [printable(title) for title, _ in reversed(found)])
    axes.set_ylim(-0.7, len(found) - 0.3)
    most = max(ratio for _, ratio in found)
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
    directions = sorted({row.directions for row in shadows.sky})
    _logarithmic(axes, "directions; dotted: 1 / √n", "RMS error, share of the mean", directions)
    figure.subplots_adjust(**_MARGINS)
    end_labels(axes, ends)
    return to_svg(figure, "shadow-sky", "Errors of shadows of environments against the number of directions")


@drawing
def caustic_svg(shadows: Shadows) -> str:
    """Errors of caustics against the number of photons, with their upper bounds."""
    figure, axes = new_figure(*_SIZE)
    cases = [case for case in shadows.caustics if case.rows]
    ends = _lines(axes, {case.title: [(row.photons, max(row.nrmse, 1e-3)) for row in case.rows] for case in cases})
    for (color, _), case in zip(_LINES, cases, strict=False):
        for row in case.rows:
            reach = [max(row.nrmse, 1e-3), max(row.most, 1e-3)]
            axes.plot([row.photons] * 2, reach, color=placeholder(color), linewidth=1.2, marker="_", alpha=0.8)
    _bar(axes, CAUSTIC_ERROR, f"promised from {short_count(PHOTONS)}")
    counts = sorted({row.photons for case in cases for row in case.rows})
    _logarithmic(axes, "photons", "RMS error, share of the mean", counts)
    figure.subplots_adjust(**_MARGINS)
    end_labels(axes, ends)
    return to_svg(figure, "caustics", "Errors of caustics against the number of photons")


def _by_size(case: ShadowCase, value: Callable[[ShadowRow], float | None]) -> dict[int, float]:
    found = {row.size: value(row) for row in case.rows if row.kind == "method"}
    return {size: error for size, error in found.items() if error}


def _costs(shadows: Shadows) -> list[tuple[str, float]]:
    """Scenes with the time of their map of the usual size."""
    return [
        (case.title, row.ratio.median)
        for case in shadows.cases
        for row in case.rows
        if row.kind == "method" and row.size == USUAL and row.ratio is not None
    ]


def _lines(axes: Axes, lines: Mapping[str, Sequence[tuple[int, float]]]) -> list[tuple[str, str, float, float]]:
    """Draw lines, and return where each ends, with its name."""
    ends = []
    for (name, line), (color, marker) in zip(lines.items(), _LINES, strict=False):
        x, y = zip(*line, strict=True)
        axes.plot(x, y, color=placeholder(color), marker=marker, markersize=6, linewidth=1.8)
        ends.append((name, color, float(x[-1]), float(y[-1])))
    return ends


def _bar(axes: Axes, height: float, name: str) -> None:
    """Draw the limit that errors must stay below."""
    axes.axhline(height, color=placeholder("muted"), linestyle=(0, (4, 3)), linewidth=1.2)
    at = {"xycoords": ("axes fraction", "data"), "xytext": (4, 3), "textcoords": "offset points"}
    axes.annotate(name, (0.0, height), **at, color=placeholder("muted"), size=FONT_SIZE - 1)


def _logarithmic(axes: Axes, across: str, up: str, measured: Sequence[int], *, plain: bool = True) -> None:
    """Logarithmic axes with ticks at the measured values; upwards at round numbers, or at powers of ten alone."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    axes.xaxis.set_major_locator(FixedLocator(measured))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: short_count(x) if x >= 1e4 else f"{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    if plain:
        axes.yaxis.set_major_locator(FixedLocator(_decades(-4, 1, (1, 2, 5), *axes.get_ylim())))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}" if plain else power_text(y)))
    axes.yaxis.set_minor_formatter(NullFormatter())
