"""The plot of a case: cost of every method against its error."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from translucent.bench.frontier import ERROR_FLOOR, error_of
from translucent.bench.page.figure import FONT_SIZE, drawing, new_figure, shortened, to_svg
from translucent.bench.page.labels import place_labels
from translucent.bench.page.numbers import error_text, power_text, ratio_text
from translucent.bench.page.theme import placeholder, style_of
from translucent.bench.record import CaseRecord
from translucent.bench.row import Quantity, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Units of errors, for axes.
UNITS: Mapping[Quantity, str] = {
    "thickness": "in thickness, share of the diagonal",
    "transmittance": "in transmittance, 0 to 1",
    "radiance": "in radiance, share of its mean",
}

#: Error at which smaller ones, and those of zero, are drawn.
_ZERO = 1e-9
_SYMBOL = 9.0
_STARS = ("*", (4, 1, 0), (6, 1, 0))  # their points are thin

#: Errors down to which plots go at least: to what float32 is good for, or to what a path traced truth can tell.
_LEAST, _LEAST_BY_PATHS = 1e-7, 5e-3


def plotted(case: CaseRecord) -> list[Row]:
    """The rows that have a time and an error: family by family, the one with the cheapest method first.

    Within a family, one method with growing settings stands together.
    """
    rows = [row for row in case.rows if row.ratio is not None and error_of(row, case.quantity) is not None]
    families: dict[str, float] = {}
    for row in rows:
        families[row.family] = min(families.get(row.family, math.inf), _cost(row))
    return sorted(rows, key=lambda row: (families[row.family], row.family, *_setting(row), _cost(row), row.method))


@drawing
def pareto_svg(
    case: CaseRecord, names: Mapping[str, str], name: str, size: tuple[float, float] = (760, 520), title: str = ""
) -> str:
    """The plot of a case as an ``<svg>`` element; a note where there is nothing to draw is the page's.

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
    coordinates = np.array([_coordinates(row, case.quantity) for row in rows])
    _scale(axes, coordinates, _LEAST if case.truth_noise is None else _LEAST_BY_PATHS)
    axes.set_xlabel("time ÷ time of a depth-only pass over the same triangles")
    axes.set_ylabel(f"RMS error {UNITS[case.quantity]}")
    _guides(axes, case)
    _frontier(axes, rows, coordinates)
    _series(axes, rows, coordinates)
    for i, (row, point) in enumerate(zip(rows, coordinates, strict=True)):
        _symbol(axes, row, point, f"point{i}")
    above = (34.0 if _floor_ms(case) else 10.0) + (28.0 if title else 0.0)
    figure.subplots_adjust(left=72 / size[0], right=1 - 12 / size[0], bottom=56 / size[1], top=1 - above / size[1])
    figure.text(12 / size[0], 1 - 20 / size[1], title, weight="bold", size=FONT_SIZE + 2, va="center")
    _labels(axes, rows, coordinates, names)
    tooltips = {f"point{i}": tooltip(row, case.quantity) for i, row in enumerate(rows)}
    return to_svg(figure, name, f"Cost against error: {case.title}", tooltips)


def tooltip(row: Row, quantity: Quantity) -> str:
    """A row in a line of words."""
    ratio = ratio_text(row.ratio.median if row.ratio else None)
    return f"{row.method}: {ratio} x depth-only, RMS error {error_text(error_of(row, quantity))}"


