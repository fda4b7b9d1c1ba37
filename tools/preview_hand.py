"""Mouse and keyboard of a user of the previewer's window, who sees where its fields are, and waits for what it does.

Fields and buttons are found by what the window has drawn in the last frame, and are pressed where they are seen.
Waiting is for the window's own state, and gives up when nothing is under way that could still change it.
"""

from __future__ import annotations

import itertools
import math
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from imgui_bundle import imgui

from translucent.preview import app
from translucent.preview.document import Document, camera_of
from translucent.preview.panels.viewport import on_screen
from translucent.preview.window_state import WindowState

#: Waiting for something to happen: one frame after the other, until the iterator ends.
Waiting = Iterator[None]

#: Frames for what a click does to be seen; those without work after which what has not happened will not; and seconds
#: after which it has not, whatever is under way.
FRAMES, RESTING, PATIENCE = 4, 200, 600.0

#: Pixels within which the mouse is where it was to be.
NEAR = 2.0

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
    """Mouse and keyboard of the display, by xdotool: the backend of Dear ImGui overrides events that are made there."""

    def __init__(self) -> None:
        self.window = ""

    def begin(self) -> Waiting:
        """Give the window the keyboard."""
        self.window = subprocess.check_output(["xdotool", "search", "--name", app.TITLE], text=True).split()[-1]
        yield from self._x("windowfocus", self.window)

    def _x(self, *words: object) -> Waiting:
        process = subprocess.Popen(["xdotool", *map(str, words)], stderr=subprocess.DEVNULL)
        while process.poll() is None:
            yield
        yield from frames()

    def move(self, place: tuple[float, float]) -> Waiting:
        """Move the mouse, and wait until it is there in the window."""
        yield from self._x("mousemove", "--window", self.window, round(place[0]), round(place[1]))
        for _ in range(RESTING):
            yield
            at = imgui.get_io().mouse_pos
            if math.dist((at.x, at.y), place) < NEAR:
                break
        yield from frames(1)

    def press(self, *, down: bool) -> Waiting:
        yield from self._x("mousedown" if down else "mouseup", 1)
        for _ in range(RESTING):
            if imgui.is_mouse_down(0) == down:
                break
            yield

    def wheel(self, steps: int) -> Waiting:
        yield from self._x("click", "--repeat", abs(steps), "--delay", 30, 4 if steps > 0 else 5)

    def key(self, name: str) -> Waiting:
        """Press and release a key, while those before plus signs are held."""
        *modifiers, last = name.split("+")
        for modifier in modifiers:
            yield from self.hold(modifier, down=True)
        yield from self._x("key", X_KEYS.get(last, last))
        yield from frames()
        for modifier in modifiers:
            yield from self.hold(modifier, down=False)

    def hold(self, name: str, *, down: bool) -> Waiting:
        """Press or release a key, and wait until the window knows: of keys that change in one frame, it sees the last
        state alone.
        """
        key = {"ctrl": imgui.Key.mod_ctrl, "shift": imgui.Key.mod_shift}.get(name) or getattr(imgui.Key, name)
        yield from self._x("keydown" if down else "keyup", name)
        for _ in range(RESTING):
            if imgui.is_key_down(key) == down:
                break
            yield

    def type(self, text: str) -> Waiting:
        yield from self._x("type", "--delay", 5, text)


def frames(count: int = FRAMES) -> Waiting:
    for _ in range(count):
        yield


@dataclass
class Artist:
    """A user's hand and eye in the window."""

    state: WindowState
    places: Places
    hand: Hand
    folder: Path

    @property
    def document(self) -> Document:
        return self.state.work.document

    @property
    def resting(self) -> bool:
        """True while nothing is under way in the window."""
        work = self.state.work
        return not (self.state.more or work.thumbnails.busy or any(lane.task for lane in work.lanes.values()))

    def until(self, there: Callable[[], object], what: str) -> Waiting:
        """Wait until something is there, as long as anything is under way that could bring it about."""
        begun, rested = time.monotonic(), 0
        while not there():
            rested = rested + 1 if self.resting else 0
            if rested > RESTING or time.monotonic() - begun > PATIENCE:
                told = [one.text for one in self.state.work.messages if one.kind != "info"][-1:]
                raise FailedError(f"{what}: not after {time.monotonic() - begun:.0f} s {told}")
            yield

    def seen(self, label: str, within: str = "") -> Waiting:
        """Wait for a widget, and scroll its panel until it is in view, and stays where it is."""
        yield from self.until(lambda: self.places.find(label, within), f"{label} is to be seen")
        for _ in range(60):
            place = self.at(label, within)
            yield from frames(2)
            if (now := self.places.find(label, within)) is None or now.low != place.low:
                yield from self.until(lambda: self.places.find(label, within), f"{label} is to be seen")
                continue
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
        yield from self.until(lambda: self.places.find("##name", "##browser"), "the browser is open")
        yield from self.click("##name", "##browser")
        yield from self.enter(str(path))
        yield from self.until(lambda: self.state.browser is None, "the browser closes")

    def in_view(self, x: float, y: float) -> tuple[float, float]:
        """Place in the window of a place in the viewport, in shares of its sides."""
        place = self.at("##viewport")
        return tuple(a + share * (b - a) for a, b, share in zip(place.low, place.high, (x, y), strict=True))  # type: ignore[return-value]

    def on_object(self, number: int) -> tuple[float, float]:
        """Place in the window of the middle of an object."""
        view = self.at("##viewport")
        size = view.high[0] - view.low[0], view.high[1] - view.low[1]
        assert self.document.orbit is not None
        found = on_screen(camera_of(self.document.orbit), self.state.objects[number].bounds, size)
        assert found is not None
        x, y = found.mean(axis=0)
        return view.low[0] + float(x), view.low[1] + float(y)

    def written(self, path: Path) -> Waiting:
        yield from self.until(path.is_file, f"{path.name} is written")


def require(value: object, text: str) -> None:
    """Raise if something is not so."""
    if not value:
        raise FailedError(text)
