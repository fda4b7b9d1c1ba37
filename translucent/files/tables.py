"""Tables as CSV text."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence

#: Beginnings of cells that spreadsheets run as formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\n")


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> str:
    """Write rows as CSV, below the names of their columns; other keys of a row are left out.

    A text that a spreadsheet would run as a formula gets an apostrophe before it, and all its line ends are ``\\n``, as
    the module csv leaves others without quotes. Numbers stay as they are.
    """
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _harmless(cell) for name, cell in row.items()} for row in rows)
    return stream.getvalue()


def _harmless(cell: object) -> object:
    if not isinstance(cell, str):
        return cell
    text = cell.replace("\r\n", "\n").replace("\r", "\n")
    if not text.startswith(_FORMULAS):
        return text
    try:
        list(map(float, text.split()))
    except ValueError:
        return f"'{text}"
    return text
