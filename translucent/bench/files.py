"""Reports as files: ``report.json``, which holds everything, and ``report.csv``, a line for each row."""

from __future__ import annotations

import csv
import dataclasses
import io
from pathlib import Path
from typing import Any, get_args, get_type_hints

from translucent.bench.record import CaseRecord, Report
from translucent.bench.row import Row
from translucent.files.paths import write_text_atomically
from translucent.files.reading import read_text

#: Largest size of a report in bytes: it holds pictures.
_LARGEST = 1 << 28

#: Fields of a row that are dataclasses, one column for each of their fields.
_GROUPS = (
    *("wall", "gpu", "frame", "ratio", "frame_ratio"),
    *("thickness", "transmittance", "radiance", "sampled", "color_difference", "light"),
)


def write_report(report: Report, path: Path) -> None:
    """Write ``report.json``: complete, or not at all."""
    write_text_atomically(path, report.to_json())


def read_report(path: Path) -> Report:
    """Read the report of a file.

    Raises
    ------
    InputError
        If it cannot be read, or is no report.
    """
    text = read_text(path, f"report {str(path)!r}", _LARGEST, do="give a report.json")
    return Report.from_json(text, path.name)


def write_csv(report: Report, path: Path) -> None:
    """Write the rows of all cases, one a line, under the names of their fields: ``thickness.rms``, ``wall.median``."""
    lines = [_flat(case, row) for case in report.cases for row in case.rows]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, _columns(), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    write_text_atomically(path, stream.getvalue())


def _columns() -> list[str]:
    columns = ["case", "quantity", "triangles", "size", "compared_size"]
    hints = get_type_hints(Row)
    for field in dataclasses.fields(Row):
        if field.name in _GROUPS:
            group = next(kind for kind in get_args(hints[field.name]) if kind is not type(None))
            columns += [f"{field.name}.{part.name}" for part in dataclasses.fields(group)]
        else:
            columns.append(field.name)
    return columns


def _flat(case: CaseRecord, row: Row) -> dict[str, Any]:
    line: dict[str, Any] = {
        "case": case.name,
        "quantity": case.quantity,
        "triangles": case.triangles,
        "size": "x".join(map(str, case.size)),
        "compared_size": "x".join(map(str, case.compared_size)),
    }
    for name, value in dataclasses.asdict(row).items():
        if isinstance(value, dict):
            line.update({f"{name}.{part}": _cell(number) for part, number in value.items()})
        elif value is not None:
            line[name] = value
    return line


def _cell(value: Any) -> Any:
    """A number, or those of the channels with spaces between them."""
    return " ".join(map(str, value)) if isinstance(value, tuple) else value
