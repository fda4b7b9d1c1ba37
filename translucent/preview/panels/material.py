"""The material panel: the medium of the bodies, by the names of glTF, with the numbers of ``translucent
extinction``.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from imgui_bundle import ImVec2, imgui, implot

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas.color import linear_to_srgb, srgb_to_linear, to_hex
from translucent.materials import TARGETS, text_block
from translucent.media.colors import parse_color
from translucent.media.conversion import summary
from translucent.media.medium import Medium, color_at
from translucent.media.preset import Preset
from translucent.media.presets import grouped, presets
from translucent.preview.actions import Assign, SetField
from translucent.preview.document import SHOWN_UNITS, TIPS, Material, Triple, length_text, triple_text
from translucent.preview.panels.files import save_preset
from translucent.preview.scenes import medium_of
from translucent.preview.thumbnails import ball_key, draw_ball
from translucent.preview.window_state import (
    FAINT,
    WARNING,
    WindowState,
    begin_rows,
    draw_cards,
    draw_frame,
    em,
    fact,
    row,
    slider,
    tooltip,
    triple,
    wrapped,
)
from translucent.units import metres_per_unit

#: Darkest linear channel of the color field: 0 has no finite extinction. See `translucent.media.conversion.CLAMP`.
DARKEST = 1e-4


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
    return [
        (
            "color",
            f"{triple_text(facts['color'])} linear, {to_hex(facts['color'])} sRGB, after {facts['distance']:g} m",
        ),
        ("extinction", f"{triple_text(facts['extinction'])} 1/m"),
        ("mean free path", f"{triple_text(infinite[0])} m"),
        ("half-value", f"{triple_text(infinite[1])} m"),
    ]


def to_display(color: Triple) -> Triple:
    """Encode a linear color in sRGB, as a color field shows it."""
    red, green, blue = np.clip(linear_to_srgb(color), 0.0, 1.0).tolist()
    return red, green, blue


def from_display(encoded: npt.ArrayLike) -> Triple:
    """Decode a color field's 8-bit value to linear; black is raised to the darkest color of a medium."""
    levels = np.rint(np.clip(np.asarray(encoded, dtype=np.float64), 0.0, 1.0) * 255.0) / 255.0
    red, green, blue = np.maximum(srgb_to_linear(levels), DARKEST).tolist()
    return red, green, blue


@lru_cache(maxsize=4)
def swatches(material: Material) -> list[tuple[float, str]]:
    """Distances in metres, and the hex colors of white light after them."""
    facts = extinction_facts(material)
    return [(float(factor) * facts["distance"], to_hex(row)) for factor, row in facts["transmittance"].items()]


def transmittance_curves(material: Material, most: float) -> tuple[Array, Array]:
    """Distances (64,) from 0 to `most` metres, and transmittance (64, 3) there."""
    distances = np.linspace(0.0, most, 64)
    return distances, medium_of(material).transmittance(distances)


#: Width of a card in ems.
CARD = 5.0

#: Type of what is dragged.
PRESET = "preset"

SAVE_TIP = "Saves the medium, ior and roughness as a .toml file to be shared: others put it into this folder of theirs."


def library_panel(state: WindowState) -> None:
    """Draw the panel."""
    library = state.work.library
    imgui.set_next_item_width(-1.0)
    hint = "search: wine, measured, stone ..."
    _, library.search = imgui.input_text_with_hint("##search", hint, library.search)
    wrapped(f"Click: {state.target_text}. Drag: onto an object.", FAINT)
    groups = library.groups()
    if not groups:
        wrapped("None has these words.", FAINT)
    if imgui.begin_child("##presets", ImVec2(0.0, -em(3.6))):
        for group, members in groups.items():
            imgui.separator_text(f"{group} ({len(members)})")
            _cards(state, members)
    imgui.end_child()
    imgui.separator()
    imgui.set_next_item_width(-em(6.2))
    entered, text = imgui.input_text_with_hint(
        "##name", "name of this material", state.texts.get("preset", ""), imgui.InputTextFlags_.enter_returns_true
    )
    state.texts["preset"] = text
    imgui.same_line()
    pressed = imgui.button("Save preset")
    tooltip(f"{SAVE_TIP}\n{library.folder}")
    if (entered or pressed) and text.strip() and save_preset(state, text):
        state.texts["preset"] = ""


def _cards(state: WindowState, members: list[Preset]) -> None:
    line = imgui.get_text_line_height()
    draw_cards(members, CARD, lambda width: width + 2.2 * line, partial(_card, state))


