"""The files panel: pictures, the session, export of the medium, and baking; and our own file browser."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from translucent.preview.dialogs import Browser
from translucent.preview.library import model_key
from translucent.preview.panels import widgets as ui
from translucent.preview.window_state import WindowState

RECIPES = (
    ("Copy command", "command", "translucent render with options for this picture, its stage and caustics"),
    ("Copy Python", "python", "A script that makes this picture, with all that no option says"),
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
    ui.wrapped("A copy of the model's file with this medium in its materials.", ui.FAINT)
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
        imgui.text_colored(ui.FAINT, "nothing of these kinds is here")
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
