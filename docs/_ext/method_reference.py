"""The method reference: each method's own docstring, and what the published report has measured of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

from translucent.planning.methods import METHODS

HEADER = "| scene | variant | time / floor | RMS error | p99.9 error | invalid |\n|---|---|---|---|---|---|"


def table(report: dict[str, Any], method: str) -> str:
    """Cost and error of a method on each scene of the report; of its variants there, the most exact one."""
    lines = []
    for case in report["cases"]:
        quantity = case["quantity"]
        ran = [row for row in case["rows"] if row["family"] == method and row["kind"] == "method"]
        ran = [row for row in ran if row["ratio"] and row[quantity]]
        if ran:
            row = min(ran, key=lambda row: (row[quantity]["rms"], row["ratio"]["median"]))
            error = row[quantity]
            lines.append(
                f"| {case['title']} | {row['method']} | {row['ratio']['median']:.2f} "
                f"| {error['rms']:.1e} | {error['p999']:.1e} | {row['invalid']:.1%} |"
            )
    return "\n".join([HEADER, *lines]) if lines else ""


def write_reference(app: Sphinx) -> None:
    """Write ``generated/methods.md``, which ``methods.md`` includes."""
    source = Path(app.srcdir)
    report = json.loads((source / "reports" / "software.json").read_text(encoding="utf-8"))
    parts = []
    for name, method in METHODS.items():
        parts += [
            f"## {method.__name__}",
            f"`--method {name}`",
            f"```{{eval-rst}}\n.. autoclass:: translucent.{method.__name__}\n```",
        ]
        parts.append(table(report, method.__name__))
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    (folder / "methods.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_reference)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
