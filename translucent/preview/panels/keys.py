"""Keys of the window, and the page that tells them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from translucent.preview.desk import FAINT, Desk, em
from translucent.preview.hiding import hide, isolate, show_all

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


def keys_page(desk: Desk) -> None:
    """Draw the page, if it is asked for."""
    if not desk.keys_shown:
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
            desk.keys_shown = False
        if not desk.keys_shown:
            imgui.close_current_popup()
        imgui.end_popup()


def handle_keys(desk: Desk) -> None:
    """Do what keys ask for; not while somebody types."""
    io = imgui.get_io()
    if imgui.is_key_pressed(imgui.Key.escape, False) and not _closes_itself(desk):
        desk.escape()
    if io.want_text_input or desk.browser is not None:
        return
    if imgui.is_key_pressed(imgui.Key.f1, False) or (io.key_shift and imgui.is_key_pressed(imgui.Key.slash, False)):
        desk.keys_shown = not desk.keys_shown
    if desk.keys_shown:
        return
    if imgui.is_key_pressed(imgui.Key.f, False):
        desk.frame()
    if imgui.is_key_pressed(imgui.Key.h, False) and io.key_alt:
        show_all(desk)
    elif imgui.is_key_pressed(imgui.Key.h, False) and desk.target is not None:
        hide(desk, desk.target)
    if imgui.is_key_pressed(imgui.Key.i, False) and desk.target is not None:
        isolate(desk, desk.target)
    if imgui.is_key_pressed(imgui.Key.c, False) and not io.key_ctrl:
        desk.change("display.converge", not desk.get("display.converge"), step=True)
    if imgui.is_key_pressed(imgui.Key.p, False):
        desk.change("display.caustics", not desk.get("display.caustics"), step=True)
    if io.key_ctrl and imgui.is_key_pressed(imgui.Key.z):
        (desk.work.redo if io.key_shift else desk.work.undo)()
    elif io.key_ctrl and imgui.is_key_pressed(imgui.Key.y):
        desk.work.redo()
    elif io.key_ctrl and imgui.is_key_pressed(imgui.Key.o, False):
        desk.ask_file("open")
    elif imgui.is_key_pressed(imgui.Key.o, False) and desk.work.document.orbit is not None:
        desk.change("orbit.orthographic", not desk.get("orbit.orthographic"), step=True)


def _closes_itself(desk: Desk) -> bool:
    """True if Escape is for a menu, a list or a field that is being typed in, which see to it themselves."""
    own = desk.browser is not None or desk.keys_shown
    typing = imgui.get_io().want_text_input
    return not own and (typing or imgui.is_popup_open("", imgui.PopupFlags_.any_popup))
