"""Memory that the previewer takes for a large mesh: ``python tools/preview_memory.py [SUBDIVISIONS] [--stage auto]``.

Where Linux tells what processes hold; on a display, or on none: see tools/headless_window.py.
Writes a dented ball of 20 * 4^SUBDIVISIONS triangles (9: 5.2 million), opens it in a window, waits until the picture is
at rest, turns the camera, and waits again. Meanwhile the memory of the window and of all the processes that it has
started is summed up, with what several of them share counted once (PSS). Tells when the first picture was there, and
each new state, the largest sum until then, with the part of each process, and the longest frame.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from headless_window import open_nowhere

#: When the process was asked for, in the environment of the process.
BEGUN = "TRANSLUCENT_BEGUN"

#: Seconds between two looks at the memory, and without work after which the picture is at rest.
INTERVAL, REST = 0.1, 1.0


def main() -> int:
    """Start the window, and watch it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("subdivisions", nargs="?", type=int, default=9)
    parser.add_argument("--format", default="ply")
    parser.add_argument("--stage", default="auto")
    parser.add_argument("--inset", action="store_true", help="compare with the reference in the background")
    parser.add_argument("--patience", type=float, default=120.0, help="seconds to wait for rest")
    parser.add_argument("--show", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.show:
        show(given.show, given.stage, given.inset, given.patience)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), given.format, given.subdivisions)
        command = [
            sys.executable,
            __file__,
            "--show",
            str(path),
            "--stage",
            given.stage,
            "--patience",
            str(given.patience),
        ]
        command += ["--inset"] * given.inset
        environment = {**os.environ, BEGUN: str(time.time())}
        window = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        watch = Watch(window.pid)
        watch.start()
        assert window.stdout is not None
        for line in window.stdout:
            print(f"{line.strip():44} {watch.told()}", flush=True)
        return window.wait()


def written(folder: Path, suffix: str, subdivisions: int) -> Path:
    """File with a dented ball."""
    import numpy as np
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.05)
    x, y, z = 20.0 * ball.vertices.T
    dented = ball.vertices * (1 + 0.15 * np.sin(5 * x) * np.cos(4 * y) * np.sin(3 * z))[:, None]
    path = folder / f"ball-{subdivisions}.{suffix}"
    trimesh.Trimesh(dented, ball.faces, process=False).export(path)
    return path


class Watch(threading.Thread):
    """Sums of the memory of a process and all that it has started."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.pid = pid
        self.largest: dict[int, int] = {}
        self.now: dict[int, int] = {}

    def run(self) -> None:
        """Look again and again."""
        while True:
            self.now = held(self.pid)
            if sum(self.now.values()) > sum(self.largest.values()):
                self.largest = self.now
            time.sleep(INTERVAL)

    def told(self) -> str:
        """The sum now, and the largest so far."""
        return f"now {_text(self.now)}; at most {_text(self.largest)}"


def _text(parts: dict[int, int]) -> str:
    each = " + ".join(f"{part / 1e6:.0f}" for _, part in sorted(parts.items()))
    return f"{sum(parts.values()) / 1e9:.2f} GB ({each} MB)"


def held(pid: int) -> dict[int, int]:
    """Bytes of a process and of all that it has started."""
    above: dict[int, int] = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            above[int(status.parent.name)] = int(status.read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue
    family = {pid}
    while more := {child for child, parent in above.items() if parent in family} - family:
        family |= more
    found = {}
    for one in family:
        try:
            lines = Path(f"/proc/{one}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue
        found[one] = sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return found


def show(path: Path, stage: str, inset: bool, patience: float) -> None:
    """Open the window, tell what is reached, and close it."""
    from translucent.preview import app
    from translucent.preview.actions import OrbitBy
    from translucent.preview.document import Display, Document, Look, Model
    from translucent.preview.script import PAUSE, Script
    from translucent.preview.window_state import WindowState

    if "DISPLAY" not in os.environ:
        open_nowhere()
    begun = float(os.environ[BEGUN])

    class Waiting(Script):
        reached = -1
        last = since = busy = begun
        longest = 0.0

        def step(self, state: WindowState) -> bool:
            now = time.time()
            if state.more:
                self.busy = now
            if state.idle:
                time.sleep(PAUSE)  # as a window without a script, which leaves other processes the time
            self.longest, self.last = max(self.longest, now - self.last), now
            if self.reached < 0:
                if state.view.timings[0].wall:
                    self.reach("first picture", now)
                return False
            if now - self.busy < REST and now - self.since < patience:
                return False
            self.reach(("at rest", "turned, at rest")[self.reached], now)
            state.work.do(OrbitBy(30.0, 5.0))
            return self.reached == 2

        def reach(self, state: str, now: float) -> None:
            frame = f"longest frame {1e3 * self.longest:.0f} ms" if self.reached >= 0 else ""
            print(f"{state} after {now - begun:.1f} s, {frame}", flush=True)
            time.sleep(2 * INTERVAL)
            self.reached += 1
            self.longest, self.since, self.last, self.busy = 0.0, time.time(), time.time(), time.time()

    document = Document(Model(str(path)), look=Look(stage=stage), display=Display(inset=inset))
    app.leave(app.run(document, (1280, 800), script=Waiting([])))


if __name__ == "__main__":
    sys.exit(main())
