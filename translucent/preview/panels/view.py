"""Panels for the view: look, environments, method and messages."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import get_args

import numpy as np
from imgui_bundle import imgui

from translucent.errors import InputError
from translucent.formulas.color import linear_to_srgb, srgb_to_linear
from translucent.formulas.tone import TONES
from translucent.planning.flags import Flags
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import SCATTERINGS
from translucent.preview.actions import Keep, Recall, SetField, SetOrbit, SetTime, Stand
from translucent.preview.document import (
    AUTO,
    METHOD_NAMES,
    SNAPSHOTS,
    STAGE_WORDS,
    TIPS,
    Compare,
    Mode,
    length_text,
    triple_of,
)
from translucent.preview.library import BUILT_IN, draw_panorama, panorama_key, title
from translucent.preview.measuring import MOST_TRIANGLES, measurable
from translucent.preview.panels import widgets as ui
from translucent.preview.panels.gizmos import view_buttons
from translucent.preview.quality import StepTiming
from translucent.preview.window_state import WindowState
from translucent.units import parse_length, short_length

#: Width of the card of an environment in ems.
CARD = 8.0

#: Advice about invalid pixels of a model with holes.
CLOSE_HOLES = "Close the holes, or choose the method thin-layer. translucent explain lists the open edges."

#: Colors of messages.
COLORS = {"info": ui.FAINT, "warning": ui.WARNING, "error": ui.ERROR}


def look_panel(state: WindowState) -> None:
    """Draw the look panel: size of the model, camera, stage, environment, light and exposure."""
    imgui.separator_text("Size")
    if ui.begin_rows("size"):
        _height(state)
        ui.row("upwards", TIPS["model.up"])
        up = state.get("model.up")
        ui.combo(
            "up", f"{up.upper()} axis", [("Y axis", "y"), ("Z axis", "z")], up, lambda one: state.work.do(Stand(one))
        )
        ui.check(state, "ruler on the ground", "display.ruler")
        imgui.end_table()
    imgui.separator_text("Camera")
    orbit = state.work.document.orbit
    if orbit is not None and ui.begin_rows("camera"):
        ui.slider(state, "field of view", "orbit.fov_y", 5.0, 120.0, "%.0f deg")
        ui.check(state, "orthographic", "orbit.orthographic")
        imgui.end_table()
    if imgui.button("Frame (F)"):
        state.work.frame()
    imgui.same_line()
    if imgui.button("Reset") and orbit is not None:
        state.work.do(SetOrbit(None))
    view_buttons(state)
    if ui.begin_rows("lens"):
        ui.check(state, "depth of field", "look.depth_of_field")
        if state.get("look.depth_of_field"):
            far = 1.0 if orbit is None else orbit.distance
            ui.slider(state, "lens", "look.aperture", 1e-3 * far, 0.5 * far, "%.4f m", log=True)
            ui.slider(state, "in focus", "look.focus", -0.5 * far, 0.5 * far, "%.4f m")
        imgui.end_table()
    _animation(state)
    imgui.separator_text("Stage and environment")
    if ui.begin_rows("environment"):
        ui.choice(state, "stage", "look.stage", STAGE_WORDS)
        _environment(state, "lights with", "environment", "the stage's, or the model's own")
        _environment(state, "background", "background", "the same")
        ui.slider(state, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        imgui.end_table()
    imgui.separator_text("Lights")
    if ui.begin_rows("light"):
        ui.check(state, "directional light", "look.light")
        if state.get("look.light"):
            ui.slider(state, "from around", "look.light_yaw", -180.0, 180.0, "%.0f deg")
            ui.slider(state, "from above", "look.light_pitch", -89.0, 89.0, "%.0f deg")
            ui.slider(state, "irradiance", "look.light_irradiance", 0.0, 50.0, "%.2f W/m2")
        imgui.end_table()
    _lights(state)
    imgui.separator_text("Picture")
    if ui.begin_rows("picture"):
        ui.slider(state, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        ui.choice(state, "tone curve", "look.tone", (AUTO, *TONES))
        imgui.end_table()


def _animation(state: WindowState) -> None:
    """Draw the timeline of the model's animations, if it has any."""
    if (duration := state.duration) is None:
        return
    imgui.separator_text("Animation")
    if imgui.button("Stop" if state.playing else "Play"):
        state.play()
    imgui.same_line()
    if imgui.button("As written"):
        state.playing = False
        state.work.do(SetTime(None))
    ui.tooltip("Use the pose that is stored in the file, like translucent render without --time.")
    imgui.set_next_item_width(-1.0)
    now = state.get("model.time")
    form = "as written" if now is None else f"%.3f of {duration:.3g} s"
    changed, value = imgui.slider_float("##time", now or 0.0, 0.0, duration, form, imgui.SliderFlags_.always_clamp)
    ui.tooltip(TIPS["model.time"])
    ui.begin_drag(state)
    if changed:
        state.playing = False
        state.work.do(SetTime(value, state.drag))


