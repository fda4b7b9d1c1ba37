"""The material panel: the medium of the bodies, by the names of glTF, with the numbers of ``translucent
extinction``.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from imgui_bundle import imgui, implot

from translucent.errors import InputError
from translucent.formulas.color import to_hex
from translucent.materials import TITLES, text_block
from translucent.media.colors import parse_color
from translucent.media.medium import Medium
from translucent.media.presets import grouped, presets
from translucent.preview import numbers
from translucent.preview.actions import Assign, Change
from translucent.preview.desk import (
    FAINT,
    WARNING,
    Desk,
    begin_rows,
    em,
    fact,
    row,
    slider,
    tooltip,
    triple,
    wrapped,
)
from translucent.preview.document import SHOWN_UNITS, Material
from translucent.preview.panels.library import told
from translucent.preview.scenes import medium_of
from translucent.preview.tips import TIPS
from translucent.units import metres_per_unit

#: Colors of curves: red, green and blue that are told apart on a dark background.
CURVES = ((0.95, 0.36, 0.33, 1.0), (0.38, 0.80, 0.42, 1.0), (0.36, 0.58, 1.0, 1.0))

numbers_told = lru_cache(maxsize=4)(numbers.told)
extinction_lines = lru_cache(maxsize=4)(numbers.extinction_lines)
swatches = lru_cache(maxsize=4)(numbers.swatches)


def material_panel(desk: Desk) -> None:
    """Draw the panel."""
    material = desk.material
    _source(desk, material)
    imgui.separator_text("Volume")
    if begin_rows("volume"):
        _color(desk, material)
        imgui.end_table()
    _distance(desk, material)
    if begin_rows("thickness"):
        slider(desk, "thickness", "material.thickness", 1e-5, 10.0, "%.5f m", log=True)
        imgui.end_table()
    _swatches(desk, material)
    _curves(desk, material)
    imgui.separator_text("Surface")
    if begin_rows("surface"):
        slider(desk, "ior", "material.ior", 1.0, 2.5, "%.3f")
        slider(desk, "roughness", "material.roughness", 0.0, 1.0)
        slider(desk, "transmission", "material.transmission", 0.0, 1.0)
        slider(desk, "dispersion", "material.dispersion", 0.0, 10.0)
        imgui.end_table()
    imgui.separator_text("Thin film and clear coat")
    if begin_rows("film"):
        slider(desk, "iridescence", "material.iridescence", 0.0, 1.0)
        slider(desk, "film ior", "material.iridescence_ior", 1.0, 3.0, "%.3f")
        slider(desk, "film thickness", "material.iridescence_thickness", 0.0, 1e-6, "%.0f nm", unit=1e-9)
        slider(desk, "clearcoat", "material.clearcoat", 0.0, 1.0)
        slider(desk, "coat roughness", "material.clearcoat_roughness", 0.0, 1.0)
        imgui.end_table()
    imgui.separator_text("Scattering and emission")
    triple(desk, "absorption, 1/m", "material.absorption", 0.5)
    triple(desk, "scattering, 1/m", "material.scattering", 0.5)
    triple(desk, "emission, radiance per m", "material.emission", 0.05)
    if begin_rows("scattering"):
        slider(desk, "anisotropy g", "material.anisotropy", -0.99, 0.99)
        imgui.end_table()
    imgui.separator_text("Numbers")
    _numbers(desk, material)
    imgui.separator_text("Copy")
    _copies(desk, material)


def _source(desk: Desk, material: Material) -> None:
    if begin_rows("source"):
        if len(desk.objects) > 1:
            _object(desk)
        row("preset", "A named medium; the Library has them as pictures.")
        if imgui.begin_combo("##preset", material.preset or "none"):
            for group, members in grouped(presets()).items():
                imgui.text_colored(FAINT, group)
                for each in members:
                    if imgui.selectable(f"{each.name}  ({each.kind})", each.name == material.preset)[0]:
                        desk.choose_preset(each.name)
                    tooltip(told(each))
            imgui.end_combo()
        words = {
            "file": "the model's own",
            "color": "color at a distance",
            "preset": f"preset {material.preset}",
            "coefficients": "coefficients",
        }
        fact("medium from", words[material.source])
        imgui.end_table()
    if material.source == "preset" and (found := desk.work.library.find(material.preset)) is not None:
        wrapped(f"{found.kind}: {found.source}", FAINT)
        if found.warning:
            wrapped(found.warning, WARNING)


def _object(desk: Desk) -> None:
    """Draw the choice of the object that the panel is about."""
    row("object", "Click one in the picture, or choose it here. Changes are then of its own material.")
    every = "all without their own"
    if imgui.begin_combo("##object", every if desk.target is None else _object_name(desk, desk.target)):
        if imgui.selectable(every, desk.target is None)[0]:
            desk.select(None)
        for number in range(len(desk.objects)):
            if imgui.selectable(f"{_object_name(desk, number)}##{number}", number == desk.target)[0]:
                desk.select(number)
        imgui.end_combo()
    if desk.target is not None and desk.work.document.own_material(desk.target) is not None:
        row("")
        if imgui.button("No material of its own"):
            desk.work.do(Assign(desk.target, None))


def _object_name(desk: Desk, number: int) -> str:
    own = " *" if desk.work.document.own_material(number) is not None else ""
    return f"{desk.name_of(number)}{own}"


def _color(desk: Desk, material: Material) -> None:
    row("attenuationColor", TIPS["material.color"])
    shown = list(numbers.to_display(material.color))
    flags = imgui.ColorEditFlags_.display_hex | imgui.ColorEditFlags_.picker_hue_wheel
    changed, encoded = imgui.color_edit3("##color", shown, flags)
    if imgui.is_item_activated():
        desk.drag += 1
    if changed:
        desk.change("material.color", numbers.from_display(np.asarray(list(encoded)[:3])))
    fact("linear", numbers.triple_text(material.color))
    row("as text", "A hex color, a CSS name, srgb(r,g,b) or linear(r,g,b); press Enter.")
    text = desk.texts.get("color", "")
    entered, text = imgui.input_text_with_hint(
        "##colortext", to_hex(material.color), text, imgui.InputTextFlags_.enter_returns_true
    )
    desk.texts["color"] = text
    if entered and text:
        desk.texts["color"] = _typed_color(desk, text)


def _typed_color(desk: Desk, text: str) -> str:
    """Text that stays in the field: none, or the one that could not be parsed."""
    try:
        color = np.asarray(parse_color(text))
    except InputError as error:
        desk.work.refuse(error)
        return text
    desk.change("material.color", color.tolist(), step=True)
    return ""


def _distance(desk: Desk, material: Material) -> None:
    unit = desk.get("display.unit")
    scale = metres_per_unit(unit)
    imgui.text("attenuationDistance")
    tooltip(TIPS["material.distance"])
    imgui.set_next_item_width(-em(4.2))
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format
    changed, value = imgui.slider_float(
        "##distance", material.distance / scale, 1e-5 / scale, 1e2 / scale, "%.5g", flags
    )
    if imgui.is_item_activated():
        desk.drag += 1
    if changed and value > 0:
        # Five digits are what is shown, so that what is copied is what is seen.
        desk.change("material.distance", float(f"{value:.5g}") * scale)
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if imgui.begin_combo("##unit", unit, imgui.ComboFlags_.height_small):
        for word in SHOWN_UNITS:
            if imgui.selectable(word, word == unit)[0]:
                desk.work.do(Change("display.unit", word))
        imgui.end_combo()


def _swatches(desk: Desk, material: Material) -> None:
    imgui.text_colored(FAINT, "white light after")
    found, unit = swatches(material), desk.get("display.unit")
    width = imgui.get_content_region_avail().x
    each = max((width - em(0.25) * (len(found) - 1)) / len(found), em(1.0))
    for i, (metres, text) in enumerate(found):
        if i:
            imgui.same_line(0.0, em(0.25))
        red, green, blue = (int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        imgui.color_button(f"##swatch{i}", imgui.ImVec4(red, green, blue, 1.0), flags, imgui.ImVec2(each, em(1.6)))
        if imgui.is_item_hovered():
            imgui.set_tooltip(f"{numbers.length_text(metres, unit)}\n{text}")


def _curves(desk: Desk, material: Material) -> None:
    measured, unit = desk.work.measured, desk.get("display.unit")
    scale = metres_per_unit(unit)
    most = float(measured.seen.edges[-1]) if measured is not None else 3.0 * material.distance
    distances, curves = numbers.transmittance_curves(material, most)
    quiet = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight
    plain = implot.Flags_.no_menus | implot.Flags_.no_inputs | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
    if not implot.begin_plot("##curves", imgui.ImVec2(-1.0, em(9.0)), plain | implot.Flags_.no_legend):
        return
    implot.setup_axes(f"thickness, {unit}", "transmittance", quiet, quiet)
    implot.setup_axes_limits(0.0, most / scale, 0.0, 1.05, implot.Cond_.always)
    if measured is not None and measured.seen.pixels:
        seen = measured.seen
        centers = np.ascontiguousarray((seen.edges[:-1] + seen.edges[1:]) / 2 / scale)
        spec = implot.Spec()
        spec.fill_color = imgui.ImVec4(0.55, 0.58, 0.65, 0.35)
        spec.line_color = imgui.ImVec4(0.55, 0.58, 0.65, 0.35)
        implot.plot_bars(
            "how much of the model is so thick", centers, seen.counts, float(centers[1] - centers[0]), spec
        )
    for channel, name in enumerate(("red", "green", "blue")):
        spec = implot.Spec()
        spec.line_color, spec.line_weight = imgui.ImVec4(*CURVES[channel]), 2.0
        implot.plot_line(name, distances / scale, np.ascontiguousarray(curves[:, channel]), spec)
    implot.end_plot()
    if measured is not None and measured.seen.thickness.size:
        seen = measured.seen
        text = _average_hex(measured, medium_of(material))
        median = numbers.length_text(float(np.median(seen.thickness)), unit)
        wrapped(f"bars: thickness of the model, median {median}; on average it shows {text}", FAINT)


_averages: dict[int, tuple[object, Medium, str]] = {}


def _average_hex(measured: object, medium: Medium) -> str:
    """Average color of the model; cached until either changes."""
    known = _averages.get(0)
    if known is None or known[0] is not measured or known[1] != medium:
        seen = measured.seen  # type: ignore[attr-defined]
        known = _averages[0] = measured, medium, seen.average_hex(medium)
    return known[2]


def _numbers(desk: Desk, material: Material) -> None:
    if begin_rows("numbers"):
        for label, text in extinction_lines(material):
            fact(label, text)
        imgui.end_table()
    for line in numbers_told(material)["warnings"]:
        wrapped(line, WARNING)


def _copies(desk: Desk, material: Material) -> None:
    width = imgui.get_content_region_avail().x
    for target, label in TITLES.items():
        size = imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x
        if target != next(iter(TITLES)):
            imgui.same_line()
            if imgui.get_cursor_pos_x() + size > width:
                imgui.new_line()
        if imgui.button(label):
            desk.work.attempt(lambda t=target: _copy(material, t), f"copied as {label}")  # type: ignore[misc]


def copied_text(material: Material, target: str) -> str:
    """Text that is copied for a target, as ``translucent extinction --as`` prints it."""
    medium, distance = medium_of(material), float(numbers.told(material)["distance"])
    return text_block(target, medium, medium.transmittance(distance), distance, material.roughness)


def _copy(material: Material, target: str) -> None:
    imgui.set_clipboard_text(copied_text(material, target))
