"""Compare the speed of two checkouts of the project, which draw the same in turns, or measure one.

``python tools/compare_checkouts.py [OLDER [NEWER]] [--scene SCENE] [--model MODEL] [--rounds N] [--pairs N]
[--first]``; without OLDER this checkout is measured alone, NEWER is this checkout unless given, and ``git worktree
add`` makes others. Each draws in a process of its own; the times are processor time, which other programs hardly
change. Processes of the same code differ by up to a fifth, by where their memory and threads come to lie, so several
pairs of them draw one after the other. ``--first`` compares first frames without the caches of the driver instead,
which compile all shaders.

Frames: ``absorbing`` is a body without interfaces, lights or scattering; ``glass`` a bear with interfaces, which
covers a quarter of 640 x 480 pixels; ``knot`` a knot of the same glass; ``gl`` the bear with hits found by a shader;
``empty`` the bear out of view; ``staged`` the bear as `render` shows it, in 240 x 135 pixels; ``rim`` the rim of a
goblet of glass on the same stage, from near by; ``many`` 2,000 small balls. Traced rays meet up to 12 interfaces with
2 forks, whatever the planner of a version picks. ``paths`` follows 64 random paths for each of 128 x 128 pixels of
the bear; ``caustics`` a million photons through a ball.

Solves: ``light``, ``medium``, ``index``, ``pose`` and ``mesh`` are no frames: light that diffuses in a bear is solved
for again after a change of the sun and the environment, of absorption, of the index of refraction, of where the body
is, or of its mesh; those with ``-64`` in a grid of 64 cells along a side in place of 32.

Commands: ``default``, ``wax`` and ``jade`` are `translucent render MODEL` in 960 x 720 pixels, in glass or such a
medium; ``cold`` is a bear of 64 x 64 pixels without the caches of the driver; ``memory`` is the memory in MB that
traced rays add to a picture of 1280 x 720 pixels.

The window: ``orbit`` is the previewer of MODEL in glass on no stage, or ``staged-orbit`` on the usual one, while a
script turns the view: time by the clock of the first coarse step of each turn, and processor time of the whole
picture that follows, in 1280 x 800 pixels. It needs a display, or Xvfb.
"""

from __future__ import annotations

import argparse
import os
import resource
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROUNDS, PAIRS = 10, 6

_GLASS = """
mesh = tl.load_mesh("meshes/{mesh}.ply")
size, center = (640, 480), mesh.vertices.min(axis=0) / 2 + mesh.vertices.max(axis=0) / 2
glass = tl.Medium(absorption=[share / mesh.diagonal for share in (0.3, 0.6, 1.0)], ior=1.5)
eye = center + (0, 0, 1.12 * mesh.diagonal)
camera = tl.Camera.look_at(eye, {target}, fov_y=45.0)
scene = tl.Scene([tl.Object(mesh, glass)], camera, environment=tl.Environment.constant((1, 1, 1)))
"""

_RIM = """
mesh = tl.load_mesh("meshes/goblet.ply")
size, top = (120, 90), [*(mesh.vertices.min(axis=0) / 2 + mesh.vertices.max(axis=0) / 2)]
top[1] = mesh.vertices[:, 1].max()
eye = [at + share * mesh.diagonal for at, share in zip(top, (0.25, 0.12, 0.55))]
scene = tl.showcase(mesh, tl.Medium(ior=1.5), size, camera=tl.Camera.look_at(eye, top, fov_y=30.0))
"""

_MANY = """
import numpy as np
from translucent.geometry.solids import Sphere
ball, size, red = Sphere(radius=0.4).tessellate(10), (256, 256), tl.Medium((1.0, 2.0, 3.0))
camera = tl.Camera.look_at((22, 22, 68), (22, 22, 0))
places = [np.array([[1, 0, 0, i % 45], [0, 1, 0, i // 45], [0, 0, 1, 0], [0, 0, 0, 1]]) for i in range(2000)]
scene = tl.Scene([tl.Object(ball, red, place) for place in places], camera)
"""

_PHOTONS = """
from translucent.geometry.solids import Box, Sphere
ball, size = tl.Object(Sphere().tessellate(64), tl.Medium(ior=1.5)), (256, 192)
floor = tl.Object(Box((-4, -1.2, -4), (4, -1.1, 4)).tessellate())
sun = tl.DirectionalLight((0.3, -1, 0.2), (3, 3, 3))
scene = tl.Scene([ball, floor], tl.Camera.look_at((0, 4, 6), (0, -1, 0), fov_y=45.0), [sun])
"""

