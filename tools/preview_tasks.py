"""Twenty tasks of an artist in the previewer, by mouse and keyboard: ``python tools/preview_tasks.py [NAME...]``.

On a display of its own (Xvfb), in two windows one after the other. Where xdotool is installed, the pointer and the
keys are those of the system; else imgui is told of them. Fields and buttons are found by what the window has drawn in
the last frame, so that the tool presses what a user sees, where it is seen. Each task checks its result. For each are
told the seconds that it took, the longest frame, how much of that the renderer took, and the time of all cores in it,
which tells more where others use them. ``--size 2560x1600 --scale 2`` for a large display, ``--keep FOLDER`` for a
picture of the window after each task.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import imgui
from PIL import Image, ImageGrab

import translucent as tl
from translucent.assets import mesh_path
from translucent.preview import app
from translucent.preview import desk as desks
from translucent.preview.desk import Desk
from translucent.preview.document import Document, Model
from translucent.preview.orbiting import camera_of
from translucent.preview.panels.viewport import on_screen, probe_lines
from translucent.preview.picturing import ball_key, model_key
from translucent.preview.script import PAUSE, Script

#: Waiting for something to happen: one frame after the other, until the iterator ends.
Waiting = Iterator[None]

#: Seconds after which something that was to happen has not, and frames for what a click does to be seen.
PATIENCE, FRAMES = 300.0, 4

#: Widgets whose places are noted, by their labels.
WIDGETS = ("button", "small_button", "selectable", "checkbox", "invisible_button", "slider_float", "color_edit3")
WIDGETS += ("input_text", "input_text_with_hint", "begin_combo", "begin_menu", "menu_item")

#: Names of keys, as X has them.
X_KEYS = {"escape": "Escape", "enter": "Return", "f1": "F1"}


class FailedError(AssertionError):
    """A task whose result is not there."""


@dataclass
class Place:
    """Place of a widget in the window, in the part of it that is seen, and the frame in which it was drawn."""

    low: tuple[float, float]
    high: tuple[float, float]
    clip: tuple[float, float]
    window: str
    frame: int

    @property
    def middle(self) -> tuple[float, float]:
        return (self.low[0] + self.high[0]) / 2, (self.low[1] + self.high[1]) / 2


class Places:
    """Places of the widgets that were drawn."""

    def __init__(self) -> None:
        self.known: dict[tuple[str, str], Place] = {}
        for name in WIDGETS:
            setattr(imgui, name, self._noting(name, getattr(imgui, name)))

    def _noting(self, name: str, draw: Callable[..., Any]) -> Callable[..., Any]:
        def noting(label: str, *arguments: Any, **options: Any) -> Any:
            done = draw(label, *arguments, **options)
            if name != "begin_combo" or not done:  # of an open one, the last thing drawn is within its list
                low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
                window = imgui.internal.get_current_window()
                rect = window.inner_clip_rect
                clip = (-math.inf, math.inf) if "menu" in name else (rect.min.y, rect.max.y)
                frame = imgui.get_frame_count()
                place = Place((low.x, low.y), (high.x, high.y), clip, window.name, frame)
                self.known[window.name, label] = place
            return done

        return noting

    def find(self, label: str, within: str = "") -> Place | None:
        """Place of a widget that is drawn now, in a window whose name has `within`."""
        now = imgui.get_frame_count()
        found = (place for (window, text), place in self.known.items() if text == label and within in window)
        return next((place for place in found if place.frame >= now - 1), None)


class Hand:
    """Mouse and keyboard: those of the system by xdotool, or what imgui is told."""

    def __init__(self) -> None:
        self.real = shutil.which("xdotool") is not None
        self.window = ""

    def begin(self) -> Waiting:
        """Give the window the keyboard."""
        if self.real:
            self.window = subprocess.check_output(["xdotool", "search", "--name", app.TITLE], text=True).split()[-1]
            yield from self._x("windowfocus", self.window)

    def _x(self, *words: object) -> Waiting:
        process = subprocess.Popen(["xdotool", *map(str, words)], stderr=subprocess.DEVNULL)
        while process.poll() is None:
            yield
        yield from frames()

    def move(self, place: tuple[float, float]) -> Waiting:
        if self.real:
            yield from self._x("mousemove", "--window", self.window, round(place[0]), round(place[1]))
        else:
            imgui.get_io().add_mouse_pos_event(*place)
            yield from frames()

    def press(self, *, down: bool) -> Waiting:
        if self.real:
            yield from self._x("mousedown" if down else "mouseup", 1)
        else:
            imgui.get_io().add_mouse_button_event(0, down)
            yield from frames()

    def wheel(self, steps: int) -> Waiting:
        if self.real:
            yield from self._x("click", "--repeat", abs(steps), "--delay", 30, 4 if steps > 0 else 5)
        else:
            imgui.get_io().add_mouse_wheel_event(0.0, steps)
            yield from frames()

    def key(self, name: str, down: bool | None = None) -> Waiting:
        """Press and release a key, with modifiers before a plus sign; or one of both."""
        if self.real:
            verb = {None: "key", True: "keydown", False: "keyup"}[down]
            between = ("--delay", 60)  # each in a frame of its own, as by a hand
            yield from self._x(verb, *between, "+".join(X_KEYS.get(word, word) for word in name.split("+")))
            return
        modifiers = {"ctrl": imgui.Key.mod_ctrl, "shift": imgui.Key.mod_shift}
        keys = [modifiers.get(word) or getattr(imgui.Key, word) for word in name.split("+")]
        for pressed in (True, False) if down is None else (down,):
            for one in keys:
                imgui.get_io().add_key_event(one, pressed)
        yield from frames()

    def type(self, text: str) -> Waiting:
        if self.real:
            yield from self._x("type", "--delay", 5, text)
        else:
            imgui.get_io().add_input_characters_utf8(text)
            yield from frames()


def frames(count: int = FRAMES) -> Waiting:
    for _ in range(count):
        yield


@dataclass
class Artist:
    """What a user does in the window, and sees there."""

    desk: Desk
    places: Places
    hand: Hand
    folder: Path

    @property
    def document(self) -> Document:
        return self.desk.work.document

    def until(self, there: Callable[[], object], what: str, seconds: float = PATIENCE) -> Waiting:
        begun = time.monotonic()
        while not there():
            if time.monotonic() - begun > seconds:
                told = [one.text for one in self.desk.work.messages if one.kind != "info"][-1:]
                raise FailedError(f"{what}: not after {seconds:.0f} s {told}")
            yield

    def seen(self, label: str, within: str = "") -> Waiting:
        """Wait for a widget, and scroll its panel until it is in view."""
        yield from self.until(lambda: self.places.find(label, within), f"{label} is to be seen", 20.0)
        for _ in range(60):
            place = self.at(label, within)
            top, bottom = place.clip
            if top <= place.low[1] and place.high[1] <= bottom:
                return
            yield from self.hand.move((place.middle[0], (top + bottom) / 2))
            yield from self.hand.wheel(1 if place.low[1] < top else -1)
        raise FailedError(f"{label} does not scroll into view")

    def at(self, label: str, within: str = "") -> Place:
        place = self.places.find(label, within)
        if place is None:
            raise FailedError(f"{label} is not in the window")
        return place

    def click(self, label: str, within: str = "", end: bool = False) -> Waiting:
        """Click a widget in the middle, or at its right end."""
        yield from self.seen(label, within)
        place = self.at(label, within)
        x, y = place.middle
        yield from self.click_at((place.high[0] - (place.high[1] - place.low[1]) / 2, y) if end else (x, y))

    def click_at(self, place: tuple[float, float]) -> Waiting:
        yield from self.hand.move(place)
        yield from self.hand.press(down=True)
        yield from self.hand.press(down=False)

    def drag(self, *way: tuple[float, float]) -> Waiting:
        """Drag from the first place over the others to the last."""
        yield from self.hand.move(way[0])
        yield from self.hand.press(down=True)
        for begin, end in itertools.pairwise(way):
            for share in (0.1, 0.25, 0.5, 0.75, 1.0):
                x, y = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
                yield from self.hand.move((x, y))
        yield from self.hand.press(down=False)

    def panel(self, name: str) -> Waiting:
        """Click on the tab of a panel."""
        rectangle = imgui.internal.find_window_by_name(name).dc.dock_tab_item_rect
        yield from self.click_at(((rectangle.min.x + rectangle.max.x) / 2, (rectangle.min.y + rectangle.max.y) / 2))

    def choose(self, label: str, word: str) -> Waiting:
        """Choose a word of a list."""
        yield from self.click(label)
        yield from self.click(word, "##Combo")

    def enter(self, text: str) -> Waiting:
        """Type over what a field holds."""
        yield from self.hand.key("ctrl+a")
        yield from self.hand.type(text)
        yield from self.hand.key("enter")

    def answer(self, path: Path) -> Waiting:
        """Name a file in the browser that is open."""
        yield from self.until(lambda: self.places.find("##name", "##browser"), "the browser is open", 10.0)
        yield from self.click("##name", "##browser")
        yield from self.enter(str(path))
        yield from self.until(lambda: self.desk.browser is None, "the browser closes", 10.0)

    def in_view(self, x: float, y: float) -> tuple[float, float]:
        """Place in the window of a place in the viewport, in shares of its sides."""
        place = self.at("##viewport")
        return tuple(a + share * (b - a) for a, b, share in zip(place.low, place.high, (x, y), strict=True))  # type: ignore[return-value]

    def on_object(self, number: int) -> tuple[float, float]:
        """Place in the window of the middle of an object."""
        view = self.at("##viewport")
        size = view.high[0] - view.low[0], view.high[1] - view.low[1]
        assert self.document.orbit is not None
        found = on_screen(camera_of(self.document.orbit), self.desk.objects[number].bounds, size)
        assert found is not None
        x, y = found.mean(axis=0)
        return view.low[0] + float(x), view.low[1] + float(y)

    def written(self, path: Path, seconds: float = PATIENCE) -> Waiting:
        yield from self.until(path.is_file, f"{path.name} is written", seconds)


def require(value: object, text: str) -> None:
    if not value:
        raise FailedError(text)


def open_model(a: Artist, name: str) -> Waiting:
    yield from a.hand.key("ctrl+o")
    yield from a.answer(a.folder / name)
    yield from a.until(lambda: Path(a.document.model.path).name == name and a.desk.drawn, f"{name} is on show")


def open_file(a: Artist) -> Waiting:
    yield from open_model(a, "bear.ply")


def frame(a: Artist) -> Waiting:
    before = a.document.orbit
    yield from a.hand.move(a.in_view(0.3, 0.7))
    yield from a.hand.wheel(-6)
    yield from a.drag(a.in_view(0.5, 0.5), a.in_view(0.7, 0.4))
    require(a.document.orbit != before, "wheel and drag move the camera")
    yield from a.hand.key("f")
    view = a.at("##viewport")
    assert a.document.orbit is not None
    size = view.high[0] - view.low[0], view.high[1] - view.low[1]
    box = on_screen(camera_of(a.document.orbit), a.desk.objects[0].bounds, size)
    assert box is not None
    spans = (box.max(axis=0) - box.min(axis=0)) / size
    require(0.6 < spans.max() <= 1.1, f"the model fills the view, not {spans.max():.0%} of it")


def preset_by_picture(a: Artist) -> Waiting:
    yield from a.panel("Library")
    yield from a.click("##search")
    yield from a.enter("jade")
    key = ball_key(tl.preset("jade"))
    yield from a.until(lambda: key in a.desk._textures, "there is a picture of jade", 300.0)
    yield from a.click("##jade")
    require(a.document.material.preset == "jade", "the model is of jade")


def drag_color(a: Artist) -> Waiting:
    yield from a.panel("Material")
    before = a.document.material.color
    steps = len(a.desk.work.history.past)
    yield from a.click("##color", "Material", end=True)
    stack = imgui.internal.find_window_by_name("Material").ctx.open_popup_stack
    require(len(stack), "the picker opens")
    window, unit = stack[len(stack) - 1].window, imgui.get_frame_height()
    # The wheel of imgui's picker, by how it is laid out there.
    picture = 12.0 * unit - unit - imgui.get_style().item_inner_spacing.x
    middle = window.work_rect.min.x + (picture + unit) / 2, window.work_rect.min.y + picture / 2
    ring = 0.46 * picture
    way = [(middle[0] + ring * np.cos(t), middle[1] + ring * np.sin(t)) for t in np.linspace(0.4, 3.0, 5)]
    yield from a.drag(*way)
    require(a.document.material.color != before, "the color follows the mouse")
    require(a.document.material.source == "color", "the medium is of that color")
    require(len(a.desk.work.history.past) == steps + 1, "a drag is one step")
    yield from a.hand.key("escape")


def distance(a: Artist) -> Waiting:
    yield from a.seen("##distance")
    yield from a.hand.key("ctrl", True)
    yield from a.click("##distance")
    yield from a.hand.key("ctrl", False)
    yield from a.enter("7.5")
    require(abs(a.document.material.distance - 0.0075) < 1e-9, f"7.5 mm, not {a.document.material.distance} m")


def compare(a: Artist) -> Waiting:
    yield from a.panel("Method")
    yield from a.choose("##display.compare", "method")
    yield from a.until(lambda: a.desk.stage.plans[1] is not None, "the other method is drawn")
    require(isinstance(a.desk.stage.plans[1].method, tl.ThinLayer), "it is the thin layer")  # type: ignore[union-attr]
    yield from a.drag(a.in_view(0.5, 0.8), a.in_view(0.35, 0.8))
    require(abs(a.document.display.split - 0.35) < 0.03, "the split follows the mouse")


def probe(a: Artist) -> Waiting:
    yield from a.hand.move(a.in_view(0.25, 0.55))

    def told() -> bool:
        lines = probe_lines(a.desk, a.desk.hovered) if a.desk.hovered else []
        return any("thickness" in line for line in lines) and any("reference" in line for line in lines)

    yield from a.until(told, "the probe tells thickness and the reference")


def read_reference(a: Artist) -> Waiting:
    yield from a.choose("##display.compare", "off")
    yield from a.click("##display.inset")
    require(a.document.display.inset, "the inset is asked for")
    measured = a.desk.work
    yield from a.until(lambda: measured.measured is not None and measured.measured.errors, "it is measured")
    require(measured.measured.errors[0].median < 1e-5, "the median error of thickness")  # type: ignore[union-attr]
    yield from a.until(lambda: a.desk._inset is not None, "the inset is on show")


def bake(a: Artist) -> Waiting:
    yield from a.panel("Files")
    yield from a.choose("##bakesize", "256")
    yield from a.choose("##bakerays", "16")
    yield from a.click("Bake", "Files")
    yield from a.until(lambda: a.desk.work.bake is not None, "there is a map")
    path = a.folder / "thickness.exr"
    yield from a.click("Save map ...")
    yield from a.answer(path)
    yield from a.written(path)
    yield from a.click("show on the model")
    require(a.desk.work.shown_bake is None, "the medium is on show again")


def save_png(a: Artist) -> Waiting:
    yield from a.panel("Files")
    yield from a.click("transparent background")
    yield from a.click("PNG ...")
    path = a.folder / "view.png"
    yield from a.answer(path)
    yield from a.written(path)
    alpha = np.asarray(Image.open(path))[..., 3]
    require(alpha.min() == 0 and alpha.max() > 100, "there is the model, and nothing beside it")


def save_turntable(a: Artist) -> Waiting:
    yield from a.panel("Files")
    a.desk.export["pictures"] = 6  # no knob asks for so few
    yield from a.click("Turntable ...")
    path = a.folder / "turntable.gif"
    yield from a.answer(path)
    yield from a.written(path)
    require(getattr(Image.open(path), "n_frames", 1) == 6, "six pictures")


def undo_ten(a: Artist) -> Waiting:
    yield from a.panel("Material")
    first = a.document.material.roughness
    for tenths in range(1, 11):
        yield from a.hand.key("ctrl", True)
        yield from a.click("##material.roughness")
        yield from a.hand.key("ctrl", False)
        yield from a.enter(f"{tenths / 20:g}")
    require(a.document.material.roughness == 0.5, "roughness is what was typed")
    before = len(a.desk.work.history.past)
    require(before >= 10, f"{before} steps to undo")
    for _ in range(10):
        yield from a.hand.key("ctrl+z")
    work = a.desk.work
    yield from a.until(lambda: len(work.history.past) <= before - 10, "ten steps are undone", 10.0)
    require(len(work.history.past) == before - 10, "no more than ten steps are undone")
    require(a.document.material.roughness == first, "roughness is as it was")


def open_second(a: Artist) -> Waiting:
    yield from open_model(a, "two.glb")
    require(len(a.desk.objects) == 2, "there are two objects")


def assign_two(a: Artist) -> Waiting:
    yield from a.panel("Scene")
    name = a.desk.name_of(0)
    yield from a.click(f"{name}##name")
    require(a.desk.selected == 0, f"{name} is selected")
    yield from a.panel("Library")
    yield from a.click("##search")
    yield from a.enter("wax")
    yield from a.click("##wax")
    yield from a.click("##search")
    yield from a.enter("honey")
    yield from a.seen("##honey")
    yield from a.drag(a.at("##honey").middle, a.in_view(0.5, 0.9), a.on_object(1))
    yield from a.until(lambda: a.document.own_material(1) is not None, "honey arrives", 20.0)
    found = [a.document.own_material(i) for i in (0, 1)]
    require([one.preset if one else "" for one in found] == ["wax", "honey"], "each has its own")


def hide_and_show(a: Artist) -> Waiting:
    yield from a.panel("Scene")
    yield from a.click(f"{a.desk.name_of(1)}##name")
    yield from a.click("Isolate", "Scene")
    require(a.document.hidden == (0,), "the other is hidden")
    yield from a.until(lambda: a.desk.drawn, "it is drawn")
    yield from a.click("Show all")
    require(a.document.hidden == (), "both are on show")


def save_glb(a: Artist) -> Waiting:
    yield from a.panel("Files")
    yield from a.click("Save medium into .glb ...")
    path = a.folder / "saved.glb"
    yield from a.answer(path)
    yield from a.written(path)
    media = [item.medium for item in tl.load_scene(path).objects]
    require(media[0] and media[1] and media[0] != media[1], "each object has its medium")


def turn_environment(a: Artist) -> Waiting:
    before = a.document.look.rotation
    yield from a.hand.move(a.in_view(0.4, 0.6))
    yield from a.hand.key("e", True)
    yield from a.drag(a.in_view(0.4, 0.6), a.in_view(0.6, 0.6))
    yield from a.hand.key("e", False)
    require(a.document.look.rotation != before, "it turns")


def load_hdr(a: Artist) -> Waiting:
    yield from a.panel("Environments")
    yield from a.click("Open ...", "Environments")
    yield from a.answer(a.folder / "sky.hdr")
    yield from a.until(lambda: a.document.look.environment.endswith("sky.hdr"), "it lights the model", 20.0)

    def lit() -> bool:
        scene = a.desk.work.scene()
        return scene is not None and scene.environment.kind == "image" and a.desk.stage.viewport.steps(0) > 0

    yield from a.until(lit, "it is in the picture")
    require(a.desk.work.failure is None, f"nothing failed: {a.desk.work.failure}")


def find_key(a: Artist) -> Waiting:
    yield from a.hand.key("f1")
    yield from a.until(lambda: imgui.is_popup_open("", imgui.PopupFlags_.any_popup), "the page opens", 5.0)
    yield from a.hand.key("escape")
    require(not a.desk.keys_shown, "Escape closes it")


def copy_blender(a: Artist) -> Waiting:
    yield from a.panel("Material")
    yield from a.click("Blender")
    require("bpy" in imgui.get_clipboard_text(), "there is a script for Blender")


def leave(a: Artist) -> Waiting:
    yield from a.click("File")
    yield from a.click("Quit")


def find_again(a: Artist) -> Waiting:
    yield from a.click("File")
    yield from a.click("Recent")
    recent = a.desk.work.recent
    require([Path(path).name for path in recent[:2]] == ["two.glb", "bear.ply"], f"recent files are {recent}")
    yield from a.until(lambda: model_key(recent[0]) in a.desk._textures, "they have pictures", 10.0)
    path = Path(recent[0])
    label = next(text for _, text in a.places.known if text.startswith(f"{path.name}\n"))
    yield from a.click(label)
    yield from a.until(lambda: a.document.model.path == recent[0] and a.desk.drawn, "it is on show")
    require(a.desk.environments.path == str(a.folder), "the folder of environments is known")


#: Tasks by name, in their order; the last is of a second window.
TASKS: dict[str, Callable[[Artist], Waiting]] = {
    "open": open_file,
    "frame": frame,
    "png with alpha": save_png,
    "turntable": save_turntable,
    "preset by picture": preset_by_picture,
    "drag color": drag_color,
    "distance in mm": distance,
    "compare": compare,
    "probe": probe,
    "reference": read_reference,
    "bake": bake,
    "undo ten times": undo_ten,
    "second file": open_second,
    "two materials": assign_two,
    "hide and show": hide_and_show,
    "save .glb": save_glb,
    "turn environment": turn_environment,
    "load .hdr": load_hdr,
    "find a key": find_key,
    "copy for blender": copy_blender,
    "close": leave,
}
AGAIN: dict[str, Callable[[Artist], Waiting]] = {"find everything again": find_again, "close": leave}


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
    _last: float = 0.0
    _last_spent: float = 0.0
    _longest: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _artist: Artist | None = None
    _places: Places = field(default_factory=Places)

    def step(self, desk: Desk) -> bool:
        """Continue the task; returns whether all are done."""
        now = time.perf_counter()
        if self._running is not None and self._last:
            spent = time.process_time() - self._last_spent
            self._longest = max(self._longest, (now - self._last, desk.stage.drawing, spent))
        ended = self._continue(desk)
        if desk.drawn:
            time.sleep(PAUSE)  # other processes need the time more
        self._last, self._last_spent = (
            time.perf_counter(),
            time.process_time(),
        )  # what the tool does is no part of a frame
        return ended

    def _continue(self, desk: Desk) -> bool:
        if self._artist is None:
            if desk.work.loaded is None or desk.stage.timings[0].wall == 0.0:
                return False
            self._artist = Artist(desk, self._places, Hand(), self.folder)
            self._running = self._artist.hand.begin()
            return False
        if self._running is None:
            if not self.todo:
                return True
            self._name, task = self.todo.pop(0)
            self._running, self._began, self._longest = task(self._artist), time.perf_counter(), (0.0, 0.0, 0.0)
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
        spent, (longest, drawing, cpu) = time.perf_counter() - self._began, self._longest
        text = (
            f"longest frame {1e3 * longest:5.0f} ms, {1e3 * drawing:5.0f} of drawing, {1e3 * cpu:5.0f} ms of all cores"
        )
        print(f"{self._name:22} {spent:6.1f} s, {text}{'; FAILED: ' if problem else ''}{problem}", flush=True)
        if self.keep is not None:
            picture = ImageGrab.grab(xdisplay=os.environ["DISPLAY"])
            picture.save(self.keep / f"{len(list(self.keep.glob('*.png'))):02d}_{self._name.replace(' ', '_')}.png")


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
    desks.open_dialog = lambda _: None  # the browser of the window's own, on every machine
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
    if options.folder:
        return play(options)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.keep:
            Path(options.keep).mkdir(parents=True, exist_ok=True)
        own = {key: str(folder / key.lower()) for key in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
        own |= {"MESA_SHADER_CACHE_DIR": str(Path.home() / ".cache" / "mesa_shader_cache")}
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
