"""Menus, and the line at the bottom of the window."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, hello_imgui, imgui

from translucent.assets import mesh_names
from translucent.errors import shortened
from translucent.preview.desk import Desk, em, tooltip
from translucent.preview.document import Model
from translucent.preview.picturing import model_key
from translucent.units import METRES_PER_UNIT


def menus(desk: Desk) -> None:
    """File, Edit, Help."""
    if imgui.begin_menu("File"):
        _file(desk)
        imgui.end_menu()
    if imgui.begin_menu("Edit"):
        history = desk.work.history
        if imgui.menu_item("Undo", "Ctrl Z", False, bool(history.past))[0]:
            desk.work.undo()
        if imgui.menu_item("Redo", "Ctrl Y", False, bool(history.future))[0]:
            desk.work.redo()
        if imgui.menu_item("Frame the model", "F", False, True)[0]:
            desk.frame()
        if imgui.menu_item("Reload shaders", "", False, True)[0]:
            desk.stage.reload(desk.work)
        imgui.end_menu()
    if imgui.begin_menu("Help"):
        if imgui.menu_item("Mouse and keys", "?", False, True)[0]:
            desk.keys_shown = True
        imgui.end_menu()


def _file(desk: Desk) -> None:
    unit = desk.get("model.unit")
    if imgui.menu_item("Open ...", "Ctrl O", False, True)[0]:
        desk.ask_file("open")
    if imgui.begin_menu("Recent", bool(desk.work.recent)):
        for path in desk.work.recent:
            _recent(desk, path, unit)
        imgui.end_menu()
    if imgui.begin_menu("The toolkit's own"):
        for name in mesh_names():
            if imgui.menu_item(name, "", name == desk.get("model.path"), True)[0]:
                desk.work.open(Model(name))
        imgui.end_menu()
    if imgui.begin_menu("Unit of the file"):
        for word in METRES_PER_UNIT:
            if imgui.menu_item(word, "", word == unit, True)[0] and word != unit:
                desk.work.open(Model(desk.get("model.path"), word))
        imgui.end_menu()
    imgui.separator()
    if imgui.menu_item("Open session ...", "", False, True)[0]:
        desk.ask_file("open session")
    if imgui.menu_item("Save session ...", "", False, True)[0]:
        desk.ask_file("save session")
    imgui.separator()
    if imgui.menu_item("Quit", "", False, True)[0]:
        hello_imgui.get_runner_params().app_shall_exit = True


def _recent(desk: Desk, path: str, unit: str) -> None:
    """Draw a recent file, with the picture that it had."""
    size = ImVec2(em(4.5), em(3.0))
    picture = desk.work.shelf.picture(model_key(path))
    if picture is not None:
        imgui.image(imgui.ImTextureRef(desk.texture(model_key(path), picture).glo), size)
    else:
        imgui.dummy(size)
    imgui.same_line()
    if imgui.menu_item(f"{Path(path).name}\n{shortened(str(Path(path).parent), 60)}##{path}", "", False, True)[0]:
        desk.work.open(Model(path, unit))
    tooltip(path)


def status(desk: Desk) -> None:
    """Status line: the model, how it is drawn, and work under way."""
    loaded, stage = desk.work.loaded, desk.stage
    if loaded is not None:
        name = Path(loaded.model.path).name
        imgui.text(f"{name}: {loaded.triangles} triangles, {stage.renderer.provenance['renderer']}")
        imgui.same_line()
        imgui.text(f"|  {stage.state}")
    task = next((one for one in desk.work.busy if one.name), None)
    if task is None:
        return
    imgui.same_line()
    imgui.text(f"|  {task.told}")
    imgui.same_line()
    if imgui.small_button("cancel"):
        task.cancel()
