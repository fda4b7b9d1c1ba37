"""Scripts: user actions as a list in TOML; for tests, pictures of the window and demonstrations.

Every ``[[action]]`` has a verb in ``do``. Of documents: ``change`` (field, value), ``open`` (model, unit), ``resize``
(height, as 12cm), ``stand`` (up: y or z), ``time`` (seconds), ``play``, ``preset`` (name), ``scatter`` (color, radius),
``texture`` (slot: color_texture or roughness_texture; file), ``turn`` (right, up: degrees), ``view`` (name), ``pan``
(right, down: heights of the picture), ``zoom`` (factor, right, down), ``undo``, ``redo``, ``frame``, ``keep``,
``recall`` and ``compare_with`` (name of a snapshot). Of lights: ``add_light``, ``light`` (field, value: of the selected
one), ``remove_light`` (number). Of places: ``place`` (field, value: of the selected object), ``ground``, ``gizmo``
(name: move, rotate, scale).
Of the library: ``library`` (search), ``drop`` (preset, x, y: fractions of the
viewport), ``save_preset`` (name), ``environments`` (folder). Of files: ``ask`` (kind: as of ``save``), in our own
browser, and ``answer`` (file). Of the keyboard: ``key`` (name, such as escape or ctrl+z), ``type`` (text). Of
objects: ``pick`` (x, y: fractions of the viewport), ``object`` (number; -1: none), ``hide``, ``isolate`` (number). Of
the window: ``probe`` (x, y: fractions of the viewport), ``select`` (panel), ``wait`` (seconds; without them, until
nothing is under way), ``reload``, ``bake`` (mode, size, rays), ``save`` (kind, file), ``session`` (file). Of the
mouse: ``point`` (x, y: fractions of the window), ``press``, ``release`` (button), ``wheel`` (steps).
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from translucent.errors import InputError
from translucent.media.colors import parse_color
from translucent.preview.actions import OrbitBy, Pan, SetTime, Stand, Zoom
from translucent.preview.document import Model, triple_of
from translucent.preview.session import read_toml
from translucent.units import parse_length

if TYPE_CHECKING:
    from translucent.preview.window_state import WindowState

#: Seconds after which a script continues, whatever work is under way.
PATIENCE = 120.0

#: Seconds between frames of a script that waits for other processes, which need the time more.
PAUSE = 0.03

#: Frames between two actions, so that changes are drawn before the next one.
FRAMES = 2

#: Actions by their verbs. A default of a parameter is its value where a script gives none, or if it is a type, the type
#: of a value that every script has to give.
VERBS: dict[str, Callable[..., object]] = {
    "change": lambda state, field=str, value=object: state.change(field, value, step=True),
    "open": lambda state, model=str, unit="m": state.work.open(Model(model, unit)),
    "resize": lambda state, height=str: state.work.resize(parse_length(height)),
    "preset": lambda state, name=str: state.choose_preset(name),
    "turn": lambda state, right=0.0, up=0.0: state.work.do(OrbitBy(right, up)),
    "pan": lambda state, right=0.0, down=0.0: state.work.do(Pan(right, down)),
    "zoom": lambda state, factor=1.0, right=0.0, down=0.0: state.work.do(Zoom(factor, right, down)),
    "view": lambda state, name=str: state.view_from(name),
    "stand": lambda state, up=str: state.work.do(Stand(up)),
    "gizmo": lambda state, name="": setattr(state, "gizmo", name),
    "place": lambda state, field=str, value=object: state.change_place(field, value, step=True),
    "ground": lambda state: state.drop_to_ground(),
    "add_light": lambda state: state.add_light(),
    "light": lambda state, field=str, value=object: state.change_light(field, value, step=True),
    "remove_light": lambda state, number=int: state.remove_light(number),
    "scatter": lambda state, color="", radius="": state.scatter(
        triple_of(parse_color(color)) if color else None, parse_length(radius) if radius else None
    ),
    "texture": lambda state, slot=str, file="": state.use_texture(slot, file),
    "keep": lambda state, name=str: state.snapshot(name, keep=True),
    "recall": lambda state, name=str: state.snapshot(name, keep=False),
    "compare_with": lambda state, name=str: state.compare_with(name),
    "time": lambda state, seconds=0.0: state.work.do(SetTime(seconds)),
    "play": lambda state: state.play(),
    "library": lambda state, search="": setattr(state.work.library, "search", search),
    "pick": lambda state, x=0.5, y=0.5: state.pick((x, y), state.select),
    "object": lambda state, number=-1: state.select(None if number < 0 else number),
    "hide": lambda state, number=int: state.hide(number),
    "isolate": lambda state, number=int: state.isolate(number),
    "drop": lambda state, preset=str, x=0.5, y=0.5: state.drop_preset(preset, (x, y)),
    "save_preset": lambda state, name=str: state.save_preset(name),
    "ask": lambda state, kind=str: state.ask_file(kind, system=False),
    "answer": lambda state, file=str: state.answer(file),
    "environments": lambda state, folder=str: state.environments.take(folder),
    "key": lambda state, name=str: state.press(name),
    "type": lambda state, text=str: state.io.add_input_characters_utf8(text),
    "undo": lambda state: state.work.undo(),
    "redo": lambda state: state.work.redo(),
    "frame": lambda state: state.work.frame(state.selected),
    "probe": lambda state, x=0.5, y=0.5: setattr(state, "pinned", (x, y)),
    "select": lambda state, panel=str: state.select_panel(panel),
    "wait": lambda state, seconds=-1.0: None,  # see `Script.step`
    "reload": lambda state: state.view.reload(state.work),
    "bake": lambda state, mode="cone", size=256, rays=16: state.work.start_bake(mode, size, rays),
    "save": lambda state, kind=str, file=str: state.use_file(kind, file),
    "session": lambda state, file=str: state.work.open_session(file),
    "point": lambda state, x=0.5, y=0.5: setattr(state, "pointer", (x, y)),
    "press": lambda state, button=0: state.io.add_mouse_button_event(button, True),
    "release": lambda state, button=0: state.io.add_mouse_button_event(button, False),
    "wheel": lambda state, steps=1.0: state.io.add_mouse_wheel_event(0.0, steps),
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
        Steps that are still to be done, the next one last.
    remembers : bool
        Whether the window remembers what windows without a script remember.
    """

    steps: list[Step]
    remembers: ClassVar[bool] = False
    _frames: int = 0
    _waiting: float | None = None
    _until: float = 0.0

    @classmethod
    def of(cls, steps: list[Step]) -> Script:
        """Script that waits for the model first, and for all work at the end."""
        settle = Step("wait", {"seconds": -1.0})
        return cls([settle, *steps, settle][::-1])

    def step(self, state: WindowState) -> bool:
        """Do the next action, if it is time; returns whether all are done."""
        state.hold_pointer()
        if self._waiting is not None:
            passed = time.monotonic() - self._waiting
            if state.idle:
                time.sleep(PAUSE)
            busy = (state.more or state.work.thumbnails.busy) and passed <= PATIENCE
            if passed < self._until if self._until >= 0 else passed <= 0.5 or busy:
                return False
            self._waiting = None
        self._frames += 1
        if self._frames < FRAMES:
            return False
        self._frames = 0
        if not self.steps:
            return True
        step = self.steps.pop()
        if step.do == "wait":
            self._waiting, self._until = time.monotonic(), step.values["seconds"]
        VERBS[step.do](state, **step.values)
        return False


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
        raise InputError(
            what, "the file does not contain a list of [[action]]", 'write [[action]], and do = "turn" on the next line'
        )
    return Script.of([read_step(one, f"{what}, action {i}") for i, one in enumerate(actions, 1)])


