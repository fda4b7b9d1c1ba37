"""State of the window beside the document, and the actions of its panels, keys, dropped files and scripts."""

from __future__ import annotations

import dataclasses
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import hello_imgui, imgui

from translucent.errors import InputError, TranslucentError
from translucent.gltf.load import SUFFIXES
from translucent.gltf.write import Filling, write_media
from translucent.media.colors import read_encoded
from translucent.planning.caustics import Caustics
from translucent.preview.actions import (
    Assign,
    ChoosePreset,
    Hide,
    Keep,
    Place,
    Recall,
    SetField,
    SetLights,
    SetMaterial,
    SetOrbit,
    SetTime,
    changed_material,
    preset_material,
    scattered_material,
)
from translucent.preview.dialogs import (
    QUESTIONS,
    Browser,
    browser_for,
    chosen_path,
    move_pointer,
    open_dialog,
)
from translucent.preview.document import (
    AddedLight,
    Look,
    Material,
    Model,
    Placed,
    Triple,
    checked,
    lens_of,
    triple_of,
)
from translucent.preview.exports import Recipe, command_line, python_code, write_picture, write_turntable
from translucent.preview.library import ENVIRONMENT_SUFFIXES, EnvironmentFolder, model_key, model_picture
from translucent.preview.measuring import Crossing, first_object
from translucent.preview.scenes import material_of, medium_of, placed_objects, request_of, tone_of
from translucent.preview.session import put_first, save_session
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace
from translucent.scene.camera import direction_from
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import fillable

#: Yaw and pitch in degrees of views by name.
VIEWS = {
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "right": (90.0, 0.0),
    "left": (-90.0, 0.0),
    "top": (0.0, 89.9),
    "bottom": (0.0, -89.9),
    "three quarters": (24.0, 18.0),
}

#: Largest number of triangles among which a thread finds the one under the mouse; else a worker process does.
PICKED_AT_ONCE = 200_000


def pixel_at(position: tuple[float, float], size: tuple[int, int]) -> tuple[int, int]:
    """Pixel at a position in fractions of a picture."""
    x, y = (min(max(int(fraction * side), 0), side - 1) for fraction, side in zip(position, size, strict=True))
    return x, y


@dataclass
class ProbedPixel:
    """Pixel under the mouse, with the reference's values for it, once they are requested and known."""

    pixel: tuple[int, int]
    scene: object
    crossing: Crossing | None = None
    requested: bool = False


