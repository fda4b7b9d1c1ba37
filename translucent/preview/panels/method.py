"""The method panel: the plan and its reasons, times, errors, and the comparison."""

from __future__ import annotations

from imgui_bundle import imgui

from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import SCATTERINGS
from translucent.preview.document import AUTO, METHOD_NAMES, length_text
from translucent.preview.measuring import MOST_TRIANGLES, measurable
from translucent.preview.quality import StepTiming
from translucent.preview.window_state import (
    ERROR,
    FAINT,
    WARNING,
    WindowState,
    begin_rows,
    check,
    choice,
    fact,
    slider,
    wrapped,
)

SCATTERING_NAMES = (AUTO, *SCATTERINGS)
#: Advice about invalid pixels, by a word in the plan's limits or the diagnosis.
CLOSE_HOLES = "Close the holes, or declare the model a sheet (thin-layer). translucent explain tells which edges."


def method_panel(state: WindowState) -> None:
    """Draw the panel."""
    display = state.work.document.display
    if begin_rows("method"):
        choice(state, "method", "display.method", METHOD_NAMES)
        choice(state, "scattering", "display.scattering", SCATTERING_NAMES)
        choice(state, "show", "display.mode", ("picture", "thickness", "transmittance", "validity"))
        choice(state, "right of split", "display.compare", ("off", "method", "reference", "error"))
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
        fact("time", f"{1e3 * timing.wall:.1f} ms, GPU {1e3 * timing.gpu:.1f} ms{part}")
        for step in plan.passes:
            spent = (timing.passes or {}).get(step.name)
            fact(step.name, f"{step.reason}" + (f" ({1e3 * spent:.1f} ms)" if spent is not None else ""))
        imgui.end_table()
    for limit in plan.limits:
        wrapped(f"limit: {limit}", WARNING)
    for effect in plan.unmodelled:
        wrapped(f"not modelled: {effect}", WARNING)
    for remark in plan.remarks:
        wrapped(f"remark: {remark}", WARNING)


def _errors(state: WindowState) -> None:
    measured, unit = state.work.measured, state.get("display.unit")
    scene, display = state.work.scene(), state.work.document.display
    if scene is not None and not (display.inset or measurable(scene)):
        wrapped(
            f"not measured, unless its inset is shown: {MOST_TRIANGLES:,} triangles and more take much memory", FAINT
        )
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


COLORS = {"info": FAINT, "warning": WARNING, "error": ERROR}


def messages_panel(state: WindowState) -> None:
    """Draw the panel."""
    for text in (state.view.problem, state.view.shader_problem):
        if text:
            wrapped(text, ERROR)
    if not state.work.messages:
        imgui.text_colored(FAINT, "Drop a model here: .glb .gltf .obj .stl .ply")
    for message in reversed(state.work.messages):
        wrapped(message.text, COLORS[message.kind])
