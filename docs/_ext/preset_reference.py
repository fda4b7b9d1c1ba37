"""Mean colors of media on the ball against path-traced truth, as tables for the page on named media."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: Largest deviation of a channel that passes, of our pictures and of those of Blender.
MOST, MOST_BLENDER = 0.1, 0.05

#: What measures each file.
TOOLS = {"measured": "measure_presets.py", "blender": "measure_blender.py"}


def rows(measured: dict[str, Any], what: str = "drawn", most: float = MOST) -> list[str]:
    """A row for each medium: ratios of the mean color, `what` over true, in each environment."""
    environments = list(dict.fromkeys(name for one in measured.values() for name in one["colors"]))
    lines = [
        f"| medium | {' | '.join(environments)} | standard error | within {100 * most:.0f} % |",
        "|---" * (len(environments) + 3) + "|",
    ]
    for name, one in measured.items():
        ratios = {
            where: [drawn / true for drawn, true in zip(found[what], found["truth"], strict=True)]
            for where, found in one["colors"].items()
        }
        errors = [
            error / true
            for found in one["colors"].values()
            for error, true in zip(found["error"], found["truth"], strict=True)
        ]
        cells = [", ".join(f"{ratio:.2f}" for ratio in ratios.get(where, [])) for where in environments]
        passed = all(abs(ratio - 1) <= most for found in ratios.values() for ratio in found)
        lines.append(f"| {name} | {' | '.join(cells)} | {max(errors):.1%} | {'yes' if passed else 'no'} |")
    return lines


def write_tables(app: Sphinx) -> None:
    """Write ``generated/presets.md`` and ``generated/blender.md``, which ``measurements/media.md`` includes."""
    source = Path(app.srcdir)
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    for name, file, key, what, most in (
        ("presets", "measured", "presets", "drawn", MOST),
        ("blender", "blender", "materials", "cycles", MOST_BLENDER),
    ):
        data = json.loads((source / "presets" / f"{file}.json").read_text(encoding="utf-8"))
        day = date.fromisoformat(data["written"])
        machine = f", on: {data['renderer']}" if "renderer" in data else ""
        origin = f"*Last measured on {day.day} {day:%B %Y}, by `python tools/{TOOLS[file]}`{machine}.*"
        lines = [*rows(data[key], what, most), "", origin]
        (folder / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
