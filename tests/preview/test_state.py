"""The previewer's state: documents, actions, undo, sessions, cameras. No window, no GPU."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.cli import main
from translucent.geometry import support
from translucent.geometry.solids import Box, Sphere
from translucent.planning.plan import plan
from translucent.preview import document as orbiting
from translucent.preview import scenes
from translucent.preview.actions import (
    MAX_STEPS,
    ChoosePreset,
    History,
    Open,
    OrbitBy,
    Pan,
    SetField,
    SetOrbit,
    Zoom,
    apply,
)
from translucent.preview.document import Document, Material, Model, Orbit
from translucent.preview.panels import material as numbers
from translucent.preview.quality import FrameBudget, StepTimes
from translucent.preview.scenes import Loaded, material_of, medium_of, request_of, scene_of
from translucent.preview.script import read_script
from translucent.preview.session import load_session, save_session
from translucent.preview.tasks import Task
from translucent.scene.showcase import framing, showcase

ORBIT = Orbit((0.1, 0.2, 0.3), 40.0, 20.0, 2.0)


def test_a_change_makes_a_new_document_and_leaves_the_old_one() -> None:
    before = Document()
    after = apply(before, SetField("material.roughness", 0.25))
    assert (before.material.roughness, after.material.roughness) == (0.0, 0.25)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("material.roughness", 1.5, "material.roughness = 1.5; the value is outside its range"),
        ("material.roughness", float("nan"), "the value must be a finite number"),
        ("material.color", [0.0, 0.5, 0.5], "the value is outside its range"),
        ("material.color", [0.5, 0.5], "the value must be three numbers"),
        ("material.distance", 0.0, "the value is outside its range"),
        ("material.distance", True, "the value has the wrong type"),
        ("display.method", "guess", "the value is not one of the allowed words"),
        ("material.rougness", 0.5, "this field does not exist, or cannot be changed"),
        ("history.past", (), "this field does not exist, or cannot be changed"),
    ],
)
def test_a_bad_value_is_refused(field: str, value: object, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        apply(Document(), SetField(field, value))


def test_a_drag_is_one_step_of_undo() -> None:
    history = History()
    for value in (0.1, 0.2, 0.3):
        history = history.done(SetField("material.roughness", value, drag=1))
    history = history.done(SetField("material.roughness", 0.9, drag=2))
    history = history.done(SetField("material.transmission", 0.4, drag=2))
    assert [step.material.roughness for step in history.past] == [0.0, 0.3, 0.9]
    back = history.undone().undone()
    assert back.present.material.roughness == 0.3
    assert back.redone().redone().present == history.present
    assert back.undone().undone().present == Document()


def test_a_drag_after_undo_is_a_step_of_its_own() -> None:
    history = History().done(SetField("material.roughness", 0.1, drag=1)).undone()
    history = history.done(SetField("material.roughness", 0.2, drag=1))
    assert len(history.past) == 1
    assert history.future == ()


def test_undo_leaves_the_camera_where_it_is() -> None:
    history = History(dataclasses.replace(Document(), orbit=ORBIT)).done(SetField("look.exposure", 1.0))
    turned = history.done(OrbitBy(30.0, 0.0))
    assert len(turned.past) == 1
    assert turned.undone().present.orbit == turned.present.orbit != ORBIT


def test_history_has_an_end() -> None:
    history = History()
    for i in range(MAX_STEPS + 20):
        history = history.done(SetField("look.exposure", float(i % 7)))
    assert len(history.past) == MAX_STEPS


def test_a_session_comes_back_to_the_last_digit(tmp_path: Path) -> None:
    drawn = random.Random(3)
    document = dataclasses.replace(apply(Document(), ChoosePreset("skim milk")), orbit=ORBIT)
    for name in ("material.distance", "material.roughness", "look.exposure", "orbit.yaw", "display.split"):
        document = apply(document, SetField(name, drawn.random()))
    document = apply(document, SetField("material.color", [drawn.random() for _ in range(3)]))
    save_session(tmp_path / "a.toml", document)
    assert load_session(tmp_path / "a.toml") == document


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "version None"),
        ("version = 1\n[material]\nrougness = 0.5", "the key 'rougness' is unknown"),
        ("version = 1\n[material]\nroughness = 7", "the value is outside its range"),
        ("version = 1\n[weather]\nrain = 1", ".weather. is unknown"),
        ("version = ", "the file is not valid TOML:"),
    ],
)
def test_what_is_no_session_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(tl.InputError, match=message):
        load_session(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[action]]\ndo = "trun"', "did you mean turn"),
        ('[[action]]\ndo = "turn"\nleft = 3', "the action turn has no parameter 'left'"),
        ('[[action]]\ndo = "open"', "the action open needs the parameter 'model'"),
        ('[[action]]\ndo = "turn"\nright = "far"', "give a value of type float"),
        ("action = 3", r"the file does not contain a list of \[\[action\]\]"),
    ],
)
def test_what_is_no_script_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(tl.InputError, match=message):
        read_script(tmp_path / "a.toml")


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[list[str]]:
    assert main(["extinction", *arguments]) == 0
    return [line.split() for line in capsys.readouterr().out.splitlines()[:4]]


def test_the_numbers_are_those_that_extinction_prints(capsys: pytest.CaptureFixture[str]) -> None:
    document = apply(Document(), SetField("material.color", numbers.from_display([0x7B / 255, 0x1E / 255, 0x3A / 255])))
    document = apply(document, SetField("material.distance", 0.01))
    merlot = apply(Document(), ChoosePreset("merlot"))
    for shown, arguments in ((document, ("#7b1e3a", "1cm")), (merlot, ("--preset", "merlot"))):
        lines = [f"{label} {text}".split() for label, text in numbers.extinction_lines(shown.material)]
        assert lines == printed(capsys, *arguments)


def test_color_fields_hold_eight_bits_and_are_never_black() -> None:
    color = numbers.from_display([0.0, 0.5, 1.0])
    assert color[0] == numbers.DARKEST
    assert numbers.from_display(numbers.to_display(color)) == color


def test_a_preset_is_the_medium_that_it_names() -> None:
    material = apply(Document(), ChoosePreset("Marble")).material
    assert medium_of(material) == tl.preset("marble").medium
    edited = apply(apply(Document(), ChoosePreset("Marble")), SetField("material.scattering", [0.0, 0.0, 0.0])).material
    assert (edited.source, edited.preset) == ("coefficients", "")


def test_sessions_with_the_former_switch_of_the_material_are_read(tmp_path: Path) -> None:
    """Light scattered many times is the planner's choice now, or `display.scattering`."""
    text = "version = 1\n[material]\nroughness = 0.5\nmultiple_scattering = true\n"
    (tmp_path / "a.toml").write_text(text)
    found = load_session(tmp_path / "a.toml")
    assert found == Document(material=Material(roughness=0.5))
    (tmp_path / "a.toml").write_text(text.replace("[material]", "[look]").replace("roughness", "exposure"))
    with pytest.raises(tl.InputError, match="the key 'multiple_scattering' is unknown"):
        load_session(tmp_path / "a.toml")


