"""Random actions in the previewer: ``python tools/preview_monkey.py [ACTIONS [SEED [SECONDS]]]``, default 10000 and 0.

What a user could do, in an order that nobody would: fields with good and with bad values, models that are none, undo,
sizes. After every action the picture is drawn. Fails on an exception, an OpenGL error, a document that changed though
its action was refused, or objects that become more and more. Memory is printed, and no reason to fail: a software
OpenGL compiles each shader anew for every state that it meets, and keeps all of that.
"""

from __future__ import annotations

import dataclasses
import gc
import random
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

from translucent.media.presets import presets
from translucent.preview.actions import ChoosePreset, OrbitBy, Pan, SetField, SetOrbit, Zoom
from translucent.preview.document import RANGES, Document, Model, Orbit
from translucent.preview.scenes import method_of
from translucent.preview.session import save_session
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace

#: Small meshes of the toolkit, closed and open ones.
MODELS = ("knot", "leaf", "soap", "shell", "wine")

#: Objects that must not become more: what they hold is large. Models and modes change how many there are.
COUNTED = (
    "Texture",
    "TextureArray",
    "Buffer",
    "Framebuffer",
    "VertexArray",
    "Mesh",
    "Scene",
    "Frame",
    "EnvironmentMap",
)
ALLOWED = 300


def bad_files(folder: Path) -> list[str]:
    """Files that are no models."""
    (folder / "empty.glb").write_bytes(b"")
    (folder / "truncated.glb").write_bytes(b"glTF\x02\x00\x00\x00\xff\x00\x00\x00")
    (folder / "text.obj").write_text("no mesh at all\n")
    (folder / "noise.ply").write_bytes(random.Random(5).randbytes(500))
    (folder / "holes.stl").write_text("solid a\nendsolid a\n")
    return [
        str(folder / name) for name in ("empty.glb", "truncated.glb", "text.obj", "noise.ply", "holes.stl", "none.glb")
    ]


