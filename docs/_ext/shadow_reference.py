"""Tables of what the published report has measured of shadows and caustics, for the page on methods."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

from sphinx.application import Sphinx


def cell(value: float | None, form: str = ".1e") -> str:
    """A number, or nothing where there is none."""
    return "" if value is None else format(value, form)


def errors(cases: list[dict[str, Any]]) -> list[str]:
    """Errors of maps, a row for each scene."""
    lines = [
        "| scene | rays of texels: p99.9 | 1024: median, p99 | 4096: median, p99 "
        "| with outlines, mean: 512, 1024, 2048, 4096 | time / depth alone, 1024 |",
        "|---|---|---|---|---|---|",
    ]
    for case in cases:
        rows = {row["size"]: row for row in case["rows"] if row["kind"] == "method" and row["errors"]}
        of = [
            f"{rows[n]['errors']['median']:.1e}, {rows[n]['errors']['p99']:.1e}" if n in rows else ""
            for n in (1024, 4096)
        ]
        outlines = ", ".join(cell(rows[n]["edges"]) for n in sorted(rows))
        texels = case["texels"] and case["texels"]["p999"]
        ratio = rows[1024]["ratio"] if 1024 in rows else None
        cost = cell(ratio and ratio["median"], ".2f")
        lines.append(f"| {case['title']} | {cell(texels)} | {of[0]} | {of[1]} | {outlines} | {cost} |")
    return lines


def shortcuts(cases: list[dict[str, Any]]) -> list[str]:
    """Errors of what others do: the median over the scenes, and the least and the largest."""
    found: dict[str, list[float]] = {}
    for row in (row for case in cases for row in case["rows"] if row["kind"] != "method" and row["errors"]):
        found.setdefault(row["method"], []).append(row["errors"]["median"])
    lines = ["| instead | error, median of the scenes | least, largest |", "|---|---|---|"]
    return [
        *lines,
        *(f"| {name} | {median(some):.1e} | {min(some):.1e}, {max(some):.1e} |" for name, some in found.items()),
    ]


def directions(rows: list[dict[str, Any]]) -> list[str]:
    """Errors by the number of directions, a row for each environment."""
    counts = sorted({row["directions"] for row in rows})
    lines = [f"| environment | {' | '.join(map(str, counts))} |", "|---" * (len(counts) + 1) + "|"]
    for name in dict.fromkeys(row["environment"] for row in rows):
        of = {row["directions"]: row["error"] for row in rows if row["environment"] == name}
        lines.append(f"| {name} | {' | '.join(cell(of.get(count), '.3f') for count in counts)} |")
    return lines


def caustics(cases: list[dict[str, Any]]) -> list[str]:
    """Errors by the number of photons, a column for each scene."""
    lines = [
        f"| photons | {' | '.join(case['title'] + ': power, nRMSE (at most), seconds' for case in cases)} |",
        "|---" * (len(cases) + 1) + "|",
    ]
    for count in sorted({row["photons"] for case in cases for row in case["rows"]}):
        cells = [
            f"{row['power']:+.2%}, {row['nrmse']:.3f} ({row['most']:.3f}), {row['seconds']:.1f}"
            for case in cases
            for row in case["rows"]
            if row["photons"] == count
        ]
        lines.append(f"| {count:,} | {' | '.join(cells)} |")
    return lines


def media(cases: list[dict[str, Any]]) -> list[str]:
    """Errors in media with photons and without, a row for each scene."""
    lines = ["| | mean, of a truth uncertain by | nRMSE (at most) | without photons |", "|---|---|---|---|"]
    for case in cases:
        rows = {bool(row["photons"]): row for row in case["rows"]}
        of = {there: f"{row['nrmse']:.2f} ({row['most']:.2f})" for there, row in rows.items()}
        mean = f"{rows[True]['power']:+.1%}, {case['noise']:.1%}"
        lines.append(f"| {case['title']} | {mean} | {of[True]} | {rows[False]['power']:+.1%}, {of[False]} |")
    return lines


def write_tables(app: Sphinx) -> None:
    """Write the files that ``methods.md`` includes."""
    source = Path(app.srcdir)
    found = json.loads((source / "reports" / "software.json").read_text(encoding="utf-8"))["shadows"]
    cases = [case for case in found["cases"] if not case["failure"]]
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    for name, lines in {
        "shadows": [*errors(cases), "", *shortcuts(cases)],
        "shadow_directions": directions(found["sky"]),
        "caustics": caustics([case for case in found["caustics"] if case["rows"]]),
        "caustics_in_media": media([case for case in found.get("media", ()) if case["rows"]]),
    }.items():
        (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