def _lights(state: WindowState) -> None:
    """Draw the lights that the user has added, and the fields of the selected one."""
    lights = state.work.document.lights
    for number in range(len(lights)):
        if imgui.selectable(f"light {number + 1}", state.light == number)[0]:
            state.light = None if state.light == number else number
    if imgui.button("Add a light"):
        state.add_light()
    if state.light is None or state.light >= len(lights):
        return None
    imgui.same_line()
    if imgui.button("Remove"):
        return state.remove_light(state.light)
    light = lights[state.light]
    far = 1.0 if state.work.document.orbit is None else state.work.document.orbit.distance
    if ui.begin_rows("added"):
        ui.vector(state, "position, m", "light.position", light.position, 2e-3 * far, state.change_light)
        ui.number(state, "radius", "light.radius", light.radius, (0.0, far), "%.4f m", state.change_light)
        most = 100.0 * far**2
        ui.number(state, "intensity", "light.intensity", light.intensity, (0.0, most), "%.4g W/sr", state.change_light)
        ui.row("color", TIPS["light.color"])
        changed, color = imgui.color_edit3("##light color", np.clip(linear_to_srgb(light.color), 0.0, 1.0).tolist())
        ui.begin_drag(state)
        if changed:
            state.change_light("color", triple_of(srgb_to_linear(np.asarray(list(color)[:3]))))
        imgui.end_table()
    return None


def _height(state: WindowState) -> None:
    """Field for the height of the model, with a unit."""
    ui.row("height", "Write the height of the model, such as 12cm, and press Enter. Lengths of media do not change.")
    loaded = state.work.loaded
    if loaded is None:
        return ui.wrapped("no model yet", ui.FAINT)
    low, high = loaded.scene.shown_bounds
    now = short_length(float(high[1] - low[1]))
    if (text := ui.text_field(state, "height", "12cm", now)) is not None:
        try:
            state.work.resize(parse_length(text))
        except InputError as error:
            state.work.refuse(error)
        state.texts["height"] = ""
    return None


def _environment(state: WindowState, label: str, name: str, empty: str) -> None:
    field = f"look.{name}"
    ui.row(label, TIPS[field])
    now = state.get(field)
    if imgui.begin_combo(f"##{field}", now or empty):
        for word in BUILT_IN:
            if imgui.selectable(word or empty, word == now)[0]:
                state.work.do(SetField(field, word))
        if imgui.selectable("a file ...", False)[0]:
            state.ask_file(name)
        imgui.end_combo()


