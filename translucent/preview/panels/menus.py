"""Menus, keys, the page that lists them, and the line at the bottom of the window."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, hello_imgui, imgui

from translucent.assets import mesh_names
from translucent.errors import shortened
from translucent.preview.document import Model
from translucent.preview.panels.scene import hide, isolate, show_all
from translucent.preview.thumbnails import model_key
from translucent.preview.window_state import FAINT, WindowState, em, tooltip
from translucent.units import METRES_PER_UNIT


def menus(state: WindowState) -> None:
    """File, Edit, Help."""
    if imgui.begin_menu("File"):
        _file(state)
        imgui.end_menu()
    if imgui.begin_menu("Edit"):
        history = state.work.history
        if imgui.menu_item("Undo", "Ctrl Z", False, bool(history.past))[0]:
            state.work.undo()
        if imgui.menu_item("Redo", "Ctrl Y", False, bool(history.future))[0]:
            state.work.redo()
        if imgui.menu_item("Frame the model", "F", False, True)[0]:
            state.frame()
        if imgui.menu_item("Reload shaders", "", False, True)[0]:
            state.view.reload(state.work)
        imgui.end_menu()
    if imgui.begin_menu("Help"):
        if imgui.menu_item("Mouse and keys", "?", False, True)[0]:
            state.keys_shown = True
        imgui.end_menu()


def _file(state: WindowState) -> None:
    unit = state.get("model.unit")
    if imgui.menu_item("Open ...", "Ctrl O", False, True)[0]:
        state.ask_file("open")
    if imgui.begin_menu("Recent", bool(state.work.recent)):
        for path in state.work.recent:
            _recent(state, path, unit)
        imgui.end_menu()
    if imgui.begin_menu("The toolkit's own"):
        for name in mesh_names():
            if imgui.menu_item(name, "", name == state.get("model.path"), True)[0]:
                state.work.open(Model(name))
        imgui.end_menu()
    if imgui.begin_menu("Unit of the file"):
        for word in METRES_PER_UNIT:
            if imgui.menu_item(word, "", word == unit, True)[0] and word != unit:
                state.work.open(Model(state.get("model.path"), word))
        imgui.end_menu()
    imgui.separator()
    if imgui.menu_item("Open session ...", "", False, True)[0]:
        state.ask_file("open session")
    if imgui.menu_item("Save session ...", "", False, True)[0]:
        state.ask_file("save session")
    imgui.separator()
    if imgui.menu_item("Quit", "", False, True)[0]:
        hello_imgui.get_runner_params().app_shall_exit = True


def _recent(state: WindowState, path: str, unit: str) -> None:
    """Draw a recent file, with the picture that it had."""
    size = ImVec2(em(4.5), em(3.0))
    picture = state.work.thumbnails.picture(model_key(path))
    if picture is not None:
        imgui.image(imgui.ImTextureRef(state.texture(model_key(path), picture).glo), size)
    else:
        imgui.dummy(size)
    imgui.same_line()
    if imgui.menu_item(f"{Path(path).name}\n{shortened(str(Path(path).parent), 60)}##{path}", "", False, True)[0]:
        state.work.open(Model(path, unit))
    tooltip(path)


def status(state: WindowState) -> None:
    """Status line: the model, how it is drawn, and work under way."""
    loaded, stage = state.work.loaded, state.view
    if loaded is not None:
        name = Path(loaded.model.path).name
        imgui.text(f"{name}: {loaded.triangles} triangles, {stage.renderer.provenance['renderer']}")
        imgui.same_line()
        imgui.text(f"|  {stage.state}")
    task = next((one for one in state.work.busy if one.name), None)
    if task is None:
        return
    imgui.same_line()
    imgui.text(f"|  {task.told}")
    imgui.same_line()
    if imgui.small_button("cancel"):
        task.cancel()


#: What mouse and keys do.
KEYS = (
    ("drag", "orbit"),
    ("right drag, Shift drag", "pan"),
    ("wheel", "zoom to the cursor"),
    ("click", "select an object, whose material the panels then change"),
    ("F", "frame the model, or the selected object"),
    ("H, Alt H", "hide the selected object; show all"),
    ("I", "isolate the selected object; all again"),
    ("O", "orthographic or perspective"),
    ("C", "converge: path trace the still picture"),
    ("P", "photons: caustics in the still picture"),
    ("L drag", "move the light"),
    ("E drag", "turn the environment, or the stage with its lamps"),
    ("Ctrl Z, Ctrl Y", "undo, redo"),
    ("Ctrl O", "open"),
    ("Ctrl click", "type a number into a slider"),
    ("?, F1", "this page"),
    ("Escape", "close what is on top, or select nothing"),
)

PAGE = "Mouse and keys"


def keys_page(state: WindowState) -> None:
    """Draw the page, if it is asked for."""
    if not state.keys_shown:
        return
    if not imgui.is_popup_open(PAGE):
        imgui.open_popup(PAGE)
    room = imgui.get_io().display_size
    imgui.set_next_window_pos(ImVec2(0.5 * room.x, 0.5 * room.y), imgui.Cond_.always, ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_title_bar
    if imgui.begin_popup_modal(PAGE, None, flags)[0]:
        imgui.text(PAGE)
        if imgui.begin_table("keys", 2):
            imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed, em(13.0))
            imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed, em(26.0))
            for keys, what in KEYS:
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text_colored(FAINT, keys)
                imgui.table_next_column()
                imgui.text(what)
            imgui.end_table()
        if imgui.button("Close"):
            state.keys_shown = False
        if not state.keys_shown:
            imgui.close_current_popup()
        imgui.end_popup()


def handle_keys(state: WindowState) -> None:
    """Do what keys ask for; not while somebody types."""
    io = imgui.get_io()
    if imgui.is_key_pressed(imgui.Key.escape, False) and not _closes_itself(state):
        state.escape()
    if io.want_text_input or state.browser is not None:
        return
    if imgui.is_key_pressed(imgui.Key.f1, False) or (io.key_shift and imgui.is_key_pressed(imgui.Key.slash, False)):
        state.keys_shown = not state.keys_shown
    if state.keys_shown:
        return
    if imgui.is_key_pressed(imgui.Key.f, False):
        state.frame()
    if imgui.is_key_pressed(imgui.Key.h, False) and io.key_alt:
        show_all(state)
    elif imgui.is_key_pressed(imgui.Key.h, False) and state.target is not None:
        hide(state, state.target)
    if imgui.is_key_pressed(imgui.Key.i, False) and state.target is not None:
        isolate(state, state.target)
    if imgui.is_key_pressed(imgui.Key.c, False) and not io.key_ctrl:
        state.change("display.converge", not state.get("display.converge"), step=True)
    if imgui.is_key_pressed(imgui.Key.p, False):
        state.change("display.caustics", not state.get("display.caustics"), step=True)
    if io.key_ctrl and imgui.is_key_pressed(imgui.Key.z):
        (state.work.redo if io.key_shift else state.work.undo)()
    elif io.key_ctrl and imgui.is_key_pressed(imgui.Key.y):
        state.work.redo()
    elif io.key_ctrl and imgui.is_key_pressed(imgui.Key.o, False):
        state.ask_file("open")
    elif imgui.is_key_pressed(imgui.Key.o, False) and state.work.document.orbit is not None:
        state.change("orbit.orthographic", not state.get("orbit.orthographic"), step=True)


def _closes_itself(state: WindowState) -> bool:
    """True if Escape is for a menu, a list or a field that is being typed in, which see to it themselves."""
    own = state.browser is not None or state.keys_shown
    typing = imgui.get_io().want_text_input
    return not own and (typing or imgui.is_popup_open("", imgui.PopupFlags_.any_popup))
