"""Widgets that panels share: rows of labels and fields, facts, tooltips, and cards with thumbnails."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from imgui_bundle import ImVec2, hello_imgui, imgui

from translucent.errors import InputError
from translucent.preview.document import RANGES, TIPS, Triple
from translucent.preview.library import Picture
from translucent.preview.window_state import WindowState

#: sRGB colors of warnings, errors and secondary lines.
WARNING, ERROR, FAINT = (1.0, 0.75, 0.35, 1.0), (1.0, 0.45, 0.35, 1.0), (0.62, 0.64, 0.68, 1.0)

#: Colors of the frames of cards: the chosen one, the one under the mouse, and others.
CHOSEN, HOVERED, PLAIN = 0xFFFFB050, 0xFFC0C0C0, 0x40FFFFFF

#: Color behind a thumbnail that is not there yet.
EMPTY = 0xFF303030

#: Ems between two cards.
GAP = 0.5

#: Type of what is dragged.
PRESET = "preset"

T = TypeVar("T")


def em(count: float) -> float:
    """Length of so many ems in pixels, whatever the display's scale."""
    return float(hello_imgui.em_size(count))


def packed(color: Sequence[float]) -> int:
    """Opaque color as lists of drawings take it."""
    red, green, blue = (int(255.0 * channel) for channel in color)
    return 0xFF000000 | blue << 16 | green << 8 | red


def of_hex(text: str) -> Triple:
    """Channels of a hex color, 0 to 1."""
    return int(text[1:3], 16) / 255.0, int(text[3:5], 16) / 255.0, int(text[5:7], 16) / 255.0


def wrapped(text: str, color: tuple[float, float, float, float] | None = None) -> None:
    """Draw wrapped text."""
    imgui.push_text_wrap_pos(0.0)
    if color is None:
        imgui.text(text)
    else:
        imgui.text_colored(color, text)
    imgui.pop_text_wrap_pos()


def tooltip(text: str) -> None:
    """Draw a wrapped tooltip while the mouse is over the last item."""
    if text and imgui.is_item_hovered() and imgui.begin_tooltip():
        imgui.push_text_wrap_pos(em(30.0))
        imgui.text(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def begin_rows(name: str) -> bool:
    """Begin a table of labels and fields."""
    if not imgui.begin_table(name, 2, imgui.TableFlags_.sizing_stretch_prop):
        return False
    imgui.table_setup_column("label", imgui.TableColumnFlags_.width_fixed, em(9.2))
    imgui.table_setup_column("field", imgui.TableColumnFlags_.width_stretch, 1.0)
    return True


def row(label: str, tip: str = "") -> None:
    """Draw the label of the next field."""
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    imgui.text(label)
    tooltip(tip)
    imgui.table_next_column()
    imgui.set_next_item_width(-1.0)


def fact(label: str, text: str, color: tuple[float, float, float, float] | None = None) -> None:
    """Label and text, wrapped over as many lines as it takes."""
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.text_colored(FAINT, label)
    imgui.table_next_column()
    wrapped(text, color)


def slider(
    state: WindowState,
    label: str,
    name: str,
    low: float,
    high: float,
    form: str = "%.3f",
    *,
    log: bool = False,
    unit: float = 1.0,
) -> None:
    """Slider for a number of the document, shown in a unit."""
    row(label, TIPS[name])
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if log else 0)
    changed, value = imgui.slider_float(f"##{name}", state.get(name) / unit, low / unit, high / unit, form, flags)
    if not imgui.is_item_active():
        tooltip(TIPS[name])
    begin_drag(state)
    if changed and math.isfinite(value):
        state.change(name, value * unit)


def begin_drag(state: WindowState) -> None:
    """Begin a step of undo if the last item is pressed: all its changes until it is let go are one."""
    if imgui.is_item_activated():
        state.drag += 1


def triple(state: WindowState, label: str, name: str, speed: float) -> None:
    """Fields for three numbers of the document, at least 0, on a line of their own; not in a table."""
    imgui.text(label)
    tooltip(TIPS[name])
    imgui.set_next_item_width(-1.0)
    changed, values = imgui.drag_float3(
        f"##{name}", list(state.get(name)), speed, 0.0, min(RANGES[name].high, 1e9), "%.5g"
    )
    begin_drag(state)
    if changed and all(math.isfinite(v) for v in values):
        state.change(name, [max(v, 0.0) for v in values])


def number(
    state: WindowState,
    label: str,
    name: str,
    now: float,
    ends: tuple[float, float],
    form: str,
    change: Callable[[str, float], None],
) -> None:
    """Slider for a field, such as ``light.radius``, of what `change` takes the name of the field and its value."""
    row(label, TIPS[name])
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format
    changed, value = imgui.slider_float(f"##{name}", now, *ends, form, flags)
    begin_drag(state)
    if changed and math.isfinite(value):
        change(name.partition(".")[2], value)


def vector(
    state: WindowState, label: str, name: str, now: Triple, speed: float, change: Callable[[str, Triple], None]
) -> None:
    """Fields for three numbers, as `number`."""
    row(label, TIPS[name])
    changed, values = imgui.drag_float3(f"##{name}", list(now), speed, 0.0, 0.0, "%.4g")
    begin_drag(state)
    if changed and all(math.isfinite(v) for v in values):
        red, green, blue = values
        change(name.partition(".")[2], (red, green, blue))


def whole(state: WindowState, label: str, name: str, empty: str = "") -> None:
    """Field for a whole number of the document, or for none, which is shown as `empty`."""
    row(label, TIPS[name])
    now = state.get(name)
    shown = "" if now is None else f"{now:.0f}"
    if (text := text_field(state, name, empty, shown)) is not None:
        if not text.strip() and empty:
            return state.change(name, None, step=True)
        try:
            state.change(name, float(round(float(text))), step=True)
        except (ValueError, OverflowError):
            error = InputError(f"{label} {text!r}", "the text is not a number", "write a number such as 1920")
            state.work.refuse(error)
    return None


