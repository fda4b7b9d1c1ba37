"""Files: the panel, our own file browser, and the use of chosen and dropped files."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from translucent.errors import InputError, TranslucentError
from translucent.gltf.load import SUFFIXES
from translucent.gltf.write import Filling, write_media
from translucent.planning.caustics import Caustics
from translucent.preview.actions import SetField
from translucent.preview.dialogs import QUESTIONS, Browser, chosen_path, with_recent
from translucent.preview.document import Model
from translucent.preview.exports import Recipe, command_line, python_code, write_picture, write_turntable
from translucent.preview.library import ENVIRONMENT_SUFFIXES
from translucent.preview.scenes import medium_of, method_of, scattering_of, tone_of
from translucent.preview.thumbnails import model_key
from translucent.preview.window_state import FAINT, WARNING, WindowState, begin_rows, em, fact, row, wrapped
from translucent.scene.scene import Scene

RECIPES = (
    ("Copy command", "command", "translucent render with options for this picture, its stage and caustics"),
    ("Copy Python", "python", "A script that makes this picture, with all that no option says"),
)


def files_panel(state: WindowState) -> None:
    """Draw the files panel: pictures and turntables, the session, export of the medium, and baking."""
    imgui.separator_text("Picture of this view")
    changed, value = imgui.checkbox("transparent background", state.export["transparent"])
    if changed:
        state.export["transparent"] = value
    for label, kind in (("PNG ...", "png"), ("EXR ...", "exr")):
        if imgui.button(label):
            state.ask_file(kind)
        imgui.same_line()
    if imgui.button("Turntable ..."):
        state.ask_file("turntable")
    for label, kind, tip in RECIPES:
        if imgui.button(label):
            _copy(state, kind)
        if imgui.is_item_hovered():
            imgui.set_tooltip(tip)
        imgui.same_line()
    imgui.new_line()
    imgui.separator_text("Session")
    if imgui.button("Open session ..."):
        state.ask_file("open session")
    imgui.same_line()
    if imgui.button("Save session ..."):
        state.ask_file("save session")
    imgui.separator_text("Model")
    if imgui.button("Save medium into .glb ..."):
        state.ask_file("save glb")
    wrapped("A copy of the model's file with this medium in its materials.", FAINT)
    import translucent as tl

    if hasattr(tl, "bake_thickness"):
        _bake(state)


def _copy(state: WindowState, kind: str) -> None:
    """Copy how to make this picture without the window."""
    if (text := recipe(state, kind)) is not None:
        imgui.set_clipboard_text(text)


def _bake(state: WindowState) -> None:
    imgui.separator_text("Bake thickness")
    modes, sizes, rays = ("cone", "normal", "transmittance", "inscribed"), (256, 512, 1024, 2048), (16, 64, 256)
    if begin_rows("bake"):
        for label, values in (("mode", modes), ("size", sizes), ("rays", rays)):
            row(label)
            if imgui.begin_combo(f"##bake{label}", str(state.baking[label])):
                for value in values:
                    if imgui.selectable(str(value), value == state.baking[label])[0]:
                        state.baking[label] = value
                imgui.end_combo()
        imgui.end_table()
    task = state.work.lanes["bake"].task
    if task is not None:
        imgui.progress_bar(task.share or 0.0)
        if imgui.button("Cancel"):
            task.cancel()
    elif imgui.button("Bake"):
        state.work.start_bake(**state.baking)
    if (bake := state.work.bake) is not None:
        imgui.same_line()
        if imgui.button("Save map ..."):
            state.ask_file("map")
        changed, shown = imgui.checkbox("show on the model", state.work.show_bake)
        if changed:
            state.work.show_bake = shown
        if begin_rows("baked"):
            fact("thickest", bake.thickest_text(state.get("display.unit")))
            fact("covered", f"{bake.covered:.0%} of the texels")
            imgui.end_table()


def take_answers(state: WindowState) -> None:
    """Handle dialogs that have been answered."""
    for entry in list(state.dialogs):
        path = chosen_path(entry[1])
        if path is None:
            continue
        state.dialogs.remove(entry)
        if path:
            use_file(state, entry[0], path)


def use_file(state: WindowState, kind: str, path: str) -> None:
    """Read or write a file, according to its dialog."""
    work = state.work
    state.folders = with_recent(state.folders, path)
    match kind:
        case "open":
            work.open(Model(path, state.get("model.unit")))
        case "open session":
            work.open_session(path)
        case "save session":
            work.save_session(path)
        case "environment" | "background":
            work.do(SetField(f"look.{kind}", path))
            state.environments.take(path)
        case "save glb":
            _save_medium(state, path)
        case "map":
            if work.bake is not None:
                work.write(path, work.bake.map.save)
        case "png" | "exr" | "turntable":
            _export(state, kind, path)
        case _:
            found = f"{kind!r} is nothing to read or write"
            work.refuse(InputError(f"file {path!r}", found, f"use {', '.join(QUESTIONS)}"))


def save_preset(state: WindowState, words: str) -> bool:
    """Save the material as an own preset; returns whether it is."""
    try:
        path, left_out = state.work.library.save(words, state.material)
    except TranslucentError as error:
        state.work.refuse(error)
        return False
    state.work.tell("info", f"saved {path}")
    if left_out:
        state.work.tell("warning", f"no preset keeps: {', '.join(left_out)}")
    return True


def _export(state: WindowState, kind: str, path: str) -> None:
    scene, document = state.work.picture(), state.work.document
    if scene is None:
        return
    method, size = method_of(document.display.method, document.material), state.view.viewport.size
    look = document.look.exposure, tone_of(document.look, scene)
    ways = scattering_of(document.display.scattering), caustics_of(state, scene)
    if kind == "turntable":
        state.work.export(path, write_turntable, scene, method, size, look, state.export["pictures"], *ways)
    else:
        state.work.export(path, write_picture, scene, method, size, look, state.export["transparent"], *ways)


def recipe(state: WindowState, kind: str) -> str | None:
    """Text of a command, or of ``python``, that makes the picture from here; None before there is one."""
    work = state.work
    if (scene := work.picture()) is None or work.loaded is None:
        return None
    if work.shown_bake is not None:
        work.refuse(InputError("a recipe", "the model is painted with a map", "clear 'show on the model' first"))
        return None
    shot = Recipe(work.document, work.loaded, scene, state.view.viewport.size, caustics_of(state, scene))
    if kind == "python":
        work.tell("info", "copied as Python")
        return python_code(shot)
    text, left_out = command_line(shot)
    if left_out:
        work.tell("warning", f"no option of the copied command says: {', '.join(left_out)}; Python does")
    else:
        work.tell("info", "copied as a command")
    return text


def caustics_of(state: WindowState, scene: Scene) -> Caustics | None:
    """Photons of a file: as many as the picture on show has, and what ``translucent render`` follows at least."""
    document = state.work.document
    if not document.display.caustics:
        return None
    light, method = state.view.photons.light, method_of(document.display.method, document.material)
    caustics = Caustics(max(light.photons if light is not None else 0, Caustics().photons))
    try:
        state.view.renderer.plan(scene, method, caustics=caustics)
    except InputError as error:
        state.work.tell("warning", f"without caustics: {error}")
        return None
    return caustics


def _save_medium(state: WindowState, path: str) -> None:
    """Write the model's file with the medium in its materials; other kinds of files have none to keep."""
    source, material = state.get("model.path"), state.work.document.material
    if Path(source).suffix.lower() not in SUFFIXES:
        do = "copy the medium as glTF, or export the model as .glb first"
        return state.work.refuse(InputError(f"saving into {path!r}", f"{Path(source).name} is no glTF file", do))
    outside, document = state.work.allow_outside, state.work.document
    named = [(state.objects[one.object].mesh.name, one.material) for one in document.assigned]
    whole = [] if named and material.source == "file" else [(None, material)]

    fillings = [Filling(medium_of(one), one.distance, name) for name, one in (*whole, *named)]
    return state.work.write(path, lambda to: write_media(source, to, fillings, allow_outside=outside))


