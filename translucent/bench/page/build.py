"""The page of a report, from its record alone."""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from translucent.bench.frontier import ERROR_FLOOR, error_of
from translucent.bench.page import numbers
from translucent.bench.page.advice import GOOD_ENOUGH, MAX_INVALID, WORST, advise, summarize
from translucent.bench.page.figure import require_packages
from translucent.bench.page.pareto import UNITS, identifier, pareto_svg, plotted
from translucent.bench.page.pictures import data_address, heat_map, scale_colors
from translucent.bench.page.scaling import AXES, axis_groups, scaling_svg
from translucent.bench.page.shadows import shadow_section
from translucent.bench.page.slabs import mark, slab_tables
from translucent.bench.page.swatch import swatch
from translucent.bench.page.theme import css_variables
from translucent.bench.record import CaseRecord, Report
from translucent.bench.seeing import seen_words
from translucent.files.paths import write_text_atomically

#: Rows of a legend that stands beside its plot; longer ones stand below.
MOST_BESIDE = 22


def write_page(report: Report, path: Path) -> None:
    """Write ``report.html``: complete, or not at all."""
    write_text_atomically(path, build_page(report))


def build_page(report: Report) -> str:
    """The page as HTML that needs nothing else: no network, no scripts, no files beside it.

    The same record gives the same text.

    Raises
    ------
    RenderError
        If the packages of the extra ``report`` are not installed.
    """
    require_packages()
    from markupsafe import Markup

    template = _environment().get_template("page.html.j2")
    style = css_variables() + "\n" + _resource("page.css")
    cases = [_case(case, f"{n}-{identifier(case.name)}") for n, case in enumerate(report.cases, start=1)]
    text: str = template.render(
        report=report,
        provenance=report.provenance,
        style=Markup(style),
        cases=cases,
        answers=summarize([(case["record"], case["advice"]) for case in cases]),
        scaling=[
            {"axis": axis, "label": AXES[axis], "series": group, "svg": Markup(scaling_svg(axis, group))}
            for axis, group in axis_groups(report.scaling).items()
        ],
        slabs=slab_tables(report.slabs),
        shadows=shadow_section(report.shadows),
        scale=scale_colors(),
        good_enough=GOOD_ENOUGH,
        worst=WORST,
        max_invalid=MAX_INVALID,
        error_floor=ERROR_FLOOR,
        units=UNITS,
    )
    return text


@cache
def _environment() -> Any:
    """Templates, compiled once, that escape whatever they are given, and fail on a name that they were not given."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        loader=FunctionLoader(_resource),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        error=numbers.error_text,
        limit=numbers.limit_text,
        signed=numbers.signed_error_text,
        ratio=numbers.ratio_text,
        ms=numbers.ms_text,
        share=numbers.share_text,
        change=numbers.change_text,
        signed_share=numbers.signed_share_text,
        count=numbers.count_text,
        rounded=numbers.rounded_text,
        data=data_address,
        heat=heat_map,
        seen=seen_words,
    )
    environment.globals.update(swatch=swatch, mark=mark)
    return environment


def _case(case: CaseRecord, name: str) -> dict[str, Any]:
    """A case as the template shows it."""
    from markupsafe import Markup

    rows = plotted(case)
    tall = len(rows) > MOST_BESIDE
    index = {row.method: str(number) for number, row in enumerate(rows, start=1)}
    by_method = {row.method: row for row in case.rows}
    return {
        "record": case,
        "id": name,
        "advice": advise(case),
        "legend": _parts([(index[row.method], row, error_of(row, case.quantity)) for row in rows], 3 if tall else 1),
        "svg": Markup(pareto_svg(case, index, f"pareto-{name}", (1160, 560) if tall else (760, 520))) if rows else None,
        "pictures": [(picture, by_method.get(picture.method), heat_map(picture)) for picture in case.pictures],
        "picture_columns": _columns(len(case.pictures)),
        "measured": [row for row in case.rows if row.refusal is None and row.failure is None],
        "refused": _refusals(case),
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


def _refusals(case: CaseRecord) -> dict[str, list[str]]:
    """The methods that each reason keeps from this scene."""
    found: dict[str, list[str]] = {}
    for row in case.rows:
        if row.refusal is not None:
            found.setdefault(row.refusal, []).append(row.method)
    return found


def _parts(rows: list[Any], count: int) -> list[list[Any]]:
    """The rows in so many parts, of equal length but for the last."""
    length = max(1, math.ceil(len(rows) / count))
    return [rows[i : i + length] for i in range(0, len(rows), length)]


def _columns(count: int) -> int:
    """Number of columns of pictures: up to eight in a row, the rows as equal as can be."""
    rows = max(1, math.ceil(count / 8))
    return max(6, math.ceil(count / rows))


def _resource(name: str) -> str:
    return files("translucent.bench.page").joinpath(name).read_text(encoding="utf-8")
