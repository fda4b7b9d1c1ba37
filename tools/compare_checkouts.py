"""Compare the speed of two checkouts of the project, which draw the same frames in turns.

``python tools/compare_checkouts.py OLDER [NEWER] [--scene SCENE] [--rounds N] [--pairs N] [--first]``; NEWER is this
checkout unless given, and ``git worktree add`` makes others. Each draws in a process of its own; the times are
processor time, which other programs hardly change. Processes of the same code differ by up to a fifth, by where their
memory and threads come to lie, so several pairs of them draw one after the other. ``--first`` compares first frames
without the caches of the driver instead, which compile all shaders.

Scenes: ``absorbing`` is a body without interfaces, lights or scattering; ``glass`` a bear with interfaces, which covers
a quarter of 640 x 480 pixels; ``knot`` a knot of the same glass; ``empty`` the bear out of view; ``staged`` the bear as
`render` shows it, in 240 x 135 pixels; ``rim`` the rim of a goblet of glass on the same stage, from near by. ``light``,
``medium``, ``index``, ``pose`` and ``mesh`` are no frames: light that diffuses in a bear is solved for again after a
change of the sun and the environment, of absorption, of the index of refraction, of where the body is, or of its mesh;
those with ``-64`` in a grid of 64 cells along a side in place of 32. Traced rays meet up to 12 interfaces with 2 forks,
whatever the planner of a version picks.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
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

#: Requested interfaces: what the planner picks differs from version to version.
_FRAMES = """
renderer, bends = tl.Renderer(), any(body.has_interface for body in scene.objects)
interfaces = tl.TracedInterfaces(depth=12, forks=2) if bends else None
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
}
SCENES = {name: scene + _FRAMES for name, scene in SCENES.items()}
SCENES |= {
    f"{name}{suffix}": _SOLVES.format(change=change, resolution=resolution)
    for name, change in _CHANGES.items()
    for suffix, resolution in (("", 32), ("-64", 64))
}

#: Answers every line on its input with the processor time of some frames.
DRAWS = """
import time
import translucent as tl
{scene}
work, begin = prepared(), time.process_time()
work()
print(time.process_time() - begin, flush=True)
for _ in range(5):
    prepared()()
while input() != "end":
    works = [prepared() for _ in range(5)]
    begin = time.process_time()
    for work in works:
        work()
    print((time.process_time() - begin) / 5, flush=True)
"""


class Checkout:
    """A process that draws with the code of a checkout. `first` is the processor time of its first frame."""

    def __init__(self, root: Path, scene: str, cached: bool) -> None:
        if not (root / "translucent" / "__init__.py").is_file():
            raise SystemExit(f"{root}: no checkout of this project; give the folder that holds translucent/")
        self._process = subprocess.Popen(
            [sys.executable, "-c", DRAWS.format(scene=SCENES[scene])],
            cwd=root,
            env={**os.environ, "PYTHONPATH": str(root), "MESA_SHADER_CACHE_DISABLE": "false" if cached else "true"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.first = float(self._answer())

    def seconds(self) -> float:
        """Processor time of a frame."""
        self._ask("")
        return float(self._answer())

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


def _pair(chosen: argparse.Namespace) -> tuple[float, float]:
    """Processor time of a frame, older and newer, by a process for each."""
    older, newer = (Checkout(root.resolve(), chosen.scene, not chosen.first) for root in (chosen.older, chosen.newer))
    times = [(older.first, newer.first)]
    if not chosen.first:
        times = [(older.seconds(), newer.seconds()) for _ in range(chosen.rounds)]
    older.end()
    newer.end()
    before, after = map(statistics.median, zip(*times, strict=True))
    return before, after


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("older", type=Path)
    parser.add_argument("newer", type=Path, nargs="?", default=Path(__file__).parents[1])
    parser.add_argument("--scene", choices=SCENES, default="absorbing")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--pairs", type=int, default=PAIRS)
    parser.add_argument("--first", action="store_true")
    chosen = parser.parse_args()
    pairs = [_pair(chosen) for _ in range(chosen.pairs)]
    ratios = sorted(after / before for before, after in pairs)
    print(f"{1e3 * statistics.median(before for before, _ in pairs):.2f} ms of processor time for a frame before")
    print(f"{1e3 * statistics.median(after for _, after in pairs):.2f} ms after")
    print(f"ratio {statistics.median(ratios):.3f}, from {ratios[0]:.3f} to {ratios[-1]:.3f} in {len(pairs)} pairs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