def check(state: WindowState, label: str, name: str) -> None:
    """Checkbox for a field of the document."""
    row(label, TIPS[name])
    changed, value = imgui.checkbox(f"##{name}", bool(state.get(name)))
    if changed:
        state.change(name, value, step=True)


def choice(state: WindowState, label: str, name: str, words: tuple[str, ...]) -> None:
    """Choice of one of some words for a field of the document."""
    row(label, TIPS[name])
    now = state.get(name)
    combo(name, now, [(word, word) for word in words], now, lambda word: state.change(name, word, step=True))


def combo(name: str, shown: str, options: Iterable[tuple[str, T]], now: T, choose: Callable[[T], object]) -> None:
    """List of options by their texts, which opens below the one that is `shown`."""
    if imgui.begin_combo(f"##{name}", shown):
        for text, value in options:
            if imgui.selectable(text, value == now)[0]:
                choose(value)
        imgui.end_combo()


def text_field(state: WindowState, name: str, hint: str, default: str | None = None) -> str | None:
    """Text in a field once Enter is pressed, else None; until then, the state keeps it.

    With a `default`, the field shows that whenever nobody types in it.
    """
    flags = imgui.InputTextFlags_.enter_returns_true
    shown = state.texts.get(name, default or "")
    entered, state.texts[name] = imgui.input_text_with_hint(f"##{name}", hint, shown, flags)
    text = state.texts[name]
    if default is not None and not imgui.is_item_active():
        state.texts.pop(name)
    return text if entered else None


@dataclass
class Card:
    """Card to click: a thumbnail, and lines of text below it.

    Attributes
    ----------
    label : str
        Label of its button.
    key : str
        Key of the thumbnail.
    picture : (h, w, 3) uint8, optional
    lines : tuple of (str, bool)
        Texts, and whether they are bright.
    tip : str
        Text of its tooltip.
    chosen : bool
        Its frame is bright.
    swatch : str
        Hex color that is drawn until there is a picture, or nothing.
    preset : str
        Name of the preset that is dragged with it, or nothing.
    """

    label: str
    key: str
    picture: Picture | None
    lines: tuple[tuple[str, bool], ...]
    tip: str
    chosen: bool
    swatch: str = ""
    preset: str = ""


def draw_cards(
    state: WindowState,
    members: Sequence[T],
    least: float,
    aspect: float,
    card: Callable[[T], Card],
    choose: Callable[[T], None],
    lines: int = 1,
) -> None:
    """Draw the cards of a list in rows, as far as they can be seen.

    Parameters
    ----------
    state : WindowState
    members : sequence
    least : float
        Width of a card in ems, at least.
    aspect : float
        Height of its thumbnail, divided by that.
    card : callable
        Card of a member.
    choose : callable
        Takes the member whose card is clicked.
    lines : int
        Number of lines of text on each.
    """
    room, line = imgui.get_content_region_avail().x, imgui.get_text_line_height()
    across = max(int((room + em(GAP)) / em(least + GAP)), 1)
    width = (room - em(GAP) * (across - 1)) / across
    size = ImVec2(width, aspect * width + (0.2 + lines) * line)
    for i, member in enumerate(members):
        if i % across:
            imgui.same_line(0.0, em(GAP))
        if not imgui.is_rect_visible(size):
            imgui.dummy(size)
            continue
        low, shown = imgui.get_cursor_screen_pos(), card(member)
        if imgui.invisible_button(shown.label, size):
            choose(member)
        hovered = imgui.is_item_hovered()
        if shown.preset and imgui.begin_drag_drop_source():
            state.dragged = shown.preset
            imgui.set_drag_drop_payload_py_id(PRESET, 0)
            imgui.text(shown.lines[0][0])
            imgui.end_drag_drop_source()
        else:
            tooltip(shown.tip)
        _draw_card(state, shown, low, ImVec2(low.x + width, low.y + aspect * width), hovered=hovered)


def _draw_card(state: WindowState, card: Card, low: ImVec2, high: ImVec2, *, hovered: bool) -> None:
    over, line = imgui.get_window_draw_list(), imgui.get_text_line_height()
    if card.picture is not None:
        over.add_image(imgui.ImTextureRef(state.texture(card.key, card.picture).glo), low, high)
    else:
        over.add_rect_filled(low, high, EMPTY)
        if card.swatch:
            middle = ImVec2(0.5 * (low.x + high.x), 0.5 * (low.y + high.y))
            over.add_circle_filled(middle, 0.42 * (high.x - low.x), packed(of_hex(card.swatch)))
    color = CHOSEN if card.chosen else HOVERED if hovered else PLAIN
    over.add_rect(low, high, color, 0.0, em(0.12) if card.chosen else 1.0)
    over.push_clip_rect(ImVec2(low.x, high.y), ImVec2(high.x, high.y + (0.2 + len(card.lines)) * line), True)
    for i, (text, bright) in enumerate(card.lines):
        shade = imgui.get_color_u32(imgui.Col_.text) if bright else imgui.get_color_u32(imgui.ImVec4(*FAINT))
        over.add_text(ImVec2(low.x, high.y + (0.1 + 0.95 * i) * line), shade, text)
    over.pop_clip_rect()


def accepts_preset() -> bool:
    """True if a preset is dropped on the last item: `WindowState.dragged` names it."""
    dropped = False
    if imgui.begin_drag_drop_target():
        dropped = imgui.accept_drag_drop_payload_py_id(PRESET) is not None
        imgui.end_drag_drop_target()
    return dropped
