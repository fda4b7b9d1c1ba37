"""State of the window beside the document, and the widgets that panels share: rows, fields, cards."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from imgui_bundle import ImVec2, hello_imgui, imgui

from translucent.errors import TranslucentError
from translucent.preview.actions import Assign, ChoosePreset, SetField, changed_material, preset_material
from translucent.preview.dialogs import Browser, browser_for, open_dialog
from translucent.preview.document import RANGES, TIPS, Material
from translucent.preview.library import EnvironmentFolder
from translucent.preview.measuring import Crossing, first_object
from translucent.preview.scenes import material_of
from translucent.preview.thumbnails import model_key, model_picture
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Comparing, Workspace
from translucent.scene.scene import Object
from translucent.scene.showcase import fillable

#: Largest number of triangles among which a thread finds the one under the mouse; else a worker process does.
PICKED_AT_ONCE = 200_000

#: sRGB colors of warnings, errors and secondary lines.
WARNING, ERROR, FAINT = (1.0, 0.75, 0.35, 1.0), (1.0, 0.45, 0.35, 1.0), (0.62, 0.64, 0.68, 1.0)


@dataclass
class Probed:
    """Probed pixel, with the reference's values for it."""

    pixel: tuple[int, int]
    scene: object
    crossing: Crossing | None = None
    asked: bool = False