def read_step(table: Any, where: str) -> Step:
    """Check one action."""
    verb = table.get("do") if isinstance(table, dict) else None
    if not isinstance(verb, str) or verb not in VERBS:
        close = get_close_matches(str(verb), VERBS, n=1)
        raise InputError(where, f"do = {verb!r}", f"did you mean {close[0]}?" if close else f"use {', '.join(VERBS)}")
    _, *parameters = inspect.signature(VERBS[verb]).parameters.values()
    known, values = {one.name: one.default for one in parameters}, {k: v for k, v in table.items() if k != "do"}
    if unknown := sorted(set(values) - set(known)):
        raise InputError(
            where, f"the action {verb} has no parameter {unknown[0]!r}", f"use {', '.join(known) or 'nothing'}"
        )
    found = {}
    for key, default in known.items():
        required = isinstance(default, type)
        if key not in values and required:
            raise InputError(
                where, f"the action {verb} needs the parameter {key!r}", f"add the parameter: {', '.join(known)}"
            )
        value = values.get(key, default)
        kind = default if required else type(default)
        if kind is float and isinstance(value, int):
            value = float(value)
        if kind is not object and not isinstance(value, kind):
            raise InputError(where, f"{key} = {value!r}", f"give a value of type {kind.__name__}")
        found[key] = value
    return Step(verb, found)
