"""Speed against error, measured in one run: `measure_all` makes a `Report`, which ``output.write_outputs`` writes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from translucent.bench.judgement import Change, compare_reports
from translucent.bench.output import read_report, write_csv, write_report
from translucent.bench.record import Report

if TYPE_CHECKING:
    from translucent.bench.run import ReportRequest, measure_all

__all__ = [
    "Change",
    "Report",
    "ReportRequest",
    "compare_reports",
    "measure_all",
    "read_report",
    "write_csv",
    "write_report",
]


def __getattr__(name: str) -> Any:
    # Reading and comparing reports needs no OpenGL, so it does not load it.
    if name in ("ReportRequest", "measure_all"):
        from translucent.bench import run

        return getattr(run, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
