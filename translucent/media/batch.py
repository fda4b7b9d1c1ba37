"""Conversion of tables of colors at distances to extinction; a bad row does not stop the others."""

from __future__ import annotations

import json
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from translucent.errors import InputError
from translucent.files.paths import csv_text, require_output, write_atomically
from translucent.media.conversion import CLAMP, clamp_colors, html_strip, summary
from translucent.media.medium import Medium
from translucent.media.preset import Row, check_cells, read_table
from translucent.units import metres_per_unit

#: Largest number of rows in a table of swatches.
MOST_SHOWN = 30

_TRIPLES = ("color", "extinction", "mean_free_path", "half_value_thickness", "condition_number", "extinction_per_unit")


@dataclass(frozen=True)
class Batch:
    """Result of converting a table.

    Attributes
    ----------
    records : list of dict
        Per good row its name, and what `conversion.summary` says.
    errors : list of str
        Per bad row its location and what is wrong.
    clamped : int
        Records whose color was clamped.
    """

    records: list[dict[str, Any]]
    errors: list[str]
    clamped: int = 0

    def write(self, path: Path) -> None:
        """Write the records to a ``.json`` or ``.csv`` file, which appears complete or not at all."""
        check_batch_output(path)
        text = self.to_csv() if path.suffix.lower() == ".csv" else self.to_json()

        def fill(temporary: Path) -> None:
            temporary.write_text(text, encoding="utf-8", newline="")

        write_atomically(path, fill)

    def _repr_html_(self) -> str:
        """Names, swatches and errors, for notebooks; of long tables the first rows."""
        parts = [
            f"<div>{escape(one['name'])}</div>{html_strip(one['extinction'], one['distance'])}"
            for one in self.records[:MOST_SHOWN]
        ]
        if (more := len(self.records) - MOST_SHOWN) > 0:
            parts.append(f"<div>and {more} more</div>")
        return "".join([*parts, *(f"<div>error: {escape(line)}</div>" for line in self.errors[:MOST_SHOWN])])

    def to_json(self) -> str:
        """The records as a JSON list, one record per line; null is infinity."""
        return "[\n" + ",\n".join(json.dumps(record) for record in self.records) + "\n]\n"

    def to_csv(self) -> str:
        """The records as CSV: triples in columns ``_r``, ``_g``, ``_b``, warnings joined by `` | ``."""
        columns = ["name", "distance", "unit", *(f"{name}_{c}" for name in _TRIPLES for c in "rgb"), "warnings"]
        rows = []
        for record in self.records:
            triples = {
                f"{name}_{c}": "inf" if value is None else repr(value)
                for name in _TRIPLES
                for c, value in zip("rgb", record[name], strict=True)
            }
            rows.append({**record, **triples, "warnings": " | ".join(record["warnings"])})
        return csv_text(columns, rows)


def convert_table(path: str | Path, unit: str = "m", unit_out: str = "m", clamp: bool = False) -> Batch:
    """Convert every row of a table.

    Parameters
    ----------
    path : str or Path
        CSV with the columns ``name``, ``color``, ``distance`` and, if lengths name none, ``unit``; or a JSON list of
        objects with these keys, in which a color may also be a linear triple.
    unit : str
        Of distances for which neither they nor their row name one.
    unit_out : str
        The records also hold the extinction per this unit.
    clamp : bool
        Whether channels of 0 become 1e-4; a record's warnings say where it happened.

    Raises
    ------
    InputError
        If the table as a whole cannot be used.
    """
    metres_per_unit(unit), metres_per_unit(unit_out)
    records: list[dict[str, Any]] = []
    errors: list[str] = []
    clamped = 0
    for row in read_table(path, needs=[("name",), ("color",), ("distance",)]):
        try:
            record, changed = _record(row, unit, unit_out, clamp)
        except InputError as error:
            errors.append(f"{row.location}: {error}")
        else:
            records.append(record)
            clamped += changed
    return Batch(records, errors, clamped)


def check_batch_output(path: Path) -> None:
    """Raise before any work is done if a table could not be written to `path`."""
    if path.suffix.lower() not in (".json", ".csv"):
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .json or .csv")
    require_output(path, f"output {str(path)!r}")


def _record(row: Row, unit: str, unit_out: str, clamp: bool) -> tuple[dict[str, Any], bool]:
    """The record of a row, and whether its color was clamped."""
    check_cells(row)
    name, color = str(row.need("name")), row.color()
    distance = row.length("distance", str(row.cells.get("unit", unit)))
    lighter, channels = clamp_colors(color)
    changed = clamp and bool(channels.any())
    kept = lighter if changed else color
    medium = Medium.from_color(kept, distance)
    found = summary(kept, distance, medium.extinction, unit_out)
    if changed:
        found["warnings"].insert(0, f"color clamped to {CLAMP:g} where it was below")
    return {"name": name, **found}, changed
