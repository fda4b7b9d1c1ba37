"""The plots of how cost grows with the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from translucent.bench.page.figure import FONT_SIZE, drawing, new_figure, shortened, to_svg
from translucent.bench.page.labels import spread
from translucent.bench.page.theme import placeholder, style_of
from translucent.bench.record import Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Quantity that each axis counts.
AXES = {
    "triangles": "triangles",
    "pixels": "pixels of the frame",
    "layers": "surfaces on each ray",
    "media": "different media",
}

#: Distance from the axes to the names of the lines, in pixels.
_LEADER = 14.0


def axis_groups(scaling: Sequence[Series]) -> dict[str, list[Series]]:
    """The series of each axis that has any numbers, in the order of `AXES`."""
    groups = {axis: [s for s in scaling if s.axis == axis and any(p.wall for p in s.points)] for axis in AXES}
    return {axis: series for axis, series in groups.items() if series}


@drawing
def scaling_svg(axis: str, group: Sequence[Series]) -> str:
    """Milliseconds of each method along one axis, both logarithmic."""
    figure, axes = new_figure(620, 400)
    ends: list[tuple[str, str, float, float]] = []
    for series in group:
        x, y = np.array([(p.x, p.wall.median) for p in series.points if p.wall is not None]).T
        style = style_of(series.family)
        color = placeholder(style.color)
        dashes = (0, (4, 3)) if series.family == "depth only" else "-"
        axes.plot(x, y, linestyle=dashes, color=color, marker=style.marker, markersize=6, linewidth=1.5)
        ends.append((series.method, style.color, float(x[-1]), float(y[-1])))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(AXES[axis])
    axes.set_ylabel("ms, median")
    _ticks(axes, sorted({p.x for s in group for p in s.points}))
    figure.subplots_adjust(left=0.115, right=0.97, bottom=0.135, top=0.97)
    end_labels(axes, ends)
    return to_svg(figure, f"scaling-{axis}", f"Milliseconds against {AXES[axis]}")


def _ticks(axes: Axes, measured: Sequence[int]) -> None:
    """The measured values on the horizontal axis, thinned out where they would touch."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    kept: list[int] = []
    reach = max(np.log(measured[-1] / measured[0]), 1e-9)
    for x in measured:
        if not kept or np.log(x / kept[-1]) / reach > 0.12:
            kept.append(x)
    axes.xaxis.set_major_locator(FixedLocator(kept))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: short_count(x)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    low, high = axes.get_ylim()
    if high / low < 30:  # a decade alone would have one tick
        axes.yaxis.set_major_locator(
            FixedLocator([d * s for d in 10.0 ** np.arange(-4, 7) for s in (1, 2, 5) if low <= d * s <= high])
        )
    axes.yaxis.set_minor_formatter(NullFormatter())


def short_count(x: float) -> str:
    """``4``, ``100k``, ``1M``."""
    for unit, name in ((1e6, "M"), (1e3, "k")):
        if x >= unit:
            return f"{x / unit:.3g}{name}"
    return f"{x:g}"


def end_labels(axes: Axes, ends: Sequence[tuple[str, str, float, float]]) -> None:
    """Names to the right of where the lines end, apart from each other, with a line to each."""
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
