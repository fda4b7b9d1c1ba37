"""Files that are dropped on the window: a session or a model, and an environment."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from translucent.preview.desk import Desk
from translucent.preview.environments import SUFFIXES


def take_dropped(desk: Desk, paths: Sequence[str]) -> None:
    """Open the first session or model, light it with the first environment, and tell of the others."""
    lights = [path for path in paths if Path(path).suffix.lower() in SUFFIXES]
    models = [path for path in paths if path not in lights]
    if lights:
        desk.environments.take(lights[0])
        desk.light_with(lights[0])
    if models and Path(models[0]).suffix.lower() == ".toml":
        desk.work.open_session(models[0])
    elif models:
        desk.work.open(dataclasses.replace(desk.work.document.model, path=models[0]))
    if others := [*models[1:], *lights[1:]]:
        names = ", ".join(Path(path).name for path in others[:3]) + (", ..." if len(others) > 3 else "")
        desk.work.tell("warning", f"{len(others)} dropped files are left out, as one model is shown at a time: {names}")
