"""Overview figure of the whole report, as a separate file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from translucent.bench.page.figure import require_packages, standalone
from translucent.bench.page.pareto import pareto_svg, plotted
from translucent.bench.record import CaseRecord, Report
from translucent.errors import InputError
from translucent.files.paths import write_text_atomically

#: Left out: the backend without OpenGL, which is off the scale, and methods for what this scene does not have.
_LEFT_OUT = {"cpu backend", "RayMarched on the CPU", "RayMarched"}


def write_overview(report: Report, path: Path) -> None:
    """Write ``report.svg``: complete, or not at all.

    Raises
    ------
    InputError
        If the report has no scene with numbers.
    """
    write_text_atomically(path, overview_svg(report))


def overview_svg(report: Report) -> str:
    """Cost against error on the first closed, concave scene that only absorbs, with the names of the methods."""
    require_packages()
    cases = _shown(report)
    if not cases:
        raise InputError("the figure of the report", "no scene in it has numbers", "measure at least one")
    wanted = [case for case in cases if case.closed and case.absorption_only and not case.convex]
    case = (wanted or cases)[0]
    names = {row.method: row.method for row in case.rows}
    device = "software rasterizer" if report.provenance.software else report.provenance.renderer
    title = f"{case.title}, {case.size[0]} × {case.size[1]}, {device}"
    return standalone(pareto_svg(case, names, "overview", (900, 520), title))


def has_overview(report: Report) -> bool:
    """True if there is anything to draw."""
    return bool(_shown(report))


def _shown(report: Report) -> list[CaseRecord]:
    """The cases with anything to draw."""
    return [case for case in map(_reduced, report.cases) if plotted(case)]


def _reduced(case: CaseRecord) -> CaseRecord:
    rows = tuple(row for row in case.rows if row.family not in _LEFT_OUT)
    return dataclasses.replace(case, rows=rows)