@dataclass
class WindowState:
    """Window state, none of which is part of the document."""

    work: Workspace
    view: ViewportRenderer
    drag: int = 0
    more: bool = True
    drawn: bool = False
    waits: bool = False
    pressed_at: tuple[float, float] = (0.0, 0.0)
    dragging_split: bool = False
    texts: dict[str, str] = field(default_factory=dict)
    probed: Probed | None = None
    hovered: tuple[float, float] | None = None
    pointer: tuple[float, float] | None = None
    pinned: tuple[float, float] | None = None
    selected: int | None = None
    dialogs: list[tuple[str, Any]] = field(default_factory=list)
    export: dict[str, Any] = field(default_factory=lambda: {"transparent": False, "pictures": 36})
    baking: dict[str, Any] = field(default_factory=lambda: {"mode": "cone", "size": 512, "rays": 64})
    dragged: str = ""
    browser: Browser | None = None
    folders: list[str] = field(default_factory=list)
    environments: EnvironmentFolder = field(default_factory=EnvironmentFolder)
    keys_shown: bool = False
    kept_of: str = ""
    _textures: dict[str, Any] = field(default_factory=dict)
    _inset: tuple[Any, Any] | None = None

    def __post_init__(self) -> None:
        self.comparing = Comparing(self.work)

    def change(self, name: str, value: Any, *, step: bool = False) -> None:
        """Give a field a value; all changes while the mouse is down are one undo step.

        Fields of the material are those of the selected object.
        """
        section, _, key = name.partition(".")
        drag = None if step else self.drag
        if section != "material" or self.target is None:
            return self.work.do(SetField(name, value, drag))
        return self._assign(self.target, lambda material: changed_material(material, key, value), drag)

    def get(self, name: str) -> Any:
        """Value of a field of the document; of the material, that of the selected object."""
        section, _, key = name.partition(".")
        return getattr(self.material if section == "material" else getattr(self.work.document, section), key)

    @property
    def target(self) -> int | None:
        """Number of the selected object, if there are others beside it; None: panels are about the whole model."""
        objects = self.objects
        return self.selected if self.selected is not None and 1 < len(objects) > self.selected else None

    @property
    def objects(self) -> Sequence[Object]:
        """Objects of the model."""
        return () if self.work.loaded is None else self.work.loaded.scene.objects

    @property
    def target_text(self) -> str:
        """Target that a material is assigned to."""
        return "fills the model" if self.target is None else f"assigns to {self.name_of(self.target)}"

    @property
    def material(self) -> Material:
        """Material of the selected object, or of the model."""
        return self.material_of(self.target)

    def material_of(self, number: int | None) -> Material:
        """Material of an object: its own one, or that of the model."""
        document, loaded = self.work.document, self.work.loaded
        if number is None or loaded is None:
            return document.material
        if (own := document.own_material(number)) is not None:
            return own
        filled = any(one is loaded.scene.objects[number] for one in fillable(loaded.scene))
        own_of_file = document.material.source == "file" or not filled
        return material_of(loaded.scene, number) if own_of_file else document.material

    def choose_preset(self, name: str, number: int | None = None) -> None:
        """Fill an object with a preset: this one, the selected one, or the model."""
        number = self.target if number is None else number
        if number is None:
            return self.work.do(ChoosePreset(name))
        return self._assign(number, lambda material: preset_material(material, name))

    def drop_preset(self, name: str, position: tuple[float, float]) -> None:
        """Fill the object at a position of the viewport with a preset, as soon as it is known."""

        def give(number: int | None) -> None:
            if number is None:
                self.work.tell("warning", f"{name} is not assigned: nothing is there; drop it on an object")
            else:
                self.choose_preset(name, number if len(self.objects) > 1 else None)

        self.pick(position, give)

    def pick(self, position: tuple[float, float], then: Callable[[int | None], None]) -> None:
        """Find the first object at a position, in shares of the viewport, in the background; None: there is none."""
        scene, size = self.work.scene(), self.view.viewport.size
        if scene is None:
            return

        shown = self.work.document.shown_among(len(self.objects))  # before the ground of a stage

        def take(found: int | None) -> None:
            then(shown[found] if found is not None and found < len(shown) else None)

        x, y = (min(max(int(share * side), 0), side - 1) for share, side in zip(position, size, strict=True))
        if self.work.loaded is not None and self.work.loaded.triangles <= PICKED_AT_ONCE:
            self.work.lanes["ray"].start("", lambda _: first_object(scene, size, (x, y)), take)
        else:
            self.work.cross(scene, size, (x, y), lambda found: take(found.body))

    def select(self, number: int | None) -> None:
        """Select an object, or none."""
        self.selected = number

    def name_of(self, number: int) -> str:
        """Name of an object."""
        return self.objects[number].mesh.name or f"object {number}"

    def _assign(self, number: int, change: Callable[[Material], Material], drag: int | None = None) -> None:
        try:
            material = change(self.material_of(number))
        except TranslucentError as error:
            return self.work.refuse(error)
        return self.work.do(Assign(number, material, drag))

    def draw(self, pixels: tuple[int, int]) -> bool:
        """Draw a step, and start measurements of a still view; returns whether more steps are to come."""
        self.work.size = pixels
        self.work.update()
        more = self.view.draw(self.work, pixels)
        self.drawn = not more
        self.waits = self.view.waits or not more
        # All pixels are there; edges may become smooth later.
        self.work.thumbnails.begin_frame(idle=not more or self.view.state.startswith("full"))
        if self.drawn and self.work.scene() is not None and self.work.lanes["load"].task is None:
            self._keep_picture()
        uncompared = self.comparing.step(self.view.viewport.size)
        return more or uncompared or bool(self.work.busy)

    def frame(self) -> None:
        """Frame the whole model, or the object that was clicked."""
        self.work.frame(self.selected)

    def turn_light(self, right: float, up: float) -> None:
        """Turn the light around and upwards, by degrees; it is switched on if it was off."""
        if not self.get("look.light"):
            self.change("look.light", True)
        self.change("look.light_yaw", math.remainder(self.get("look.light_yaw") + right, 360.0))
        self.change("look.light_pitch", min(max(self.get("look.light_pitch") + up, -89.0), 89.0))

    def ask_file(self, kind: str, *, system: bool = True) -> None:
        """Ask for a file to read or to write: in a dialog of the system, or where it has none in the browser."""
        dialog = open_dialog(kind) if system else None
        if dialog is not None:
            self.dialogs.append((kind, dialog))
        else:
            folder = self.environments.path if kind in ("environment", "background") else ""
            places = [place for place in (folder, *self.folders, *self.places()) if os.path.isdir(place)]
            self.browser = browser_for(kind, Path(places[0]))

    def places(self) -> list[str]:
        """Folders to begin with: recent ones, that of the model, the working folder and the user's own."""
        model = self.get("model.path")
        own = str(Path(model).resolve().parent) if os.path.isfile(model) else ""
        return [one for one in dict.fromkeys((*self.folders, own, os.getcwd(), str(Path.home()))) if os.path.isdir(one)]

    def light_with(self, name: str) -> None:
        """Light the model with an environment."""
        self.change("look.environment", name, step=True)

    def escape(self) -> None:
        """Close what is on top: the file browser, the page of keys, or let go of the selected object."""
        if self.browser is not None:
            self.browser = None
        elif self.keys_shown:
            self.keys_shown = False
        else:
            self.select(None)

    def _keep_picture(self) -> None:
        """Keep a small picture of a model's first resting view, for the list of recent files."""
        path = self.get("model.path")
        if self.kept_of == path or not os.path.isfile(path) or not self.work.document.display.pictured:
            return
        self.kept_of = path
        with self.view.current():
            seen = self.view.viewport.pixels()
        self.work.thumbnails.put(model_key(path), model_picture(seen))

    def texture(self, key: str, pixels: Any) -> Any:
        """Texture of a small picture."""
        if key not in self._textures:
            height, width = pixels.shape[:2]
            content = np.ascontiguousarray(pixels[..., :3]).tobytes()
            self._textures[key] = self.view.renderer.gpu.context.gl.texture((width, height), 3, content, alignment=1)
        return self._textures[key]

    def inset_texture(self, pixels: Any) -> Any:
        """Texture of the reference's small picture."""
        if self._inset is None or self._inset[0] is not pixels:
            if self._inset is not None:
                self._inset[1].release()
            height, width = pixels.shape[:2]
            gl = self.view.renderer.gpu.context.gl
            self._inset = pixels, gl.texture((width, height), 3, np.ascontiguousarray(pixels).tobytes(), alignment=1)
        return self._inset[1]


def em(count: float) -> float:
    """Length of so many ems in pixels, whatever the display's scale."""
    return float(hello_imgui.em_size(count))


