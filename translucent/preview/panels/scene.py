"""The scene panel: the objects of the model, to show, hide and isolate, to select, and to drop materials on."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from translucent.errors import InputError
from translucent.preview.actions import Assign, Hide
from translucent.preview.document import Material, Triple
from translucent.preview.panels.material import PRESET, seen_color, to_display
from translucent.preview.window_state import FAINT, WindowState, em, tooltip, wrapped


def hide(state: WindowState, number: int) -> None:
    """Hide an object, or show it again; the last one on show stays."""
    hidden = set(state.work.document.hidden) ^ {number}
    if hidden >= set(range(len(state.objects))):
        found = "it is the only one on show"
        return state.work.refuse(InputError(f"hiding {state.name_of(number)}", found, "show another object first"))
    return state.work.do(Hide(tuple(hidden)))


def isolate(state: WindowState, number: int) -> None:
    """Show an object alone, or all if it is alone."""
    every = range(len(state.objects))
    alone = state.work.document.shown_among(len(every)) == (number,)
    state.work.do(Hide(() if alone else tuple(i for i in every if i != number)))


def show_all(state: WindowState) -> None:
    """Show all objects."""
    state.work.do(Hide(()))


TIP = "Click: select, for the Material and Library panels. Double click: frame. Right click: more."


def scene_panel(state: WindowState) -> None:
    """Draw the panel."""
    count = len(state.objects)
    shown = len(state.work.document.shown_among(count))
    wrapped(f"{shown} of {count} objects are on show. Drop a preset of the Library on one.", FAINT)
    imgui.begin_disabled(shown == count)
    if imgui.button("Show all"):
        show_all(state)
    imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(state.target is None)
    if imgui.button("Isolate") and state.target is not None:
        isolate(state, state.target)
    imgui.end_disabled()
    tooltip("The selected object alone; once more: all (I).")
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y
    if not imgui.begin_table("objects", 3, flags):
        return
    imgui.table_setup_column("shown", imgui.TableColumnFlags_.width_fixed, imgui.get_frame_height())
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch, 1.0)
    imgui.table_setup_column("material", imgui.TableColumnFlags_.width_stretch, 1.0)
    clipper = imgui.ListClipper()
    clipper.begin(count)
    while clipper.step():
        for number in range(clipper.display_start, min(clipper.display_end, count)):
            imgui.push_id(number)
            _row(state, number)
            imgui.pop_id()
    imgui.end_table()


def _row(state: WindowState, number: int) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    name = state.name_of(number)
    changed, _ = imgui.checkbox("##shown", number not in state.work.document.hidden)
    tooltip("Show or hide (H).")
    if changed:
        hide(state, number)
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    across = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
    flags = across | imgui.SelectableFlags_.allow_double_click
    if imgui.selectable(f"{name}##name", number == state.selected, flags, ImVec2(0.0, imgui.get_frame_height()))[0]:
        state.select(number)
        if imgui.is_mouse_double_clicked(0):
            state.frame()
    tooltip(TIP)
    if imgui.begin_drag_drop_target():
        if imgui.accept_drag_drop_payload_py_id(PRESET) is not None:
            state.choose_preset(state.dragged, number if len(state.objects) > 1 else None)
        imgui.end_drag_drop_target()
    own = state.work.document.own_material(number) is not None
    if imgui.begin_popup_context_item("more"):
        _more(state, number, own)
        imgui.end_popup()
    imgui.table_next_column()
    _material(state, number, own)


def _more(state: WindowState, number: int, own: bool) -> None:
    if imgui.menu_item("Frame", "F", False, True)[0]:
        state.select(number)
        state.frame()
    if imgui.menu_item("Isolate", "I", False, True)[0]:
        isolate(state, number)
    chosen = state.target
    alike = chosen is not None and chosen != number
    if imgui.menu_item("Material of the selected object", "", False, alike)[0]:
        state.work.do(Assign(number, state.material))
    if imgui.menu_item("No material of its own", "", False, own)[0]:
        state.work.do(Assign(number, None))


def _material(state: WindowState, number: int, own: bool) -> None:
    """Draw the color and name of an object's material; faint, if it is that of the model."""
    if state.objects[number].medium is None and not own and state.work.document.material.source == "file":
        return imgui.text_colored(FAINT, "opaque")
    material = state.material_of(number)
    flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop | imgui.ColorEditFlags_.no_inputs
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + (imgui.get_frame_height() - em(1.0)) / 2)
    imgui.color_button("##color", imgui.ImVec4(*_color(state, material), 1.0), flags, ImVec2(em(1.0), em(1.0)))
    imgui.same_line()
    text = _told(material)
    return imgui.text(text) if own else imgui.text_colored(FAINT, text)


def _color(state: WindowState, material: Material) -> Triple:
    """Encode the color in which a material is seen in sRGB."""
    if (found := state.work.library.find(material.preset)) is None:
        return to_display(material.color)
    text = seen_color(found)
    return int(text[1:3], 16) / 255.0, int(text[3:5], 16) / 255.0, int(text[5:7], 16) / 255.0


def _told(material: Material) -> str:
    words = {"file": "the model's", "color": "color", "coefficients": "coefficients"}
    return material.preset.replace("_", " ") or words.get(material.source, material.source)