@dataclass
class WindowState:
    """State of the window beside the document.

    Attributes
    ----------
    work : Workspace
    view : ViewportRenderer
    drag : int
        Number of the last drag: all changes in one are one step of undo.
    more, drawn : bool
        There is more to do for the view; its picture is done.
    idle : bool
        Nothing can be drawn before other work is done.
    pressed_at : (x, y)
        Where a button of the mouse was pressed, in fractions of the viewport.
    dragging_split : bool
    texts : dict
        Texts in fields that are not entered yet.
    hovered, pinned : (x, y), optional
        Probed positions, of the mouse and of a script, in fractions of the viewport.
    pointer : (x, y), optional
        Position of the mouse that a script gives, in fractions of the window.
    selected, light : int, optional
        Numbers of the selected object, and of the selected light that the user has added.
    gizmo : str
        What the gizmo of the selected object does: ``move``, ``rotate``, ``scale``, or nothing.
    playing : bool
        The animations of the model run.
    dialogs : list of (kind, dialog)
    baking : dict
        Options of maps.
    dragged : str
        Name of the preset that is dragged.
    browser : Browser, optional
    folders : list of str
        Folders that were used last.
    environments : EnvironmentFolder
    keys_shown : bool
        The page of keys is open.
    """

    work: Workspace
    view: ViewportRenderer
    drag: int = 0
    more: bool = True
    drawn: bool = False
    idle: bool = False
    pressed_at: tuple[float, float] = (0.0, 0.0)
    dragging_split: bool = False
    texts: dict[str, str] = field(default_factory=dict)
    probed: ProbedPixel | None = None
    hovered: tuple[float, float] | None = None
    pointer: tuple[float, float] | None = None
    pinned: tuple[float, float] | None = None
    selected: int | None = None
    light: int | None = None
    gizmo: str = ""
    playing: bool = False
    dialogs: list[tuple[str, Any]] = field(default_factory=list)
    baking: dict[str, Any] = field(default_factory=lambda: {"mode": "cone", "size": 512, "rays": 64})
    dragged: str = ""
    browser: Browser | None = None
    folders: list[str] = field(default_factory=list)
    environments: EnvironmentFolder = field(default_factory=EnvironmentFolder)
    keys_shown: bool = False
    _pictured: str = ""
    _played: float = 0.0
    _play_drag: int = 0
    _textures: dict[str, tuple[Any, Any]] = field(default_factory=dict)

    def draw(self, pixels: tuple[int, int]) -> bool:
        """Draw a step, and start measurements of a still view; returns whether more steps are to come."""
        self.work.size = pixels
        self._play()
        self.work.update()
        more = self.view.draw(self.work, pixels)
        self.drawn, self.idle = not more, self.view.idle or not more
        if self.view.viewport.steps(0) and not self.work.relights:
            self.view.foresee(self.work)
        # All pixels are there; edges may become smooth later.
        self.work.thumbnails.begin_frame(idle=not more or self.view.state.startswith("full"))
        if self.drawn and self.work.scene() is not None and self.work.lanes["load"].task is None:
            self._keep_picture()
        return self.work.compare(self.view.viewport.size) or more or bool(self.work.busy)

    @property
    def duration(self) -> float | None:
        """Seconds of the model's animations, if it has any."""
        return None if self.work.loaded is None else getattr(self.work.loaded.scene, "duration", None)

    def play(self) -> None:
        """Run the animations, as one step of undo, or stop them."""
        self.playing = not self.playing and self.duration is not None
        self._played = time.monotonic()
        self.drag += 1
        self._play_drag = self.drag

    def _play(self) -> None:
        """Go on to the time that it is, once the last one is on show."""
        now, work = time.monotonic(), self.work
        if not self.playing or work.loaded is None or work.loaded.model != work.document.model:
            return
        passed, self._played = now - self._played, now
        if (duration := self.duration) is None:
            self.playing = False
        else:
            moment = ((work.document.model.time or 0.0) + passed) % max(duration, 1e-6)
            work.do(SetTime(moment, self._play_drag))

    def _keep_picture(self) -> None:
        """Keep a small picture of a model's first resting view, for the list of recent files."""
        path = self.get("model.path")
        if self._pictured == path or not os.path.isfile(path) or not self.work.document.display.pictured:
            return
        self._pictured = path
        with self.view.current():
            pixels = self.view.viewport.pixels()
        self.work.thumbnails.put(model_key(path), model_picture(pixels))

    def texture(self, key: str, pixels: Any) -> Any:
        """Texture of a small picture."""
        known = self._textures.get(key)
        if known is None or known[0] is not pixels:
            if known is not None:
                known[1].release()
            size, content = pixels.shape[1::-1], np.ascontiguousarray(pixels[..., :3]).tobytes()
            known = pixels, self.view.renderer.gpu.context.gl.texture(size, 3, content, alignment=1)
            self._textures[key] = known
        return known[1]

    # Fields, objects and materials

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
    def objects(self) -> Sequence[Object]:
        """Objects of the model, in their places."""
        loaded = self.work.loaded
        return () if loaded is None else placed_objects(loaded.scene, self.work.document.placed)

    @property
    def target(self) -> int | None:
        """Number of the selected object, if there are others beside it; None: panels are about the whole model."""
        return self.selected if self.selected is not None and 1 < len(self.objects) > self.selected else None

    def select(self, number: int | None) -> None:
        """Select an object, or none."""
        self.selected, self.light = number, None

    @property
    def moved(self) -> int | None:
        """Number of the object that can be moved: the selected one, or the only one."""
        return 0 if len(self.objects) == 1 else self.target

    def place(self, place: Placed, drag: int | None = None) -> None:
        """Put an object into a place."""
        self.work.do(Place(place, drag))

    def change_place(self, name: str, value: Any, *, step: bool = False) -> None:
        """Give a field of the place of the moved object, such as ``location``, a value."""
        if (number := self.moved) is None:
            return self.work.refuse(InputError(f"placed.{name}", "no object is selected", "click an object first"))
        try:
            value = checked(f"placed.{name}", value, getattr(Placed(), name))
        except InputError as error:
            return self.work.refuse(error)
        before = self.work.document.place_of(number)
        return self.place(replace(before, **{name: value}), None if step else self.drag)

    def drop_to_ground(self) -> None:
        """Move the object down, or up, until it stands where the model as loaded does."""
        loaded, number = self.work.loaded, self.moved
        if loaded is not None and number is not None:
            place = self.work.document.place_of(number)
            x, y, z = place.location
            lift = float(loaded.scene.shown_bounds[0, 1] - self.objects[number].bounds[0, 1])
            self.place(replace(place, location=(x, y + lift, z)))

    def add_light(self) -> None:
        """Add a light above and before the model, as bright there as the directional light, and select it."""
        if (loaded := self.work.loaded) is None:
            return
        low, high = loaded.scene.shown_bounds
        middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low)) or 1.0
        yaw = 0.0 if self.work.document.orbit is None else self.work.document.orbit.yaw
        position = middle + 1.5 * size * direction_from(yaw + 30.0, 45.0)
        added = AddedLight(triple_of(position), 0.1 * size, Look().light_irradiance * (1.5 * size) ** 2)
        self.work.do(SetLights((*self.work.document.lights, added)))
        self.light = len(self.work.document.lights) - 1

    def remove_light(self, number: int) -> None:
        """Remove a light."""
        lights = self.work.document.lights
        self.light = None
        self.work.do(SetLights((*lights[:number], *lights[number + 1 :])))

    def change_light(self, name: str, value: Any, *, step: bool = False) -> None:
        """Give a field of the selected light a value."""
        lights = list(self.work.document.lights)
        if self.light is None or self.light >= len(lights):
            return self.work.refuse(InputError(f"light.{name}", "no light is selected", "add or select a light first"))
        try:
            value = checked(f"light.{name}", value, getattr(AddedLight(), name))
        except InputError as error:
            return self.work.refuse(error)
        lights[self.light] = replace(lights[self.light], **{name: value})
        return self.work.do(SetLights(tuple(lights), None if step else self.drag))

    def snapshot(self, name: str, *, keep: bool) -> None:
        """Store the document as a snapshot, or show a snapshot."""
        self.work.do(Keep(name) if keep else Recall(name))

    def compare_with(self, name: str) -> None:
        """Show a snapshot right of the split, beside the present state."""
        self.change("display.snapshot", name, step=True)
        self.change("display.compare", "snapshot", step=True)

    def view_from(self, name: str) -> None:
        """See the model from a side of `VIEWS`."""
        if name not in VIEWS:
            return self.work.refuse(InputError(f"view {name!r}", "no view has this name", f"use {', '.join(VIEWS)}"))
        if (orbit := self.work.document.orbit) is not None:
            yaw, pitch = VIEWS[name]
            self.work.do(SetOrbit(replace(orbit, yaw=yaw, pitch=pitch)))
            self.work.frame(self.selected)
        return None

    def name_of(self, number: int) -> str:
        """Name of an object."""
        return self.objects[number].mesh.name or f"object {number}"

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

    def _assign(self, number: int, change: Callable[[Material], Material], drag: int | None = None) -> None:
        try:
            material = change(self.material_of(number))
        except TranslucentError as error:
            return self.work.refuse(error)
        return self.work.do(Assign(number, material, drag))

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
                self.work.tell("warning", f"{name} was not assigned: drop the preset on an object")
            else:
                self.choose_preset(name, number if len(self.objects) > 1 else None)

        self.pick(position, give)

    def save_preset(self, words: str) -> bool:
        """Save the material as an own preset; returns whether it is."""
        try:
            path, left_out = self.work.library.save(words, self.material)
        except TranslucentError as error:
            self.work.refuse(error)
            return False
        self.work.tell("info", f"saved {path}")
        if left_out:
            self.work.tell("warning", f"a preset cannot store: {', '.join(left_out)}")
        return True

    def pick(self, position: tuple[float, float], then: Callable[[int | None], None]) -> None:
        """Find the first object at a position, in fractions of the viewport, in the background; None: there is none."""
        scene, size = self.work.scene(), self.view.viewport.size
        if scene is None:
            return

        visible = self.work.document.shown_among(len(self.objects))  # before the ground of a stage

        def take(found: int | None) -> None:
            then(visible[found] if found is not None and found < len(visible) else None)

        pixel = pixel_at(position, size)
        if self.work.loaded is not None and self.work.loaded.triangles <= PICKED_AT_ONCE:
            self.work.lanes["ray"].start("", lambda _: first_object(scene, size, pixel), take)
        else:
            self.work.cross(scene, size, pixel, lambda found: take(found.body))

    def use_texture(self, slot: str, path: str) -> None:
        """Put a picture, or none, into a slot of the material: ``color_texture`` or ``roughness_texture``."""
        if path and any(item.mesh.uv is None for item in self._textured()):
            found = "the mesh has no texture coordinates"
            return self.work.refuse(InputError(f"texture {path!r}", found, "unwrap the mesh in a modeler first"))
        if path:
            try:
                read_encoded(path, f"texture {path!r}")
            except TranslucentError as error:
                return self.work.refuse(error)
        return self.change(f"material.{slot}", path, step=True)

    def _textured(self) -> Sequence[Object]:
        """Objects with the material of the panels."""
        if self.work.loaded is None:
            return ()
        return fillable(self.work.loaded.scene) if self.target is None else (self.objects[self.target],)

    def scatter(self, color: Triple | None = None, radius: float | None = None) -> None:
        """Give the material another diffuse color, or another radius of its scattered light in metres."""

        def change(material: Material) -> Material:
            return scattered_material(material, color, radius)

        if self.target is not None:
            return self._assign(self.target, change, self.drag)
        try:
            return self.work.do(SetMaterial(change(self.material), self.drag))
        except TranslucentError as error:
            return self.work.refuse(error)

    def hide(self, number: int) -> None:
        """Hide an object, or show it again; the last one on show stays."""
        self._require(number)
        hidden = set(self.work.document.hidden) ^ {number}
        if hidden >= set(range(len(self.objects))):
            found = "no other object is visible"
            return self.work.refuse(
                InputError(
                    f"hiding {self.name_of(number)}",
                    found,
                    "at least one object must stay visible: show another object first",
                )
            )
        return self.work.do(Hide(tuple(hidden)))

    def isolate(self, number: int) -> None:
        """Show an object alone, or all if it is alone."""
        self._require(number)
        every = range(len(self.objects))
        alone = self.work.document.shown_among(len(every)) == (number,)
        self.work.do(Hide(() if alone else tuple(i for i in every if i != number)))

    def _require(self, number: int) -> None:
        if not 0 <= number < len(self.objects):
            raise InputError(
                f"object {number}",
                f"the model has {len(self.objects)} objects",
                "give an object number, counted from 0",
            )

    def turn_light(self, right: float, up: float) -> None:
        """Turn the light around and upwards, by degrees; it is switched on if it was off."""
        if not self.get("look.light"):
            self.change("look.light", True)
        self.change("look.light_yaw", math.remainder(self.get("look.light_yaw") + right, 360.0))
        self.change("look.light_pitch", min(max(self.get("look.light_pitch") + up, -89.0), 89.0))

    def escape(self) -> None:
        """Close the topmost dialog, or clear the selection."""
        if self.browser is not None:
            self.browser = None
        elif self.keys_shown:
            self.keys_shown = False
        else:
            self.select(None)

    # Files

    def ask_file(self, kind: str, *, system: bool = True) -> None:
        """Ask for a file to read or to write: in a dialog of the system, or where it has none in the browser."""
        if kind not in QUESTIONS:
            raise InputError(f"ask {kind!r}", "the window has no such question", f"use one of {', '.join(QUESTIONS)}")
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

    def answer(self, path: str | None = None) -> None:
        """Use the file that the browser names, or this one, and close it; else it says why not."""
        if self.browser is None:
            raise InputError(f"answer {path!r}", "no question is open", "open a question first")
        self.browser.text = self.browser.text if path is None else path
        if (chosen := self.browser.accept()) is not None:
            kind, self.browser = self.browser.kind, None
            self.use_file(kind, chosen)

    def take_answers(self) -> None:
        """Use the files of dialogs that have been answered."""
        for entry in list(self.dialogs):
            if (path := chosen_path(entry[1])) is not None:
                self.dialogs.remove(entry)
                if path:
                    self.use_file(entry[0], path)

    def take_dropped(self, paths: Sequence[str]) -> None:
        """Open the first session or model, light it with the first environment, and warn of the others."""
        lights = [path for path in paths if Path(path).suffix.lower() in ENVIRONMENT_SUFFIXES]
        models = [path for path in paths if path not in lights]
        if lights:
            self.environments.take(lights[0])
            self.change("look.environment", lights[0], step=True)
        if models and Path(models[0]).suffix.lower() == ".toml":
            self.work.open_session(models[0])
        elif models:
            self.work.open(dataclasses.replace(self.work.document.model, path=models[0]))
        if others := [*models[1:], *lights[1:]]:
            names = ", ".join(Path(path).name for path in others[:3]) + (", ..." if len(others) > 3 else "")
            text = f"{len(others)} dropped files are ignored, because the window shows one model at a time: {names}"
            self.work.tell("warning", text)

    def use_file(self, kind: str, path: str) -> None:
        """Read or write a file, according to its dialog."""
        work = self.work
        self.folders = put_first(str(Path(path).resolve().parent), self.folders)
        match kind:
            case "open":
                work.open(Model(path, self.get("model.unit")))
            case "open session":
                work.open_session(path)
            case "save session":
                work.attempt(lambda: save_session(path, work.document), f"saved {path}")
            case "environment" | "background":
                work.do(SetField(f"look.{kind}", path))
                self.environments.take(path)
            case "save glb":
                self._save_medium(path)
            case "map":
                if (bake := work.bake) is not None:
                    work.write(path, lambda _: bake.map.save(path))
            case "color texture" | "roughness texture":
                self.use_texture(kind.replace(" ", "_"), path)
            case "png" | "exr" | "turntable":
                self._export(kind, path)
            case _:
                found = f"{kind!r} is not a known file question"
                work.refuse(InputError(f"file {path!r}", found, f"use {', '.join(QUESTIONS)}"))

    def _save_medium(self, path: str) -> None:
        """Write the model's file with the medium in its materials; other types of files have none to keep."""
        source, document, outside = self.get("model.path"), self.work.document, self.work.allow_outside
        if Path(source).suffix.lower() not in SUFFIXES:
            do = "copy the medium as glTF, or convert the model to .glb first"
            return self.work.refuse(InputError(f"saving into {path!r}", f"{Path(source).name} is no glTF file", do))
        named = [(self.objects[one.object].mesh.name, one.material) for one in document.assigned]
        whole = [] if named and document.material.source == "file" else [(None, document.material)]
        fillings = [Filling(medium_of(one), one.distance, name) for name, one in (*whole, *named)]
        return self.work.write(path, lambda _: write_media(source, path, fillings, allow_outside=outside))

    def _export(self, kind: str, path: str) -> None:
        scene, document = self.work.picture(), self.work.document
        if scene is None:
            return
        assert document.orbit is not None
        options, request = document.export, request_of(document, self._caustics(scene))
        look = document.look.exposure, tone_of(document.look, scene)
        view = scene, options.size(self.view.viewport.size), look
        if kind == "turntable":
            self.work.export(path, write_turntable, *view, request, round(options.pictures))
        else:
            request = replace(request, transparent=options.transparent, denoise=options.denoise)
            lens = lens_of(document.look, document.orbit)
            self.work.export(path, write_picture, *view, request, round(options.samples), lens)

    def copy_recipe(self, kind: str) -> str | None:
        """Copy a ``command``, or ``python``, that makes the picture from here; None before there is one."""
        work = self.work
        if (scene := work.picture()) is None or work.loaded is None:
            return None
        if work.shown_bake is not None:
            work.refuse(
                InputError(
                    "copy a recipe",
                    "the picture shows a baked map on the model, which the copied text cannot reproduce",
                    "turn off 'show on the model' first",
                )
            )
            return None
        recipe = Recipe(work.document, work.loaded, scene, self.view.viewport.size, self._caustics(scene))
        text, left_out = (python_code(recipe), []) if kind == "python" else command_line(recipe)
        if left_out:
            work.tell("warning", f"the copied command leaves out: {', '.join(left_out)}; Copy Python has them")
        else:
            work.tell("info", "copied as Python" if kind == "python" else "copied as a command")
        imgui.set_clipboard_text(text)
        return text

    def _caustics(self, scene: Scene) -> Caustics | None:
        """Photons of a file: as many as the picture on show has, and what ``translucent render`` follows at least."""
        document = self.work.document
        if not document.display.caustics:
            return None
        light = self.view.photons.light
        caustics = Caustics(max(light.photons if light is not None else 0, Caustics().photons))
        try:
            self.view.renderer.plan_requested(scene, request_of(document, caustics))
        except InputError as error:
            self.work.tell("warning", f"without caustics: {error}")
            return None
        return caustics

    # Mouse, keys and panels, for scripts

    @property
    def io(self) -> Any:
        """Input of the window."""
        return imgui.get_io()

    def press(self, name: str) -> None:
        """Press and release a key, with modifiers before a plus sign, such as ``ctrl+z``."""
        modifiers = {"ctrl": imgui.Key.mod_ctrl, "shift": imgui.Key.mod_shift, "alt": imgui.Key.mod_alt}
        keys = [modifiers.get(word) or getattr(imgui.Key, word, None) for word in name.lower().split("+")]
        if None in keys:
            raise InputError(f"key {name!r}", "no key has this name", "write a key such as escape, f1 or ctrl+z")
        for down in (True, False):  # one after the other, in as many frames
            for key in keys:
                self.io.add_key_event(key, down)

    def hold_pointer(self) -> None:
        """Keep the mouse where a script has put it, whatever the system reports."""
        if self.pointer is not None:
            size = self.io.display_size
            place = self.pointer[0] * size.x, self.pointer[1] * size.y
            move_pointer(*place)
            self.io.add_mouse_pos_event(*place)

    def select_panel(self, panel: str) -> None:
        """Bring a panel to the front of its tabs."""
        docking = hello_imgui.get_runner_params().docking_params
        names = [one.label for one in docking.dockable_windows if one.label != "Viewport"]
        if panel not in names:
            raise InputError(f"panel {panel!r}", "no panel has this name", f"use {', '.join(names)}")
        docking.dockable_window_of_name(panel).focus_window_at_next_frame = True
