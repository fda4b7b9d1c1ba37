"""The look panel: camera, environment, light, exposure. And the files panel: sessions, pictures, bakes."""

from __future__ import annotations

from imgui_bundle import imgui

from translucent.formulas.tone import TONES
from translucent.preview.actions import Change, SetOrbit
from translucent.preview.answers import recipe
from translucent.preview.desk import FAINT, Desk, begin_rows, check, choice, fact, row, slider, wrapped
from translucent.preview.document import AUTO, STAGE_WORDS
from translucent.preview.environments import BUILT_IN
from translucent.preview.tips import TIPS

RECIPES = (
    ("Copy command", "command", "translucent render with options for this picture, its stage and caustics"),
    ("Copy Python", "python", "A script that makes this picture, with all that no option says"),
)


def look_panel(desk: Desk) -> None:
    """Draw the panel."""
    imgui.separator_text("Camera")
    orbit = desk.work.document.orbit
    if orbit is not None and begin_rows("camera"):
        slider(desk, "field of view", "orbit.fov_y", 5.0, 120.0, "%.0f deg")
        check(desk, "orthographic", "orbit.orthographic")
        imgui.end_table()
    if imgui.button("Frame (F)"):
        desk.work.frame()
    imgui.same_line()
    if imgui.button("Reset") and orbit is not None:
        desk.work.do(SetOrbit(None))
        desk.work.reframe()
    imgui.separator_text("Stage and environment")
    if begin_rows("environment"):
        choice(desk, "stage", "look.stage", STAGE_WORDS)
        _environment(desk, "lights with", "look.environment", "the stage's, or the model's own")
        _environment(desk, "background", "look.background", "the same")
        slider(desk, "rotation", "look.rotation", -180.0, 180.0, "%.0f deg")
        imgui.end_table()
    imgui.separator_text("Light")
    if begin_rows("light"):
        check(desk, "directional light", "look.light")
        if desk.get("look.light"):
            slider(desk, "from around", "look.light_yaw", -180.0, 180.0, "%.0f deg")
            slider(desk, "from above", "look.light_pitch", -89.0, 89.0, "%.0f deg")
            slider(desk, "irradiance", "look.light_irradiance", 0.0, 50.0, "%.2f W/m2")
        imgui.end_table()
    imgui.separator_text("Picture")
    if begin_rows("picture"):
        slider(desk, "exposure", "look.exposure", -6.0, 6.0, "%.2f stops")
        choice(desk, "tone curve", "look.tone", (AUTO, *TONES))
        imgui.end_table()


def _environment(desk: Desk, label: str, name: str, empty: str) -> None:
    row(label, TIPS[name])
    now = desk.get(name)
    if imgui.begin_combo(f"##{name}", now or empty):
        for word in BUILT_IN:
            if imgui.selectable(word or empty, word == now)[0]:
                desk.work.do(Change(name, word))
        if imgui.selectable("a file ...", False)[0]:
            desk.ask_file("environment" if name.endswith("environment") else "background")
        imgui.end_combo()


def files_panel(desk: Desk) -> None:
    """Draw the files panel: pictures and turntables, the session, export of the medium, and baking."""
    imgui.separator_text("Picture of this view")
    changed, value = imgui.checkbox("transparent background", desk.export["transparent"])
    if changed:
        desk.export["transparent"] = value
    for label, kind in (("PNG ...", "png"), ("EXR ...", "exr")):
        if imgui.button(label):
            desk.ask_file(kind)
        imgui.same_line()
    if imgui.button("Turntable ..."):
        desk.ask_file("turntable")
    for label, kind, tip in RECIPES:
        if imgui.button(label):
            _copy(desk, kind)
        if imgui.is_item_hovered():
            imgui.set_tooltip(tip)
        imgui.same_line()
    imgui.new_line()
    imgui.separator_text("Session")
    if imgui.button("Open session ..."):
        desk.ask_file("open session")
    imgui.same_line()
    if imgui.button("Save session ..."):
        desk.ask_file("save session")
    imgui.separator_text("Model")
    if imgui.button("Save medium into .glb ..."):
        desk.ask_file("save glb")
    wrapped("A copy of the model's file with this medium in its materials.", FAINT)
    import translucent as tl

    if hasattr(tl, "bake_thickness"):
        _bake(desk)


def _copy(desk: Desk, kind: str) -> None:
    """Copy how to make this picture without the window."""
    if (text := recipe(desk, kind)) is not None:
        imgui.set_clipboard_text(text)


def _bake(desk: Desk) -> None:
    imgui.separator_text("Bake thickness")
    modes, sizes, rays = ("cone", "normal", "transmittance", "inscribed"), (256, 512, 1024, 2048), (16, 64, 256)
    if begin_rows("bake"):
        for label, values in (("mode", modes), ("size", sizes), ("rays", rays)):
            row(label)
            if imgui.begin_combo(f"##bake{label}", str(desk.baking[label])):
                for value in values:
                    if imgui.selectable(str(value), value == desk.baking[label])[0]:
                        desk.baking[label] = value
                imgui.end_combo()
        imgui.end_table()
    task = desk.work.lanes["bake"].task
    if task is not None:
        imgui.progress_bar(task.share or 0.0)
        if imgui.button("Cancel"):
            task.cancel()
    elif imgui.button("Bake"):
        desk.work.start_bake(**desk.baking)
    if (bake := desk.work.bake) is not None:
        imgui.same_line()
        if imgui.button("Save map ..."):
            desk.ask_file("map")
        changed, shown = imgui.checkbox("show on the model", desk.work.show_bake)
        if changed:
            desk.work.show_bake = shown
        if begin_rows("baked"):
            fact("thickest", bake.thickest_text(desk.get("display.unit")))
            fact("covered", f"{bake.covered:.0%} of the texels")
            imgui.end_table()
