"""The environments panel: what lights the model, as small pictures, with rotation and exposure beside them."""

from __future__ import annotations

from functools import partial

from imgui_bundle import ImVec2, imgui

from translucent.preview.desk import FAINT, WARNING, Desk, begin_rows, slider, tooltip, wrapped
from translucent.preview.environments import BUILT_IN, title
from translucent.preview.panels.cards import draw_cards, draw_frame
from translucent.preview.picturing import draw_panorama, panorama_key

#: Width of a card in ems.
CARD = 8.0


def environments_panel(desk: Desk) -> None:
    """Draw the panel."""
    if begin_rows("light"):
        slider(desk, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        slider(desk, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        imgui.end_table()
    folder = desk.environments
    if imgui.button("Open ..."):
        desk.ask_file("environment")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    flags = imgui.InputTextFlags_.enter_returns_true
    entered, text = imgui.input_text_with_hint(
        "##folder", "folder with .hdr and .exr", desk.texts.get("environments", folder.path), flags
    )
    desk.texts["environments"] = text
    if entered:
        folder.take(text)
    if not imgui.is_item_active():
        desk.texts.pop("environments", None)
    files = folder.files()
    if folder.problem:
        wrapped(folder.problem, WARNING)
    if imgui.begin_child("##environments"):
        imgui.separator_text("built in")
        _cards(desk, list(BUILT_IN))
        if files:
            imgui.separator_text(f"in the folder ({len(files)})")
            _cards(desk, files)
    imgui.end_child()


def _cards(desk: Desk, names: list[str]) -> None:
    line = imgui.get_text_line_height()
    draw_cards(names, CARD, lambda width: 0.5 * width + 1.2 * line, partial(_card, desk))


def _card(desk: Desk, name: str, size: ImVec2) -> None:
    low = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"##card{name}", size):
        desk.light_with(name)
    hovered = imgui.is_item_hovered()
    tooltip(name or "The stage's, or the model's own.")
    over = imgui.get_window_draw_list()
    high = ImVec2(low.x + size.x, low.y + 0.5 * size.x)
    key = panorama_key(name) if name else ""
    picture = desk.work.shelf.picture(key, draw_panorama, name) if name else None
    if picture is not None:
        over.add_image(imgui.ImTextureRef(desk.texture(key, picture).glo), low, high)
    else:
        over.add_rect_filled(low, high, 0xFF303030)
    chosen = desk.get("look.environment") == name
    draw_frame(over, low, high, chosen=chosen, hovered=hovered)
    over.push_clip_rect(ImVec2(low.x, high.y), ImVec2(high.x, low.y + size.y), True)
    faint = imgui.get_color_u32(imgui.ImVec4(*FAINT))
    over.add_text(ImVec2(low.x, high.y), imgui.get_color_u32(imgui.Col_.text) if chosen else faint, title(name))
    over.pop_clip_rect()
