"""Seconds until the previewer shows its first picture: ``python tools/preview_start.py [MODEL [TIMES]]``.

On a display (where there is none: ``xvfb-run -a -s "-screen 0 2000x900x24"``). Each time, a process of its own is
started, as a user starts one; the first of them with an empty cache of compiled shaders, where Mesa draws.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

#: When the process was asked for, in the environment of the process.
BEGUN = "TRANSLUCENT_BEGUN"


def show(model: str) -> None:
    """Open the window, tell when it was there and when its picture was, and close it."""
    from translucent.preview import app
    from translucent.preview.document import Document, Model
    from translucent.preview.script import Script
    from translucent.preview.window_state import WindowState

    begun = float(os.environ[BEGUN])

    class First(Script):
        window = 0.0

        def step(self, state: WindowState) -> bool:
            self.window = self.window or time.time() - begun
            if state.view.timings[0].wall == 0.0:
                return False
            print(f"window after {self.window:.2f} s, picture after {time.time() - begun:.2f} s", end=", ")
            print(f"{time.process_time():.2f} s of all cores", flush=True)
            return True

    app.leave(app.run(Document(Model(model)), (1280, 800), script=First([])))


def main() -> int:
    """Start the processes."""
    model, times = (*sys.argv[1:3], *("goblet", "4")[len(sys.argv) - 1 :])
    if BEGUN in os.environ:
        show(model)
        return 0
    with tempfile.TemporaryDirectory() as cache:
        for _ in range(int(times)):
            environment = {**os.environ, BEGUN: str(time.time()), "MESA_SHADER_CACHE_DIR": cache}
            subprocess.run([sys.executable, __file__, model], env=environment, check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
