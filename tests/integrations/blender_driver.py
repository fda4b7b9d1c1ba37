"""Steps in Blender for `test_blender.py`: ``python blender_driver.py FOLDER`` writes ``FOLDER/result.json`` and arrays.

FOLDER holds ``translucent.zip``, the extension, and ``meshes.npz``. Nothing of the toolkit is imported here.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

FOLDER = Path(sys.argv[-1])
os.environ["BLENDER_USER_RESOURCES"] = str(FOLDER / "user")

import bpy  # noqa: E402, I001 - it makes the next one known
import addon_utils  # noqa: E402
import numpy as np  # noqa: E402

MODULE = "bl_ext.user_default.translucent"
results: dict[str, Any] = {}
arrays: dict[str, np.ndarray] = {}
meshes = dict(np.load(FOLDER / "meshes.npz"))


def step(function: Callable[[], Any]) -> Callable[[], Any]:
    """Run a function on an empty scene, and keep what it returns, or the error of an operator."""
    for collection in (bpy.data.objects, bpy.data.meshes, bpy.data.materials, bpy.data.images, bpy.data.texts):
        for one in list(collection):
            collection.remove(one)
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = "METRIC", 1.0
    name = function.__name__
    try:
        results[name] = function()
    except RuntimeError as error:
        results[name] = f"RuntimeError: {error}"
    return function


def state() -> list[str]:
    """Names of all that an operator could have added."""
    found = [
        f"{kind}:{one.name}" for kind in ("images", "materials", "meshes", "texts") for one in getattr(bpy.data, kind)
    ]
    found += [f"{one.name}.{a.name}" for one in bpy.data.meshes for a in one.attributes]
    found += [f"{one.name}/{node.name}" for one in bpy.data.materials if one.node_tree for node in one.node_tree.nodes]
    return sorted(found)


def added(name: str, unit: float = 1.0, materials: tuple[str, ...] = ("Stuff",)) -> Any:
    """Object of a mesh of the folder, selected: its faces have as many corners as they came with."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((meshes[f"{name}_vertices"] / unit).tolist(), [], meshes[f"{name}_faces"].tolist())
    if f"{name}_uv" in meshes:
        mesh.uv_layers.new().uv.foreach_set("vector", meshes[f"{name}_uv"].astype(np.float32).ravel())
    for one in materials:
        mesh.materials.append(bpy.data.materials.get(one) or bpy.data.materials.new(one))
    if f"{name}_slots" in meshes:
        mesh.polygons.foreach_set("material_index", meshes[f"{name}_slots"])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    return item


def read(image: Any, tile: int | None = None) -> np.ndarray:
    """Pixels of an image, or of one of its tiles as it is packed; the top row first."""
    if tile is not None:
        (packed,) = (one for one in image.packed_files if f".{tile}." in one.filepath)
        file = FOLDER / f"tile.{tile}.exr"
        file.write_bytes(packed.packed_file.data)
        image = bpy.data.images.load(str(file))
        image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    found = pixels.reshape(height, width, 4)[::-1]
    assert (found[..., 0] == found[..., 2]).all()
    return found[..., 0].copy()


def bake(**settings: Any) -> set[str]:
    return bpy.ops.translucent.bake_thickness(**settings)


def error_of(make: Callable[[], Any], **settings: Any) -> list[Any]:
    """Error of a bake, and whether nothing has changed."""
    make()
    before = state()
    try:
        return [str(bake(size=8, rays=2, **settings)), state() == before]
    except RuntimeError as error:
        return [str(error), state() == before]


folder = bpy.utils.user_resource("EXTENSIONS", path="user_default", create=True)
zipfile.ZipFile(FOLDER / "translucent.zip").extractall(Path(folder, "translucent"))
assert addon_utils.enable(MODULE, default_set=True) is not None
baking, running, toolkit = (importlib.import_module(f"{MODULE}.{name}") for name in ("baking", "running", "toolkit"))


@step
def bear() -> list[str]:
    added("bear")
    bake(size=64, rays=8)
    image = bpy.data.images["Stuff thickness"]
    arrays["bear"] = read(image)
    bake(target="ATTRIBUTE", rays=4)
    held = bpy.data.meshes["bear"].attributes["thickness"]
    arrays["bear_vertices"] = np.array([one.value for one in held.data])
    return [held.domain, held.data_type, image.colorspace_settings.name, str(len(image.packed_files))]