def test_the_way_of_scattering_is_one_of_those_of_the_planner() -> None:
    chosen = apply(Document(), SetField("display.scattering", "layer"))
    assert request_of(chosen).scattering == tl.ScatteringLayer()
    assert request_of(Document()).scattering is None
    with pytest.raises(tl.InputError, match="use auto, diffusion, layer, single"):
        apply(Document(), SetField("display.scattering", "many"))


def test_the_material_of_a_model_is_its_medium() -> None:
    mesh = tl.Mesh(np.eye(4, 3), [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    medium = tl.Medium(absorption=(3, 2, 1), scattering=(0.5, 0, 0), anisotropy=0.2, ior=1.3)
    material = material_of(showcase(mesh, medium, stage="none"))
    assert medium_of(material) == medium


def test_a_scene_brings_its_own_material_and_a_mesh_leaves_it() -> None:
    red = apply(Document(), SetField("material.color", [0.9, 0.1, 0.1]))
    assert apply(red, Open("other.ply")).material == red.material
    assert apply(red, Open("other.glb")).material == Material()


def test_the_model_is_framed_as_render_frames_it() -> None:
    scene = showcase(tl.load_mesh(Path(tl.__file__).parents[1] / "meshes" / "leaf.ply"), size=(320, 200), stage="none")
    found = orbiting.camera_of(orbiting.framed(None, scene.objects, (320, 200)))
    np.testing.assert_allclose(found.pose, framing(scene.objects, (320, 200)).pose, atol=1e-12)


def seen_at(orbit: Orbit, point: np.ndarray) -> np.ndarray:
    """Place of a point in the picture, in heights right and up of its center."""
    camera = orbiting.camera_of(orbit)
    local = (point - camera.eye) @ camera.pose[:3, :3]
    half = camera.half_extent((1, 1))[1]
    return local[:2] / (2 * half) / (-local[2] if camera.fov_y is not None else 1.0)


@pytest.mark.parametrize("orthographic", [False, True])
def test_zoom_keeps_what_is_under_the_cursor(orthographic: bool) -> None:
    orbit = dataclasses.replace(ORBIT, orthographic=orthographic)
    camera, height = orbiting.camera_of(orbit), orbiting.height_at_target(orbit)
    point = np.asarray(orbit.target) + height * (0.3 * camera.right - 0.2 * camera.up)
    np.testing.assert_allclose(seen_at(orbit, point), (0.3, -0.2), atol=1e-12)
    closer = apply(dataclasses.replace(Document(), orbit=orbit), Zoom(1.7, 0.3, 0.2)).orbit
    assert closer is not None
    assert closer.distance == pytest.approx(orbit.distance / 1.7)
    np.testing.assert_allclose(seen_at(closer, point), (0.3, -0.2), atol=1e-12)


def test_pan_moves_the_picture_with_the_mouse() -> None:
    moved = apply(dataclasses.replace(Document(), orbit=ORBIT), Pan(0.25, 0.1)).orbit
    assert moved is not None
    np.testing.assert_allclose(seen_at(moved, np.asarray(ORBIT.target)), (0.25, -0.1), atol=1e-12)


def test_orthographic_and_perspective_show_the_target_alike() -> None:
    document = dataclasses.replace(Document(), orbit=ORBIT)
    flat = apply(document, SetField("orbit.orthographic", True)).orbit
    assert flat is not None
    assert orbiting.camera_of(flat).height == pytest.approx(orbiting.height_at_target(ORBIT))


def test_a_camera_comes_back_from_its_orbit() -> None:
    camera = orbiting.camera_of(ORBIT)
    again = orbiting.camera_of(orbiting.orbit_of(camera, ORBIT.target))
    np.testing.assert_allclose(again.pose, camera.pose, atol=1e-12)


def test_nothing_moves_before_there_is_a_model() -> None:
    assert apply(Document(), OrbitBy(5.0, 5.0)) == Document()
    assert apply(Document(), SetOrbit(ORBIT)).orbit == ORBIT


def test_a_film_and_a_coat_reach_the_scene_and_come_back_from_it() -> None:
    loaded = Loaded(Model("box"), showcase(Box().tessellate(), stage="none"), Material())
    document = dataclasses.replace(Document(), orbit=ORBIT)
    values = {"iridescence": 1.0, "iridescence_thickness": 3e-7, "clearcoat": 0.5, "clearcoat_roughness": 0.2}
    for name, value in values.items():
        document = apply(document, SetField(f"material.{name}", value))
    scene = scene_of(document, loaded)
    surface = scene.objects[0].surface
    assert surface is not None
    assert {name: getattr(surface, name) for name in values} == values
    assert material_of(scene).surface_values == document.material.surface_values
    assert document.material.unsaid == ["iridescence", "clearcoat"]
    assert Material().unsaid == []


def test_what_nobody_has_timed_yet_is_drawn_coarsely_and_traced_rays_most_of_all() -> None:
    factors = {}
    for name, ior in (("clear", 1.0), ("glass", 1.5)):
        scene = showcase(Box().tessellate(), tl.Medium(5.0, ior=ior), stage="none")
        pace, found = StepTimes(), plan(scene)
        factors[name] = [pace.stride(found, 0.045)]
        for seconds, stride in ((0.200, 16), (0.020, 16), (0.003, 8), (0.003, 4)):  # the next ones are twice as fine
            pace.note(found, seconds, stride)
            factors[name].append(pace.stride(found, 0.045))
    assert factors == {"clear": [16, 16, 8, 4, 2], "glass": [16, 16, 8, 4, 2]}


def test_fewer_larger_steps_are_drawn_at_rest_where_small_ones_take_long_for_few_pixels() -> None:
    found, budget = plan(showcase(Box().tessellate(), tl.Medium(5.0, ior=1.5), stage="none")), 0.045
    for each, whole, stride in ((0.012, 0.9, 4), (0.012, 1.4, 8)):  # one of 4 x 4 takes 68, 100 ms
        pace = StepTimes()
        for factor in (16, 8):
            for late in (0.3, 0.0, 0.001):  # the first one compiles
                pace.note(found, each + whole / factor**2 + late, factor)
        assert pace.known(found, 4) == pytest.approx(each + whole / 16, rel=0.03)
        assert pace.stride(found, budget) == stride


@pytest.mark.parametrize(
    ("size", "pictured", "read"), [(1 << 19, True, "there"), (1 << 19, False, "here"), (9, True, "here")]
)
def test_another_process_reads_models_beside_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, pictured: bool, read: str
) -> None:
    path = tmp_path / "model.glb"
    path.write_bytes(bytes(size))
    empty = SimpleNamespace(objects=())
    monkeypatch.setattr(scenes, "load", lambda *_: SimpleNamespace(by="here", scene=empty))

    class Elsewhere:
        def call(self, *_: object, **__: object) -> tuple[SimpleNamespace, list[object]]:
            return SimpleNamespace(by="there", scene=empty), []

    task = Task("opening", lambda _: None, lambda _: None)
    found: Any = scenes.load_with(task, Elsewhere(), Model(str(path)), pictured=pictured)  # type: ignore[arg-type]
    assert found.by == read


def test_what_takes_long_of_an_opened_model_is_there_before_it_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> None:
        raise AssertionError("the window would stand still")

    ball = Sphere().tessellate(200)
    opened = SimpleNamespace(scene=SimpleNamespace(objects=[tl.Object(ball)]))
    monkeypatch.setattr(scenes, "load", lambda *_: opened)
    scenes.load_with(Task("opening", lambda _: None, lambda _: None), None, Model("ball"))  # type: ignore[arg-type]
    monkeypatch.setattr(support, "_Clusters", late)
    monkeypatch.setattr(tl.Mesh, "_used", property(late))
    turned = tl.Object(ball, transform=np.diag([2.0, 2.0, 2.0, 1.0]))
    assert (support.Support(ball, turned.matrix).many, turned.radius) == (True, pytest.approx(2.0))


def test_drawing_has_less_time_where_the_rest_of_the_window_takes_long() -> None:
    now = [0.0]
    budget = FrameBudget(lambda: now[0])
    assert budget.begin(0.045) == 0.045  # nothing is known
    for rest, left in ((0.5, 0.015), (0.025, 0.030), (0.004, 0.045), (0.025, 0.045)):  # the quickest one lately counts
        budget.end(more=True)
        now[0] += rest
        assert budget.begin(0.045) == pytest.approx(left)
    other = FrameBudget(lambda: now[0])
    other.end(more=False)
    now[0] += 0.5  # asleep
    assert other.begin(0.045) == 0.045
