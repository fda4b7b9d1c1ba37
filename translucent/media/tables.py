"""Tables written by hand: rows of a CSV file or of a JSON list, each with its location for error messages."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from translucent.errors import InputError
from translucent.files.reading import json_value, read_text
from translucent.media.colors import parse_color
from translucent.units import parse_length


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes
    ----------
    location : str
        Where it is: ``FILE line N``, or ``FILE item N`` of a JSON list.
    cells : dict
        Values by column; CSV has text only, without the spaces around it. An empty cell is absent.
    """

    location: str
    cells: dict[str, Any]

    def need(self, column: str) -> Any:
        """Value of a required column."""
        if column not in self.cells:
            raise InputError(column, "missing", "fill it in")
        return self.cells[column]

    def length(self, column: str, unit: str) -> float:
        """Length of a column in metres, read in `unit` if it names none."""
        return parse_length(str(self.need(column)), unit)

    def color(self) -> Any:
        """Linear color of the column ``color``, or of the columns ``r``, ``g`` and ``b`` (linear) without it."""
        if "color" not in self.cells and "r" in self.cells:
            return parse_color([self.number(channel) for channel in "rgb"])
        return parse_color(self.need("color"))

    def number(self, column: str) -> float:
        """Number of a column."""
        try:
            return float(self.need(column))
        except (TypeError, ValueError):
            raise InputError(f"{column} {self.cells[column]!r}", "not a number", "give a number") from None


def read_table(path: str | Path, *, needs: Iterable[tuple[str, ...]]) -> list[Row]:
    """Rows of a ``.json`` file (a list of objects), or of CSV text with a line of column names.

    Parameters
    ----------
    path : str or Path
    needs : iterable of tuple of str
        Columns that a CSV table must have; of each tuple, one is enough.

    Raises
    ------
    InputError
        If the file cannot be read, holds no row, or lacks a column.
    """
    what = f"table {str(path)!r}"
    text = read_text(path, what, do="save it as CSV or JSON, in UTF-8")
    rows = _json_rows(what, path, text) if Path(path).suffix.lower() == ".json" else _csv_rows(path, text, needs)
    if not rows:
        raise InputError(what, "no rows", "give at least one")
    return rows


def _csv_rows(path: str | Path, text: str, needs: Iterable[tuple[str, ...]]) -> list[Row]:
    what, reader = f"table {str(path)!r}", csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    rows: list[Row] = []
    try:
        names = [name.strip().lower() for name in next((line for line in reader if any(line)), [])]
        for choice in needs:
            if not set(choice) & set(names):
                found = f"no column {' or '.join(repr(name) for name in choice)}"
                has = f"its first line says {', '.join(names)}" if names else "it is empty"
                raise InputError(what, f"{found}: {has}", "name the columns in the first line")
        for line in reader:
            cells = [cell.strip() for cell in line]
            if any(cells):
                named = {name: cell for name, cell in zip(names, cells, strict=False) if cell}
                spare = {"": "cells"} if any(cells[len(names) :]) else {}
                rows.append(Row(f"{path} line {reader.line_num}", {**named, **spare}))
    except csv.Error as error:
        raise InputError(what, f"line {reader.line_num}: {error}", "save it as CSV") from None
    return rows


def _json_rows(what: str, path: str | Path, text: str) -> list[Row]:
    try:
        items = json_value(text)
    except ValueError as error:
        raise InputError(what, f"no JSON: {error}", "write a list of objects with color and distance") from None
    if not (isinstance(items, list) and all(isinstance(item, dict) for item in items)):
        raise InputError(what, "not a list of objects", 'write [{"name": ..., "color": ..., "distance": ...}]')
    return [
        Row(f"{path} item {i}", {name: value for name, value in item.items() if value not in (None, "")})
        for i, item in enumerate(items, 1)
    ]


def check_cells(row: Row) -> None:
    """Refuse a row with more cells than columns: most often an unquoted color with commas."""
    if "" in row.cells:
        raise InputError("cells", "more than there are columns", 'quote a color with commas: "linear(.2,.6,.3)"')