def _card(state: WindowState, one: Preset, size: ImVec2) -> None:
    low = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"##{one.name}", size):
        state.choose_preset(one.name)
    hovered = imgui.is_item_hovered()
    if imgui.begin_drag_drop_source():
        state.dragged = one.name
        imgui.set_drag_drop_payload_py_id(PRESET, 0)
        imgui.text(one.name.replace("_", " "))
        imgui.end_drag_drop_source()
    else:
        tooltip(preset_text(one))
    over = imgui.get_window_draw_list()
    high = ImVec2(low.x + size.x, low.y + size.x)
    picture = state.work.thumbnails.picture(ball_key(one), draw_ball, one)
    if picture is not None:
        over.add_image(imgui.ImTextureRef(state.texture(ball_key(one), picture).glo), low, high)
    else:
        _swatch(over, one, low, high)
    chosen = state.material.preset == one.name
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


def preset_text(one: Preset) -> str:
    """Text about a preset: names, source, and what to know."""
    names = ", ".join((one.name, *one.aliases))
    lines = (names, f"{one.kind}: {one.source}", f"ior {one.medium.ior:g}, {one.regime}", one.note, one.warning)
    return "\n".join(line for line in lines if line)


#: Colors of curves: red, green and blue that are told apart on a dark background.
CURVES = ((0.95, 0.36, 0.33, 1.0), (0.38, 0.80, 0.42, 1.0), (0.36, 0.58, 1.0, 1.0))


def material_panel(state: WindowState) -> None:
    """Draw the panel."""
    material = state.material
    _source(state, material)
    imgui.separator_text("Volume")
    if begin_rows("volume"):
        _color(state, material)
        imgui.end_table()
    _distance(state, material)
    if begin_rows("thickness"):
        slider(state, "thickness", "material.thickness", 1e-5, 10.0, "%.5f m", log=True)
        imgui.end_table()
    _swatches(state, material)
    _curves(state, material)
    imgui.separator_text("Surface")
    if begin_rows("surface"):
        slider(state, "ior", "material.ior", 1.0, 2.5, "%.3f")
        slider(state, "roughness", "material.roughness", 0.0, 1.0)
        slider(state, "transmission", "material.transmission", 0.0, 1.0)
        slider(state, "dispersion", "material.dispersion", 0.0, 10.0)
        imgui.end_table()
    imgui.separator_text("Thin film and clear coat")
    if begin_rows("film"):
        slider(state, "iridescence", "material.iridescence", 0.0, 1.0)
        slider(state, "film ior", "material.iridescence_ior", 1.0, 3.0, "%.3f")
        slider(state, "film thickness", "material.iridescence_thickness", 0.0, 1e-6, "%.0f nm", unit=1e-9)
        slider(state, "clearcoat", "material.clearcoat", 0.0, 1.0)
        slider(state, "coat roughness", "material.clearcoat_roughness", 0.0, 1.0)
        imgui.end_table()
    imgui.separator_text("Scattering and emission")
    triple(state, "absorption, 1/m", "material.absorption", 0.5)
    triple(state, "scattering, 1/m", "material.scattering", 0.5)
    triple(state, "emission, radiance per m", "material.emission", 0.05)
    if begin_rows("scattering"):
        slider(state, "anisotropy g", "material.anisotropy", -0.99, 0.99)
        imgui.end_table()
    imgui.separator_text("Numbers")
    _numbers(state, material)
    imgui.separator_text("Copy")
    _copies(state, material)


def _source(state: WindowState, material: Material) -> None:
    if begin_rows("source"):
        if len(state.objects) > 1:
            _object(state)
        row("preset", "A named medium; the Library has them as pictures.")
        if imgui.begin_combo("##preset", material.preset or "none"):
            for group, members in grouped(presets()).items():
                imgui.text_colored(FAINT, group)
                for each in members:
                    if imgui.selectable(f"{each.name}  ({each.kind})", each.name == material.preset)[0]:
                        state.choose_preset(each.name)
                    tooltip(preset_text(each))
            imgui.end_combo()
        words = {
            "file": "the model's own",
            "color": "color at a distance",
            "preset": f"preset {material.preset}",
            "coefficients": "coefficients",
        }
        fact("medium from", words[material.source])
        imgui.end_table()
    if material.source == "preset" and (found := state.work.library.find(material.preset)) is not None:
        wrapped(f"{found.kind}: {found.source}", FAINT)
        if found.warning:
            wrapped(found.warning, WARNING)


def _object(state: WindowState) -> None:
    """Draw the choice of the object that the panel is about."""
    row("object", "Click one in the picture, or choose it here. Changes are then of its own material.")
    every = "all without their own"
    if imgui.begin_combo("##object", every if state.target is None else _object_name(state, state.target)):
        if imgui.selectable(every, state.target is None)[0]:
            state.select(None)
        for number in range(len(state.objects)):
            if imgui.selectable(f"{_object_name(state, number)}##{number}", number == state.target)[0]:
                state.select(number)
        imgui.end_combo()
    if state.target is not None and state.work.document.own_material(state.target) is not None:
        row("")
        if imgui.button("No material of its own"):
            state.work.do(Assign(state.target, None))


def _object_name(state: WindowState, number: int) -> str:
    own = " *" if state.work.document.own_material(number) is not None else ""
    return f"{state.name_of(number)}{own}"


