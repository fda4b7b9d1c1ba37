"""Frames per second of the previewer while a mesh of 81920 triangles is orbited, and what the frames are spent on.

``python tools/preview_speed.py [SECONDS] [--adaptive] [--stage=NAME]``, on a display (where there is none:
``xvfb-run -a -s "-screen 0 2000x900x24"``). The viewport has 1280 x 720 pixels, all of them drawn in every frame, or,
adaptive, as many as there is time for; around it are the panels as they are at the start. On a stage, the ball is
turned as soon as that is there.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from translucent.frames.animation import on_stage
from translucent.preview import app, viewport_renderer
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.document import Document, Look, Model
from translucent.preview.script import Script
from translucent.preview.window_state import WindowState

VIEWPORT = (1280, 720)


class Orbit(Script):
    """Turns the camera in every frame, and keeps the times."""

    seconds = 8.0

    def step(self, state: WindowState) -> bool:
        self.frames: list[float]
        if state.work.loaded is None or state.work.scene() is None:
            return False
        if state.get("look.stage") != "none" and not on_stage(state.work.scene()):
            return False
        if not hasattr(self, "started"):
            self.started, self.frames, self.inside, self.sizes = time.perf_counter(), [], [], set()
            state.work.do(SetField("display.inset", False))
        if state.work.compiler.lane.task is not None:  # the last picture stays
            self.started, self.frames, self.inside = time.perf_counter(), [], []
        self.frames.append(time.perf_counter())
        self.inside.append(state.view.drawing)
        self.sizes.add(state.view.viewport.size)
        state.work.do(OrbitBy(2.0, 0.0))
        return time.perf_counter() - self.started > self.seconds


def main() -> int:
    """Measure and print."""
    if "--adaptive" not in sys.argv:
        viewport_renderer.FACTORS = (1.0,)  # no coarser picture while it moves
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.05)
    ball.vertices *= 1.0 + 0.15 * np.sin(40.0 * ball.vertices)
    orbit = Orbit([])
    if seconds := [float(text) for text in sys.argv[1:] if not text.startswith("--")]:
        orbit.seconds = seconds[0]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.ply"
        ball.export(path)
        name = next((text.partition("=")[2] for text in sys.argv if text.startswith("--stage=")), "none")
        work = app.run(Document(Model(str(path)), look=Look(stage=name)), (1966, 808), script=orbit)
    frames, inside = np.diff(orbit.frames)[5:], np.array(orbit.inside[1:])[5:]
    print(f"{len(ball.faces)} triangles, viewport {orbit.sizes}, {len(frames)} frames")
    print(
        f"{1 / np.median(frames):.1f} frames per second (median), {1 / np.quantile(frames, 0.95):.1f} (95th percentile)"
    )
    print(f"renderer {1e3 * np.median(inside):.1f} ms, whole frame {1e3 * np.median(frames):.1f} ms,")
    print(f"share outside the renderer {1 - np.median(inside) / np.median(frames):.0%}")
    app.leave(work)
    return 0


if __name__ == "__main__":
    sys.exit(main())
