"""The longest frames of the previewer, and what the user had just done: ``python tools/preview_blocks.py [MODEL...]``.

On a display (where there is none: ``xvfb-run -a -s "-screen 0 2000x1000x24"``). The window opens with a built-in mesh
and does one thing after the other, and all of it once more: what OpenGL compiles when it first sees a method, it has
then. For each are told the longest frame in milliseconds, how much of that the renderer took, and how long it was until
all was at rest. Models are opened after that, and turned.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field

from translucent.preview import app
from translucent.preview.document import Document, Model
from translucent.preview.script import VERBS, Script, Step, read_step
from translucent.preview.window_state import WindowState

#: Seconds after which the user does the next thing, whatever is under way.
PATIENCE = 8.0

#: What the user does, with the words of scripts.
ACTIONS: tuple[dict[str, object], ...] = (
    {"do": "turn", "right": 20.0},
    {"do": "change", "field": "material.color", "value": [0.6, 0.1, 0.2]},
    {"do": "change", "field": "material.distance", "value": 0.02},
    {"do": "preset", "name": "whole_milk"},
    {"do": "change", "field": "look.light", "value": True},
    {"do": "turn", "right": 20.0},
    {"do": "change", "field": "look.light", "value": False},
    {"do": "preset", "name": "apple_juice"},
    {"do": "change", "field": "display.method", "value": "depth-peeling"},
    {"do": "change", "field": "display.method", "value": "fragment-lists"},
    {"do": "change", "field": "display.method", "value": "auto"},
    {"do": "change", "field": "display.compare", "value": "method"},
    {"do": "change", "field": "display.compare", "value": "error"},
    {"do": "change", "field": "display.compare", "value": "off"},
    {"do": "change", "field": "display.mode", "value": "thickness"},
    {"do": "change", "field": "display.mode", "value": "picture"},
    {"do": "select", "panel": "Look"},
    {"do": "select", "panel": "Files"},
    {"do": "reload"},
    {"do": "bake", "mode": "cone", "size": 256, "rays": 16},
    {"do": "turn", "right": 20.0},
    {"do": "open", "model": "goblet"},
    {"do": "turn", "right": 20.0},
    {"do": "open", "model": "knot"},
    {"do": "change", "field": "look.stage", "value": "studio"},
    {"do": "turn", "right": 20.0},
    {"do": "change", "field": "material.color", "value": [0.2, 0.5, 0.6]},
    {"do": "change", "field": "look.rotation", "value": 30.0},
    {"do": "change", "field": "display.caustics", "value": True},
    {"do": "turn", "right": 20.0},
    {"do": "change", "field": "display.caustics", "value": False},
    {"do": "change", "field": "look.stage", "value": "none"},
)


@dataclass
class Longest(Script):
    """Keeps the longest frame after each action."""

    told: list[tuple[str, float, float, float]] = field(default_factory=list)

    def step(self, state: WindowState) -> bool:
        now = time.perf_counter()
        if self.told and hasattr(self, "last"):
            label, longest, drawing, _ = self.told[-1]
            frame = now - self.last
            if frame > longest:
                longest, drawing = frame, state.view.drawing
            self.told[-1] = label, longest, drawing, now - self.began
        self.last = now
        loading = state.work.loaded is None or state.work.lanes["load"].task is not None
        if not self.told and (loading or state.more):
            return False
        if self.told:
            label, longest, drawing, spent = self.told[-1]
            if spent < 0.4 or loading or (state.more and spent < PATIENCE):
                return False
            rest = "not at rest" if state.more else "at rest"
            print(f"{label:52} {1e3 * longest:7.0f} ms, {1e3 * drawing:7.0f} of drawing; {rest} after {spent:6.1f} s")
            sys.stdout.flush()
        if not self.steps:
            return True
        step = self.steps.pop()
        self.began: float = time.perf_counter()
        self.last: float = self.began
        self.told.append((" ".join(map(str, (step.do, *step.values.values()))), 0.0, 0.0, 0.0))
        VERBS[step.do](state, **step.values)
        return False


def main() -> int:
    """Play, and print."""
    steps = [read_step(action, "the tool") for action in (*ACTIONS, *ACTIONS)]
    for model in sys.argv[1:]:
        steps += [Step("open", {"model": model, "unit": "m"}), Step("turn", {"right": 20.0, "up": 5.0})] * 2
    app.leave(app.run(Document(Model("knot")), (1280, 800), script=Longest(steps[::-1])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