#: Requested interfaces: what the planner picks differs from version to version.
_FRAMES = """
renderer, bends = tl.Renderer(), any(body.has_interface for body in scene.objects)
hits = dict({hits}) if "hits" in tl.TracedInterfaces.__dataclass_fields__ else dict()  # older ones have shaders alone
interfaces = tl.TracedInterfaces(depth=12, forks=2, **hits) if bends else None
def prepared():
    return lambda: renderer.render(scene, size, samples=1, interfaces=interfaces)
"""

_SOLVES = """
from itertools import count
from math import cos, sin
from translucent.diffusion.cache import FieldCache
from translucent.planning.plan import plan
mesh, numbers, cache = tl.load_mesh("meshes/bear.ply"), count(), FieldCache()
unit = 10 / max(mesh.bounds[1] - mesh.bounds[0])
def prepared():
    i = next(numbers)
    turn = angle = 0.0
    absorption, ior, shape = 1.0, 1.4, mesh
    {change}
    absorbed = [share * absorption * unit for share in (0.02, 0.1, 0.5)]
    medium = tl.Medium(absorbed, [20 * unit, 15 * unit, 10 * unit], ior=ior)
    pose = [[cos(angle), 0, sin(angle), angle], [0, 1, 0, 0], [-sin(angle), 0, cos(angle), 0], [0, 0, 0, 1]]
    sun = tl.DirectionalLight((cos(turn), -1.0, sin(turn)), (1, 1, 1))
    scene = tl.Scene([tl.Object(shape, medium, pose)], tl.Camera.look_at((0, 0, 5), (0, 0, 0)), [sun],
                     tl.Environment.studio(rotation=37.0 * turn))
    planned = plan(scene, scattering=tl.Diffusion({resolution}))
    return lambda: cache.of(planned)
"""

#: What changes from one solve to the next.
_CHANGES = {
    "light": "turn = float(i)",
    "medium": "absorption = 1.0 + 0.01 * i",
    "index": "ior = 1.3 + 0.001 * i",
    "pose": "angle = 0.1 * i",
    "mesh": "shape = tl.Mesh(mesh.vertices, mesh.faces)",
}

#: What makes a scene and prepares a frame of it, or a solve, by any version of the project.
SCENES = {
    "absorbing": """
size = (512, 512)
scene = tl.showcase(tl.load_mesh("meshes/knot.ply"), tl.Medium.from_color((0.8, 0.3, 0.2), 0.01), size, stage="none")
""",
    "glass": _GLASS.format(mesh="bear", target="center"),
    "knot": _GLASS.format(mesh="knot", target="center"),
    "empty": _GLASS.format(mesh="bear", target="2 * eye - center"),
    "staged": 'size = (240, 135)\nscene = tl.showcase(tl.load_mesh("meshes/bear.ply"), None, size)',
    "rim": _RIM,
    "many": _MANY,
}
SCENES = {name: scene + _FRAMES.format(hits="") for name, scene in SCENES.items()}
SCENES["gl"] = _GLASS.format(mesh="bear", target="center") + _FRAMES.format(hits='hits="gl"')
SCENES |= {
    f"{name}{suffix}": _SOLVES.format(change=change, resolution=resolution)
    for name, change in _CHANGES.items()
    for suffix, resolution in (("", 32), ("-64", 64))
}

_SLOW = """
renderer = tl.Renderer()
def prepared():
    return lambda: renderer.render(scene, {size}, {choices})
"""

#: Of these, one is timed at a time.
SLOW = {
    "paths": SCENES["glass"] + _SLOW.format(size=(128, 128), choices="method=tl.PathTraced(paths=64)"),
    "caustics": _PHOTONS + _SLOW.format(size="size", choices="samples=1, caustics=tl.Caustics(photons=1_000_000)"),
}

#: Answers every line on its input with the processor time of some frames.
DRAWS = """
import time
import translucent as tl
{scene}
work, begin = prepared(), time.process_time()
work()
print(time.process_time() - begin, flush=True)
for _ in range({count} - 1):
    prepared()()
while input() != "end":
    works = [prepared() for _ in range({count})]
    begin = time.process_time()
    for work in works:
        work()
    print((time.process_time() - begin) / {count}, flush=True)
"""

