"""Menus, keys and the page that lists them, the bottom line, the files panel and the file browser.

The files panel has pictures, the session, the medium in other formats, and baking.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from imgui_bundle import ImVec2, hello_imgui, imgui

from translucent.assets import mesh_names, scene_names
from translucent.errors import shortened
from translucent.preview.actions import Hide, Resize
from translucent.preview.dialogs import Browser
from translucent.preview.document import SNAPSHOTS, Model
from translucent.preview.library import model_key
from translucent.preview.panels import widgets as ui
from translucent.preview.window_state import WindowState
from translucent.units import METRES_PER_UNIT

PAGE = "Mouse and keys"

#: Keys, and what they do.
KEYS = (
    ("drag", "orbit"),
    ("right drag, Shift drag", "pan"),
    ("wheel", "zoom to the cursor"),
    ("click", "select an object; the panels then change its material"),
    ("F", "frame the model, or the selected object"),
    ("H, Alt H", "hide the selected object; show all"),
    ("I", "isolate the selected object; all again"),
    ("O", "orthographic or perspective"),
    ("keypad 1, 3, 7", "view from the front, the right, the top; with Ctrl from behind them"),
    ("W, R, S", "gizmo that moves, rotates, scales the selected object"),
    ("1 to 9, Shift 1 to 9", "show a snapshot; keep one"),
    ("Space", "play the animations, or stop them"),
    ("C", "converge: path trace the still picture"),
    ("P", "photons: caustics in the still picture"),
    ("L drag", "move the light"),
    ("E drag", "turn the environment, or the stage with its lights"),
    ("Ctrl Z, Ctrl Y", "undo, redo"),
    ("Ctrl O", "open"),
    ("Ctrl click", "type a number into a slider"),
    ("?, F1", "this page"),
    ("Escape", "close what is on top, or select nothing"),
)


def menu_item(label: str, act: Callable[[], object], keys: str = "", *, enabled: bool = True) -> None:
    """Item of a menu, which acts when it is chosen."""
    if imgui.menu_item(label, keys, False, enabled)[0]:
        act()


def menus(state: WindowState) -> None:
    """File, Edit, Help."""
    work = state.work
    if imgui.begin_menu("File"):
        _file(state)
        imgui.end_menu()
    if imgui.begin_menu("Edit"):
        menu_item("Undo", work.undo, "Ctrl Z", enabled=bool(work.history.past))
        menu_item("Redo", work.redo, "Ctrl Y", enabled=bool(work.history.future))
        menu_item("Frame the model", lambda: work.frame(state.selected), "F")
        menu_item("Reload shaders", lambda: state.view.reload(work))
        imgui.end_menu()
    if imgui.begin_menu("Help"):
        menu_item(PAGE, lambda: setattr(state, "keys_shown", True), "?")
        imgui.end_menu()


def _file(state: WindowState) -> None:
    path, unit = state.get("model.path"), state.get("model.unit")
    menu_item("Open ...", lambda: state.ask_file("open"), "Ctrl O")
    if imgui.begin_menu("Recent", bool(state.work.recent)):
        for recent in state.work.recent:
            _recent(state, recent, unit)
        imgui.end_menu()
    if imgui.begin_menu("The toolkit's own"):
        for name in (*scene_names(), *mesh_names()):
            if imgui.menu_item(name, "", name == path, True)[0]:
                state.work.open(Model(name))
        imgui.end_menu()
    if imgui.begin_menu("Unit of the file"):
        for word in METRES_PER_UNIT:
            if imgui.menu_item(word, "", word == unit, True)[0] and word != unit:
                state.work.do(Resize(word))
        imgui.end_menu()
    imgui.separator()
    menu_item("Open session ...", lambda: state.ask_file("open session"))
    menu_item("Save session ...", lambda: state.ask_file("save session"))
    imgui.separator()
    menu_item("Quit", lambda: setattr(hello_imgui.get_runner_params(), "app_shall_exit", True))


def _recent(state: WindowState, path: str, unit: str) -> None:
    """Draw a recent file, with its thumbnail."""
    size, key = ImVec2(ui.em(4.5), ui.em(3.0)), model_key(path)
    if (picture := state.work.thumbnails.picture(key)) is not None:
        imgui.image(imgui.ImTextureRef(state.texture(key, picture).glo), size)
    else:
        imgui.dummy(size)
    imgui.same_line()
    label = f"{Path(path).name}\n{shortened(str(Path(path).parent), 60)}##{path}"
    menu_item(label, lambda: state.work.open(Model(path, unit)))
    ui.tooltip(path)


def status(state: WindowState) -> None:
    """Status line: the model, the state of its picture, and work under way."""
    loaded, view = state.work.loaded, state.view
    if loaded is not None:
        name = Path(loaded.model.path).name
        imgui.text(f"{name}: {loaded.triangles} triangles, {view.renderer.provenance['renderer']}")
        imgui.same_line()
        imgui.text(f"|  {view.state}")
    if (task := next((one for one in state.work.busy if one.name), None)) is not None:
        imgui.same_line()
        imgui.text(f"|  {task.progress}")
        imgui.same_line()
        if imgui.small_button("cancel"):
            task.cancel()


def _handle_tools(state: WindowState) -> None:
    """Act on keys of gizmos, views, snapshots and animations."""
    io, key = imgui.get_io(), imgui.Key
    for word, each in (("move", key.w), ("rotate", key.r), ("scale", key.s)):
        if imgui.is_key_pressed(each, False) and not io.key_ctrl:
            state.gizmo = "" if state.gizmo == word else word
    for each, view, opposite in (
        (key.keypad1, "front", "back"),
        (key.keypad3, "right", "left"),
        (key.keypad7, "top", "bottom"),
    ):
        if imgui.is_key_pressed(each, False):
            state.view_from(opposite if io.key_ctrl else view)
    for name in SNAPSHOTS:
        if imgui.is_key_pressed(getattr(key, f"_{name}"), False):
            state.snapshot(name, keep=io.key_shift)
    if imgui.is_key_pressed(key.space, False):
        state.play()


def keys_page(state: WindowState) -> None:
    """Draw the page of keys, if it is open."""
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
            imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed, ui.em(13.0))
            imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed, ui.em(26.0))
            for keys, what in KEYS:
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text_colored(ui.FAINT, keys)
                imgui.table_next_column()
                imgui.text(what)
            imgui.end_table()
        if imgui.button("Close"):
            state.keys_shown = False
        if not state.keys_shown:
            imgui.close_current_popup()
        imgui.end_popup()


def handle_keys(state: WindowState) -> None:
    """Act on pressed keys; not while somebody types."""
    io, work, key = imgui.get_io(), state.work, imgui.Key

    def pressed(which: imgui.Key) -> bool:
        return imgui.is_key_pressed(which, False)

    def switch(name: str) -> None:
        state.change(name, not state.get(name), step=True)

    # Escape is for a menu, a list or a field in which somebody types, which see to it themselves; or for ours.
    own = state.browser is not None or state.keys_shown
    others = io.want_text_input or imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
    if pressed(key.escape) and (own or not others):
        state.escape()
    if io.want_text_input or state.browser is not None:
        return
    if pressed(key.f1) or (io.key_shift and pressed(key.slash)):
        state.keys_shown = not state.keys_shown
    if state.keys_shown:
        return
    if pressed(key.f):
        work.frame(state.selected)
    if pressed(key.h) and io.key_alt:
        work.do(Hide(()))
    elif pressed(key.h) and state.target is not None:
        state.hide(state.target)
    if pressed(key.i) and state.target is not None:
        state.isolate(state.target)
    _handle_tools(state)
    if pressed(key.c) and not io.key_ctrl:
        switch("display.converge")
    if pressed(key.p):
        switch("display.caustics")
    if io.key_ctrl and imgui.is_key_pressed(key.z):
        (work.redo if io.key_shift else work.undo)()
    elif io.key_ctrl and imgui.is_key_pressed(key.y):
        work.redo()
    elif io.key_ctrl and pressed(key.o):
        state.ask_file("open")
    elif pressed(key.o) and work.document.orbit is not None:
        switch("orbit.orthographic")


RECIPES = (
    ("Copy command", "command", "a translucent render command for this picture, its stage and caustics"),
    ("Copy Python", "python", "a script for this picture, with the settings that have no option"),
)

#: Width of the browser's column of folders, in ems.
PLACES = 11.0

POPUP = "##browser"


def files_panel(state: WindowState) -> None:
    """Draw the files panel: pictures and turntables, the session, export of the medium, and baking."""
    imgui.separator_text("Picture of this view")
    if ui.begin_rows("export"):
        ui.whole(state, "width", "export.width", "as the viewport")
        ui.whole(state, "height", "export.height", "as the viewport")
        ui.whole(state, "samples", "export.samples")
        ui.check(state, "transparent", "export.transparent")
        ui.check(state, "denoise", "export.denoise")
        ui.whole(state, "turntable of", "export.pictures")
        imgui.end_table()
    for label, kind in (("PNG ...", "png"), ("EXR ...", "exr")):
        if imgui.button(label):
            state.ask_file(kind)
        imgui.same_line()
    if imgui.button("Turntable ..."):
        state.ask_file("turntable")
    for label, kind, tip in RECIPES:
        if imgui.button(label):
            state.copy_recipe(kind)
        ui.tooltip(tip)
        imgui.same_line()
    imgui.new_line()
    imgui.separator_text("Session")
    if imgui.button("Open session ..."):
        state.ask_file("open session")
    imgui.same_line()
    if imgui.button("Save session ..."):
        state.ask_file("save session")
    imgui.separator_text("Model")
    if imgui.button("Save medium into .glb ..."):
        state.ask_file("save glb")
    ui.wrapped("Saves a copy of the model file with this medium in its materials.", ui.FAINT)
    _bake(state)


def _bake(state: WindowState) -> None:
    imgui.separator_text("Bake thickness")
    modes, sizes, rays = ("cone", "normal", "transmittance", "inscribed"), (256, 512, 1024, 2048), (16, 64, 256)
    if ui.begin_rows("bake"):
        for label, values in (("mode", modes), ("size", sizes), ("rays", rays)):
            ui.row(label)
            now, choose = state.baking[label], partial(state.baking.__setitem__, label)
            ui.combo(f"bake{label}", str(now), [(str(value), value) for value in values], now, choose)
        imgui.end_table()
    task = state.work.lanes["bake"].task
    if task is not None:
        imgui.progress_bar(task.share or 0.0)
        if imgui.button("Cancel"):
            task.cancel()
    elif imgui.button("Bake"):
        state.work.start_bake(**state.baking)
    if (bake := state.work.bake) is not None:
        imgui.same_line()
        if imgui.button("Save map ..."):
            state.ask_file("map")
        changed, shown = imgui.checkbox("show on the model", state.work.show_bake)
        if changed:
            state.work.show_bake = shown
        if ui.begin_rows("baked"):
            ui.fact("thickest", bake.thickest_text(state.get("display.unit")))
            ui.fact("covered", f"{bake.covered:.0%} of the texels")
            imgui.end_table()


def file_browser(state: WindowState) -> None:
    """Draw the file browser, in front of everything, until a file is chosen or Escape."""
    browser = state.browser
    if browser is None:
        return
    if not imgui.is_popup_open(POPUP):
        imgui.open_popup(POPUP)
    room = imgui.get_io().display_size
    imgui.set_next_window_size(ImVec2(min(ui.em(52.0), 0.9 * room.x), min(ui.em(34.0), 0.85 * room.y)))
    imgui.set_next_window_pos(ImVec2(0.5 * room.x, 0.5 * room.y), imgui.Cond_.appearing, ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move
    imgui.push_style_color(imgui.Col_.popup_bg, imgui.ImVec4(0.16, 0.165, 0.175, 1.0))
    if imgui.begin_popup_modal(POPUP, None, flags)[0]:
        _content(state, browser)
        if state.browser is None:
            imgui.close_current_popup()
        imgui.end_popup()
    imgui.pop_style_color()


def _content(state: WindowState, browser: Browser) -> None:
    imgui.text(browser.title)
    if imgui.button("Up"):
        browser.enter("..")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if (text := ui.text_field(state, "path", "folder", str(browser.folder))) is not None:
        browser.enter(text)
    below = -2.0 * imgui.get_frame_height_with_spacing() - imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("##places", ImVec2(ui.em(PLACES), below)):
        for folder in state.places():
            if imgui.selectable(f"{Path(folder).name or folder}##{folder}", folder == str(browser.folder))[0]:
                browser.enter(folder)
            ui.tooltip(folder)
    imgui.end_child()
    imgui.same_line()
    chosen = None
    if imgui.begin_child("##files", ImVec2(0.0, below), imgui.ChildFlags_.borders):
        chosen = _files(state, browser)
    imgui.end_child()
    ui.wrapped(browser.problem or " ", ui.WARNING)
    _, browser.every = imgui.checkbox("all files", browser.every)
    imgui.same_line()
    imgui.text_colored(ui.FAINT, " ".join(browser.patterns))
    imgui.set_next_item_width(-ui.em(11.0))
    flags = imgui.InputTextFlags_.enter_returns_true
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    entered, browser.text = imgui.input_text_with_hint("##name", "name or path of a file", browser.text, flags)
    imgui.same_line()
    if imgui.button(browser.button, ImVec2(ui.em(5.0), 0.0)) or entered or chosen:
        state.answer()
    imgui.same_line()
    if imgui.button("Cancel", ImVec2(ui.em(5.0), 0.0)):
        state.browser = None


def _files(state: WindowState, browser: Browser) -> bool:
    """Draw the list; returns whether a file was double-clicked."""
    entries, chosen = browser.entries(), False
    if not entries:
        imgui.text_colored(ui.FAINT, "no file of these types in this folder")
    clipper = imgui.ListClipper()
    clipper.begin(len(entries))
    while clipper.step():
        for entry in entries[clipper.display_start : clipper.display_end]:
            label = f"{entry.name}/" if entry.is_folder else entry.name
            if imgui.selectable(label, entry.name == browser.text, imgui.SelectableFlags_.allow_double_click)[0]:
                if entry.is_folder:
                    browser.enter(entry.name)
                else:
                    browser.text = entry.name
                    chosen = imgui.is_mouse_double_clicked(0)
            if not entry.is_folder and imgui.is_item_hovered():
                _thumbnail_tooltip(state, browser.folder / entry.name)
    return chosen


def _thumbnail_tooltip(state: WindowState, path: Path) -> None:
    """Draw a tooltip with the picture that a model had when it was last open."""
    key = model_key(str(path))
    if (picture := state.work.thumbnails.picture(key)) is not None and imgui.begin_tooltip():
        texture = state.texture(key, picture)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(ui.em(12.0), ui.em(12.0) * texture.height / texture.width))
        imgui.end_tooltip()
