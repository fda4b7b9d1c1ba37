"""Panels for the objects of the model, for materials by the names of glTF, and for the library of materials."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
from imgui_bundle import ImVec2, imgui, implot

from translucent.errors import InputError
from translucent.formulas.color import linear_to_srgb, srgb_to_linear, to_hex
from translucent.frames.appearance import average_color
from translucent.materials import TARGETS, text_block
from translucent.media.colors import parse_color
from translucent.media.conversion import summary
from translucent.media.medium import color_at
from translucent.media.preset import PatternName, Preset
from translucent.media.presets import grouped, presets
from translucent.preview.actions import Assign, Hide, SetField, scattering_of
from translucent.preview.document import (
    SHOWN_UNITS,
    TIPS,
    Material,
    Placed,
    Triple,
    length_text,
    triple_of,
    triple_text,
)
from translucent.preview.library import ball_key, draw_ball
from translucent.preview.measuring import ThicknessStatistics
from translucent.preview.panels import widgets as ui
from translucent.preview.panels.menus import menu_item
from translucent.preview.scenes import medium_of
from translucent.preview.window_state import WindowState
from translucent.units import metres_per_unit

#: Darkest linear channel of the color field: 0 has no finite extinction. See `translucent.media.conversion.CLAMP`.
DARKEST = 1e-4

#: Width of the card of a preset in ems.
CARD = 5.0

#: Colors of curves: red, green and blue that are easily distinguished on a dark background; and of bars.
CURVES = ((0.95, 0.36, 0.33, 1.0), (0.38, 0.80, 0.42, 1.0), (0.36, 0.58, 1.0, 1.0))
BARS = (0.55, 0.58, 0.65, 0.35)

SCATTER_TIP = (
    "Diffuse color of a thick body of this medium (--scattering-color of translucent render). Typical: wax "
    "#f2e0b8, milk #fdfbf5."
)

RADIUS_TIP = (
    "Mean free path: length after which light in the medium is scattered or absorbed, on average "
    "(--mean-free-path). A large value lets more light through. Typical: skin 0.3 mm, wax 2 mm, jade 4 mm."
)

SAVE_TIP = "Save the medium, ior and roughness as a .toml file, which others can copy into their own folder of presets."


def material_panel(state: WindowState) -> None:
    """Draw the material panel."""
    material = state.material
    _source(state, material)
    plan = state.view.plans[0]
    for remark in plan.remarks if plan is not None else ():
        ui.wrapped(remark, ui.WARNING)
    imgui.separator_text("Volume")
    if ui.begin_rows("volume"):
        _color(state, material)
        imgui.end_table()
    _distance(state, material)
    if ui.begin_rows("thickness"):
        ui.slider(state, "thickness", "material.thickness", 1e-5, 10.0, "%.5f m", log=True)
        imgui.end_table()
    _swatches(state, material)
    _curves(state, material)
    imgui.separator_text("Surface")
    if ui.begin_rows("surface"):
        ui.slider(state, "ior", "material.ior", 1.0, 2.5, "%.3f")
        ui.slider(state, "roughness", "material.roughness", 0.0, 1.0)
        ui.slider(state, "transmission", "material.transmission", 0.0, 1.0)
        ui.slider(state, "dispersion", "material.dispersion", 0.0, 10.0)
        for slot in ("color_texture", "roughness_texture"):
            _texture(state, slot)
        ui.row("pattern", TIPS["material.pattern"])
        words = [(name or "none", name) for name in get_args(PatternName)]
        choose = partial(state.change, "material.pattern", step=True)
        ui.combo("pattern", material.pattern or "none", words, material.pattern, choose)
        imgui.end_table()
    imgui.separator_text("Thin film and clear coat")
    if ui.begin_rows("film"):
        ui.slider(state, "iridescence", "material.iridescence", 0.0, 1.0)
        ui.slider(state, "film ior", "material.iridescence_ior", 1.0, 3.0, "%.3f")
        ui.slider(state, "film thickness", "material.iridescence_thickness", 0.0, 1e-6, "%.0f nm", unit=1e-9)
        ui.slider(state, "clearcoat", "material.clearcoat", 0.0, 1.0)
        ui.slider(state, "coat roughness", "material.clearcoat_roughness", 0.0, 1.0)
        imgui.end_table()
    imgui.separator_text("Scattering")
    _scattering(state, material)
    if imgui.tree_node("advanced: coefficients"):
        ui.triple(state, "absorption, 1/m", "material.absorption", 0.5)
        ui.triple(state, "scattering, 1/m", "material.scattering", 0.5)
        ui.triple(state, "emission, radiance per m", "material.emission", 0.05)
        if ui.begin_rows("anisotropy"):
            ui.slider(state, "anisotropy g", "material.anisotropy", -0.99, 0.99)
            imgui.end_table()
        imgui.tree_pop()
    imgui.separator_text("Numbers")
    if ui.begin_rows("numbers"):
        for label, text in extinction_lines(material):
            ui.fact(label, text)
        imgui.end_table()
    for text in extinction_facts(material)["warnings"]:
        ui.wrapped(text, ui.WARNING)
    imgui.separator_text("Copy")
    _copies(state, material)


def _texture(state: WindowState, slot: str) -> None:
    """Draw a slot for a picture of the surface."""
    label, path = slot.replace("_", " "), str(state.get(f"material.{slot}"))
    ui.row(label, TIPS[f"material.{slot}"])
    if imgui.button(f"{Path(path).name or 'choose ...'}##{slot}"):
        state.ask_file(label)
    ui.tooltip(path)
    if path:
        imgui.same_line()
        if imgui.small_button(f"none##{slot}"):
            state.use_texture(slot, "")


def _scattering(state: WindowState, material: Material) -> None:
    """Draw the color of a medium where it is thick, and the radius over which it spreads light."""
    known = scattering_of(material)
    if known is None:
        if imgui.button("Make it scatter"):
            state.drag += 1
            state.scatter()
        return ui.tooltip(SCATTER_TIP)
    color, radius = known
    scale, unit = metres_per_unit(state.get("display.unit")), state.get("display.unit")
    if not ui.begin_rows("scatter"):
        return None
    ui.row("scatter color", SCATTER_TIP)
    flags = imgui.ColorEditFlags_.display_hex | imgui.ColorEditFlags_.picker_hue_wheel
    changed, encoded = imgui.color_edit3("##scatter color", list(to_display(color)), flags)
    ui.begin_drag(state)
    if changed:
        state.scatter(color=from_display(np.asarray(list(encoded)[:3])))
    ui.row("scatter radius", RADIUS_TIP)
    logarithmic = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format
    ends = 1e-6 / scale, 1.0 / scale
    changed, value = imgui.slider_float("##scatter radius", radius / scale, *ends, f"%.4g {unit}", logarithmic)
    ui.begin_drag(state)
    if changed and value > 0:
        state.scatter(radius=value * scale)
    imgui.end_table()
    return None


def _source(state: WindowState, material: Material) -> None:
    if ui.begin_rows("source"):
        if len(state.objects) > 1:
            _object(state)
        ui.row("preset", "A named medium; the Library shows pictures of all media.")
        if imgui.begin_combo("##preset", material.preset or "none"):
            for group, members in grouped(presets()).items():
                imgui.text_colored(ui.FAINT, group)
                for each in members:
                    if imgui.selectable(f"{each.name}  ({each.kind})", each.name == material.preset)[0]:
                        state.choose_preset(each.name)
                    ui.tooltip(preset_text(each))
            imgui.end_combo()
        words = {"file": "the model's own", "color": "color at a distance", "preset": f"preset {material.preset}"}
        ui.fact("medium from", words.get(material.source, material.source))
        imgui.end_table()
    if material.source == "preset" and (found := state.work.library.find(material.preset)) is not None:
        ui.wrapped(f"{found.kind}: {found.source}", ui.FAINT)
        if found.warning:
            ui.wrapped(found.warning, ui.WARNING)


def _object(state: WindowState) -> None:
    """Draw the choice of the object that the panel is about."""
    target, document = state.target, state.work.document

    def name(number: int | None) -> str:
        if number is None:
            return "all without their own"
        return state.name_of(number) + (" *" if document.own_material(number) is not None else "")

    ui.row("object", "Click an object in the picture, or choose it here, to change the material of this object alone.")
    numbers: list[int | None] = [None, *range(len(state.objects))]
    ui.combo(
        "object", name(target), ((f"{name(number)}##{number}", number) for number in numbers), target, state.select
    )
    if target is not None and document.own_material(target) is not None:
        ui.row("")
        if imgui.button("No material of its own"):
            state.work.do(Assign(target, None))


def _color(state: WindowState, material: Material) -> None:
    ui.row("attenuationColor", TIPS["material.color"])
    flags = imgui.ColorEditFlags_.display_hex | imgui.ColorEditFlags_.picker_hue_wheel
    changed, encoded = imgui.color_edit3("##color", list(to_display(material.color)), flags)
    ui.begin_drag(state)
    if changed:
        state.change("material.color", from_display(np.asarray(list(encoded)[:3])))
    ui.fact("linear", triple_text(material.color))
    ui.row("as text", "Write a hex color, a CSS name, srgb(r,g,b) or linear(r,g,b), and press Enter.")
    if text := ui.text_field(state, "colortext", to_hex(material.color)):
        try:
            color = np.asarray(parse_color(text)).tolist()
        except InputError as error:
            state.work.refuse(error)
        else:
            state.change("material.color", color, step=True)
            state.texts["colortext"] = ""


def _distance(state: WindowState, material: Material) -> None:
    unit = state.get("display.unit")
    scale = metres_per_unit(unit)
    imgui.text("attenuationDistance")
    ui.tooltip(TIPS["material.distance"])
    imgui.set_next_item_width(-ui.em(4.2))
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format
    ends = 1e-5 / scale, 1e2 / scale
    changed, value = imgui.slider_float("##distance", material.distance / scale, *ends, "%.5g", flags)
    ui.begin_drag(state)
    if changed and value > 0:
        # Five digits are what is shown, so that what is copied is what is seen.
        state.change("material.distance", float(f"{value:.5g}") * scale)
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    units = [(word, word) for word in SHOWN_UNITS]
    ui.combo("unit", unit, units, unit, lambda word: state.work.do(SetField("display.unit", word)))


def _swatches(state: WindowState, material: Material) -> None:
    imgui.text_colored(ui.FAINT, "white light after")
    found, unit = swatches(material), state.get("display.unit")
    width = imgui.get_content_region_avail().x
    each = max((width - ui.em(0.25) * (len(found) - 1)) / len(found), ui.em(1.0))
    for i, (metres, text) in enumerate(found):
        if i:
            imgui.same_line(0.0, ui.em(0.25))
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        imgui.color_button(f"##swatch{i}", imgui.ImVec4(*ui.of_hex(text), 1.0), flags, imgui.ImVec2(each, ui.em(1.6)))
        ui.tooltip(f"{length_text(metres, unit)}\n{text}")


def _curves(state: WindowState, material: Material) -> None:
    """Draw transmittance over thickness, with bars for the thickness of the model."""
    statistics, unit = None if state.work.measured is None else state.work.measured.seen, state.get("display.unit")
    scale, medium = metres_per_unit(unit), medium_of(material)
    distances = np.linspace(0.0, 3.0 * material.distance if statistics is None else float(statistics.edges[-1]), 64)
    curves = medium.transmittance(distances)
    quiet = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight
    plain = implot.Flags_.no_menus | implot.Flags_.no_inputs | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
    if not implot.begin_plot("##curves", imgui.ImVec2(-1.0, ui.em(9.0)), plain | implot.Flags_.no_legend):
        return
    implot.setup_axes(f"thickness, {unit}", "transmittance", quiet, quiet)
    implot.setup_axes_limits(0.0, distances[-1] / scale, 0.0, 1.05, implot.Cond_.always)
    if statistics is not None and statistics.pixels:
        centers = np.ascontiguousarray((statistics.edges[:-1] + statistics.edges[1:]) / 2 / scale)
        spec = implot.Spec()
        spec.fill_color = spec.line_color = imgui.ImVec4(*BARS)
        width = float(centers[1] - centers[0])
        implot.plot_bars("fraction of pixels with this thickness", centers, statistics.counts, width, spec)
    for channel, name in enumerate(("red", "green", "blue")):
        spec = implot.Spec()
        spec.line_color, spec.line_weight = imgui.ImVec4(*CURVES[channel]), 2.0
        implot.plot_line(name, distances / scale, np.ascontiguousarray(curves[:, channel]), spec)
    implot.end_plot()
    if statistics is not None and statistics.thickness.size:
        median, average = length_text(float(np.median(statistics.thickness)), unit), _average_hex(statistics, material)
        ui.wrapped(f"bars: thickness of the model, median {median}; on average it shows {average}", ui.FAINT)


@lru_cache(maxsize=1)
def _average_hex(statistics: ThicknessStatistics, material: Material) -> str:
    """Average color of the model."""
    return to_hex(average_color(statistics.thickness, medium_of(material)))


def _copies(state: WindowState, material: Material) -> None:
    """Draw a button for each target that the medium can be copied for."""
    width = imgui.get_content_region_avail().x
    for target, system in TARGETS.items():
        label = system.title
        size = imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x
        if target != next(iter(TARGETS)):
            imgui.same_line()
            if imgui.get_cursor_pos_x() + size > width:
                imgui.new_line()
        if imgui.button(label):
            state.work.attempt(partial(_copy, material, target), f"copied as {label}")


def _copy(material: Material, target: str) -> None:
    """Copy the text for a target, as ``translucent extinction --as`` prints it."""
    medium, distance = medium_of(material), float(extinction_facts(material)["distance"])
    imgui.set_clipboard_text(text_block(target, medium, medium.transmittance(distance), distance, material.roughness))


def library_panel(state: WindowState) -> None:
    """Draw the library panel: presets as thumbnails to click, or to drag onto an object."""
    library = state.work.library
    imgui.set_next_item_width(-1.0)
    hint = "search: wine, measured, stone ..."
    _, library.search = imgui.input_text_with_hint("##search", hint, library.search)
    target = "fill the model" if state.target is None else f"fill {state.name_of(state.target)}"
    ui.wrapped(f"Click a preset: {target}. Or drag a preset onto an object.", ui.FAINT)
    groups, chosen = library.groups(), state.material.preset
    if not groups:
        ui.wrapped("No preset has these words.", ui.FAINT)

    def card(one: Preset) -> ui.Card:
        key, title = ball_key(one), one.name.replace("_", " ")
        picture, lines = state.work.thumbnails.picture(key, draw_ball, one), ((title, True), (one.kind, False))
        swatch = "" if picture is not None else preset_color(one)
        return ui.Card(f"##{one.name}", key, picture, lines, preset_text(one), one.name == chosen, swatch, one.name)

    if imgui.begin_child("##presets", ImVec2(0.0, -ui.em(3.6))):
        for group, members in groups.items():
            imgui.separator_text(f"{group} ({len(members)})")
            imgui.push_id(group)  # a preset may be in two of them
            ui.draw_cards(state, members, CARD, 1.0, card, lambda one: state.choose_preset(one.name), lines=2)
            imgui.pop_id()
    imgui.end_child()
    imgui.separator()
    imgui.set_next_item_width(-ui.em(6.2))
    entered = ui.text_field(state, "name", "name of this material")
    imgui.same_line()
    pressed = imgui.button("Save preset")
    ui.tooltip(f"{SAVE_TIP}\n{library.folder}")
    words = state.texts["name"]
    if (entered or pressed) and words.strip() and state.save_preset(words):
        state.texts["name"] = ""


def preset_color(one: Preset) -> str:
    """Hex color in which a preset is seen: multiply scattered light, or what is left of white light after 1 cm."""
    return one.diffuse_color() if one.regime == "scattering dominated" else one.colors()["1 cm"]


def preset_text(one: Preset) -> str:
    """Text about a preset: names, source, regime, note and warning."""
    names = ", ".join((one.name, *one.aliases))
    lines = (names, f"{one.kind}: {one.source}", f"ior {one.medium.ior:g}, {one.regime}", one.note, one.warning)
    return "\n".join(line for line in lines if line)


@lru_cache(maxsize=4)
def extinction_facts(material: Material) -> dict[str, Any]:
    """Facts that ``translucent extinction`` prints of this medium."""
    medium = medium_of(material)
    color, distance = np.asarray(material.color), material.distance
    if material.source != "color" or medium.scatters:
        color = medium.transmittance(distance)
    if not (color > 0).all():  # too dark to be stated there
        color, distance = color_at(medium, None)
    return summary(color, float(distance), medium.extinction)


@lru_cache(maxsize=4)
def extinction_lines(material: Material) -> list[tuple[str, str]]:
    """Names and values, as ``translucent extinction`` prints them."""
    facts = extinction_facts(material)
    infinite = [[np.inf if v is None else v for v in facts[key]] for key in ("mean_free_path", "half_value_thickness")]
    color = f"{triple_text(facts['color'])} linear, {to_hex(facts['color'])} sRGB, after {facts['distance']:g} m"
    return [
        ("color", color),
        ("extinction", f"{triple_text(facts['extinction'])} 1/m"),
        ("mean free path", f"{triple_text(infinite[0])} m"),
        ("half-value", f"{triple_text(infinite[1])} m"),
    ]


def to_display(color: Triple) -> Triple:
    """Encode a linear color in sRGB, as a color field shows it."""
    return triple_of(np.clip(linear_to_srgb(color), 0.0, 1.0))


def from_display(encoded: npt.ArrayLike) -> Triple:
    """Decode a color field's 8-bit value to linear; black is raised to the darkest color of a medium."""
    levels = np.rint(np.clip(np.asarray(encoded, dtype=np.float64), 0.0, 1.0) * 255.0) / 255.0
    return triple_of(np.maximum(srgb_to_linear(levels), DARKEST))


