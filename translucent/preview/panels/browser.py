"""The file browser, where the system has no dialogs: in front of everything, until a file is chosen or Escape."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from translucent.preview.answers import use_file
from translucent.preview.browser import Browser
from translucent.preview.desk import FAINT, WARNING, Desk, em, wrapped
from translucent.preview.picturing import model_key

#: Width of the column of folders, in ems.
PLACES = 11.0

POPUP = "##browser"


def file_browser(desk: Desk) -> None:
    """Draw the browser, if a question is asked."""
    browser = desk.browser
    if browser is None:
        return
    if not imgui.is_popup_open(POPUP):
        imgui.open_popup(POPUP)
    room = imgui.get_io().display_size
    imgui.set_next_window_size(ImVec2(min(em(52.0), 0.9 * room.x), min(em(34.0), 0.85 * room.y)))
    imgui.set_next_window_pos(ImVec2(0.5 * room.x, 0.5 * room.y), imgui.Cond_.appearing, ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move
    imgui.push_style_color(imgui.Col_.popup_bg, imgui.ImVec4(0.16, 0.165, 0.175, 1.0))
    if imgui.begin_popup_modal(POPUP, None, flags)[0]:
        _content(desk, browser)
        if desk.browser is None:
            imgui.close_current_popup()
        imgui.end_popup()
    imgui.pop_style_color()


def _content(desk: Desk, browser: Browser) -> None:
    imgui.text(browser.title)
    if imgui.button("Up"):
        browser.enter("..")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    shown = desk.texts.get("folder", str(browser.folder))
    entered, text = imgui.input_text("##folder", shown, imgui.InputTextFlags_.enter_returns_true)
    desk.texts["folder"] = text
    if entered:
        browser.enter(text)
    if not imgui.is_item_active():
        desk.texts.pop("folder", None)
    below = -2.0 * imgui.get_frame_height_with_spacing() - imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("##places", ImVec2(em(PLACES), below)):
        for folder in desk.places():
            if imgui.selectable(f"{Path(folder).name or folder}##{folder}", folder == str(browser.folder))[0]:
                browser.enter(folder)
            if imgui.is_item_hovered():
                imgui.set_tooltip(folder)
    imgui.end_child()
    imgui.same_line()
    chosen = None
    if imgui.begin_child("##files", ImVec2(0.0, below), imgui.ChildFlags_.borders):
        chosen = _files(desk, browser)
    imgui.end_child()
    wrapped(browser.problem or " ", WARNING)
    _, browser.every = imgui.checkbox("all files", browser.every)
    imgui.same_line()
    imgui.text_colored(FAINT, " ".join(browser.patterns))
    imgui.set_next_item_width(-em(11.0))
    flags = imgui.InputTextFlags_.enter_returns_true
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    entered, browser.text = imgui.input_text_with_hint("##name", "name or path of a file", browser.text, flags)
    imgui.same_line()
    if imgui.button(browser.button, ImVec2(em(5.0), 0.0)) or entered or chosen:
        answer(desk)
    imgui.same_line()
    if imgui.button("Cancel", ImVec2(em(5.0), 0.0)):
        desk.browser = None


def _files(desk: Desk, browser: Browser) -> bool:
    """Draw the list; returns whether a file was double-clicked."""
    entries, chosen = browser.entries(), False
    if not entries:
        imgui.text_colored(FAINT, "nothing of these kinds is here")
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
                _tell(desk, browser.folder / entry.name)
    return chosen


def _tell(desk: Desk, path: Path) -> None:
    """Draw a tooltip with the picture that a model had when it was last open."""
    picture = desk.work.shelf.picture(model_key(str(path)))
    if picture is not None and imgui.begin_tooltip():
        texture = desk.texture(model_key(str(path)), picture)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(em(12.0), em(12.0) * texture.height / texture.width))
        imgui.end_tooltip()


def answer(desk: Desk) -> None:
    """Use the file that the browser names, and close it; or tell why not."""
    browser = desk.browser
    if browser is None:
        return
    path = browser.accept()
    if path is not None:
        desk.browser = None
        use_file(desk, browser.kind, path)