def identifier(name: str) -> str:
    """Name with only the characters of an HTML identifier."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "x"


def _setting(row: Row) -> tuple[str, float]:
    """The name of a method without its first number, and that number."""
    number = re.search(r"\d+", row.method)
    if number is None:
        return row.method, math.inf
    return row.method[: number.start()] + "#" + row.method[number.end() :], float(number.group())


def _cost(row: Row) -> float:
    return row.ratio.median if row.ratio is not None else math.inf


def _coordinates(row: Row, quantity: Quantity) -> tuple[float, float]:
    return max(_cost(row), 1e-3), max(error_of(row, quantity) or 0.0, _ZERO)


def _floor_ms(case: CaseRecord) -> float | None:
    return next((row.wall.median for row in case.rows if row.kind == "floor" and row.wall is not None), None)


def _scale(axes: Axes, coordinates: np.ndarray, least: float) -> None:
    """Logarithmic axes with room for labels, over a decade at least, and down to an error."""
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    left, right = min(low[0], 1.0) / 1.35, max(high[0], 2.0) * 1.5
    bottom, top = min(low[1], least) / 2.5, max(high[1], 1e-2) * 3
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    _ticks(axes)


def _ticks(axes: Axes) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

    left, right = axes.get_xlim()
    steps = (1, 1.5, 2, 3, 5) if right / left < 30 else (1, 2, 5) if right / left < 1000 else (1,)
    decades = 10.0 ** np.arange(-3, 7)
    axes.xaxis.set_major_locator(FixedLocator([d * s for d in decades for s in steps if left <= d * s <= right]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}×"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(10, numticks=12))
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"≤ {power_text(_ZERO)}" if value <= _ZERO else power_text(value))
    )
    axes.yaxis.set_minor_formatter(NullFormatter())


def _guides(axes: Axes, case: CaseRecord) -> None:
    """The floor, and below what errors are float32's own; milliseconds above."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    bottom = axes.get_ylim()[0]
    axes.axvline(1.0, color=placeholder("muted"), linewidth=1.2, linestyle=(0, (4, 3)))
    if bottom < ERROR_FLOOR:
        axes.axhspan(bottom, ERROR_FLOOR, color=placeholder("panel"), zorder=0, linewidth=0)
        note = "as exact as float32 paths are"
        axes.text(0.008, 0.012, note, transform=axes.transAxes, color=placeholder("muted"), size=FONT_SIZE - 1)
    floor = _floor_ms(case)
    if floor is None:
        return
    above = axes.secondary_xaxis("top", functions=(lambda x: x * floor, lambda ms: ms / floor))
    low, high = (floor * limit for limit in axes.get_xlim())
    steps = (1, 2, 5) if high / low < 1000 else (1,)
    ticks = [d * s for d in 10.0 ** np.arange(-5, 8) for s in steps if low <= d * s <= high]
    above.xaxis.set_major_locator(FixedLocator(ticks))
    above.xaxis.set_minor_locator(NullLocator())
    above.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} ms"))
    above.spines["top"].set_color(placeholder("line"))
    above.tick_params(color=placeholder("line"), labelcolor=placeholder("muted"))


def _frontier(axes: Axes, rows: Sequence[Row], coordinates: np.ndarray) -> None:
    """Steps through the rows that no other beats: all above and right of them costs more or errs more."""
    on = np.array([row.pareto for row in rows], dtype=bool)
    if not on.any():
        return
    chosen = coordinates[on][np.argsort(coordinates[on][:, 0], kind="stable")]
    x = np.append(chosen[:, 0], axes.get_xlim()[1])
    y = np.minimum.accumulate(chosen[:, 1])
    x, y = np.insert(x, 0, x[0]), np.concatenate([[axes.get_ylim()[1]], y, y[-1:]])
    axes.step(x, y, where="post", color=placeholder("ink"), linewidth=1.4, alpha=0.55, zorder=2)
    axes.fill_between(
        x, y, axes.get_ylim()[1], step="post", color=placeholder("line"), alpha=0.18, zorder=0, linewidth=0
    )


def _series(axes: Axes, rows: Sequence[Row], coordinates: np.ndarray) -> None:
    """A thin line through the same method with different numbers."""
    series: dict[tuple[str, str], list[int]] = {}
    for i, row in enumerate(rows):  # in the order of their settings
        series.setdefault((row.family, _setting(row)[0]), []).append(i)
    for (family, _), members in series.items():
        axes.plot(
            *coordinates[members].T, color=placeholder(style_of(family).color), linewidth=1.0, alpha=0.6, zorder=3
        )


def _symbol(axes: Axes, row: Row, point: np.ndarray, gid: str) -> None:
    """Filled for methods, hollow for counter-examples, ringed on the frontier."""
    style = style_of(row.family)
    color = placeholder(style.color)
    filled = row.kind in ("method", "cpu")
    if row.pareto:
        axes.plot(
            *point, "o", markersize=_SYMBOL + 8, markerfacecolor="none", markeredgecolor=placeholder("ink"), zorder=4
        )
    axes.plot(
        *point,
        linestyle="none",
        marker=style.marker,
        markersize=_SYMBOL + (3 if style.marker in _STARS else 0),
        markerfacecolor=color if filled else placeholder("paper"),
        markeredgecolor=placeholder("paper") if filled else color,
        markeredgewidth=0.6 if filled else 1.6,
        zorder=5,
        gid=gid,
    )


def _labels(axes: Axes, rows: Sequence[Row], coordinates: np.ndarray, names: Mapping[str, str]) -> None:
    """The label of every row, beside its symbol, with a line to it where it had to go farther."""
    figure = axes.figure
    renderer = figure.canvas.get_renderer()
    points = axes.transData.transform(coordinates)
    texts = [
        axes.text(
            *(0.0, 0.0, shortened(names[row.method])),
            ha="center",
            va="center",
            weight="bold" if row.pareto else "normal",
            size=FONT_SIZE - 1,
            zorder=6,
        )
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
            axes.plot(
                *back.transform(np.array([point, nearest])).T, color=placeholder("muted"), linewidth=0.7, zorder=3
            )
