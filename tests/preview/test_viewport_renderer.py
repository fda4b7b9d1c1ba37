"""Drawing of the viewport, without a window: the same pictures and numbers as render, and nothing that ends it."""

from __future__ import annotations

import runpy
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from tests.processes import PATIENCE
from translucent import assets as data
from translucent.diffusion import irradiance_maps
from translucent.geometry.solids import Sphere
from translucent.planning.plan import plan as plan_of
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import Treatment
from translucent.preview import quality, viewport_renderer
from translucent.preview.actions import ChoosePreset, OrbitBy, SetField
from translucent.preview.document import Model
from translucent.preview.measuring import crossing
from translucent.preview.quality import SMALL, StepTimes
from translucent.preview.tasks import Task
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace

GLASS = tl.Medium(ior=1.5)


@pytest.fixture
def view(quick_pictures: None) -> Iterator[ViewportRenderer]:
    made = ViewportRenderer()
    yield made
    made.close()


@pytest.fixture
def solved_here(work: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """Light is solved for in the thread that else waits for a worker process, which takes a second to start."""
    monkeypatch.setattr(work.pool, "call", lambda task, solve, *given, urgency: solve(*given))


@pytest.mark.parametrize("budget", [1e9, 0.0])
def test_the_picture_is_the_one_that_render_makes(view: ViewportRenderer, work: Workspace, budget: float) -> None:
    """At once, and from the smallest steps: these differ by float32 rounding at silhouettes only."""
    view.budget = budget
    finish(view, work)
    work.do(OrbitBy(20.0, 10.0))  # by now the stage knows what a step takes
    finish(view, work)
    scene = work.scene()
    assert scene is not None
    with view.current():
        frame = view.renderer.render(scene, SIZE)
    different = np.abs(pixels(view) - frame.to_srgb8()).max(axis=2) > 1
    assert different.mean() < 2e-3
    y, x = np.argwhere(frame.coverage)[frame.coverage.sum() // 2]
    probe = view.probe(int(x), int(y))
    assert probe is not None
    assert probe.thickness == pytest.approx(frame.thickness[y, x], rel=1e-5)
    assert (probe.covered, probe.valid) == (True, True)
    found = crossing(scene, SIZE, (int(x), int(y)))
    assert found.thickness == pytest.approx(frame.thickness[y, x], rel=1e-4)
    assert found.layers % 2 == 0
    assert found.body == 0


@pytest.mark.parametrize("slow", [False, True])
def test_slow_traced_interfaces_wait_until_the_view_is_still(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch, slow: bool
) -> None:
    work.do(SetField("material.ior", 1.5))
    finish(view, work)
    assert view.plans[0] is not None
    usual = view.plans[0].interfaces
    assert usual == tl.TracedInterfaces(depth=24)
    view.budget = 0.0 if slow else 1e9
    monkeypatch.setattr(StepTimes, "stride", lambda *_: 4 if slow else 1)  # not 256 steps for a picture
    drawn: list[RenderPlan] = []
    draw = view.renderer.draw_requested

    def spied(*given: Any, **options: Any) -> RenderPlan:
        drawn.append(draw(*given, **options))
        return drawn[-1]

    monkeypatch.setattr(view.renderer, "draw_requested", spied)
    for _ in range(2):
        work.do(OrbitBy(20.0, 10.0))
        assert view.draw(work, SIZE)
        assert ("Approximate reflections while the view moves" in view.simpler) is slow
    assert [plan.interfaces for plan in drawn] == 2 * [tl.ScreenInterfaces() if slow else usual]
    finish(view, work)
    assert (view.simpler, view.plans[0].interfaces) == ("", usual)
    scene = work.scene()
    assert scene is not None
    with view.current():
        frame = view.renderer.render(scene, SIZE)
    assert np.abs(pixels(view) - frame.to_srgb8().astype(int)).mean() < 1.0


def test_samples_wait_for_an_environment_that_is_being_read(view: ViewportRenderer, work: Workspace) -> None:
    """All pixels of the last picture are drawn, once, and smoothed when it is known to stay."""
    view.budget = 1e9
    work.do(SetField("display.antialias", True))
    finish(view, work)
    assert view.viewport.steps(0) > 1
    reads = threading.Event()
    work.lanes["light"].start("reading the environment", lambda _: reads.wait(PATIENCE), lambda _: None)
    view.viewport.restart()
    for _ in range(4):
        assert view.draw(work, SIZE)
    assert view.viewport.steps(0) == 1
    reads.set()
    finish(view, work)
    assert view.viewport.steps(0) > 1


def test_light_diffuses_as_soon_as_it_is_solved_for(view: ViewportRenderer, work: Workspace) -> None:
    """Until then, and in every picture for which it is not known, bodies are layers; a camera may move."""
    view.preparing = 1e9  # what is solved for in a frame is drawn in it
    work.do(ChoosePreset("whole_milk"))
    assert view.draw(work, SIZE)
    assert "Softening light in the " in view.quality.notes[1]
    assert view.plans[0] is not None
    assert view.plans[0].treated(Treatment.LAYER) == (0,)
    finish(view, work)
    assert view.quality.notes[1] == ""
    assert view.plans[0].treated(Treatment.DIFFUSION) == (0,)
    scene = work.scene()
    assert scene is not None
    with view.current():
        frame = view.renderer.render(scene, SIZE)
    assert np.abs(pixels(view) - frame.to_srgb8().astype(int)).mean() < 1.0
    work.do(SetField("look.light", True))
    finish(view, work)
    for action, told in ((OrbitBy(20.0, 10.0), ""), (SetField("look.light_yaw", 3.0), "rough preview")):
        work.do(action)
        view.draw(work, SIZE)
        assert (told in view.quality.notes[1]) if told else not view.quality.notes[1]
        assert view.plans[0].diffusion == (SMALL if told else tl.Diffusion())
        assert work.lanes["diffuse"].task is None  # while the light moves, nothing is looked for that nobody will see
    finish(view, work)
    assert view.plans[0].diffusion == tl.Diffusion()
    work.do(SetField("display.scattering", "single"))
    finish(view, work)
    assert not view.plans[0].diffuses


@pytest.mark.usefixtures("solved_here")
def test_light_on_objects_in_glass_is_solved_for_aside(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until then, and while a light moves, it comes straight."""
    monkeypatch.setattr(irradiance_maps, "SAMPLES", 64)
    glass, inner = (tl.Object(Sphere(radius=r).tessellate(8), medium) for r, medium in ((1.0, GLASS), (0.5, None)))
    camera, suns = tl.Camera.look_at((0, 2, 5), (0, 0, 0)), [tl.DirectionalLight((x, -1, -1), 2.0) for x in (0.0, 1.0)]
    scenes = [tl.Scene([glass, inner], camera, [sun], tl.Environment.constant("#808080")) for sun in suns]
    monkeypatch.setattr(work, "scene", lambda: scenes[0])
    diffusion, told = view.renderer.gpu.diffusion, "Light on objects in glass: first guess"
    assert view.draw(work, SIZE)
    assert (view.quality.notes[1], diffusion.of(plan_of(scenes[0]))) == (told, None)
    finish(view, work)
    assert view.quality.notes[1] == ""
    light = diffusion.of(plan_of(scenes[0]))
    assert light is not None
    assert set(light.fields.maps) == {1}
    with view.current():
        frame = view.renderer.render(scenes[0], SIZE)
    assert np.abs(pixels(view) - frame.to_srgb8().astype(int)).max() <= 1
    scenes.reverse()
    view.draw(work, SIZE)
    assert (view.quality.notes[1], work.lanes["diffuse"].task) == (told, None)


@pytest.mark.usefixtures("solved_here")
def test_light_that_takes_long_to_solve_for_is_drawn_in_the_next_frame(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Solve in one frame and draw that light in the next, though another is wanted by then: what moves is drawn."""
    work.do(ChoosePreset("whole_milk"))
    work.do(SetField("look.light", True))
    finish(view, work)
    view.preparing = 0.0
    monkeypatch.setattr(quality, "LONGEST", 1e9)
    drawn: list[tl.Scene] = []
    draw = view.renderer.draw_requested
    monkeypatch.setattr(
        view.renderer, "draw_requested", lambda scene, *a, **k: (drawn.append(scene), draw(scene, *a, **k))[1]
    )
    scenes = []
    for yaw in range(1, 7):
        work.do(SetField("look.light_yaw", float(yaw)))
        scenes.append(work.scene())
        assert view.draw(work, SIZE)
    assert [id(scene) for scene in drawn] == [id(scene) for scene in scenes[::2]]
    assert work.lanes["diffuse"].task is None
    finish(view, work)
    assert view.quality.notes[1] == ""


def test_a_picture_that_takes_long_to_be_shown_has_frames_for_that(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    view.budget = 0.0
    monkeypatch.setattr(
        StepTimes, "stride", lambda *_: 4
    )  # steps of 4 x 4: in fewer frames than the 16 x 16 of that budget
    work.do(SetField("display.antialias", False))
    finish(view, work)
    whole = pixels(view)
    monkeypatch.setattr(viewport_renderer, "QUICK", 0.0)
    monkeypatch.setattr(viewport_renderer, "APART", 0.0)
    frame: list[str] = []
    for name in ("step", "present"):
        done = getattr(view.viewport, name)
        monkeypatch.setattr(
            view.viewport, name, lambda *a, done=done, name=name, **k: (frame.append(name), done(*a, **k))
        )
    work.do(OrbitBy(20.0, 10.0))
    frames = []
    while view.draw(work, SIZE):
        frames.append(tuple(frame))
        frame.clear()
    assert frames[1] == ("step", "present")  # the first that is sharper than what moved
    assert set(frames[2:]) == {("step",), ("present",)}
    work.do(OrbitBy(-20.0, -10.0))
    finish(view, work)
    assert (pixels(view) != whole).mean() < 1e-3  # the last step is shown, too


def test_light_that_cannot_be_solved_for_is_told_once(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise tl.RenderError("diffusion in a body", "the solver is not there", "render layers")

    monkeypatch.setattr(view.renderer.gpu.diffusion, "solve", fail)
    work.do(ChoosePreset("whole_milk"))
    finish(view, work)
    assert "has failed: first guess" in view.quality.notes[1]
    assert [message.kind for message in work.messages] == ["error"]
    assert view.plans[0] is not None
    assert view.plans[0].treated(Treatment.LAYER) == (0,)


def test_smooth_edges_are_those_of_many_samples(view: ViewportRenderer, work: Workspace) -> None:
    work.do(SetField("display.antialias", True))
    finish(view, work)
    scene = work.scene()
    assert scene is not None
    with view.current():
        frames = [view.renderer.render(scene, SIZE, samples=n) for n in (64, 1)]
    smooth, sharp = (frame.to_srgb8().astype(int) for frame in frames)
    shown = pixels(view)
    assert np.abs(shown - smooth).mean() < 0.5 * np.abs(sharp - smooth).mean()


def test_a_split_shows_another_method_and_then_the_reference(view: ViewportRenderer, work: Workspace) -> None:
    view.budget = 1e9  # both sides take steps of one size
    work.do(SetField("display.mode", "thickness"))
    work.do(SetField("display.compare", "method"))
    finish(view, work)
    scene = work.scene()
    assert scene is not None
    left, right = (view.viewport.steps(side) for side in (0, 1))
    assert left == right > 0
    sheet = view.probe(SIZE[0] // 2, SIZE[1] // 2, 1)
    solid = view.probe(SIZE[0] // 2, SIZE[1] // 2, 0)
    assert sheet is not None
    assert solid is not None
    assert sheet.thickness != solid.thickness
    work.do(SetField("display.compare", "reference"))
    work.draw_reference(scene, None, SIZE, (1,))
    wait(work, lambda: work.truth is not None and work.lanes["truth"].task is None)
    finish(view, work)
    assert view.presenter.truth is not None
    truth = view.probe(SIZE[0] // 2, SIZE[1] // 2, 1)
    assert truth is not None
    assert truth.thickness == pytest.approx(solid.thickness, rel=1e-4, abs=1e-9)


def test_a_shader_that_does_not_compile_leaves_the_last_good_one(
    view: ViewportRenderer, work: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish(view, work)
    before = pixels(view)
    shutil.copytree(data._folder("shaders"), tmp_path / "shaders")
    monkeypatch.setattr(data, "_folder", lambda kind: tmp_path / kind)
    broken = tmp_path / "shaders" / "thickness" / "signed_depth.frag"
    good = broken.read_text()
    broken.write_text(good + "\nvoid broken( {\n")
    view.reload(work)
    assert "shaders/thickness/signed_depth.frag:" in view.shader_problem
    work.do(OrbitBy(1.0, 0.0))
    work.do(OrbitBy(-1.0, 0.0))
    finish(view, work)
    assert view.problem == ""
    assert (np.abs(pixels(view) - before).max(axis=2) > 1).mean() < 2e-3
    broken.write_text(good)
    view.reload(work)
    assert view.shader_problem == ""
    finish(view, work)
    assert (np.abs(pixels(view) - before).max(axis=2) > 1).mean() < 2e-3


def test_a_picture_that_is_too_large_is_told_and_the_stage_goes_on(view: ViewportRenderer, work: Workspace) -> None:
    finish(view, work)
    assert not view.draw(work, (1 << 20, 8))
    assert "this OpenGL allows at most" in view.problem
    finish(view, work)
    assert view.problem == ""


@pytest.mark.parametrize("content", [b"", b"glTF\x02\x00\x00\x00\xff\x00\x00\x00", None])
def test_a_file_that_is_no_model_is_told_and_changes_nothing(
    work: Workspace, tmp_path: Path, content: bytes | None
) -> None:
    before = work.document
    if content is not None:
        (tmp_path / "bad.glb").write_bytes(content)
    work.open(Model(str(tmp_path / "bad.glb")))
    wait(work, lambda: work.lanes["load"].task is None)
    assert work.document == before
    assert "bad.glb" in work.messages[-1].text
    assert work.messages[-1].kind == "error"


def test_undo_brings_the_last_model_back(work: Workspace) -> None:
    work.open(Model("soap"))
    wait(work, lambda: work.loaded is not None and work.loaded.model.path == "soap")
    work.undo()
    wait(work, lambda: work.loaded is not None and work.loaded.model.path == "sphere")
    assert work.scene() is not None


def test_the_error_is_measured(work: Workspace) -> None:
    scene = work.scene()
    assert scene is not None
    work.measure(scene, None, SIZE)
    wait(work, lambda: work.lanes["draw"].task is None)
    found = work.measured
    assert found is not None
    assert found.scene is scene
    thickness, transmittance = found.errors
    # Signed depth is exact up to float32 in units of the diagonal.
    assert thickness.median < 1e-6 * scene.diagonal
    assert transmittance.median < 1e-5
    assert found.seen.pixels == found.seen.thickness.size > 100


def test_a_cancelled_task_hands_nothing_over(work: Workspace) -> None:
    taken: list[object] = []

    def slow(task: Task) -> str:
        for i in range(1000):
            task.report(i / 1000)
            time.sleep(0.01)
        return "done"

    task = work.lanes["truth"].start("slow", slow, taken.append)
    wait(work, lambda: task.share)
    task.cancel()
    wait(work, lambda: task.finished)
    work.update()
    assert not taken
    assert not work.busy


def test_a_defect_in_a_task_is_a_message(work: Workspace) -> None:
    work.lanes["truth"].start("faulty", lambda _: 1 / 0, lambda _: None)
    wait(work, lambda: work.lanes["truth"].task is None)
    assert "unexpected ZeroDivisionError" in work.messages[-1].text


def test_random_actions() -> None:
    tool = Path(tl.__file__).parents[1] / "tools" / "preview_monkey.py"
    with np.errstate(all="warn"):
        told = runpy.run_path(str(tool))["play"](12, 11)
    assert told["actions"] == 12
