"""Tables of the benchmark: what renderers scored here, and how far judges agree with the truth."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from translucent.benchmark.scenes import SCENES
from translucent.benchmark.truth import read_records

if TYPE_CHECKING:
    from sphinx.application import Sphinx

Results = dict[str, Any]


def published(folder: Path) -> list[Results]:
    """Results that lie in a folder, each a results.json of a renderer; the nearest to the truth first."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]
    return sorted(found, key=lambda one: median(errors(one).values() or [9.0]))


def errors(results: Results) -> dict[str, float]:
    """nRMSE by scene."""
    scores = {name: one["score"] for name, one in results["scenes"].items() if one["score"]}
    return {name: score["nrmse"] for name, score in scores.items() if score["nrmse"] is not None}


def number(value: float | None) -> str:
    """Two digits."""
    return "" if value is None else f"{value:.2g}" if value >= 1e-3 else f"{value:.0e}"


def machines(results: list[Results]) -> list[str]:
    """Table of renderers, versions, settings and machines."""
    lines = ["| renderer | settings | device | machine | date |", "|---|---|---|---|---|"]
    for one in results:
        texts = (f"{one['name']} {one['version']}", one["settings"], one["device"], one["machine"], one["date"])
        lines.append("| " + " | ".join(text.replace("|", "/") for text in texts) + " |")
    return lines


def scores(results: list[Results]) -> list[str]:
    """nRMSE of each renderer on each scene, and time by the floor's; the nearest in bold."""
    lines = ["| scene | " + " | ".join(one["name"] for one in results) + " |", "|---|" + "--:|" * len(results)]
    for scene in SCENES:
        known = [errors(one).get(scene.name) for one in results]
        if not any(value is not None for value in known):
            continue
        best = min(value for value in known if value is not None)
        cells = []
        for one, value in zip(results, known, strict=True):
            result = one["scenes"].get(scene.name, {})
            ratio = result["seconds"] / result["floor"] if result.get("seconds") and result.get("floor") else None
            text = f"**{number(value)}**" if value == best else number(value)
            cells.append(
                f"{text} ({number(ratio) if ratio and ratio < 10 else f'{ratio:.0f}'})" if ratio and text else text
            )
        lines.append(f"| {scene.title} | " + " | ".join(cells) + " |")
    return lines


def thickness(results: list[Results]) -> list[str]:
    """Errors of thickness, 99 % of the pixels, as fractions of the largest thickness."""
    able = [one for one in results if any((s["score"] or {}).get("thickness") for s in one["scenes"].values())]
    lines = ["| scene | " + " | ".join(one["name"] for one in able) + " |", "|---|" + "--:|" * len(able)]
    for scene in (one for one in SCENES if one.thickness):
        found = [((one["scenes"].get(scene.name) or {}).get("score") or {}).get("thickness") for one in able]
        if any(found):
            lines.append(f"| {scene.title} | " + " | ".join(number(one and one["p99"]) for one in found) + " |")
    return lines


def truths() -> list[str]:
    """Noise of each truth, and its judges."""
    lines = ["| scene | noise of a half | the reference | Mitsuba |", "|---|--:|---|---|"]
    records = read_records()
    for scene in SCENES:
        record = records.get(scene.name)
        if record is None:
            lines.append(f"| {scene.title} | no truth yet | | |")
            continue
        said = [
            f"{100 * one.within:.1f} %, mean {100 * one.bias:+.2f} %" if one.paths else one.explained
            for one in record.agreements
        ]
        lines.append(f"| {scene.title} | {100 * record.noise:.1f} % | {said[0]} | {said[1]} |")
    return lines


def write_tables(app: Sphinx) -> None:
    """Write the files that the page includes."""
    source = Path(app.srcdir)
    results = published(source / "reports" / "benchmark")
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    tables = {
        "benchmark_machines": machines(results),
        "benchmark_scores": scores(results),
        "benchmark_thickness": thickness(results),
        "benchmark_truths": truths(),
    }
    for name, lines in tables.items():
        (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
