"""Panels for the view: look, environments, method and messages."""

from __future__ import annotations

from functools import partial
from typing import get_args

from imgui_bundle import imgui

from translucent.formulas.tone import TONES
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import SCATTERINGS
from translucent.preview.actions import SetField, SetOrbit
from translucent.preview.document import AUTO, METHOD_NAMES, STAGE_WORDS, TIPS, Compare, Mode, length_text
from translucent.preview.library import BUILT_IN, draw_panorama, panorama_key, title
from translucent.preview.measuring import MOST_TRIANGLES, measurable
from translucent.preview.panels.widgets import (
    ERROR,
    FAINT,
    WARNING,
    Card,
    begin_rows,
    check,
    choice,
    draw_cards,
    fact,
    row,
    slider,
    text_field,
    wrapped,
)
from translucent.preview.quality import StepTiming
from translucent.preview.window_state import WindowState

#: Width of the card of an environment in ems.
CARD = 8.0

#: Advice about invalid pixels of a model with holes.
CLOSE_HOLES = "Close the holes, or declare the model a sheet (thin-layer). translucent explain tells which edges."

#: Colors of messages.
COLORS = {"info": FAINT, "warning": WARNING, "error": ERROR}


def look_panel(state: WindowState) -> None:
    """Draw the look panel: camera, stage, environment, light and exposure."""
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
    imgui.separator_text("Stage and environment")
    if begin_rows("environment"):
        choice(state, "stage", "look.stage", STAGE_WORDS)
        _environment(state, "lights with", "environment", "the stage's, or the model's own")
        _environment(state, "background", "background", "the same")
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
    field = f"look.{name}"
    row(label, TIPS[field])
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
    if begin_rows("light"):
        slider(state, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        slider(state, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        imgui.end_table()
    folder = state.environments
    if imgui.button("Open ..."):
        state.ask_file("environment")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if (text := text_field(state, "folder", "folder with .hdr and .exr", folder.path)) is not None:
        folder.take(text)
    files = folder.files()
    if folder.problem:
        wrapped(folder.problem, WARNING)

    def card(name: str) -> Card:
        chosen = state.get("look.environment") == name
        key = panorama_key(name) if name else ""
        picture = state.work.thumbnails.picture(key, draw_panorama, name) if name else None
        tip = name or "The stage's, or the model's own."
        return Card(f"##card{name}", key, picture, ((title(name), chosen),), tip, chosen)

    if imgui.begin_child("##environments"):
        groups = {"built in": list(BUILT_IN), f"in the folder ({len(files)})": files}
        for group, names in groups.items():
            if names:
                imgui.separator_text(group)
                choose = partial(state.change, "look.environment", step=True)
                draw_cards(state, names, CARD, 0.5, card, choose)
    imgui.end_child()


def method_panel(state: WindowState) -> None:
    """Draw the method panel: the plan and its reasons, times, errors, and the comparison."""
    display = state.work.document.display
    if begin_rows("method"):
        choice(state, "method", "display.method", METHOD_NAMES)
        choice(state, "scattering", "display.scattering", (AUTO, *SCATTERINGS))
        choice(state, "show", "display.mode", get_args(Mode))
        choice(state, "right of split", "display.compare", get_args(Compare))
        if display.compare == "method":
            choice(state, "method there", "display.method_b", METHOD_NAMES)
        if display.compare != "off":
            slider(state, "split", "display.split", 0.0, 1.0, "%.2f")
        check(state, "reference inset", "display.inset")
        check(state, "smooth edges", "display.antialias")
        check(state, "caustics (P)", "display.caustics")
        check(state, "converge (C)", "display.converge")
        imgui.end_table()
    for side, (plan, timing) in enumerate(zip(state.view.plans, state.view.timings, strict=True)):
        if plan is not None:
            imgui.separator_text("Plan" if side == 0 else "Plan right of the split")
            _plan(plan, timing)
    imgui.separator_text("Against the float64 reference")
    _errors(state)
    imgui.separator_text("Validity")
    _validity(state)


def _plan(plan: RenderPlan, timing: StepTiming) -> None:
    if begin_rows("plan"):
        exact = "exact" if plan.exact else "not exact everywhere"
        fact("runs", f"{type(plan.method).__name__}: {exact}", None if plan.exact else WARNING)
        part = "" if timing.share == 1.0 else f", for 1/{1 / timing.share:.3g} of the pixels"
        passes = timing.passes or {}
        fact("time", f"{1e3 * timing.wall:.1f} ms, GPU {1e3 * sum(passes.values()):.1f} ms{part}")
        for step in plan.passes:
            spent = passes.get(step.name)
            fact(step.name, f"{step.reason}" + (f" ({1e3 * spent:.1f} ms)" if spent is not None else ""))
        imgui.end_table()
    for kind, texts in (("limit", plan.limits), ("not modelled", plan.unmodelled), ("remark", plan.remarks)):
        for text in texts:
            wrapped(f"{kind}: {text}", WARNING)


def _errors(state: WindowState) -> None:
    measured, unit = state.work.measured, state.get("display.unit")
    scene, display = state.work.scene(), state.work.document.display
    if scene is not None and not (display.inset or measurable(scene)):
        many = f"{MOST_TRIANGLES:,} triangles and more take much memory"
        wrapped(f"not measured, unless its inset is shown: {many}", FAINT)
    elif measured is None or measured.scene is not scene:
        wrapped("measured as soon as the view is still", FAINT)
    if measured is None:
        return
    if measured.doubt:
        wrapped(measured.doubt, WARNING)
    if measured.errors and begin_rows("errors"):
        thickness, transmittance = measured.errors
        fact("median", f"{length_text(thickness.median, unit)} of thickness")
        fact("99 %", f"below {length_text(thickness.p99, unit)}")
        fact("largest", length_text(thickness.max, unit))
        fact("transmittance", f"median {transmittance.median:.2g}, largest {transmittance.max:.2g}")
        fact("coverage", f"differs on {thickness.coverage_mismatch:.2%} of {thickness.pixels} pixels")
        imgui.end_table()


def _validity(state: WindowState) -> None:
    measured, loaded = state.work.measured, state.work.loaded
    if measured is not None:
        invalid = measured.seen.invalid
        text = f"{invalid} of {measured.truth.shape[0] * measured.truth.shape[1]} measured pixels are not valid"
        wrapped(text, ERROR if invalid else FAINT)
    if loaded is None:
        return
    for item in loaded.scene.objects:
        found = item.mesh.diagnosis
        if not found.solid:
            wrapped(f"{item.mesh.name}: {found}", WARNING)
            wrapped(CLOSE_HOLES, FAINT)
        for repair in item.mesh.repairs:
            wrapped(f"{item.mesh.name}: {repair}", FAINT)
    for line in getattr(loaded.scene, "left_out", ()):
        wrapped(f"left out: {line}", WARNING)


def messages_panel(state: WindowState) -> None:
    """Draw the messages panel, the latest first."""
    for text in filter(None, (state.view.problem, state.view.shader_problem)):
        wrapped(text, ERROR)
    if not state.work.messages:
        imgui.text_colored(FAINT, "Drop a model here: .glb .gltf .obj .stl .ply")
    for message in reversed(state.work.messages):
        wrapped(message.text, COLORS[message.kind])
