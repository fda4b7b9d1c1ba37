"""The scene panel: the objects of the model, to show, hide and isolate, to select, and to drop materials on."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from translucent.preview.actions import Assign
from translucent.preview.desk import FAINT, Desk, em, tooltip, wrapped
from translucent.preview.document import Material, Triple
from translucent.preview.hiding import hide, isolate, show_all
from translucent.preview.numbers import to_display
from translucent.preview.panels.library import PRESET, seen_color

TIP = "Click: select, for the Material and Library panels. Double click: frame. Right click: more."


def scene_panel(desk: Desk) -> None:
    """Draw the panel."""
    count = len(desk.objects)
    shown = len(desk.work.document.shown_among(count))
    wrapped(f"{shown} of {count} objects are on show. Drop a preset of the Library on one.", FAINT)
    imgui.begin_disabled(shown == count)
    if imgui.button("Show all"):
        show_all(desk)
    imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(desk.target is None)
    if imgui.button("Isolate") and desk.target is not None:
        isolate(desk, desk.target)
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
            _row(desk, number)
            imgui.pop_id()
    imgui.end_table()


def _row(desk: Desk, number: int) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    name = desk.name_of(number)
    changed, _ = imgui.checkbox("##shown", number not in desk.work.document.hidden)
    tooltip("Show or hide (H).")
    if changed:
        hide(desk, number)
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    across = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
    flags = across | imgui.SelectableFlags_.allow_double_click
    if imgui.selectable(f"{name}##name", number == desk.selected, flags, ImVec2(0.0, imgui.get_frame_height()))[0]:
        desk.select(number)
        if imgui.is_mouse_double_clicked(0):
            desk.frame()
    tooltip(TIP)
    if imgui.begin_drag_drop_target():
        if imgui.accept_drag_drop_payload_py_id(PRESET) is not None:
            desk.choose_preset(desk.dragged, number if len(desk.objects) > 1 else None)
        imgui.end_drag_drop_target()
    own = desk.work.document.own_material(number) is not None
    if imgui.begin_popup_context_item("more"):
        _more(desk, number, own)
        imgui.end_popup()
    imgui.table_next_column()
    _material(desk, number, own)


def _more(desk: Desk, number: int, own: bool) -> None:
    if imgui.menu_item("Frame", "F", False, True)[0]:
        desk.select(number)
        desk.frame()
    if imgui.menu_item("Isolate", "I", False, True)[0]:
        isolate(desk, number)
    chosen = desk.target
    alike = chosen is not None and chosen != number
    if imgui.menu_item("Material of the selected object", "", False, alike)[0]:
        desk.work.do(Assign(number, desk.material))
    if imgui.menu_item("No material of its own", "", False, own)[0]:
        desk.work.do(Assign(number, None))


def _material(desk: Desk, number: int, own: bool) -> None:
    """Draw the color and name of an object's material; faint, if it is that of the model."""
    if desk.objects[number].medium is None and not own and desk.work.document.material.source == "file":
        return imgui.text_colored(FAINT, "opaque")
    material = desk.material_of(number)
    flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop | imgui.ColorEditFlags_.no_inputs
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + (imgui.get_frame_height() - em(1.0)) / 2)
    imgui.color_button("##color", imgui.ImVec4(*_color(desk, material), 1.0), flags, ImVec2(em(1.0), em(1.0)))
    imgui.same_line()
    text = _told(material)
    return imgui.text(text) if own else imgui.text_colored(FAINT, text)


def _color(desk: Desk, material: Material) -> Triple:
    """Encode the color in which a material is seen in sRGB."""
    if (found := desk.work.library.find(material.preset)) is None:
        return to_display(material.color)
    text = seen_color(found)
    return int(text[1:3], 16) / 255.0, int(text[3:5], 16) / 255.0, int(text[5:7], 16) / 255.0


def _told(material: Material) -> str:
    words = {"file": "the model's", "color": "color", "coefficients": "coefficients"}
    return material.preset.replace("_", " ") or words.get(material.source, material.source)
