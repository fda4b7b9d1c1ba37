"""The page of a report: HTML that needs no network, no scripts and no files beside it, from the record alone."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from translucent.bench import figures
from translucent.bench.claims import SHADOW_CLAIMS, USUAL
from translucent.bench.judgement import (
    ERROR_FLOOR,
    GOOD_ENOUGH,
    MAX_INVALID,
    WORST,
    advise,
    error_of,
    seen_words,
    summarize,
)
from translucent.bench.plots import AXES, UNITS, pareto_svg, plotted, scaling_groups, scaling_svg, shadow_plots
from translucent.bench.record import CaseRecord, Report, ReportPicture, Shadows, Slab

if TYPE_CHECKING:
    from jinja2 import Environment

#: Rows of a legend that stands beside its plot; longer ones stand below.
MOST_BESIDE = 22

#: Magnitudes of errors at which the color of a heat map changes: anything below the first has none.
STEPS = tuple(10.0**exponent for exponent in range(-7, 0))

#: Indices of colors in a heat map: none, and two stripes. Pixels from one stripe to the next.
_TRANSPARENT = 2 * len(STEPS) + 1
_STRIPE, _HATCH = _TRANSPARENT + 1, 6

#: Errors of slabs that are good, and that are bearable.
_GOOD, _BEARABLE = 0.03, 0.05


def build_page(report: Report) -> str:
    """The page as HTML. The same record gives the same text.

    Raises
    ------
    RenderError
        If the packages of the extra ``report`` are not installed.
    """
    figures.require_packages()
    from markupsafe import Markup

    cases = [_case(case, f"{n}-{_identifier(case.name)}") for n, case in enumerate(report.cases, start=1)]
    text: str = (
        _environment()
        .get_template("page.html.j2")
        .render(
            report=report,
            provenance=report.provenance,
            style=Markup(figures.css_variables() + "\n" + _resource("page.css")),
            cases=cases,
            answers=summarize([(case["record"], case["advice"]) for case in cases]),
            scaling=[
                {"axis": axis, "label": AXES[axis], "series": group, "svg": Markup(scaling_svg(axis, group))}
                for axis, group in scaling_groups(report.scaling).items()
            ],
            slabs=_slab_tables(report.slabs),
            shadows=None if report.shadows == Shadows() else report.shadows,
            shadow_claims=[judge(report) for judge in SHADOW_CLAIMS],
            shadow_plots={title: Markup(svg) for title, svg in shadow_plots(report.shadows).items()},
            usual=USUAL,
            scale=scale_colors(),
            good_enough=GOOD_ENOUGH,
            worst=WORST,
            max_invalid=MAX_INVALID,
            error_floor=ERROR_FLOOR,
            units=UNITS,
        )
    )
    return text


@cache
def _environment() -> Environment:
    """Templates, compiled once, that escape all values and fail on unknown names."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        loader=FunctionLoader(_resource),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        error=figures.error_text,
        limit=figures.limit_text,
        signed=figures.signed_error_text,
        ratio=figures.ratio_text,
        ms=figures.ms_text,
        share=figures.share_text,
        change=figures.change_text,
        signed_share=figures.signed_share_text,
        count=figures.count_text,
        rounded=figures.rounded_text,
        data=_data_address,
        heat=heat_map,
        seen=seen_words,
    )
    environment.globals.update(swatch=figures.swatch, mark=_mark)
    return environment


def _resource(name: str) -> str:
    return files("translucent.bench").joinpath("templates", name).read_text(encoding="utf-8")