@step
def bear_in_centimetres() -> str:
    bpy.context.scene.unit_settings.scale_length = 0.01
    item = added("bear", unit=0.02)
    item.scale = (-2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    bake(size=64, mode="normal")
    arrays["bear_normal"] = read(bpy.data.images["Stuff thickness"])
    return bpy.data.materials["Stuff"].node_tree.nodes["Thickness"].image.name


@step
def box_of_two() -> list[int]:
    added("box", materials=("Red", "Blue"))
    bake(size=32, mode="normal", padding=0)
    tiles = []
    for name in ("Red", "Blue"):
        image = bpy.data.images[f"{name} thickness"]
        tiles += [tile.number for tile in image.tiles]
        for tile in (1001, 1002):
            arrays[f"{name}_{tile}"] = read(image, tile)
    return tiles


@step
def tiles_are_still_there_after_loading() -> list[Any]:
    added("box", materials=("Red", "Blue"))
    bake(size=8, mode="normal", padding=0)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "kept.blend"))
    image = bpy.data.images["Red thickness"]
    return [image.source, len(image.packed_files), float(read(image, 1002).max())]


@step
def modifiers_count() -> float:
    item = added("cube")
    displaced = item.modifiers.new("Displace", "DISPLACE")  # along (1, 1, 1) at a corner
    displaced.strength, displaced.mid_level = 0.01 * 3**0.5, 0.0
    bake(size=16, mode="normal", padding=0)
    return float(read(bpy.data.images["Stuff thickness"]).max())


@step
def quads_and_polygons_are_triangulated() -> float:
    bpy.ops.mesh.primitive_cylinder_add(vertices=7, radius=0.01, depth=0.03)
    bake(size=32, mode="normal")
    return float(read(bpy.data.images["Cylinder thickness"]).max())


@step
def a_second_bake_replaces_the_first() -> list[str]:
    added("cube")
    bake(size=8, rays=2)
    bake(size=16, rays=2)
    return [one.name for one in bpy.data.images if one.name.startswith("Stuff")]


@step
def undone() -> list[bool]:
    added("cube")
    bpy.ops.ed.undo_push()
    before = state()
    bake(size=8, rays=2)
    bpy.ops.ed.undo_push()
    after = state()
    bpy.ops.ed.undo()
    return [after != before, state() == before]


@step
def without_units() -> list[str]:
    bpy.context.scene.unit_settings.system = "NONE"
    added("cube")
    work = baking.Baking(bpy.context, "IMAGE", "", {"size": 8, "rays": 2, "padding": 0, "mode": "normal"})
    messages = [text for _, text in work.finish(bpy.context)]
    work.close()
    return messages


@step
def errors() -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}

    def clear() -> None:
        for one in list(bpy.data.objects):
            bpy.data.objects.remove(one)

    def case(name: str, make: Callable[[], Any], **settings: Any) -> None:
        clear()
        found[name] = error_of(make, **settings)

    def lamp() -> None:
        bpy.ops.object.light_add(type="POINT")

    def instances() -> None:
        item = added("cube")
        group = bpy.data.collections.new("group")
        group.objects.link(item)
        item.select_set(False)
        bpy.ops.object.collection_instance_add(collection="group")

    def changed(**values: Any) -> Callable[[], Any]:
        def make() -> None:
            item = added("cube")
            for name, value in values.items():
                setattr(item, name, value)

        return make

    def subdivided() -> None:
        added("cube").modifiers.new("Subdivision", "SUBSURF")

    def shared() -> None:
        other = added("cube").copy()
        other.scale = (2, 2, 2)
        bpy.context.scene.collection.objects.link(other)
        other.select_set(True)

    def edited() -> None:
        added("cube")
        bpy.ops.object.mode_set(mode="EDIT")

    def typed() -> None:
        added("cube").data.attributes.new("thickness", "INT", "POINT")

    case("nothing", lambda: None)
    case("lamp", lamp)
    case("instances", instances)
    case("flat", changed(scale=(1, 1, 0)))
    case("no uv", lambda: added("bare"))
    case("beyond", lambda: added("beyond"))
    case("inside out", lambda: added("inverted"))
    case("subdivided", subdivided, target="ATTRIBUTE")
    case("shared", shared, target="ATTRIBUTE")
    case("typed", typed, target="ATTRIBUTE")
    case("edited", edited)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.preferences.addons[MODULE].preferences.python = "/nowhere/python"
    case("no python", lambda: added("cube"))
    bpy.context.preferences.addons[MODULE].preferences.python = sys.executable
    case("no toolkit", lambda: added("cube"))
    bpy.context.preferences.addons[MODULE].preferences.python = ""
    return found


class Window(running.RunsWork):
    """The operator as the window runs it, with all that it calls noted."""

    doing = baking.TRANSLUCENT_OT_bake_thickness.doing

    def __init__(self, rays: int) -> None:
        self.rays, self.said = rays, []
        manager = SimpleNamespace(
            event_timer_add=lambda *_, **__: "timer",
            event_timer_remove=lambda timer: self.said.append(timer),
            progress_begin=lambda *_: None,
            progress_update=lambda percent: self.said.append(percent),
            progress_end=lambda: None,
            modal_handler_add=lambda _: None,
        )
        workspace = SimpleNamespace(status_text_set=lambda text: self.said.append(text))
        self.context = SimpleNamespace(window_manager=manager, workspace=workspace, window=None)

    def report(self, kind: set[str], text: str) -> None:
        self.said.append(text)

    def begin(self, _: Any) -> Any:
        settings = {"size": 64, "rays": self.rays, "padding": 0, "mode": "cone"}
        return baking.Baking(bpy.context, "IMAGE", "", settings)

    def send(self, kind: str) -> set[str]:
        return self.modal(self.context, SimpleNamespace(type=kind, value="PRESS"))