class Monkey:
    """Plays with a workspace and its viewport.

    Parameters
    ----------
    seed : int
    folder : Path
        For files that are no models, and for sessions.
    """

    def __init__(self, seed: int, folder: Path) -> None:
        self.random = random.Random(seed)
        self.work, self.size = Workspace(Document(Model("knot"))), (160, 96)
        self.view = ViewportRenderer(compiler=self.work.compiler)
        self.folder, self.bad = folder, bad_files(folder)
        self.refused = 0
        self.verbs = [self.change] * 8 + [self.bad_change, self.move, self.move, self.move, self.preset, self.resize]
        self.verbs += [self.undo, self.undo, self.frame, self.probe, self.session, self.measure]
        self.settle(lambda: self.work.loaded is not None)

    def settle(self, done: Any, patience: float = 60.0) -> None:
        """Let the background work."""
        end = time.monotonic() + patience
        while not done() and time.monotonic() < end:
            self.work.update()
            time.sleep(0.002)

    def play(self, number: int) -> str:
        """One action, and the picture after it; what it was."""
        verb = self.open if number % 40 == 39 else self.random.choice(self.verbs)
        verb()
        self.work.size = self.size
        self.work.update()
        for _ in range(self.random.choice((1, 1, 2, 5))):
            self.view.draw(self.work, self.size)
        if self.random.random() < 0.2:
            self.settle(lambda: self.work.compiler.lane.task is None)
            self.view.draw(self.work, self.size)
        with self.view.current() as gl:
            if (error := gl.error) != "GL_NO_ERROR":
                raise AssertionError(f"action {number}, {verb.__name__}: {error}")
        return verb.__name__

    def value(self, name: str, like: Any) -> Any:
        """A value that a field may hold, most often one that somebody would choose."""
        found, r = RANGES.get(name), self.random
        if isinstance(like, bool):
            return r.random() < 0.5
        if isinstance(like, str):
            environments = ("", "studio", "light-table", "checkerboard", "#8090a0")
            return r.choice(found.words if found is not None and found.words else environments)
        low, high = (max(found.low, -100.0), min(found.high, 100.0)) if found is not None else (0.0, 1.0)

        def one() -> float:
            drawn = r.uniform(low, high) if r.random() < 0.7 else 10.0 ** r.uniform(-6.0, 2.0)
            return min(max(drawn, low + 1e-9), high)

        return [one(), one(), one()] if isinstance(like, tuple) else one()

    def change(self) -> None:
        document = self.work.document
        section = self.random.choice(("material", "material", "look", "display", "display"))
        owner = getattr(document, section)
        key = self.random.choice([f.name for f in dataclasses.fields(owner)])
        if (section, key) in (("material", "preset"), ("material", "source")):
            return
        name = f"{section}.{key}"
        self.work.do(SetField(name, self.value(name, getattr(owner, key)), self.random.choice((None, 1, 2))))

    def bad_change(self) -> None:
        before = self.work.document
        name = self.random.choice([*RANGES, "material.nothing", "nothing.at.all", "model.path"])
        self.work.do(SetField(name, self.random.choice((float("nan"), -1e300, 1e300, "?", None, [1, 2], {}))))
        self.refused += 1
        if self.work.document != before:
            raise AssertionError(f"{name} was refused, and the document changed")

    def move(self) -> None:
        r = self.random
        self.work.do(
            r.choice(
                (
                    OrbitBy(r.uniform(-300, 300), r.uniform(-100, 100)),
                    Pan(r.uniform(-2, 2), r.uniform(-2, 2)),
                    Zoom(10 ** r.uniform(-2, 2), r.uniform(-1, 1), r.uniform(-0.5, 0.5)),
                    SetOrbit(Orbit((0.0, 0.05, 0.0), r.uniform(-180, 180), r.uniform(-89, 89), 10 ** r.uniform(-2, 1))),
                )
            )
        )

    def preset(self) -> None:
        self.work.do(ChoosePreset(self.random.choice((*presets(), "unobtainium"))))

    def resize(self) -> None:
        self.size = self.random.choice(((160, 96), (8, 8), (1, 1), (97, 203), (320, 180)))

    def undo(self) -> None:
        self.random.choice((self.work.undo, self.work.redo))()

    def frame(self) -> None:
        self.work.frame(self.random.choice((None, 0, 7)))

    def probe(self) -> None:
        size = self.view.viewport.size
        pixel = self.random.randrange(-5, 400), self.random.randrange(-5, 400)
        self.view.probe(*pixel, self.random.choice((0, 1)))
        scene = self.work.scene()
        if scene is not None and 0 <= pixel[0] < size[0] and 0 <= pixel[1] < size[1] and self.random.random() < 0.2:
            self.work.cross(scene, size, pixel, lambda _: None)

    def session(self) -> None:
        path = str(self.folder / "session.toml")
        if self.random.random() < 0.5:
            save_session(path, self.work.document)
        else:
            self.work.open_session(self.random.choice((path, str(self.folder / "text.obj"))))
            self.settle(lambda: self.work.lanes["load"].task is None)

    def measure(self) -> None:
        scene, document = self.work.scene(), self.work.document
        if scene is None or self.random.random() < 0.7:
            return
        method = method_of(document.display.method, document.material)
        self.work.measure(scene, method, (64, 36))
        if self.random.random() < 0.7:
            self.settle(lambda: self.work.lanes["draw"].task is None, 5.0)

    def open(self) -> None:
        self.work.open(Model(self.random.choice((*MODELS, *MODELS, *self.bad)), "m"))
        if self.random.random() < 0.8:
            self.settle(lambda: self.work.lanes["load"].task is None)

    def close(self) -> None:
        self.work.close()
        self.view.close()


def memory() -> float:
    """Megabytes that the process has."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def objects() -> int:
    """Number of objects with much in them that are alive."""
    gc.collect()
    return sum(type(one).__name__ in COUNTED for one in gc.get_objects())


def play(actions: int, seed: int = 0, seconds: float = 1e9) -> dict[str, float]:
    """Play, and tell what there is to tell; raises where something went wrong."""
    begun, early, done = time.monotonic(), 0.0, 0
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        monkey = Monkey(seed, Path(folder))
        try:
            for number in range(actions):
                try:
                    monkey.play(number)
                except Exception as error:
                    raise AssertionError(f"action {number} of seed {seed}: {monkey.work.document}") from error
                done = number + 1
                if number == actions // 10:
                    early = memory()
                if number % 250 == 249 and (alive := objects()) > ALLOWED:
                    raise AssertionError(f"{alive} objects are alive after {done} actions")
                if time.monotonic() - begun > seconds:
                    break
        finally:
            monkey.close()
    return {"actions": done, "seconds": time.monotonic() - begun, "early MB": early, "late MB": memory()}


def main() -> int:
    """Play as the arguments say."""
    given = [float(text) for text in sys.argv[1:]]
    actions, seed, seconds = (*given, *(10000, 0, 1e9)[len(given) :])
    told = play(int(actions), int(seed), seconds)
    print(told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
