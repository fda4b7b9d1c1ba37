"""Twenty tasks of an artist in the previewer, by mouse and keyboard: ``python tools/preview_tasks.py [NAME...]``.

Needs Xvfb and xdotool: the tool opens two windows, one after the other, on a display of its own. Each task
(`preview_artist`) checks its result, and waits for the window's own state (`preview_hand`). The tool prints for each
the seconds that it took, the longest frame, and the frame that took most time of all cores, which says more where other
programs use them: its time in the window's thread and in drawing, and what the thread was at. ``--size 2560x1600
--scale 2`` is for a large display, ``--keep FOLDER`` for a picture of the window after each task.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from main_thread import Sampler
from PIL import ImageGrab
from preview_artist import AGAIN, TASKS
from preview_hand import Artist, FailedError, Hand, Places, Waiting

from translucent.assets import mesh_path
from translucent.preview import app
from translucent.preview import window_state as states
from translucent.preview.document import Document, Model
from translucent.preview.script import PAUSE, Script
from translucent.preview.window_state import WindowState


@dataclass(frozen=True, order=True)
class Frame:
    """Frame of the window: seconds of all cores, by the clock, of its thread and of drawing, and what that was at."""

    cores: float = 0.0
    seconds: float = 0.0
    thread: float = 0.0
    drawing: float = 0.0
    at: str = ""

    def __str__(self) -> str:
        parts = f"{1e3 * self.thread:4.0f} of its thread, {1e3 * self.drawing:4.0f} of drawing"
        return f"{1e3 * self.cores:4.0f} ms of all cores, {parts}: {self.at}"


@dataclass
class Tasks(Script):
    """Does the tasks one after the other, and tells how they went."""

    remembers = True
    todo: list[tuple[str, Callable[[Artist], Waiting]]] = field(default_factory=list)
    folder: Path = Path()
    keep: Path | None = None
    failed: list[str] = field(default_factory=list)
    _running: Waiting | None = None
    _name: str = ""
    _began: float = 0.0
    _last: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _longest: float = 0.0
    _busiest: Frame = field(default_factory=Frame)
    _sampler: Sampler = field(default_factory=Sampler)
    _artist: Artist | None = None
    _places: Places = field(default_factory=Places)

    def step(self, state: WindowState) -> bool:
        """Continue the task; returns whether all are done."""
        if self._running is not None and self._last[0]:
            seconds, cores, thread = (now - before for now, before in zip(clocks(), self._last, strict=True))
            self._longest = max(self._longest, seconds)
            if cores > self._busiest.cores:
                self._busiest = Frame(cores, seconds, thread, state.view.drawing, self._sampler.told())
        ended = self._continue(state)
        if state.idle:
            time.sleep(PAUSE)  # other processes need the time more
        # What the tool does is no part of a frame.
        self._last = clocks()
        self._sampler.begin()
        return ended

    def _continue(self, state: WindowState) -> bool:
        if self._artist is None:
            if state.work.loaded is None or state.view.timings[0].wall == 0.0:
                return False
            self._artist = Artist(state, self._places, Hand(), self.folder)
            self._running = self._artist.hand.begin()
            return False
        if self._running is None:
            if not self.todo:
                return True
            self._name, task = self.todo.pop(0)
            self._running, self._began = task(self._artist), time.perf_counter()
            self._longest, self._busiest = 0.0, Frame()
        problem = ""
        try:
            next(self._running)
            return False
        except StopIteration:
            pass
        except FailedError as error:
            problem = str(error)
            self.failed.append(self._name)
        self._running = None
        if self._name:
            self._tell(problem)
        return False

    def _tell(self, problem: str) -> None:
        spent = time.perf_counter() - self._began
        text = f"longest frame {1e3 * self._longest:5.0f} ms, busiest {self._busiest}"
        print(f"{self._name:22} {spent:6.1f} s, {text}{'; FAILED: ' if problem else ''}{problem}", flush=True)
        if self.keep is not None:
            picture = ImageGrab.grab(xdisplay=os.environ["DISPLAY"])
            picture.save(self.keep / f"{len(list(self.keep.glob('*.png'))):02d}_{self._name.replace(' ', '_')}.png")


def clocks() -> tuple[float, float, float]:
    """Seconds by the clock, of all cores in this process, and of this thread."""
    return time.perf_counter(), time.process_time(), time.thread_time()


def make_files(folder: Path) -> None:
    """Make the models and the environment that the tasks open."""
    import trimesh

    shutil.copy(mesh_path("bear"), folder / "bear.ply")
    scene = trimesh.Scene()
    for name, right in (("bear", -0.5), ("soap", 0.5)):
        mesh = trimesh.load_mesh(mesh_path(name))
        mesh.visual = trimesh.visual.ColorVisuals()
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        mesh.apply_scale(0.05 / mesh.extents.max())
        mesh.apply_translation((0.06 * right, 0.0, 0.0))
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    scene.export(folder / "two.glb")
    height, width = 32, 64
    up = np.linspace(1.0, 0.0, height)[:, None, None] * np.array([60.0, 90.0, 160.0]) + 20.0
    pixels = np.broadcast_to(up, (height, width, 3)).astype(np.uint8)
    rgbe = np.concatenate([pixels, np.full((height, width, 1), 129, np.uint8)], axis=-1)
    rgbe[6:10, 10:14, 3] = 133  # a sun
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    (folder / "sky.hdr").write_bytes(header + rgbe.tobytes())


def play(options: argparse.Namespace) -> int:
    """Do tasks in this process's window."""
    states.open_dialog = lambda _: None  # the browser of the window's own, on every machine
    size, folder = tuple(map(int, options.size.split("x"))), Path(options.folder)
    if not (folder / "two.glb").exists():
        make_files(folder)
    tasks = AGAIN if options.again else TASKS
    todo = [(name, task) for name, task in tasks.items() if not options.names or name in (*options.names, "close")]
    script = Tasks([], todo=todo, folder=folder, keep=options.keep and Path(options.keep))
    document = dataclasses.replace(Document(), model=Model("sphere"))
    work = app.run(document, size, options.scale, script)  # type: ignore[arg-type]
    app.leave(work, len(script.failed))
    return len(script.failed)


def main() -> int:
    """Start a display and the windows; the exit code is the number of tasks that failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"tasks: {', '.join((*TASKS, *AGAIN))}")
    parser.add_argument("--size", default="1280x800")
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--keep", help="folder for pictures of the window")
    parser.add_argument("--folder", help="folder to work in, on the display that is there, in one window")
    parser.add_argument("--again", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if shutil.which("xdotool") is None:
        parser.error("mouse and keyboard need xdotool, which is not installed: apt-get install xdotool")
    if options.folder:
        return play(options)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.keep:
            Path(options.keep).mkdir(parents=True, exist_ok=True)
        own = {key: str(folder / key.lower()) for key in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
        own |= {"MESA_SHADER_CACHE_DIR": str(folder / "shaders")}  # the first use of everything
        screen = f"-screen 0 {options.size}x24"
        command = ["xvfb-run", "-a", "-s", screen, sys.executable, __file__, *sys.argv[1:], "--folder", str(folder)]
        failed = 0
        wanted = options.names or (*TASKS, *AGAIN)
        for names, again in ((TASKS, []), (AGAIN, ["--again"])):
            if set(names) - {"close"} & set(wanted):
                failed += subprocess.run([*command, *again], env={**os.environ, **own}, check=False).returncode
    return failed


if __name__ == "__main__":
    sys.exit(main())
