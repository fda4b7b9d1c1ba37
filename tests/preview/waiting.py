"""For tests of the previewer: what the background does is waited for, and pictures are drawn to their end."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.processes import PATIENCE, until
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace

SIZE = (112, 64)


def environment(display: str, folder: Path) -> dict[str, str]:
    """Variables of a window with folders of its own, but for shaders, which need not be compiled for each again."""
    own = {"DISPLAY": display, "XDG_CONFIG_HOME": str(folder), "XDG_CACHE_HOME": str(folder)}
    shaders = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return {"MESA_SHADER_CACHE_DIR": shaders, **os.environ, **own}


def wait(work: Workspace, done: Callable[[], object]) -> None:
    """Until something is so, with the background's results taken over."""
    until(lambda: done() or work.update())


def finish(view: ViewportRenderer, work: Workspace) -> None:
    """Draw until nothing is left to draw, or to be compiled or solved for it."""
    end = time.monotonic() + PATIENCE
    lanes = work.compiler.lane, work.lanes["diffuse"], work.lanes["trace"]
    while view.draw(work, SIZE) | (busy := work.relights or any(lane.task is not None for lane in lanes)):
        assert time.monotonic() < end, "the picture is never done"
        work.update()
        if busy:
            time.sleep(0.01)  # a view that waits for a lane returns at once: turning round, it would slow the lane


def pixels(view: ViewportRenderer) -> np.ndarray:
    """The picture on show."""
    with view.current():
        return view.viewport.pixels().astype(int)
