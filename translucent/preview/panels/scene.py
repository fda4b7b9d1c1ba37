"""The scene panel: the objects of the model, to show, hide and isolate, to select, and to drop materials on."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from translucent.preview.actions import Assign, Hide
from translucent.preview.panels import widgets as ui
from translucent.preview.panels.material import seen_color, to_display
from translucent.preview.panels.menus import menu_item
from translucent.preview.window_state import WindowState


def scene_panel(state: WindowState) -> None:
    """Draw the scene panel."""
    count = len(state.objects)
    shown = len(state.work.document.shown_among(count))
    ui.wrapped(f"{shown} of {count} objects are on show. Drop a preset of the Library on one.", ui.FAINT)
    imgui.begin_disabled(shown == count)
    if imgui.button("Show all"):
        state.work.do(Hide(()))
    imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(state.target is None)
    if imgui.button("Isolate") and state.target is not None:
        state.isolate(state.target)
    imgui.end_disabled()
    ui.tooltip("The selected object alone; once more: all (I).")
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
    ui.tooltip("Show or hide (H).")
    if changed:
        state.hide(number)
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    across = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
    flags = across | imgui.SelectableFlags_.allow_double_click
    if imgui.selectable(f"{name}##name", number == state.selected, flags, ImVec2(0.0, imgui.get_frame_height()))[0]:
        state.select(number)
        if imgui.is_mouse_double_clicked(0):
            state.work.frame(number)
    ui.tooltip("Click: select, for the Material and Library panels. Double click: frame. Right click: more.")
    if ui.accepts_preset():
        state.choose_preset(state.dragged, number if len(state.objects) > 1 else None)
    own = state.work.document.own_material(number) is not None
    if imgui.begin_popup_context_item("more"):
        _more(state, number, own)
        imgui.end_popup()
    imgui.table_next_column()
    _material(state, number, own)


def _more(state: WindowState, number: int, own: bool) -> None:
    def frame() -> None:
        state.select(number)
        state.work.frame(number)

    menu_item("Frame", frame, "F")
    menu_item("Isolate", lambda: state.isolate(number), "I")
    alike = state.target not in (None, number)
    menu_item("Material of the selected object", lambda: state.work.do(Assign(number, state.material)), enabled=alike)
    menu_item("No material of its own", lambda: state.work.do(Assign(number, None)), enabled=own)


def _material(state: WindowState, number: int, own: bool) -> None:
    """Draw the color and name of an object's material; faint, if it is that of the model."""
    if state.objects[number].medium is None and not own and state.work.document.material.source == "file":
        return imgui.text_colored(ui.FAINT, "opaque")
    material = state.material_of(number)
    preset = state.work.library.find(material.preset)
    color = to_display(material.color) if preset is None else ui.of_hex(seen_color(preset))
    flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop | imgui.ColorEditFlags_.no_inputs
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + (imgui.get_frame_height() - ui.em(1.0)) / 2)
    imgui.color_button("##color", imgui.ImVec4(*color, 1.0), flags, ImVec2(ui.em(1.0), ui.em(1.0)))
    imgui.same_line()
    source = "the model's" if material.source == "file" else material.source
    text = material.preset.replace("_", " ") or source
    return imgui.text(text) if own else imgui.text_colored(ui.FAINT, text)