def environments_panel(state: WindowState) -> None:
    """Draw the environments panel: thumbnails of all that can light the model, with rotation and exposure."""
    if ui.begin_rows("light"):
        ui.slider(state, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        ui.slider(state, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        imgui.end_table()
    folder = state.environments
    if imgui.button("Open ..."):
        state.ask_file("environment")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if (text := ui.text_field(state, "folder", "folder with .hdr and .exr", folder.path)) is not None:
        folder.take(text)
    files = folder.files()
    if folder.problem:
        ui.wrapped(folder.problem, ui.WARNING)

    def card(name: str) -> ui.Card:
        chosen = state.get("look.environment") == name
        key = panorama_key(name) if name else ""
        picture = state.work.thumbnails.picture(key, draw_panorama, name) if name else None
        tip = name or "The stage's, or the model's own."
        return ui.Card(f"##card{name}", key, picture, ((title(name), chosen),), tip, chosen)

    if imgui.begin_child("##environments"):
        for group, names in (("built in", list(BUILT_IN)), (f"in the folder ({len(files)})", files)):
            if names:
                imgui.separator_text(group)
                choose = partial(state.change, "look.environment", step=True)
                ui.draw_cards(state, names, CARD, 0.5, card, choose)
    imgui.end_child()


def method_panel(state: WindowState) -> None:
    """Draw the method panel: the plan and its reasons, times, errors, and the comparison."""
    display = state.work.document.display
    if ui.begin_rows("method"):
        ui.choice(state, "method", "display.method", METHOD_NAMES)
        ui.choice(state, "scattering", "display.scattering", (AUTO, *SCATTERINGS))
        ui.choice(state, "show", "display.mode", get_args(Mode))
        ui.choice(state, "compare with", "display.compare", get_args(Compare))
        if display.compare == "method":
            ui.choice(state, "other method", "display.method_b", METHOD_NAMES)
        if display.compare == "snapshot":
            names = tuple(one.name for one in state.work.document.snapshots)
            ui.choice(state, "snapshot", "display.snapshot", names)
        if display.compare != "off":
            ui.slider(state, "split", "display.split", 0.0, 1.0, "%.2f")
        ui.check(state, "reference inset", "display.inset")
        ui.check(state, "smooth edges", "display.antialias")
        ui.check(state, "caustics (P)", "display.caustics")
        ui.check(state, "converge (C)", "display.converge")
        ui.check(state, "denoise it", "display.denoise")
        for flag in dataclasses.fields(Flags):
            ui.check(state, flag.name.replace("_", " "), f"flags.{flag.name}")
        imgui.end_table()
    _snapshots(state)
    for side, (plan, timing) in enumerate(zip(state.view.plans, state.view.timings, strict=True)):
        if plan is not None:
            imgui.separator_text("Plan" if side == 0 else "Plan of the other method")
            _plan(plan, timing)
    imgui.separator_text("Against the float64 reference")
    _errors(state)
    imgui.separator_text("Validity")
    _validity(state)


def _snapshots(state: WindowState) -> None:
    """Draw the kept states: a click shows one, and another one compares with it."""
    imgui.separator_text("Snapshots")
    document = state.work.document
    if imgui.button("Keep"):
        state.work.do(Keep(next(name for name in SNAPSHOTS if document.snapshot(name) is None)))
    ui.tooltip("Stored materials, lights, positions and look. Shift 1 to 9 stores a snapshot; 1 to 9 shows it.")
    for one in document.snapshots:
        imgui.same_line()
        if imgui.button(f"{one.name}##snapshot"):
            state.work.do(Recall(one.name))
        ui.tooltip("Show this snapshot. Right click: compare with this snapshot.")
        if imgui.is_item_clicked(1):
            state.compare_with(one.name)


def _plan(plan: RenderPlan, timing: StepTiming) -> None:
    if ui.begin_rows("plan"):
        exact = "exact" if plan.exact else "not exact everywhere"
        ui.fact("runs", f"{type(plan.method).__name__}: {exact}", None if plan.exact else ui.WARNING)
        part = "" if timing.share == 1.0 else f", for 1/{1 / timing.share:.3g} of the pixels"
        passes = timing.passes or {}
        ui.fact("time", f"{1e3 * timing.wall:.1f} ms, GPU {1e3 * sum(passes.values()):.1f} ms{part}")
        for step in plan.passes:
            spent = passes.get(step.name)
            ui.fact(step.name, f"{step.reason}" + (f" ({1e3 * spent:.1f} ms)" if spent is not None else ""))
        imgui.end_table()
    for kind, texts in (("limit", plan.limits), ("approximation", plan.unmodelled), ("remark", plan.remarks)):
        for text in texts:
            ui.wrapped(f"{kind}: {text}", ui.WARNING)


def _errors(state: WindowState) -> None:
    measured, unit = state.work.measured, state.get("display.unit")
    scene, display = state.work.scene(), state.work.document.display
    if scene is not None and not (display.inset or measurable(scene)):
        many = f"models of {MOST_TRIANGLES:,} triangles and more need much memory"
        ui.wrapped(f"measured only while the inset is open: {many}", ui.FAINT)
    elif measured is None or measured.scene is not scene:
        ui.wrapped("measured when the view stops moving", ui.FAINT)
    if measured is None:
        return
    if measured.doubt:
        ui.wrapped(measured.doubt, ui.WARNING)
    if measured.errors and ui.begin_rows("errors"):
        thickness, transmittance = measured.errors
        ui.fact("median", f"{length_text(thickness.median, unit)} of thickness")
        ui.fact("99 %", f"below {length_text(thickness.p99, unit)}")
        ui.fact("largest", length_text(thickness.max, unit))
        ui.fact("transmittance", f"median {transmittance.median:.2g}, largest {transmittance.max:.2g}")
        ui.fact("coverage", f"differs on {thickness.coverage_mismatch:.2%} of {thickness.pixels} pixels")
        imgui.end_table()


def _validity(state: WindowState) -> None:
    measured, loaded = state.work.measured, state.work.loaded
    if measured is not None:
        invalid = measured.seen.invalid
        text = f"{invalid} of {measured.truth.shape[0] * measured.truth.shape[1]} measured pixels are invalid"
        ui.wrapped(text, ui.ERROR if invalid else ui.FAINT)
    if loaded is None:
        return
    for item in loaded.scene.objects:
        found = item.mesh.diagnosis
        if not found.solid:
            ui.wrapped(f"{item.mesh.name}: {found}", ui.WARNING)
            ui.wrapped(CLOSE_HOLES, ui.FAINT)
        for repair in item.mesh.repairs:
            ui.wrapped(f"{item.mesh.name}: {repair}", ui.FAINT)
    for line in getattr(loaded.scene, "left_out", ()):
        ui.wrapped(f"left out: {line}", ui.WARNING)


def messages_panel(state: WindowState) -> None:
    """Draw the messages panel, the latest first."""
    for text in filter(None, (state.view.problem, state.view.shader_problem)):
        ui.wrapped(text, ui.ERROR)
    if not state.work.messages:
        imgui.text_colored(ui.FAINT, "Drop a model here: .glb .gltf .obj .stl .ply")
    for message in reversed(state.work.messages):
        ui.wrapped(message.text, COLORS[message.kind])
