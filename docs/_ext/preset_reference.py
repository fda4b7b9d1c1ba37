"""Mean colors of presets on the ball against path-traced truth, as a table for the page on media."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

#: Largest deviation of a channel that passes.
MOST = 0.1


def rows(measured: dict[str, Any]) -> list[str]:
    """A row for each preset: ratios of the mean color, drawn over true, in each environment."""
    environments = list(dict.fromkeys(name for one in measured.values() for name in one["colors"]))
    lines = [
        f"| preset | {' | '.join(environments)} | standard error | within 10 % |",
        "|---" * (len(environments) + 3) + "|",
    ]
    for name, one in measured.items():
        ratios = {
            where: [drawn / true for drawn, true in zip(found["drawn"], found["truth"], strict=True)]
            for where, found in one["colors"].items()
        }
        errors = [
            error / true
            for found in one["colors"].values()
            for error, true in zip(found["error"], found["truth"], strict=True)
        ]
        cells = [", ".join(f"{ratio:.2f}" for ratio in ratios.get(where, [])) for where in environments]
        passed = all(abs(ratio - 1) <= MOST for found in ratios.values() for ratio in found)
        lines.append(f"| {name} | {' | '.join(cells)} | {max(errors):.1%} | {'yes' if passed else 'no'} |")
    return lines


def write_table(app: Sphinx) -> None:
    """Write ``generated/presets.md``, which ``media.md`` includes."""
    source = Path(app.srcdir)
    measured = json.loads((source / "presets" / "measured.json").read_text(encoding="utf-8"))["presets"]
    folder = source / "generated"
    folder.mkdir(exist_ok=True)
    (folder / "presets.md").write_text("\n".join(rows(measured)) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_table)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