def _color(state: WindowState, material: Material) -> None:
    row("attenuationColor", TIPS["material.color"])
    shown = list(to_display(material.color))
    flags = imgui.ColorEditFlags_.display_hex | imgui.ColorEditFlags_.picker_hue_wheel
    changed, encoded = imgui.color_edit3("##color", shown, flags)
    if imgui.is_item_activated():
        state.drag += 1
    if changed:
        state.change("material.color", from_display(np.asarray(list(encoded)[:3])))
    fact("linear", triple_text(material.color))
    row("as text", "A hex color, a CSS name, srgb(r,g,b) or linear(r,g,b); press Enter.")
    text = state.texts.get("color", "")
    entered, text = imgui.input_text_with_hint(
        "##colortext", to_hex(material.color), text, imgui.InputTextFlags_.enter_returns_true
    )
    state.texts["color"] = text
    if entered and text:
        state.texts["color"] = _typed_color(state, text)


def _typed_color(state: WindowState, text: str) -> str:
    """Text that stays in the field: none, or the one that could not be parsed."""
    try:
        color = np.asarray(parse_color(text))
    except InputError as error:
        state.work.refuse(error)
        return text
    state.change("material.color", color.tolist(), step=True)
    return ""


def _distance(state: WindowState, material: Material) -> None:
    unit = state.get("display.unit")
    scale = metres_per_unit(unit)
    imgui.text("attenuationDistance")
    tooltip(TIPS["material.distance"])
    imgui.set_next_item_width(-em(4.2))
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format
    changed, value = imgui.slider_float(
        "##distance", material.distance / scale, 1e-5 / scale, 1e2 / scale, "%.5g", flags
    )
    if imgui.is_item_activated():
        state.drag += 1
    if changed and value > 0:
        # Five digits are what is shown, so that what is copied is what is seen.
        state.change("material.distance", float(f"{value:.5g}") * scale)
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if imgui.begin_combo("##unit", unit, imgui.ComboFlags_.height_small):
        for word in SHOWN_UNITS:
            if imgui.selectable(word, word == unit)[0]:
                state.work.do(SetField("display.unit", word))
        imgui.end_combo()


def _swatches(state: WindowState, material: Material) -> None:
    imgui.text_colored(FAINT, "white light after")
    found, unit = swatches(material), state.get("display.unit")
    width = imgui.get_content_region_avail().x
    each = max((width - em(0.25) * (len(found) - 1)) / len(found), em(1.0))
    for i, (metres, text) in enumerate(found):
        if i:
            imgui.same_line(0.0, em(0.25))
        red, green, blue = (int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        imgui.color_button(f"##swatch{i}", imgui.ImVec4(red, green, blue, 1.0), flags, imgui.ImVec2(each, em(1.6)))
        if imgui.is_item_hovered():
            imgui.set_tooltip(f"{length_text(metres, unit)}\n{text}")


def _curves(state: WindowState, material: Material) -> None:
    measured, unit = state.work.measured, state.get("display.unit")
    scale = metres_per_unit(unit)
    most = float(measured.seen.edges[-1]) if measured is not None else 3.0 * material.distance
    distances, curves = transmittance_curves(material, most)
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
        median = length_text(float(np.median(seen.thickness)), unit)
        wrapped(f"bars: thickness of the model, median {median}; on average it shows {text}", FAINT)


_averages: dict[int, tuple[object, Medium, str]] = {}


def _average_hex(measured: object, medium: Medium) -> str:
    """Average color of the model; cached until either changes."""
    known = _averages.get(0)
    if known is None or known[0] is not measured or known[1] != medium:
        seen = measured.seen  # type: ignore[attr-defined]
        known = _averages[0] = measured, medium, seen.average_hex(medium)
    return known[2]


def _numbers(state: WindowState, material: Material) -> None:
    if begin_rows("numbers"):
        for label, text in extinction_lines(material):
            fact(label, text)
        imgui.end_table()
    for line in extinction_facts(material)["warnings"]:
        wrapped(line, WARNING)


def _copies(state: WindowState, material: Material) -> None:
    width = imgui.get_content_region_avail().x
    for target, system in TARGETS.items():
        label = system.title
        size = imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x
        if target != next(iter(TARGETS)):
            imgui.same_line()
            if imgui.get_cursor_pos_x() + size > width:
                imgui.new_line()
        if imgui.button(label):
            state.work.attempt(lambda t=target: _copy(material, t), f"copied as {label}")  # type: ignore[misc]


def copied_text(material: Material, target: str) -> str:
    """Text that is copied for a target, as ``translucent extinction --as`` prints it."""
    medium, distance = medium_of(material), float(extinction_facts(material)["distance"])
    return text_block(target, medium, medium.transmittance(distance), distance, material.roughness)


def _copy(material: Material, target: str) -> None:
    imgui.set_clipboard_text(copied_text(material, target))