def begin_rows(name: str) -> bool:
    """Begin a table of labels and fields."""
    if not imgui.begin_table(name, 2, imgui.TableFlags_.sizing_stretch_prop):
        return False
    imgui.table_setup_column("label", imgui.TableColumnFlags_.width_fixed, em(9.2))
    imgui.table_setup_column("field", imgui.TableColumnFlags_.width_stretch, 1.0)
    return True


def row(label: str, tip: str = "") -> None:
    """Draw the label of the next field."""
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    imgui.text(label)
    tooltip(tip)
    imgui.table_next_column()
    imgui.set_next_item_width(-1.0)


def slider(
    state: WindowState,
    label: str,
    name: str,
    low: float,
    high: float,
    form: str = "%.3f",
    *,
    log: bool = False,
    unit: float = 1.0,
) -> None:
    """Slider for a number of the document, shown in a unit."""
    row(label, TIPS.get(name, ""))
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if log else 0)
    changed, value = imgui.slider_float(f"##{name}", state.get(name) / unit, low / unit, high / unit, form, flags)
    if not imgui.is_item_active():
        tooltip(TIPS.get(name, ""))
    if imgui.is_item_activated():
        state.drag += 1
    if changed and math.isfinite(value):
        state.change(name, value * unit)


def triple(state: WindowState, label: str, name: str, speed: float, form: str = "%.5g", *, tip: str = "") -> None:
    """Fields for three numbers of the document, at least 0, on a line of their own; not in a table."""
    wide_row(label, tip or TIPS.get(name, ""))
    value = list(state.get(name))
    changed, values = imgui.drag_float3(f"##{name}", value, speed, 0.0, min(RANGES[name].high, 1e9), form)
    if imgui.is_item_activated():
        state.drag += 1
    if changed and all(math.isfinite(v) for v in values):
        state.change(name, [max(v, 0.0) for v in values])


def choice(state: WindowState, label: str, name: str, words: tuple[str, ...], *, tip: str = "") -> None:
    """Choice of one of some words."""
    row(label, tip or TIPS.get(name, ""))
    now = state.get(name)
    if imgui.begin_combo(f"##{name}", str(now)):
        for word in words:
            if imgui.selectable(word, word == now)[0]:
                state.change(name, word, step=True)
        imgui.end_combo()


def tooltip(text: str) -> None:
    """Draw a wrapped tooltip while the mouse is over the last item."""
    if text and imgui.is_item_hovered() and imgui.begin_tooltip():
        imgui.push_text_wrap_pos(em(30.0))
        imgui.text(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def wide_row(label: str, tip: str = "") -> None:
    """Label of a field on the whole line below it, outside a table."""
    imgui.text(label)
    tooltip(tip)
    imgui.set_next_item_width(-1.0)


def check(state: WindowState, label: str, name: str, *, tip: str = "") -> None:
    """Checkbox."""
    row(label, tip or TIPS.get(name, ""))
    changed, value = imgui.checkbox(f"##{name}", bool(state.get(name)))
    if changed:
        state.change(name, value, step=True)


def fact(label: str, text: str, color: tuple[float, float, float, float] | None = None) -> None:
    """Label and text, wrapped over as many lines as it takes."""
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.text_colored(FAINT, label)
    imgui.table_next_column()
    imgui.push_text_wrap_pos(0.0)
    if color is None:
        imgui.text(text)
    else:
        imgui.text_colored(color, text)
    imgui.pop_text_wrap_pos()


def wrapped(text: str, color: tuple[float, float, float, float]) -> None:
    """Draw wrapped text."""
    imgui.push_text_wrap_pos(0.0)
    imgui.text_colored(color, text)
    imgui.pop_text_wrap_pos()


#: Ems between two cards.
GAP = 0.5

CHOSEN, HOVERED, PLAIN = 0xFFFFB050, 0xFFC0C0C0, 0x40FFFFFF

T = TypeVar("T")


def draw_cards(
    members: Sequence[T], least: float, height: Callable[[float], float], draw: Callable[[T, ImVec2], None]
) -> None:
    """Draw the cards of a list in rows, as far as they can be seen.

    Parameters
    ----------
    members : sequence
    least : float
        Width of a card in ems, at least.
    height : callable
        From the width of a card to its height, in pixels.
    draw : callable
        Draws the card of a member, in a size.
    """
    room = imgui.get_content_region_avail().x
    across = max(int((room + em(GAP)) / em(least + GAP)), 1)
    width = (room - em(GAP) * (across - 1)) / across
    size = ImVec2(width, height(width))
    for i, member in enumerate(members):
        if i % across:
            imgui.same_line(0.0, em(GAP))
        if imgui.is_rect_visible(size):
            draw(member, size)
        else:
            imgui.dummy(size)


def draw_frame(over: imgui.ImDrawList, low: ImVec2, high: ImVec2, *, chosen: bool, hovered: bool) -> None:
    """Draw the frame of a card's picture, which tells whether it is chosen."""
    over.add_rect(low, high, CHOSEN if chosen else HOVERED if hovered else PLAIN, 0.0, em(0.12) if chosen else 1.0)
