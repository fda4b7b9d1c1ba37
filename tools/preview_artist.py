"""Tasks of an artist in the previewer's window, each with a check of its result, for ``preview_tasks.py``."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from imgui_bundle import imgui
from PIL import Image
from preview_hand import Artist, Waiting, require

import translucent as tl
from translucent.preview.document import camera_of
from translucent.preview.library import ball_key, model_key, panorama_key
from translucent.preview.panels.viewport import on_screen, probe_lines


def open_model(a: Artist, name: str) -> Waiting:
    yield from a.hand.key("ctrl+o")
    yield from a.answer(a.folder / name)
    yield from a.until(lambda: Path(a.document.model.path).name == name and a.state.drawn, f"{name} is on show")


def open_file(a: Artist) -> Waiting:
    yield from open_model(a, "bear.ply")


def frame(a: Artist) -> Waiting:
    before = a.document.orbit
    yield from a.hand.move(a.in_view(0.3, 0.7))
    yield from a.hand.wheel(-6)
    yield from a.drag(a.in_view(0.5, 0.5), a.in_view(0.7, 0.4))
    yield from a.until(lambda: a.document.orbit != before, "wheel and drag move the camera")
    before = a.document.orbit
    yield from a.hand.key("f")
    yield from a.until(lambda: a.document.orbit != before, "F frames it")
    view = a.at("##viewport")
    assert a.document.orbit is not None
    size = view.high[0] - view.low[0], view.high[1] - view.low[1]
    box = on_screen(camera_of(a.document.orbit), a.state.objects[0].bounds, size)
    assert box is not None
    spans = (box.max(axis=0) - box.min(axis=0)) / size
    require(0.6 < spans.max() <= 1.1, f"the model fills the view, not {spans.max():.0%} of it")


def preset_by_picture(a: Artist) -> Waiting:
    yield from a.panel("Library")
    yield from a.click("##search")
    yield from a.enter("jade")
    key = ball_key(tl.preset("jade"))
    yield from a.until(lambda: key in a.state._textures, "there is a picture of jade")
    yield from a.click("##jade")
    yield from a.until(lambda: a.document.material.preset == "jade", "the model is of jade")


def drag_color(a: Artist) -> Waiting:
    yield from a.panel("Material")
    before = a.document.material.color
    steps = len(a.state.work.history.past)
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
    require(len(a.state.work.history.past) == steps + 1, "a drag is one step")
    yield from a.hand.key("escape")


def distance(a: Artist) -> Waiting:
    yield from a.seen("##distance")
    yield from a.hand.hold("ctrl", down=True)
    yield from a.click("##distance")
    yield from a.hand.hold("ctrl", down=False)
    yield from a.enter("7.5")
    yield from a.until(lambda: math.isclose(a.document.material.distance, 0.0075), "the distance is 7.5 mm")


def compare(a: Artist) -> Waiting:
    yield from a.panel("Method")
    yield from a.choose("##display.compare", "method")
    yield from a.until(lambda: a.state.view.plans[1] is not None, "the other method is drawn")
    require(isinstance(a.state.view.plans[1].method, tl.ThinLayer), "it is the thin layer")  # type: ignore[union-attr]
    yield from a.drag(a.in_view(0.5, 0.8), a.in_view(0.35, 0.8))
    yield from a.until(lambda: abs(a.document.display.split - 0.35) < 0.03, "the split follows the mouse")


def probe(a: Artist) -> Waiting:
    yield from a.hand.move(a.in_view(0.25, 0.55))

    def told() -> bool:
        lines = probe_lines(a.state, a.state.hovered) if a.state.hovered else []
        return any("thickness" in line for line in lines) and any("reference" in line for line in lines)

    yield from a.until(told, "the probe tells thickness and the reference")


def read_reference(a: Artist) -> Waiting:
    yield from a.choose("##display.compare", "off")
    yield from a.click("##display.inset")
    yield from a.until(lambda: a.document.display.inset, "the inset is asked for")
    measured = a.state.work
    yield from a.until(lambda: measured.measured is not None and measured.measured.errors, "it is measured")
    require(measured.measured.errors[0].median < 1e-5, "the median error of thickness")  # type: ignore[union-attr]
    yield from a.until(lambda: "inset" in a.state._textures, "the inset is on show")


def bake(a: Artist) -> Waiting:
    yield from a.panel("Files")
    yield from a.choose("##bakesize", "256")
    yield from a.choose("##bakerays", "16")
    yield from a.click("Bake", "Files")
    yield from a.until(lambda: a.state.work.bake is not None, "there is a map")
    path = a.folder / "thickness.exr"
    yield from a.click("Save map ...")
    yield from a.answer(path)
    yield from a.written(path)
    yield from a.click("show on the model")
    yield from a.until(lambda: a.state.work.shown_bake is None, "the medium is on show again")


def save_png(a: Artist) -> Waiting:
    yield from a.panel("Files")
    yield from a.click("##export.transparent")
    yield from a.click("PNG ...")
    path = a.folder / "view.png"
    yield from a.answer(path)
    yield from a.written(path)
    alpha = np.asarray(Image.open(path))[..., 3]
    require(alpha.min() == 0 and alpha.max() > 100, "there is the model, and nothing beside it")


def save_turntable(a: Artist) -> Waiting:
    yield from a.panel("Files")
    a.state.change("export.pictures", 6.0, step=True)
    yield from a.click("Turntable ...")
    path = a.folder / "turntable.gif"
    yield from a.answer(path)
    yield from a.written(path)
    require(getattr(Image.open(path), "n_frames", 1) == 6, "six pictures")


def undo_ten(a: Artist) -> Waiting:
    yield from a.panel("Material")
    first = a.document.material.roughness
    for tenths in range(1, 11):
        yield from a.hand.hold("ctrl", down=True)
        yield from a.click("##material.roughness")
        yield from a.hand.hold("ctrl", down=False)
        yield from a.enter(f"{tenths / 20:g}")
        yield from a.until(lambda x=tenths / 20: math.isclose(a.document.material.roughness, x, rel_tol=1e-6), "typed")
    before = len(a.state.work.history.past)
    require(before >= 10, f"{before} steps to undo")
    for _ in range(10):
        yield from a.hand.key("ctrl+z")
    work = a.state.work
    yield from a.until(lambda: len(work.history.past) <= before - 10, "ten steps are undone")
    require(len(work.history.past) == before - 10, "no more than ten steps are undone")
    require(a.document.material.roughness == first, "roughness is as it was")


def open_second(a: Artist) -> Waiting:
    yield from open_model(a, "two.glb")
    require(len(a.state.objects) == 2, "there are two objects")


def assign_two(a: Artist) -> Waiting:
    yield from a.panel("Scene")
    name = a.state.name_of(0)
    yield from a.click(f"{name}##name")
    yield from a.until(lambda: a.state.selected == 0, f"{name} is selected")
    yield from a.panel("Library")
    yield from a.click("##search")
    yield from a.enter("wax")
    yield from a.click("##wax")
    yield from a.click("##search")
    yield from a.enter("honey")
    yield from a.seen("##honey")
    yield from a.drag(a.at("##honey").middle, a.in_view(0.5, 0.9), a.on_object(1))
    yield from a.until(lambda: a.document.own_material(1) is not None, "honey arrives")
    found = [a.document.own_material(i) for i in (0, 1)]
    require([one.preset if one else "" for one in found] == ["wax", "honey"], "each has its own")


def hide_and_show(a: Artist) -> Waiting:
    yield from a.panel("Scene")
    yield from a.click(f"{a.state.name_of(1)}##name")
    yield from a.click("Isolate", "Scene")
    yield from a.until(lambda: a.document.hidden == (0,), "the other is hidden")
    yield from a.until(lambda: a.state.drawn, "it is drawn")
    yield from a.click("Show all")
    yield from a.until(lambda: a.document.hidden == (), "both are on show")


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
    yield from a.hand.hold("e", down=True)
    yield from a.drag(a.in_view(0.4, 0.6), a.in_view(0.6, 0.6))
    yield from a.hand.hold("e", down=False)
    yield from a.until(lambda: a.document.look.rotation != before, "it turns")


def many_environments(a: Artist) -> Waiting:
    names = [f"sky{i:03d}.hdr" for i in range(500)]
    folder = a.folder / "skies"
    folder.mkdir(exist_ok=True)
    for name in names:
        shutil.copy(a.folder / "sky.hdr", folder / name)
    yield from a.panel("Environments")
    yield from a.click("##folder", "Environments")
    yield from a.enter(str(folder))
    yield from a.until(lambda: len(a.state.environments.files()) == len(names), "all are listed")

    def seen() -> list[str]:
        found = {path: a.places.find(f"##card{path}") for path in a.state.environments.files()}
        return [path for path, place in found.items() if place]

    def pictured() -> bool:
        return bool(shown := seen()) and all(panorama_key(path) in a.state._textures for path in shown)

    yield from a.hand.move(a.at("##card", "Environments").middle)
    for _ in range(20):
        yield from a.hand.wheel(-10)
    yield from a.until(lambda: seen() and names[50] < Path(seen()[0]).name, "the wheel scrolls")
    yield from a.until(pictured, "those in view have pictures")
    require(len(a.state._textures) < len(names), "no others were made")


def load_hdr(a: Artist) -> Waiting:
    yield from a.panel("Environments")
    yield from a.click("Open ...", "Environments")
    yield from a.answer(a.folder / "sky.hdr")
    yield from a.until(lambda: a.document.look.environment.endswith("sky.hdr"), "it lights the model")

    def lit() -> bool:
        scene = a.state.work.scene()
        return scene is not None and scene.environment.kind == "image" and a.state.view.viewport.steps(0) > 0

    yield from a.until(lit, "it is in the picture")
    require(a.state.work.failure is None, f"nothing failed: {a.state.work.failure}")


def find_key(a: Artist) -> Waiting:
    yield from a.hand.key("f1")
    yield from a.until(lambda: imgui.is_popup_open("", imgui.PopupFlags_.any_popup), "the page opens")
    yield from a.hand.key("escape")
    yield from a.until(lambda: not a.state.keys_shown, "Escape closes it")


def copy_blender(a: Artist) -> Waiting:
    yield from a.panel("Material")
    yield from a.click("Blender")
    yield from a.until(lambda: "bpy" in imgui.get_clipboard_text(), "there is a script for Blender")


def leave(a: Artist) -> Waiting:
    yield from a.click("File")
    yield from a.click("Quit")


def find_again(a: Artist) -> Waiting:
    yield from a.click("File")
    yield from a.click("Recent")
    recent = a.state.work.recent
    require([Path(path).name for path in recent[:2]] == ["two.glb", "bear.ply"], f"recent files are {recent}")
    yield from a.until(lambda: model_key(recent[0]) in a.state._textures, "they have pictures")
    path = Path(recent[0])
    label = next(text for _, text in a.places.known if text.startswith(f"{path.name}\n"))
    yield from a.click(label)
    yield from a.until(lambda: a.document.model.path == recent[0] and a.state.drawn, "it is on show")
    require(a.state.environments.path == str(a.folder), "the folder of environments is known")


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
    "500 environments": many_environments,
    "load .hdr": load_hdr,
    "find a key": find_key,
    "copy for blender": copy_blender,
    "close": leave,
}
AGAIN: dict[str, Callable[[Artist], Waiting]] = {"find everything again": find_again, "close": leave}