#: Arguments of `translucent render` after the model.
COMMANDS = {
    "default": ["--size", "960x720"],
    "wax": ["--size", "960x720", "--preset", "wax"],
    "jade": ["--size", "960x720", "--preset", "jade"],
    "cold": ["--size", "64x64", "--samples", "1"],
    "memory": ["--size", "1280x720", "--samples", "1"],
}

#: Turns the view of the previewer eight times, lets the picture become whole, and so on; every class and action has had
#: another name. Times of steps are processor time, so that what else runs does not choose their resolution.
ORBIT = """
import importlib, statistics, sys, time
clock, model, stage = time.perf_counter, *sys.argv[1:3]
processor = time.perf_counter = clock if "clock" in sys.argv else time.process_time

def named(*places):
    for place in places:
        module, _, name = place.rpartition(".")
        try:
            return getattr(importlib.import_module("translucent.preview." + module), name)
        except (ImportError, AttributeError):
            pass
    raise SystemExit("this checkout has none of " + ", ".join(places))

if __name__ == "__main__":
    from translucent.assets import mesh_path
    from translucent.preview import app
    from translucent.preview.document import Document, Look, Model
    from translucent.preview.script import Script
    turn, change = named("actions.OrbitBy", "actions.Turn"), named("actions.SetField", "actions.Change")
    renderer = named("viewport_renderer.ViewportRenderer", "stage.Stage")
    rounds, steps, coarse, whole, draw = 4, [], [], [], renderer.draw

    def timed(self, work, size):
        began, before = clock(), processor()
        more = draw(self, work, (1280, 800))
        done = self.viewport.steps(0) >= self._strides.of[0] ** 2
        steps.append((clock() - began, processor() - before, done or not more))
        return more

    class Orbit(Script):
        turns = -1
        def step(self, state):
            work = state.work
            if work.loaded is None or work.scene() is None:
                return False
            if self.turns < 0:
                self.turns, self.begun = 8, clock()
                work.do(change("display.inset", False))
                work.do(change("material.ior", 1.5))
            elif steps and self.turns < 8:
                coarse.append(steps[-1][0])
                steps.clear()
                self.turns += 1
                if self.turns < 8:
                    work.do(turn(2.0, 0.0))
            elif len(steps) > 1 and steps[-1][2] and work.compiler.lane.task is None and clock() - self.begun > 3:
                whole.append(sum(seconds for _, seconds, _ in steps))
                steps.clear()
                self.turns = 0
                work.do(turn(2.0, 0.0))
            return len(whole) > rounds

    renderer.draw = timed
    path = model if "." in model else str(mesh_path(model))
    app.leave(app.run(Document(Model(path), look=Look(stage=stage)), (1966, 888), script=Orbit([])))
    print(1e3 * statistics.median(coarse[::8]), statistics.median(whole[1:]))
"""

WINDOWS = {"orbit": "none", "staged-orbit": "auto"}

#: What the numbers of a measurement are, and their unit.
UNITS = {"memory": ("MB for rays",)} | dict.fromkeys(WINDOWS, ("ms of a first step, by the clock", "s of a picture"))

Numbers = tuple[float, ...]