@lru_cache(maxsize=4)
def swatches(material: Material) -> list[tuple[float, str]]:
    """Distances in metres, and the hex colors of white light after them."""
    facts = extinction_facts(material)
    return [(float(factor) * facts["distance"], to_hex(row)) for factor, row in facts["transmittance"].items()]


def scene_panel(state: WindowState) -> None:
    """Draw the panel that lists the objects of the model, to show, hide and select them."""
    count = len(state.objects)
    visible = len(state.work.document.shown_among(count))
    ui.wrapped(f"{visible} of {count} objects are visible. Drop a preset of the Library on an object.", ui.FAINT)
    imgui.begin_disabled(visible == count)
    if imgui.button("Show all"):
        state.work.do(Hide(()))
    imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(state.target is None)
    if imgui.button("Isolate") and state.target is not None:
        state.isolate(state.target)
    imgui.end_disabled()
    ui.tooltip("Show only the selected object; press again to show all (I).")
    _place(state)
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


def _place(state: WindowState) -> None:
    """Draw the place of the selected object, or of the only one, and the choice of its gizmo."""
    if (number := state.moved) is None:
        return ui.wrapped("Select an object to move, rotate or scale it.", ui.FAINT)
    place = state.work.document.place_of(number)
    for word, key in (("move", "W"), ("rotate", "R"), ("scale", "S")):
        if imgui.radio_button(f"{word} ({key})", state.gizmo == word):
            state.gizmo = "" if state.gizmo == word else word
        imgui.same_line()
    imgui.new_line()
    far = 1.0 if state.work.document.orbit is None else state.work.document.orbit.distance
    if ui.begin_rows("place"):
        ui.vector(state, "moved by, m", "placed.location", place.location, 2e-3 * far, state.change_place)
        ui.vector(state, "rotated, deg", "placed.rotation", place.rotation, 0.5, state.change_place)
        ui.vector(state, "scaled by", "placed.scale", place.scale, 0.005, state.change_place)
        imgui.end_table()
    if imgui.button("On the ground"):
        state.drop_to_ground()
    ui.tooltip("Move the object down to the ground.")
    imgui.same_line()
    imgui.begin_disabled(place == Placed(number))
    if imgui.button("Back in its place"):
        state.place(Placed(number))
    imgui.end_disabled()
    return None


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
    ui.tooltip("Click: select the object. Double click: center the view on it. Right click: more.")
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
    color = to_display(material.color) if preset is None else ui.of_hex(preset_color(preset))
    flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop | imgui.ColorEditFlags_.no_inputs
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + (imgui.get_frame_height() - ui.em(1.0)) / 2)
    imgui.color_button("##color", imgui.ImVec4(*color, 1.0), flags, ImVec2(ui.em(1.0), ui.em(1.0)))
    imgui.same_line()
    source = "the model's" if material.source == "file" else material.source
    text = material.preset.replace("_", " ") or source
    return imgui.text(text) if own else imgui.text_colored(ui.FAINT, text)
