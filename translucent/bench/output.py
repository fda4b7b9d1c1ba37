"""The folder of a report: record, table, page and figure."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from translucent.bench.files import write_csv, write_report
from translucent.bench.page.build import write_page
from translucent.bench.page.figure import require_packages
from translucent.bench.page.overview import has_overview, write_overview
from translucent.bench.record import Report
from translucent.errors import RenderError
from translucent.files.folders import made_folder
from translucent.files.paths import require_folder


@contextmanager
def checked_folder(folder: Path) -> Iterator[None]:
    """Make the folder if it is not there, and raise before any work is done where nothing could be written into it.

    After an error a folder that was made and is empty is removed.

    Raises
    ------
    InputError
        If its name, or that of a folder above, is one of a file.
    RenderError
        If it cannot be made or written to, or what draws the page is not installed.
    """
    require_folder(folder, f"output {str(folder)!r}")
    require_packages()
    with made_folder(folder):
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise RenderError(
                f"output {str(folder)!r}",
                f"it is no folder that can be written to ({error.strerror or error})",
                "check its permissions",
            ) from error
        yield


def write_outputs(report: Report, folder: Path) -> list[Path]:
    """Write ``report.json``, ``.csv``, ``.html`` and ``.svg`` into a folder, each complete or not at all.

    The figure is left out where no scene has numbers, and one of an earlier report removed.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    RenderError
        If a file cannot be written.
    """
    writers = {"report.json": write_report, "report.csv": write_csv, "report.html": write_page}
    if has_overview(report):
        writers["report.svg"] = write_overview
    elif os.path.lexists(folder / "report.svg"):
        (folder / "report.svg").unlink()
    for name, write in writers.items():
        write(report, folder / name)
    return [folder / name for name in writers]