def take_dropped(state: WindowState, paths: Sequence[str]) -> None:
    """Open the first session or model, light it with the first environment, and tell of the others."""
    lights = [path for path in paths if Path(path).suffix.lower() in ENVIRONMENT_SUFFIXES]
    models = [path for path in paths if path not in lights]
    if lights:
        state.environments.take(lights[0])
        state.light_with(lights[0])
    if models and Path(models[0]).suffix.lower() == ".toml":
        state.work.open_session(models[0])
    elif models:
        state.work.open(dataclasses.replace(state.work.document.model, path=models[0]))
    if others := [*models[1:], *lights[1:]]:
        names = ", ".join(Path(path).name for path in others[:3]) + (", ..." if len(others) > 3 else "")
        state.work.tell(
            "warning", f"{len(others)} dropped files are left out, as one model is shown at a time: {names}"
        )


#: Width of the column of folders, in ems.
PLACES = 11.0

POPUP = "##browser"


def file_browser(state: WindowState) -> None:
    """Draw the browser, if a question is asked."""
    browser = state.browser
    if browser is None:
        return
    if not imgui.is_popup_open(POPUP):
        imgui.open_popup(POPUP)
    room = imgui.get_io().display_size
    imgui.set_next_window_size(ImVec2(min(em(52.0), 0.9 * room.x), min(em(34.0), 0.85 * room.y)))
    imgui.set_next_window_pos(ImVec2(0.5 * room.x, 0.5 * room.y), imgui.Cond_.appearing, ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move
    imgui.push_style_color(imgui.Col_.popup_bg, imgui.ImVec4(0.16, 0.165, 0.175, 1.0))
    if imgui.begin_popup_modal(POPUP, None, flags)[0]:
        _content(state, browser)
        if state.browser is None:
            imgui.close_current_popup()
        imgui.end_popup()
    imgui.pop_style_color()


def _content(state: WindowState, browser: Browser) -> None:
    imgui.text(browser.title)
    if imgui.button("Up"):
        browser.enter("..")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    shown = state.texts.get("folder", str(browser.folder))
    entered, text = imgui.input_text("##folder", shown, imgui.InputTextFlags_.enter_returns_true)
    state.texts["folder"] = text
    if entered:
        browser.enter(text)
    if not imgui.is_item_active():
        state.texts.pop("folder", None)
    below = -2.0 * imgui.get_frame_height_with_spacing() - imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("##places", ImVec2(em(PLACES), below)):
        for folder in state.places():
            if imgui.selectable(f"{Path(folder).name or folder}##{folder}", folder == str(browser.folder))[0]:
                browser.enter(folder)
            if imgui.is_item_hovered():
                imgui.set_tooltip(folder)
    imgui.end_child()
    imgui.same_line()
    chosen = None
    if imgui.begin_child("##files", ImVec2(0.0, below), imgui.ChildFlags_.borders):
        chosen = _files(state, browser)
    imgui.end_child()
    wrapped(browser.problem or " ", WARNING)
    _, browser.every = imgui.checkbox("all files", browser.every)
    imgui.same_line()
    imgui.text_colored(FAINT, " ".join(browser.patterns))
    imgui.set_next_item_width(-em(11.0))
    flags = imgui.InputTextFlags_.enter_returns_true
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    entered, browser.text = imgui.input_text_with_hint("##name", "name or path of a file", browser.text, flags)
    imgui.same_line()
    if imgui.button(browser.button, ImVec2(em(5.0), 0.0)) or entered or chosen:
        accept_answer(state)
    imgui.same_line()
    if imgui.button("Cancel", ImVec2(em(5.0), 0.0)):
        state.browser = None


def _files(state: WindowState, browser: Browser) -> bool:
    """Draw the list; returns whether a file was double-clicked."""
    entries, chosen = browser.entries(), False
    if not entries:
        imgui.text_colored(FAINT, "nothing of these kinds is here")
    clipper = imgui.ListClipper()
    clipper.begin(len(entries))
    while clipper.step():
        for entry in entries[clipper.display_start : clipper.display_end]:
            label = f"{entry.name}/" if entry.is_folder else entry.name
            if imgui.selectable(label, entry.name == browser.text, imgui.SelectableFlags_.allow_double_click)[0]:
                if entry.is_folder:
                    browser.enter(entry.name)
                else:
                    browser.text = entry.name
                    chosen = imgui.is_mouse_double_clicked(0)
            if not entry.is_folder and imgui.is_item_hovered():
                _tell(state, browser.folder / entry.name)
    return chosen


def _tell(state: WindowState, path: Path) -> None:
    """Draw a tooltip with the picture that a model had when it was last open."""
    picture = state.work.thumbnails.picture(model_key(str(path)))
    if picture is not None and imgui.begin_tooltip():
        texture = state.texture(model_key(str(path)), picture)
        imgui.image(imgui.ImTextureRef(texture.glo), ImVec2(em(12.0), em(12.0) * texture.height / texture.width))
        imgui.end_tooltip()


def accept_answer(state: WindowState) -> None:
    """Use the file that the browser names, and close it; or tell why not."""
    browser = state.browser
    if browser is None:
        return
    path = browser.accept()
    if path is not None:
        state.browser = None
        use_file(state, browser.kind, path)