class Drawing:
    """A process that draws with the code of a checkout. `first` is the processor time of its first frame."""

    def __init__(self, root: Path, chosen: argparse.Namespace) -> None:
        name, self._first = chosen.scene, chosen.first
        text = DRAWS.format(scene=SCENES.get(name) or SLOW[name], count=1 if name in SLOW else 5)
        self._process = subprocess.Popen(
            [sys.executable, "-c", text],
            cwd=root,
            env=environment(root, cached=not chosen.first),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.first = float(self._answer())

    def __call__(self) -> Numbers:
        """Processor time of a frame."""
        if self._first:
            return (self.first,)
        self._ask("")
        return (float(self._answer()),)

    def end(self) -> None:
        """End the process."""
        self._ask("end")
        self._process.wait()

    def _ask(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a checkout cannot draw; what it says is above")
        return line


def environment(root: Path, *, cached: bool) -> dict[str, str]:
    """Variables of a process that runs the code of a checkout."""
    return {**os.environ, "PYTHONPATH": str(root), "MESA_SHADER_CACHE_DISABLE": "false" if cached else "true"}


def command(root: Path, chosen: argparse.Namespace) -> Numbers:
    """Seconds of processor time that `translucent render` takes, or MB of memory that rays add."""

    def run(*more: str) -> resource.struct_rusage:
        with tempfile.TemporaryDirectory() as folder:
            words = ["render", chosen.model, "-o", f"{folder}/picture.png", *COMMANDS[chosen.scene]]
            words += [*shlex.split(chosen.more), *more]
            process = subprocess.Popen(
                [sys.executable, "-m", "translucent", *words],
                cwd=root,
                env=environment(root, cached=chosen.scene != "cold"),
                stdout=subprocess.DEVNULL,
            )
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise SystemExit(f"{root}: translucent {' '.join(words)} failed; what it says is above")
        return used

    used = run()
    if chosen.scene != "memory":
        return (used.ru_utime + used.ru_stime,)
    return ((used.ru_maxrss - run("--interfaces", "front").ru_maxrss) / 1024,)


def window(root: Path, chosen: argparse.Namespace) -> Numbers:
    """Milliseconds of the first step of a turn, and processor time of the whole picture after it."""
    words = [sys.executable, "-c", ORBIT, chosen.model, WINDOWS[chosen.scene], *(["clock"] if chosen.clock else [])]
    if "DISPLAY" not in os.environ:
        if shutil.which("xvfb-run") is None:
            raise SystemExit("the previewer needs a display; there is neither one nor xvfb-run; install Xvfb")
        words = ["xvfb-run", "-a", "-s", "-screen 0 2000x900x24", *words]
    done = subprocess.run(words, cwd=root, env=environment(root, cached=True), stdout=subprocess.PIPE, text=True)
    if done.returncode or not done.stdout.strip():
        raise SystemExit(f"{root}: the previewer failed; what it says is above")
    return tuple(map(float, done.stdout.split()[-2:]))


def measured(roots: list[Path], chosen: argparse.Namespace) -> list[Numbers]:
    """Numbers of each checkout, medians of rounds in which they take turns."""
    if chosen.scene in COMMANDS or chosen.scene in WINDOWS:
        measure: Callable[..., Numbers] = command if chosen.scene in COMMANDS else window
        return [measure(root, chosen) for root in roots]
    processes = [Drawing(root, chosen) for root in roots]
    rounds = [[process() for process in processes] for _ in range(1 if chosen.first else chosen.rounds)]
    for process in processes:
        process.end()
    return [tuple(map(statistics.median, zip(*times, strict=True))) for times in zip(*rounds, strict=True)]


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("older", type=Path, nargs="?")
    parser.add_argument("newer", type=Path, nargs="?", default=Path(__file__).parents[1])
    parser.add_argument("--scene", choices=[*SCENES, *SLOW, *COMMANDS, *WINDOWS], default="absorbing")
    parser.add_argument("--model", default="bear", help="of commands and windows: a built-in mesh or a file")
    parser.add_argument("--more", default="", help="further arguments of commands, as '--size 256x256'")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--pairs", type=int, default=PAIRS)
    parser.add_argument("--first", action="store_true")
    parser.add_argument("--clock", action="store_true", help="times of windows by the clock, as a GPU needs it")
    chosen = parser.parse_args()
    roots = [root.resolve() for root in (chosen.older, chosen.newer) if root is not None]
    for root in roots:
        if not (root / "translucent" / "__init__.py").is_file():
            raise SystemExit(f"{root}: no checkout of this project; give the folder that holds translucent/")
    if "." in chosen.model:
        chosen.model = str(Path(chosen.model).resolve())
    pairs = [measured(roots, chosen) for _ in range(chosen.pairs)]
    for i, unit in enumerate(UNITS.get(chosen.scene, ("s of processor time",))):
        found = [[numbers[i] for numbers in pair] for pair in pairs]
        medians = [f"{statistics.median(times):.4g}" for times in zip(*found, strict=True)]
        print(f"{unit}: {' before, '.join(medians)}{' after' if len(medians) > 1 else ''}")
        if len(medians) > 1:
            ratios = sorted(after / before for before, after in found)
            line = f"ratio {statistics.median(ratios):.3f}, from {ratios[0]:.3f} to {ratios[-1]:.3f}"
            print(f"{line} in {len(pairs)} pairs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