def _identifier(name: str) -> str:
    """Name with only the characters of an HTML identifier."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "x"


def _case(case: CaseRecord, name: str) -> dict[str, Any]:
    """A case as the template shows it."""
    from markupsafe import Markup

    rows = plotted(case)
    tall = len(rows) > MOST_BESIDE
    index = {row.method: str(number) for number, row in enumerate(rows, start=1)}
    by_method = {row.method: row for row in case.rows}
    legend = [(index[row.method], row, error_of(row, case.quantity)) for row in rows]
    length = max(1, math.ceil(len(legend) / (3 if tall else 1)))
    refused: dict[str, list[str]] = {}
    for row in case.rows:
        if row.refusal is not None:
            refused.setdefault(row.refusal, []).append(row.method)
    lines = max(1, math.ceil(len(case.pictures) / 8))  # up to eight pictures in each, all about equally long
    return {
        "record": case,
        "id": name,
        "advice": advise(case),
        "legend": [legend[i : i + length] for i in range(0, len(legend), length)],
        "svg": Markup(pareto_svg(case, index, f"pareto-{name}", (1160, 560) if tall else (760, 520))) if rows else None,
        "pictures": [(picture, by_method.get(picture.method), heat_map(picture)) for picture in case.pictures],
        "picture_columns": max(6, math.ceil(len(case.pictures) / lines)),
        "measured": [row for row in case.rows if row.refusal is None and row.failure is None],
        "refused": refused,
        "scattered": [row for row in case.rows if row.light is not None],
        "failed": [row for row in case.rows if row.failure is not None],
        "sampled": any(row.sampled is not None for row in case.rows),
        "errors": [
            (row, words, errors)
            for row in case.rows
            for words, errors in (
                *((quantity, row.errors(quantity)) for quantity in UNITS),
                ("radiance, 16 samples", row.sampled),
            )
            if errors is not None
        ],
    }


def _slab_tables(slabs: Sequence[Slab]) -> list[dict[str, Any]]:
    """A table for each anisotropy and index of refraction: depths are its columns, rows are albedos with slabs."""
    tables: dict[tuple[float, float], list[Slab]] = {}
    for slab in slabs:
        tables.setdefault((slab.anisotropy, slab.ior), []).append(slab)
    return [
        {
            "anisotropy": anisotropy,
            "ior": ior,
            "depths": sorted({slab.depth for slab in members}),
            "rows": [
                (albedo, [slab for slab in members if slab.albedo == albedo])
                for albedo in sorted({slab.albedo for slab in members})
            ],
        }
        for (anisotropy, ior), members in tables.items()
    ]


def _mark(error: float) -> str:
    """Class of a cell with the error of a slab."""
    return "good" if abs(error) <= _GOOD else "" if abs(error) <= _BEARABLE else "bad"


def heat_map(picture: ReportPicture) -> str | None:
    """The error of a picture as a ``data:`` address; None where it has none.

    Too small is blue, too large red, pale to dark in steps of ten; what is not covered is transparent, and pixels that
    the method marks as invalid are striped. All pictures of the page have one scale.
    """
    from PIL import Image

    if picture.error is None:
        return None
    error = picture.error.array()
    known = np.where(np.isfinite(error), error, 0.0)
    indices = len(STEPS) + np.sign(known).astype(int) * np.searchsorted(STEPS, np.abs(known), side="right")
    indices = np.where(np.isfinite(error), indices, _TRANSPARENT)
    if picture.invalid is not None:
        rows, columns = np.indices(error.shape)
        stripes = np.where((rows + columns) % _HATCH < _HATCH // 2, _STRIPE, _STRIPE + 1)
        indices = np.where(picture.invalid.array(), stripes, indices)
    image = Image.fromarray(indices.astype(np.uint8))  # gray, until it has a palette
    image.putpalette([channel for color in _palette() for channel in color])
    stream = io.BytesIO()
    image.save(stream, format="PNG", transparency=_TRANSPARENT, optimize=True)
    return _data_address(base64.b64encode(stream.getvalue()).decode("ascii"))


def _data_address(png: str) -> str:
    """A PNG in base64 as an address."""
    return f"data:image/png;base64,{png}"


def scale_colors() -> list[tuple[str, str]]:
    """(color, least magnitude) of every step, from the most negative over none to the most positive."""
    powers = [figures.power_text(step) for step in STEPS]
    labels = [*(f"−{power}" for power in reversed(powers)), "0", *(f"+{power}" for power in powers)]
    colors = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in _palette()[: len(labels)]]
    return list(zip(colors, labels, strict=True))


@cache
def _palette() -> tuple[tuple[int, int, int], ...]:
    """Blue over white to red (a scale that color-blind readers can tell the ends of), transparent, and two stripes."""
    import matplotlib

    ends = 0.5 + 0.5 * np.linspace(0.14, 1.0, len(STEPS))
    positions = np.concatenate([1.0 - ends[::-1], [0.5], ends])
    colors = np.rint(matplotlib.colormaps["RdBu_r"](positions)[:, :3] * 255).astype(int)
    return (*(tuple(color) for color in colors.tolist()), (0, 0, 0), (90, 90, 90), (190, 190, 190))
