"""Workspace behind the window: the history, the loaded model, and the work under way. No window, no GPU."""

from __future__ import annotations

import dataclasses
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

from translucent.errors import RenderError, TranslucentError
from translucent.files.paths import remove_partial
from translucent.planning.methods import Method
from translucent.preview.actions import Action, Adopt, History, Open, Replace, Resize, SetOrbit
from translucent.preview.document import Display, Document, Model, framed
from translucent.preview.exports import Bake, bake_map, check_export
from translucent.preview.library import Library, ThumbnailCache
from translucent.preview.measuring import (
    Crossing,
    Measurement,
    ReferencePicture,
    crossing,
    measurable,
    measure,
    reference_frame,
    reference_plan,
)
from translucent.preview.preparation import Compiler
from translucent.preview.scenes import (
    Lighting,
    Loaded,
    first_orbit,
    load_with,
    medium_of,
    method_of,
    own_material,
    placed_objects,
    prepare,
    rescaled,
    scene_of,
    stage_name,
)
from translucent.preview.session import load_session, put_first
from translucent.preview.tasks import Lane, Task, problem
from translucent.preview.worker import Pool, Urgency
from translucent.scene.scene import Scene
from translucent.scene.showcase import fillable
from translucent.units import metres_per_unit, scale_to, size_note

#: Largest number of messages that the window keeps.
MAX_MESSAGES = 50

#: Number of models that are cached for undo.
KEPT_MODELS = 2

#: Seconds after which a view is still.
STILL = 0.25

#: Names of background threads; each does one thing at a time.
LANES = (
    "load",
    "draw",
    "diffuse",
    "trace",
    "truth",
    "bake",
    "ray",
    "light",
    "write",
    "thumbnails",
    "compared light",
    "denoise",
)

#: Seconds for which a closed window waits for work, so that files are complete and no processes are left behind.
PATIENCE = {"write": 60.0, "bake": 12.0}


@dataclass(frozen=True)
class Message:
    """Message for the user."""

    kind: Literal["info", "warning", "error"]
    text: str
    when: float = field(default_factory=time.monotonic)


