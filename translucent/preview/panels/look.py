"""The look panel: camera, environment, light, exposure. And the files panel: sessions, pictures, bakes."""

from __future__ import annotations

from functools import partial

from imgui_bundle import ImVec2, imgui

from translucent.formulas.tone import TONES
from translucent.preview.actions import SetField, SetOrbit
from translucent.preview.document import AUTO, STAGE_WORDS, TIPS
from translucent.preview.library import BUILT_IN, title
from translucent.preview.thumbnails import draw_panorama, panorama_key
from translucent.preview.window_state import (
    FAINT,
    WARNING,
    WindowState,
    begin_rows,
    check,
    choice,
    draw_cards,
    draw_frame,
    row,
    slider,
    tooltip,
    wrapped,
)

#: Width of a card in ems.
CARD = 8.0


def look_panel(state: WindowState) -> None:
    """Draw the panel."""
    imgui.separator_text("Camera")
    orbit = state.work.document.orbit
    if orbit is not None and begin_rows("camera"):
        slider(state, "field of view", "orbit.fov_y", 5.0, 120.0, "%.0f deg")
        check(state, "orthographic", "orbit.orthographic")
        imgui.end_table()
    if imgui.button("Frame (F)"):
        state.work.frame()
    imgui.same_line()
    if imgui.button("Reset") and orbit is not None:
        state.work.do(SetOrbit(None))
        state.work.reframe()
    imgui.separator_text("Stage and environment")
    if begin_rows("environment"):
        choice(state, "stage", "look.stage", STAGE_WORDS)
        _environment(state, "lights with", "look.environment", "the stage's, or the model's own")
        _environment(state, "background", "look.background", "the same")
        slider(state, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        imgui.end_table()
    imgui.separator_text("Light")
    if begin_rows("light"):
        check(state, "directional light", "look.light")
        if state.get("look.light"):
            slider(state, "from around", "look.light_yaw", -180.0, 180.0, "%.0f deg")
            slider(state, "from above", "look.light_pitch", -89.0, 89.0, "%.0f deg")
            slider(state, "irradiance", "look.light_irradiance", 0.0, 50.0, "%.2f W/m2")
        imgui.end_table()
    imgui.separator_text("Picture")
    if begin_rows("picture"):
        slider(state, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        choice(state, "tone curve", "look.tone", (AUTO, *TONES))
        imgui.end_table()


def _environment(state: WindowState, label: str, name: str, empty: str) -> None:
    row(label, TIPS[name])
    now = state.get(name)
    if imgui.begin_combo(f"##{name}", now or empty):
        for word in BUILT_IN:
            if imgui.selectable(word or empty, word == now)[0]:
                state.work.do(SetField(name, word))
        if imgui.selectable("a file ...", False)[0]:
            state.ask_file("environment" if name.endswith("environment") else "background")
        imgui.end_combo()


def environments_panel(state: WindowState) -> None:
    """Draw the panel."""
    if begin_rows("light"):
        slider(state, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        slider(state, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        imgui.end_table()
    folder = state.environments
    if imgui.button("Open ..."):
        state.ask_file("environment")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    flags = imgui.InputTextFlags_.enter_returns_true
    entered, text = imgui.input_text_with_hint(
        "##folder", "folder with .hdr and .exr", state.texts.get("environments", folder.path), flags
    )
    state.texts["environments"] = text
    if entered:
        folder.take(text)
    if not imgui.is_item_active():
        state.texts.pop("environments", None)
    files = folder.files()
    if folder.problem:
        wrapped(folder.problem, WARNING)
    if imgui.begin_child("##environments"):
        imgui.separator_text("built in")
        _cards(state, list(BUILT_IN))
        if files:
            imgui.separator_text(f"in the folder ({len(files)})")
            _cards(state, files)
    imgui.end_child()


def _cards(state: WindowState, names: list[str]) -> None:
    line = imgui.get_text_line_height()
    draw_cards(names, CARD, lambda width: 0.5 * width + 1.2 * line, partial(_card, state))


def _card(state: WindowState, name: str, size: ImVec2) -> None:
    low = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"##card{name}", size):
        state.light_with(name)
    hovered = imgui.is_item_hovered()
    tooltip(name or "The stage's, or the model's own.")
    over = imgui.get_window_draw_list()
    high = ImVec2(low.x + size.x, low.y + 0.5 * size.x)
    key = panorama_key(name) if name else ""
    picture = state.work.thumbnails.picture(key, draw_panorama, name) if name else None
    if picture is not None:
        over.add_image(imgui.ImTextureRef(state.texture(key, picture).glo), low, high)
    else:
        over.add_rect_filled(low, high, 0xFF303030)
    chosen = state.get("look.environment") == name
    draw_frame(over, low, high, chosen=chosen, hovered=hovered)
    over.push_clip_rect(ImVec2(low.x, high.y), ImVec2(high.x, low.y + size.y), True)
    faint = imgui.get_color_u32(imgui.ImVec4(*FAINT))
    over.add_text(ImVec2(low.x, high.y), imgui.get_color_u32(imgui.Col_.text) if chosen else faint, title(name))
    over.pop_clip_rect()
