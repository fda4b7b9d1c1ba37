"""The library panel: materials as small pictures to click, or to drag onto an object."""

from __future__ import annotations

from functools import partial

from imgui_bundle import ImVec2, imgui

from translucent.media.preset import Preset
from translucent.preview.answers import save_preset
from translucent.preview.desk import FAINT, Desk, em, tooltip, wrapped
from translucent.preview.panels.cards import draw_cards, draw_frame
from translucent.preview.picturing import ball_key, draw_ball

#: Width of a card in ems.
CARD = 5.0

#: Type of what is dragged.
PRESET = "preset"

SAVE_TIP = "Saves the medium, ior and roughness as a .toml file to be shared: others put it into this folder of theirs."


def library_panel(desk: Desk) -> None:
    """Draw the panel."""
    library = desk.work.library
    imgui.set_next_item_width(-1.0)
    hint = "search: wine, measured, stone ..."
    _, library.search = imgui.input_text_with_hint("##search", hint, library.search)
    wrapped(f"Click: {desk.target_text}. Drag: onto an object.", FAINT)
    groups = library.groups()
    if not groups:
        wrapped("None has these words.", FAINT)
    if imgui.begin_child("##presets", ImVec2(0.0, -em(3.6))):
        for group, members in groups.items():
            imgui.separator_text(f"{group} ({len(members)})")
            _cards(desk, members)
    imgui.end_child()
    imgui.separator()
    imgui.set_next_item_width(-em(6.2))
    entered, text = imgui.input_text_with_hint(
        "##name", "name of this material", desk.texts.get("preset", ""), imgui.InputTextFlags_.enter_returns_true
    )
    desk.texts["preset"] = text
    imgui.same_line()
    pressed = imgui.button("Save preset")
    tooltip(f"{SAVE_TIP}\n{library.folder}")
    if (entered or pressed) and text.strip() and save_preset(desk, text):
        desk.texts["preset"] = ""


def _cards(desk: Desk, members: list[Preset]) -> None:
    line = imgui.get_text_line_height()
    draw_cards(members, CARD, lambda width: width + 2.2 * line, partial(_card, desk))


def _card(desk: Desk, one: Preset, size: ImVec2) -> None:
    low = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"##{one.name}", size):
        desk.choose_preset(one.name)
    hovered = imgui.is_item_hovered()
    if imgui.begin_drag_drop_source():
        desk.dragged = one.name
        imgui.set_drag_drop_payload_py_id(PRESET, 0)
        imgui.text(one.name.replace("_", " "))
        imgui.end_drag_drop_source()
    else:
        tooltip(told(one))
    over = imgui.get_window_draw_list()
    high = ImVec2(low.x + size.x, low.y + size.x)
    picture = desk.work.shelf.picture(ball_key(one), draw_ball, one)
    if picture is not None:
        over.add_image(imgui.ImTextureRef(desk.texture(ball_key(one), picture).glo), low, high)
    else:
        _swatch(over, one, low, high)
    chosen = desk.material.preset == one.name
    draw_frame(over, low, high, chosen=chosen, hovered=hovered)
    line = imgui.get_text_line_height()
    over.push_clip_rect(ImVec2(low.x, high.y), ImVec2(high.x, high.y + 2.2 * line), True)
    text = imgui.get_color_u32(imgui.Col_.text)
    over.add_text(ImVec2(low.x, high.y + 0.1 * line), text, one.name.replace("_", " "))
    over.add_text(ImVec2(low.x, high.y + 1.05 * line), imgui.get_color_u32(imgui.ImVec4(*FAINT)), one.kind)
    over.pop_clip_rect()


def seen_color(one: Preset) -> str:
    """Color that a preset is seen in: what it gives back, or what is left of white light after a centimeter."""
    return one.diffuse_color() if one.regime == "scattering dominated" else one.colors()["1 cm"]


def _swatch(over: imgui.ImDrawList, one: Preset, low: ImVec2, high: ImVec2) -> None:
    """Draw what a centimeter of the medium looks like, until there is a picture."""
    red, green, blue = (int(seen_color(one)[i : i + 2], 16) for i in (1, 3, 5))
    over.add_rect_filled(low, high, 0xFF303030)
    middle, radius = ImVec2(0.5 * (low.x + high.x), 0.5 * (low.y + high.y)), 0.42 * (high.x - low.x)
    over.add_circle_filled(middle, radius, 0xFF000000 | blue << 16 | green << 8 | red)


def told(one: Preset) -> str:
    """Text about a preset: names, source, and what to know."""
    names = ", ".join((one.name, *one.aliases))
    lines = (names, f"{one.kind}: {one.source}", f"ior {one.medium.ior:g}, {one.regime}", one.note, one.warning)
    return "\n".join(line for line in lines if line)