@step
def in_a_window() -> list[Any]:
    added("cube")
    window = Window(rays=8)
    told = [window.invoke(window.context, None), window.send("MOUSEMOVE")]
    while (answer := window.send("TIMER")) == {"RUNNING_MODAL"}:
        time.sleep(0.05)
    percents = [one for one in window.said if isinstance(one, float)]
    return [
        *map(sorted, told),
        sorted(answer),
        max(percents, default=0.0),
        window.said[-1],
        "Stuff thickness" in bpy.data.images,
    ]


@step
def cancelled() -> list[Any]:
    added("bear")
    before, window = state(), Window(rays=4096)
    window.invoke(window.context, None)
    while window._work.task.progress == 0.0 and not window._work.task.ended():
        window.send("TIMER")
        time.sleep(0.05)
    running_then = not window._work.task.ended()
    answer = window.send("ESC")
    process, place = window._work.task._process, window._work.folder
    return [
        running_then,
        sorted(answer),
        process.returncode is not None,
        place.exists(),
        state() == before,
        window.said[-1],
    ]


@step
def presets() -> list[Any]:
    bpy.context.scene.unit_settings.scale_length = 0.01
    items = [added("cube"), added("bare")]
    bpy.ops.translucent.material(source="PRESET", preset="jade")
    material = items[0].active_material
    volume = next(node for node in material.node_tree.nodes if node.type == "PRINCIPLED_VOLUME")
    return [material.name, items[1].active_material == material, volume.inputs["Density"].default_value]


@step
def color_at_a_distance() -> list[Any]:
    bpy.context.scene.unit_settings.scale_length = 0.01
    item = added("cube")
    bpy.ops.translucent.material(source="COLOR", color=(0.5, 0.25, 0.125), distance=2.0, ior=1.4)
    nodes = {node.type: node for node in item.active_material.node_tree.nodes}
    volume = nodes["VOLUME_ABSORPTION"].inputs
    density, color = volume["Density"].default_value, volume["Color"].default_value
    return [[density * (1 - channel) for channel in color[:3]], nodes["BSDF_GLASS"].inputs["IOR"].default_value]


@step
def checked() -> list[Any]:
    item = added("cube")
    empty = bpy.ops.translucent.check_materials()
    nothing = bpy.data.texts["Material check"].as_string()
    nodes = item.active_material.node_tree.nodes
    nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    group = bpy.data.node_groups.new("glTF Material Output", "ShaderNodeTree")
    group.interface.new_socket("Thickness", in_out="INPUT", socket_type="NodeSocketFloat")
    node = nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Thickness"].default_value = 0.5
    done = bpy.ops.translucent.check_materials()
    return [sorted(empty), nothing, sorted(done), bpy.data.texts["Material check"].as_string()]


@step
def nodes_that_an_export_leaves_out() -> list[Any]:
    added("cube")
    bpy.ops.translucent.material(source="COLOR", color=(0.5, 0.25, 0.125), distance=0.02, ior=1.4)
    done = bpy.ops.translucent.check_materials()
    return [sorted(done), bpy.data.texts["Material check"].as_string()]


class Layout:
    """Recorder of a panel: its settings, and its buttons with their properties."""

    def __init__(self) -> None:
        self.drawn: list[Any] = []

    def column(self) -> Layout:
        return self

    def separator(self) -> None:
        pass

    def prop(self, settings: Any, name: str) -> None:
        self.drawn.append([name, getattr(settings, name)])

    def operator(self, name: str, **_: Any) -> SimpleNamespace:
        self.drawn.append(SimpleNamespace(name=name))
        return self.drawn[-1]  # type: ignore[no-any-return]


@step
def panel() -> list[Any]:
    bpy.context.scene.translucent.size = 32
    layout = Layout()
    importlib.import_module(f"{MODULE}.panel").TRANSLUCENT_PT_panel.draw(SimpleNamespace(layout=layout), bpy.context)
    bpy.context.scene.translucent.size = 1024
    return [one if isinstance(one, list) else vars(one) for one in layout.drawn]


addon_utils.disable(MODULE, default_set=True)
results["left"] = [name for name in dir(bpy.types) if name.startswith("TRANSLUCENT")]
results["left"] += ["scene"] * hasattr(bpy.types.Scene, "translucent")
results["left"] += [str(len(toolkit._running))]
np.savez(FOLDER / "arrays.npz", **arrays)
(FOLDER / "result.json").write_text(json.dumps(results, default=sorted))
