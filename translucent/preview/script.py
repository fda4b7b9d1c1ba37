"""Scripts: user actions as a list in TOML; for tests, pictures of the window and demonstrations.

Every ``[[action]]`` has a verb in ``do``. Of documents: ``change`` (field, value), ``open`` (model, unit), ``preset``
(name), ``turn`` (right, up: degrees), ``pan`` (right, down: heights of the picture), ``zoom`` (factor, right, down),
``undo``, ``redo``, ``frame``. Of the library: ``library`` (search), ``drop`` (preset, x, y: shares of the viewport),
``save_preset`` (name), ``environments`` (folder). Of files: ``ask`` (kind: as of ``save``), in our own browser, and
``answer`` (file). Of the keyboard: ``key`` (name, such as escape or ctrl+z), ``type`` (text). Of objects: ``pick`` (x,
y: shares of the viewport), ``object`` (number; -1: none), ``hide``, ``isolate`` (number). Of the window: ``probe`` (x,
y: shares of the viewport), ``select`` (panel), ``wait`` (seconds; without them, until nothing is under way),
``reload``, ``bake`` (mode, size, rays), ``save`` (kind, file), ``session`` (file). Of the mouse: ``point`` (x, y:
shares of the window), ``press``, ``release`` (button), ``wheel`` (steps).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from translucent.errors import InputError
from translucent.preview.actions import Pan, Turn, Zoom
from translucent.preview.document import Model
from translucent.preview.session import read_toml

if TYPE_CHECKING:
    from translucent.preview.window_state import WindowState

#: Seconds after which a script continues, whatever work is under way.
PATIENCE = 120.0

#: Seconds between frames of a script that waits for other processes, which need the time more.
PAUSE = 0.03

#: Frames between two actions, so that changes are drawn before the next one.
FRAMES = 2

#: Names of panels.
PANELS = ("Material", "Library", "Scene", "Method", "Look", "Environments", "Files", "Messages")

_WORDS: dict[str, dict[str, Any]] = {
    "change": {"field": str, "value": object},
    "open": {"model": str, "unit": "m"},
    "preset": {"name": str},
    "turn": {"right": 0.0, "up": 0.0},
    "pan": {"right": 0.0, "down": 0.0},
    "zoom": {"factor": 1.0, "right": 0.0, "down": 0.0},
    "library": {"search": ""},
    "pick": {"x": 0.5, "y": 0.5},
    "object": {"number": -1},
    "hide": {"number": int},
    "isolate": {"number": int},
    "drop": {"preset": str, "x": 0.5, "y": 0.5},
    "save_preset": {"name": str},
    "ask": {"kind": str},
    "answer": {"file": str},
    "environments": {"folder": str},
    "key": {"name": str},
    "type": {"text": str},
    "undo": {},
    "redo": {},
    "frame": {},
    "probe": {"x": 0.5, "y": 0.5},
    "select": {"panel": str},
    "wait": {"seconds": -1.0},
    "reload": {},
    "bake": {"mode": "cone", "size": 256, "rays": 16},
    "save": {"kind": str, "file": str},
    "session": {"file": str},
    "point": {"x": 0.5, "y": 0.5},
    "press": {"button": 0},
    "release": {"button": 0},
    "wheel": {"steps": 1.0},
}


@dataclass(frozen=True)
class Step:
    """One action of a script."""

    do: str
    values: dict[str, Any]


@dataclass
class Script:
    """Running script.

    Attributes
    ----------
    steps : list of Step
        Those that are still to be done, the next one last.
    remembers : bool
        Whether the window remembers what windows without a script remember.
    """

    steps: list[Step]
    remembers: ClassVar[bool] = False
    _frames: int = 0
    _waiting: float | None = None
    _until: float = 0.0
    done: list[Step] = field(default_factory=list)

    @classmethod
    def of(cls, steps: list[Step]) -> Script:
        """Script that waits for the model first, and for all work at the end."""
        settle = Step("wait", {"seconds": -1.0})
        return cls([settle, *steps, settle][::-1])

    def step(self, state: WindowState) -> bool:
        """Do the next action, if it is time; returns whether all are done."""
        hold_pointer(state)
        if self._waiting is not None:
            if not self._rested(state):
                return False
            self._waiting = None
        self._frames += 1
        if self._frames < FRAMES:
            return False
        self._frames = 0
        if not self.steps:
            return True
        step = self.steps.pop()
        self.done.append(step)
        if step.do == "wait":
            self._waiting = time.monotonic()
            self._until = step.values["seconds"]
        else:
            perform(state, step)
        return False

    def _rested(self, state: WindowState) -> bool:
        assert self._waiting is not None
        passed = time.monotonic() - self._waiting
        if state.waits:
            time.sleep(PAUSE)
        if self._until >= 0:
            return passed >= self._until
        return passed > 0.5 and (not (state.more or state.work.thumbnails.busy) or passed > PATIENCE)


def read_script(path: str | Path) -> Script:
    """Read a script from a file.

    Raises
    ------
    InputError
        If there is no such file, or an action in it is unknown, lacks a value or has one of the wrong type.
    """
    what = f"script {str(path)!r}"
    table = read_toml(path, what)
    actions = table.get("action")
    if not isinstance(actions, list) or set(table) != {"action"}:
        raise InputError(what, "not a list of [[action]]", 'write [[action]], and do = "turn" below')
    return Script.of([read_step(one, f"{what}, action {i}") for i, one in enumerate(actions, 1)])


def read_step(table: Any, where: str) -> Step:
    """Check one action."""
    verb = table.get("do") if isinstance(table, dict) else None
    if verb not in _WORDS:
        close = get_close_matches(str(verb), _WORDS, n=1)
        raise InputError(where, f"do = {verb!r}", f"did you mean {close[0]}?" if close else f"use {', '.join(_WORDS)}")
    known, values = _WORDS[verb], {key: value for key, value in table.items() if key != "do"}
    if unknown := sorted(set(values) - set(known)):
        raise InputError(where, f"{verb} knows no {unknown[0]!r}", f"use {', '.join(known) or 'nothing'}")
    found = {}
    for key, default in known.items():
        required = isinstance(default, type)
        if key not in values and required:
            raise InputError(where, f"{verb} without {key!r}", f"give it: {', '.join(known)}")
        value = values.get(key, default)
        kind = default if required else type(default)
        if kind is float and isinstance(value, int):
            value = float(value)
        if kind is not object and not isinstance(value, kind):
            raise InputError(where, f"{key} = {value!r}", f"give a {kind.__name__}")
        found[key] = value
    return Step(verb, found)


def perform(state: WindowState, step: Step) -> None:
    """Do one action."""
    work, v = state.work, step.values
    verbs: dict[str, Callable[[], object]] = {
        "change": lambda: state.change(v["field"], v["value"], step=True),
        "open": lambda: work.open(Model(v["model"], v["unit"])),
        "preset": lambda: state.choose_preset(v["name"]),
        "library": lambda: setattr(work.library, "search", v["search"]),
        "pick": lambda: state.pick((v["x"], v["y"]), state.select),
        "object": lambda: state.select(None if v["number"] < 0 else v["number"]),
        "hide": lambda: _hide(state, v["number"], alone=False),
        "isolate": lambda: _hide(state, v["number"], alone=True),
        "drop": lambda: state.drop_preset(v["preset"], (v["x"], v["y"])),
        "save_preset": lambda: _save_preset(state, v["name"]),
        "ask": lambda: _ask(state, v["kind"]),
        "answer": lambda: _answer(state, v["file"]),
        "environments": lambda: state.environments.take(v["folder"]),
        "key": lambda: _press(v["name"]),
        "type": lambda: _io().add_input_characters_utf8(v["text"]),
        "turn": lambda: work.do(Turn(v["right"], v["up"])),
        "pan": lambda: work.do(Pan(v["right"], v["down"])),
        "zoom": lambda: work.do(Zoom(v["factor"], v["right"], v["down"])),
        "undo": work.undo,
        "redo": work.redo,
        "frame": state.frame,
        "probe": lambda: setattr(state, "pinned", (v["x"], v["y"])),
        "select": lambda: _select(v["panel"]),
        "reload": lambda: state.view.reload(work),
        "bake": lambda: work.start_bake(v["mode"], v["size"], v["rays"]),
        "save": lambda: _use_file(state, v["kind"], v["file"]),
        "session": lambda: work.open_session(v["file"]),
        "point": lambda: setattr(state, "pointer", (v["x"], v["y"])),
        "press": lambda: _io().add_mouse_button_event(v["button"], True),
        "release": lambda: _io().add_mouse_button_event(v["button"], False),
        "wheel": lambda: _io().add_mouse_wheel_event(0.0, v["steps"]),
    }
    verbs[step.do]()


def _hide(state: WindowState, number: int, *, alone: bool) -> None:
    from translucent.preview.panels.scene import hide, isolate

    if not 0 <= number < len(state.objects):
        raise InputError(f"object {number}", f"the model has {len(state.objects)}", "give a number from 0 on")
    (isolate if alone else hide)(state, number)


def _use_file(state: WindowState, kind: str, path: str) -> None:
    from translucent.preview.panels.files import use_file

    use_file(state, kind, path)


def _ask(state: WindowState, kind: str) -> None:
    from translucent.preview.dialogs import QUESTIONS

    if kind not in QUESTIONS:
        raise InputError(f"ask {kind!r}", "there is no such question", f"use one of {', '.join(QUESTIONS)}")
    state.ask_file(kind, system=False)


def _answer(state: WindowState, path: str) -> None:
    from translucent.preview.panels.files import accept_answer

    if state.browser is None:
        raise InputError(f"answer {path!r}", "nothing is asked", "ask first")
    state.browser.text = path
    accept_answer(state)


def _press(name: str) -> None:
    """Press and release a key, with modifiers before a plus sign, such as ``ctrl+z``."""
    from imgui_bundle import imgui

    words = name.lower().split("+")
    modifiers = {"ctrl": imgui.Key.mod_ctrl, "shift": imgui.Key.mod_shift, "alt": imgui.Key.mod_alt}
    keys = [modifiers.get(word) or getattr(imgui.Key, word, None) for word in words]
    if None in keys:
        raise InputError(f"key {name!r}", "there is none of that name", "write for example escape, f1 or ctrl+z")
    for down in (True, False):  # one after the other, in as many frames
        for key in keys:
            _io().add_key_event(key, down)


def _save_preset(state: WindowState, name: str) -> None:
    from translucent.preview.panels.files import save_preset

    save_preset(state, name)


def hold_pointer(state: WindowState) -> None:
    """Keep the mouse where the script has put it, whatever the system reports."""
    if state.pointer is not None:
        from translucent.preview.dialogs import move_pointer

        size = _io().display_size
        place = state.pointer[0] * size.x, state.pointer[1] * size.y
        move_pointer(*place)
        _io().add_mouse_pos_event(*place)


def _io() -> Any:
    from imgui_bundle import imgui

    return imgui.get_io()


def _select(panel: str) -> None:
    from imgui_bundle import hello_imgui

    window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(panel)
    if window is None:
        raise InputError(f"panel {panel!r}", "there is none", f"use {', '.join(PANELS)}")
    window.focus_window_at_next_frame = True
