"""Handling of the files that dialogs and scripts name."""

from __future__ import annotations

from pathlib import Path

from translucent.errors import InputError, TranslucentError
from translucent.gltf.load import SUFFIXES
from translucent.gltf.write import Filling, write_media
from translucent.planning.caustics import Caustics
from translucent.preview.actions import Change
from translucent.preview.browser import with_recent
from translucent.preview.desk import Desk
from translucent.preview.dialogs import QUESTIONS, answer
from translucent.preview.document import Model
from translucent.preview.exports import write_picture, write_turntable
from translucent.preview.recipes import Shot, command_line, python_code
from translucent.preview.scenes import medium_of, method_of, scattering_of
from translucent.preview.staging import tone_of
from translucent.scene.scene import Scene


def take_answers(desk: Desk) -> None:
    """Handle dialogs that have been answered."""
    for entry in list(desk.dialogs):
        path = answer(entry[1])
        if path is None:
            continue
        desk.dialogs.remove(entry)
        if path:
            use_file(desk, entry[0], path)


def use_file(desk: Desk, kind: str, path: str) -> None:
    """Read or write a file, according to its dialog."""
    work = desk.work
    desk.folders = with_recent(desk.folders, path)
    match kind:
        case "open":
            work.open(Model(path, desk.get("model.unit")))
        case "open session":
            work.open_session(path)
        case "save session":
            work.save_session(path)
        case "environment" | "background":
            work.do(Change(f"look.{kind}", path))
            desk.environments.take(path)
        case "save glb":
            _save_medium(desk, path)
        case "map":
            if work.bake is not None:
                work.write(path, work.bake.map.save)
        case "png" | "exr" | "turntable":
            _export(desk, kind, path)
        case _:
            found = f"{kind!r} is nothing to read or write"
            work.refuse(InputError(f"file {path!r}", found, f"use {', '.join(QUESTIONS)}"))


def save_preset(desk: Desk, words: str) -> bool:
    """Save the material as an own preset; returns whether it is."""
    try:
        path, left_out = desk.work.library.save(words, desk.material)
    except TranslucentError as error:
        desk.work.refuse(error)
        return False
    desk.work.tell("info", f"saved {path}")
    if left_out:
        desk.work.tell("warning", f"no preset keeps: {', '.join(left_out)}")
    return True


def _export(desk: Desk, kind: str, path: str) -> None:
    scene, document = desk.work.picture(), desk.work.document
    if scene is None:
        return
    method, size = method_of(document.display.method, document.material), desk.stage.viewport.size
    look = document.look.exposure, tone_of(document.look, scene)
    ways = scattering_of(document.display.scattering), caustics_of(desk, scene)
    if kind == "turntable":
        desk.work.export(path, write_turntable, scene, method, size, look, desk.export["pictures"], *ways)
    else:
        desk.work.export(path, write_picture, scene, method, size, look, desk.export["transparent"], *ways)


def recipe(desk: Desk, kind: str) -> str | None:
    """Text of a command, or of ``python``, that makes the picture from here; None before there is one."""
    work = desk.work
    if (scene := work.picture()) is None or work.loaded is None:
        return None
    if work.shown_bake is not None:
        work.refuse(InputError("a recipe", "the model is painted with a map", "clear 'show on the model' first"))
        return None
    shot = Shot(work.document, work.loaded, scene, desk.stage.viewport.size, caustics_of(desk, scene))
    if kind == "python":
        work.tell("info", "copied as Python")
        return python_code(shot)
    text, left_out = command_line(shot)
    if left_out:
        work.tell("warning", f"no option of the copied command says: {', '.join(left_out)}; Python does")
    else:
        work.tell("info", "copied as a command")
    return text


def caustics_of(desk: Desk, scene: Scene) -> Caustics | None:
    """Photons of a file: as many as the picture on show has, and what ``translucent render`` follows at least."""
    document = desk.work.document
    if not document.display.caustics:
        return None
    light, method = desk.stage.photons.light, method_of(document.display.method, document.material)
    caustics = Caustics(max(light.photons if light is not None else 0, Caustics().photons))
    try:
        desk.stage.renderer.plan(scene, method, caustics=caustics)
    except InputError as error:
        desk.work.tell("warning", f"without caustics: {error}")
        return None
    return caustics


def _save_medium(desk: Desk, path: str) -> None:
    """Write the model's file with the medium in its materials; other kinds of files have none to keep."""
    source, material = desk.get("model.path"), desk.work.document.material
    if Path(source).suffix.lower() not in SUFFIXES:
        do = "copy the medium as glTF, or export the model as .glb first"
        return desk.work.refuse(InputError(f"saving into {path!r}", f"{Path(source).name} is no glTF file", do))
    outside, document = desk.work.allow_outside, desk.work.document
    named = [(desk.objects[one.object].mesh.name, one.material) for one in document.assigned]
    whole = [] if named and material.source == "file" else [(None, material)]

    fillings = [Filling(medium_of(one), one.distance, name) for name, one in (*whole, *named)]
    return desk.work.write(path, lambda to: write_media(source, to, fillings, allow_outside=outside))