class Workspace:
    """Workspace of a document: its history, the loaded model, and the work under way.

    Attributes
    ----------
    history : History
    allow_outside : bool
        Whether models may link to files outside their folders.
    loaded : Loaded, optional
        The model on show: that of the document, or the one before while that is being read.
    messages : deque of Message
    failure : Exception, optional
        The first error that was shown, by which a script fails.
    recent : list of str
    size : (width, height)
        Of the viewport in pixels.
    measured : Measurement, optional
        The last comparison with the reference.
    truth : ReferencePicture, optional
        The reference of the whole picture, if the split shows it.
    bake : Bake, optional
        The last map.
    show_bake : bool
        Whether the model is painted with it.
    thumbnails : ThumbnailCache
    library : Library
        Presets of the toolkit and of the user.
    pool : Pool
        Worker processes.
    compiler : Compiler
        Compiles shaders in the background, for a viewport renderer that waits for them.
    """

    def __init__(self, document: Document | None = None, allow_outside: bool = False) -> None:
        self.history = History(document or Document())
        self.allow_outside = allow_outside
        self.loaded: Loaded | None = None
        self.messages: deque[Message] = deque(maxlen=MAX_MESSAGES)
        self.failure: Exception | None = None
        self.recent: list[str] = []
        self.size = (1280, 720)
        self.measured: Measurement | None = None
        self.truth: ReferencePicture | None = None
        self.bake: Bake | None = None
        self.show_bake = True
        self.pool = Pool()
        self.compiler = Compiler(self.pool)
        self.lanes = {name: Lane(name) for name in LANES} | {"compile": self.compiler.lane}
        self.thumbnails = ThumbnailCache(self.lanes["thumbnails"], partial(self.pool.call, urgency=Urgency.LATER))
        self.library = Library(self.refuse)
        self._lighting = Lighting(self.lanes["light"])
        self._other_lighting = Lighting(self.lanes["compared light"], begun=True)
        self._models: list[Loaded] = []
        self._scene: tuple[Document, Loaded, Scene] | None = None
        self._other: tuple[Document, Loaded, Scene] | None = None
        self._view: object = None
        self._still_since, self._compared = 0.0, False
        self._want(self.document.model)

    @property
    def document(self) -> Document:
        """Document on show."""
        return self.history.present

    def do(self, action: Action) -> None:
        """Apply an action to the document; if that fails, show why."""
        if isinstance(action, Open):
            return self.open(Model(action.path, action.unit))
        try:
            self._set(self.history.done(action))
        except TranslucentError as error:
            self.refuse(error)
        return None

    def undo(self) -> None:
        """Undo a step."""
        self._set(self.history.undone())

    def redo(self) -> None:
        """Redo a step."""
        self._set(self.history.redone())

    def open(self, model: Model, then: Document | None = None) -> None:
        """Read a model in the background, and show it, or the document `then` with it, once it is there."""
        self._load(model, Open(model.path, model.unit) if then is None else Replace(then))

    def open_session(self, path: str) -> None:
        """Show the document of a file."""
        try:
            document = load_session(path)
        except TranslucentError as error:
            return self.refuse(error)
        return self.open(document.model, document)

    def attempt(self, work: Callable[[], object], done: str) -> None:
        """Do quick work on files, and show a message: `done`, or why not."""
        try:
            work()
        except TranslucentError as error:
            self.refuse(error)
        else:
            self.tell("info", done)

    def resize(self, height: float) -> None:
        """Scale the model to a height in metres."""
        if self.loaded is None:
            return None
        try:
            factor = scale_to(self.loaded.scene.shown_bounds, height, None, Path(self.loaded.model.path).name)
        except TranslucentError as error:
            return self.refuse(error)
        return self.do(Resize(f"{factor * metres_per_unit(self.loaded.model.unit)!r}m"))

    def frame(self, number: int | None = None) -> None:
        """Frame the whole model, or one of its objects, from the side of the camera."""
        if self.loaded is not None:
            objects = placed_objects(self.loaded.scene, self.document.placed)
            visible = [objects[i] for i in self.document.shown_among(len(objects))]
            chosen = [objects[number]] if number is not None and number < len(objects) else visible
            self.do(SetOrbit(framed(self.document.orbit, chosen, self.size)))

    def update(self) -> None:
        """Take over results of background work, and request missing ones."""
        for lane in self.lanes.values():
            lane.poll(self.refuse)
        self._set(self.history)  # a model or a stage may be ready

    def scene(self) -> Scene | None:
        """Scene on show; the same object for as long as nothing about it changes."""
        loaded = self.loaded
        if loaded is None or self.document.orbit is None:
            return None
        document = self._lighting.lit(self.document, loaded)
        if (bake := self.shown_bake) is not None:
            return bake.seen_from(self.document.orbit)
        if self._scene is None or self._scene[1] is not loaded or not _shows_alike(self._scene[0], document):
            self._scene = document, loaded, scene_of(document, loaded)
        return self._scene[2]

    def picture(self) -> Scene | None:
        """Scene of a picture from here, whatever quantity is on show."""
        if (scene := self.scene()) is None or self.document.display.pictured or self.shown_bake is not None:
            return scene
        assert self.loaded is not None
        document = self._lighting.lit(self.document, self.loaded)
        return scene_of(dataclasses.replace(document, display=Display()), self.loaded)

    def compared(self) -> Scene | None:
        """Scene of the snapshot that is compared with, from this camera; None if there is none."""
        document, loaded = self.document, self.loaded
        kept = document.snapshot(document.display.snapshot)
        if document.display.compare != "snapshot" or kept is None or loaded is None or document.orbit is None:
            return None
        seen = self._other_lighting.lit(document.seen_as(kept.document), loaded)
        if self._other is None or self._other[1] is not loaded or not _shows_alike(self._other[0], seen):
            self._other = seen, loaded, scene_of(seen, loaded)
        return self._other[2]

    @property
    def shown_bake(self) -> Bake | None:
        """Baked map displayed on the model; None if the model shows its medium."""
        return self.bake if self.show_bake else None

    @property
    def busy(self) -> list[Task]:
        """Tasks under way that the user may want to see or to cancel."""
        tasks = [lane.task for lane in self.lanes.values() if lane.task is not None]
        return [task for task in tasks if task.name or task not in (self.compiler.lane.task, self.thumbnails.lane.task)]

    @property
    def relights(self) -> bool:
        """True if another environment or stage is being prepared, so that the picture drawn now will not stay."""
        task = self.lanes["light"].task
        return task is not None and bool(task.name)

    @property
    def prepares(self) -> bool:
        """True if worker processes prepare the picture, which may take all memory."""
        lanes = self.lanes["trace"], self.compiler.lane
        return self.relights or any(lane.task is not None and lane.task.name for lane in lanes)

    def prepare(self) -> None:
        """Prepare later pictures, now that the first is there."""
        self._lighting.begun = True
        if self.lanes["light"].task is None:
            self.lanes["light"].start("", prepare)

    def compare(self, size: tuple[int, int]) -> bool:
        """Compare the view with the reference, once it is still and its picture has all that it needs.

        Parameters
        ----------
        size : (width, height)
            Of the viewport, in pixels.

        Returns
        -------
        bool
            True if the comparison has still to begin.
        """
        scene, display = self.scene(), self.document.display
        measured = scene is not None and (display.inset or measurable(scene))
        view = scene, display.method, display.compare, measured
        if view != self._view:
            self._view, self._still_since, self._compared = view, time.monotonic(), False
            if (last := self.lanes["draw"].task) is not None:
                last.cancel()
        if scene is None or self._compared:
            return False
        if time.monotonic() - self._still_since <= STILL or self.prepares:
            return True
        self._compared = True
        method = method_of(display.method, self.document.material)
        if measured and self.shown_bake is None:
            self.measure(scene, method, size)
        if display.compare in ("reference", "error") and self.shown_bake is None:
            self.draw_reference(scene, method, size, (1,) if display.compare == "error" else None)
        return False

    def measure(self, scene: Scene, method: Method | None, size: tuple[int, int]) -> None:
        """Compare a small picture with the reference, in the background."""

        def take(found: Measurement) -> None:
            self.measured = dataclasses.replace(found, scene=scene)

        self.lanes["draw"].start("measuring", lambda task: self.pool.call(task, measure, scene, method, size), take)

    def cross(
        self, scene: Scene, size: tuple[int, int], pixel: tuple[int, int], then: Callable[[Crossing], None]
    ) -> None:
        """Follow the ray of a pixel in the reference, in the background."""
        self.lanes["ray"].start("", lambda task: self.pool.call(task, crossing, scene, size, pixel), then)

    def draw_reference(
        self, scene: Scene, method: Method | None, size: tuple[int, int], levels: tuple[int, ...] | None
    ) -> None:
        """Draw the reference of the whole picture in the background; `truth` is the finest that is there."""
        rendered, divisors = reference_plan(scene, levels)

        def work(task: Task) -> None:
            for number, level in enumerate(divisors):
                task.report(number / len(divisors), f"at 1/{level}")
                small = max(size[0] // level, 1), max(size[1] // level, 1)
                frame = self.pool.call(task, reference_frame, rendered, method, small, urgency=Urgency.LATER)
                self.truth = ReferencePicture(scene, method, frame, level, straight=levels is not None)

        self.lanes["truth"].start("float64 reference", work)

    def start_bake(self, mode: str, size: int, rays: int) -> None:
        """Bake a map of the first body, and show it."""
        if self.loaded is None:
            return
        body = fillable(self.loaded.scene)[0]
        medium = medium_of(self.document.material)

        def show(bake: Bake) -> None:
            self.bake, self.show_bake = bake, True

        work = partial(bake_map, pool=self.pool, body=body, medium=medium, mode=mode, size=size, rays=rays)
        self.lanes["bake"].start(f"baking {mode}", work, show)

    def export(self, path: str, work: Callable[..., None], *arguments: Any) -> None:
        """Have another process draw a file by ``work(path, *arguments)``."""

        def write(task: Task) -> None:
            try:
                self.pool.call(task, work, path, *arguments, urgency=Urgency.LATER)
            except Exception:
                remove_partial(Path(path))  # of a process that had to be killed
                raise

        try:
            check_export(path)
        except TranslucentError as error:
            return self.refuse(error)
        return self.write(path, write)

    def write(self, path: str, work: Callable[[Task], object]) -> None:
        """Write a file in the background."""
        if (other := self.lanes["write"].task) is not None:
            found = f"another task is still running: {other.name}"
            return self.refuse(
                RenderError(
                    f"the file {path!r} has not been written yet",
                    found,
                    "wait until the file is written, or cancel the task",
                )
            )
        done = f"wrote {path}"
        self.lanes["write"].start(f"writing {Path(path).name}", work, lambda _: self.tell("info", done))
        return None

    def refuse(self, error: Exception) -> None:
        """Show why something was not done."""
        self.failure = self.failure or error
        self.tell("error", problem(error))

    def tell(self, kind: Literal["info", "warning", "error"], text: str) -> None:
        """Add a message for the user, unless it repeats the last one."""
        if not self.messages or self.messages[-1].text != text or time.monotonic() - self.messages[-1].when > 1.0:
            self.messages.append(Message(kind, text))

    def close(self) -> None:
        """End all work."""
        for lane in self.lanes.values():
            if lane.task is not None:
                lane.task.cancel()
        self.pool.close(0.5)  # nobody will see its results
        for name, lane in self.lanes.items():
            lane.close(PATIENCE.get(name, 0.5))

    @property
    def ended(self) -> bool:
        """True if all work has ended."""
        return all(lane.ended for lane in self.lanes.values())

    def _set(self, history: History) -> None:
        """Show the present of a history, once its model is there."""
        self.history = history
        if self.loaded is not None and self.document.model == self.loaded.model:
            self._complete()
        else:
            self._want(self.document.model)

    def _want(self, model: Model) -> None:
        """Show the document's model: one that is cached, or request it."""
        for loaded in self._models:
            if loaded.model == model:
                self._keep(loaded)
                return self._complete()
        if (last := self.loaded) is not None and last.model == dataclasses.replace(model, unit=last.model.unit):
            factor = metres_per_unit(model.unit) / metres_per_unit(last.model.unit)
            self._keep(rescaled(last, model))
            self.measured = self.measured and self.measured.scaled(factor)
            return self._complete()
        if self.lanes["load"].task is None and not self.lanes["load"].failed(model):
            self._load(model)
        return None

    def _load(self, model: Model, action: Action | None = None) -> None:
        """Read a model in the background; then apply an action, by which the document shows it, if it does not yet."""

        def work(task: Task) -> Loaded:
            task.report(None, f"reading {Path(model.path).name}")
            return load_with(task, self.pool, model, self.allow_outside, pictured=self.loaded is not None)

        def take(loaded: Loaded) -> None:
            known = self.loaded is not None and self.loaded.model.path == model.path
            self._keep(loaded)
            notes = dict.fromkeys(size_note(item.mesh, way="field") for item in loaded.scene.objects)
            for note in filter(None, () if known else notes):
                self.tell("info", f"{Path(model.path).name}: {note}")
            for remark in () if known else getattr(loaded.scene, "remarks", ()):
                self.tell("info", remark)
            self._set(self.history if action is None else self.history.done(action))
            if action is not None and os.path.exists(model.path):
                self.recent = put_first(str(Path(model.path).resolve()), self.recent)

        self.lanes["load"].start(f"opening {Path(model.path).name}", work, take).key = model

    def _keep(self, loaded: Loaded) -> None:
        self._models = [loaded, *(one for one in self._models if one.model != loaded.model)][:KEPT_MODELS]
        if self.loaded is not loaded:
            self.loaded, self.bake = loaded, None

    def _complete(self) -> None:
        """Complete the document from the model: its own material, and the camera."""
        if self.loaded is None:
            return
        if not self.document.shown_among(len(self.loaded.scene.objects)):
            self.tell("warning", "all objects of the model were hidden, so all are shown again")
            visible = dataclasses.replace(self.document, hidden=())
            self.history = dataclasses.replace(self.history, present=visible)
        present = self.document
        own = own_material(self._lighting.lit(present, self.loaded).look, self.loaded)
        if present.material.source == "file" and present.material != own:
            self.history = self.history.done(Adopt(own))
        if present.orbit is None:
            stage = stage_name(present.look, self.loaded)
            self.history = self.history.done(SetOrbit(first_orbit(self.loaded, self.size, stage)))


def _shows_alike(first: Document, second: Document) -> bool:
    """True if two documents show the same scene, except for exposure and tone curve."""
    names = ("exposure", "tone", "depth_of_field", "aperture", "focus")
    developed = dataclasses.replace(first.look, **{name: getattr(second.look, name) for name in names})
    others = ("material", "assigned", "hidden", "orbit", "placed", "lights")
    same = all(getattr(first, name) == getattr(second, name) for name in others)
    return same and developed == second.look and first.display.pictured == second.display.pictured
