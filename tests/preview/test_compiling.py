"""Another process compiles the shaders that the window needs, while it shows the last picture."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, finish, pixels, wait
from tests.processes import PATIENCE, until
from translucent import assets as data
from translucent.geometry import normals
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import corner_normals, drawn_normals, has_drawn_normals, made_normals
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.hierarchies import has_packed
from translucent.gpu.shaders import CompileBudget, PostponedError, ProgramName
from translucent.gpu.viewport import Viewport
from translucent.planning.passes import PassName
from translucent.preview import preparation
from translucent.preview.actions import ChoosePreset, SetField
from translucent.preview.preparation import Compiled, Compiler, stand_in
from translucent.preview.tasks import Task
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.worker import Pool
from translucent.preview.workspace import Workspace
from translucent.scene.showcase import showcase
from translucent.scene.texture import Texture

LEAF = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
BALL = Sphere(radius=0.02).tessellate(24)
GLASS = tl.Medium.from_color((0.2, 0.6, 0.3), 0.01, ior=1.5)
MILK = tl.Medium(absorption=1.0, scattering=(30.0, 40.0, 50.0), ior=1.35)
METHODS = (
    tl.SignedDepth(),
    tl.BackFaceDepth(),
    tl.ThinLayer(1e-3),
    tl.DepthPeeling(),
    tl.FragmentLists(),
    tl.KBuffer(4),
)


@pytest.fixture
def view(work: Workspace, quick_pictures: None) -> Iterator[ViewportRenderer]:
    made = ViewportRenderer(compiler=work.compiler)
    yield made
    made.close()


@pytest.fixture
def near(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Work of another process, done in this one, once the event is set."""
    go = threading.Event()

    def call(_: Pool, task: Any, work: Callable[..., Any], *arguments: Any, **_urgency: Any) -> Any:
        go.wait(PATIENCE)
        return work(*arguments)

    monkeypatch.setattr(Pool, "call", call)
    preparation._engine.cache_clear()
    return go


def drawn_alone(work: Workspace) -> np.ndarray:
    """The picture of a viewport renderer that compiles all by itself."""
    alone = ViewportRenderer()
    try:
        finish(alone, work)
        return pixels(alone)
    finally:
        alone.close()


def sky() -> tl.Environment:
    return tl.Environment.image(np.full((50, 100, 3), 0.5))


def scenes() -> dict[str, tl.Scene]:
    ball, lamp = showcase(BALL, stage="none"), tl.DirectionalLight((0.0, -1.0, -1.0), 3.0)
    uv = Mesh(BALL.vertices, BALL.faces, uv=BALL.vertices[:, :2])
    checks = Texture(np.indices((128, 128)).sum(axis=0)[..., None] % 2 * np.ones(3))
    painted = tl.Surface(roughness=0.3, color_texture=checks, normal_texture=Texture(np.full((50, 30, 3), 0.5)))
    floor = tl.Object(Box((-0.1, -0.03, -0.1), (0.1, -0.025, 0.1)).tessellate())
    grown = tl.LinearDensity(1, 0.5, 1.5)
    return {
        "ball": ball,
        "knot": showcase(tl.load_mesh(data.mesh_path("knot")), stage="none"),
        "glass": showcase(BALL, GLASS, stage="none"),
        "milk": showcase(BALL, MILK, environment=sky(), lights=[lamp]),
        "lamp": showcase(BALL, MILK, lights=[tl.PointLight((0.0, 0.05, 0.0), (1.0, 1.0, 1.0))]),
        "painted": tl.Scene([tl.Object(uv, GLASS, surface=painted)], ball.camera),
        "two": tl.Scene([tl.Object(BALL, GLASS), tl.Object(BALL, MILK, np.diag([0.5, 0.5, 0.5, 1.0]))], ball.camera),
        "union": tl.Scene([tl.Object(BALL, tl.Medium(a)) for a in (1.0, 2.0)], ball.camera, overlap="union"),
        "floor": tl.Scene([*ball.objects, floor], ball.camera, [lamp], sky()),
        "glow": showcase(BALL, tl.Medium(absorption=(1.0, 2.0, 3.0), emission=1.0), stage="none"),
        "grown": tl.Scene([tl.Object(BALL, tl.Medium(5.0), density=grown)], ball.camera),
        "leaf": tl.Scene([tl.Object(LEAF, GLASS, sheet_thickness=1e-3)], ball.camera),
    }


def needed(*plans: tl.RenderPlan) -> list[set[ProgramName]]:
    """Programs that a new renderer has made, after each of some plans that it draws."""
    found = []
    with tl.Renderer() as renderer:
        gl = renderer.gpu.context.gl
        gl.extra = budget = CompileBudget()
        with renderer.gpu.context.current():
            for plan in plans:
                renderer.gpu.draw(plan, gl.simple_framebuffer(SIZE), 0.0, "none")
                found.append(set(budget.needed))
    return found


#: Each method with three of the scenes, and all with those that have the most features.
DRAWN_BY = {name: METHODS if name in ("painted", "floor") else METHODS[i % 3 :: 3] for i, name in enumerate(scenes())}


@pytest.mark.parametrize("name", DRAWN_BY)
def test_what_stands_in_for_a_scene_is_drawn_with_its_programs(name: str, coarse_light: None) -> None:
    scene = scenes()[name]
    with tl.Renderer() as renderer:
        for method in (None, *DRAWN_BY[name]):
            try:
                plan = renderer.plan(scene, method)
            except tl.InputError:
                continue
            # Cells take time, and are those of all methods: the picture in full is drawn by the planner's own alone.
            quick = preparation._quick(plan)
            own = plan if method is None else replace(quick, scene=plan.scene)
            before, after = needed(quick, own)
            assert after == before, method


def test_a_frame_that_has_made_enough_draws_nothing() -> None:
    budget = CompileBudget(postpones=True)
    budget.begin_frame(-1.0)
    budget.leave_room()  # there was nothing to make
    budget.enter(None)
    with pytest.raises(PostponedError):
        budget.leave_room()
    budget.begin_frame(60.0)
    budget.enter(None)
    budget.leave_room()


def test_programs_are_compiled_elsewhere_for_each_kind_of_texture() -> None:
    """Drivers compile a program once more for textures whose sides are powers of two, as those of bakes are."""

    def painted(side: int) -> tl.Scene:
        plain = Sphere(radius=0.02).tessellate(8)
        ball = Mesh(plain.vertices, plain.faces, np.zeros((len(plain.vertices), 2)))
        surface = tl.Surface(color_texture=Texture(np.ones((side, side, 3), np.float32)))
        return tl.Scene([tl.Object(ball, GLASS, surface=surface)], showcase(ball).camera)

    with tl.Renderer() as renderer:
        gl = renderer.gpu.context.gl
        gl.extra = budget = CompileBudget()

        def draw(side: int) -> None:
            scene = painted(side)
            plan = renderer.plan(scene, interfaces=tl.ScreenInterfaces())
            budget.begin_frame(60.0)
            renderer.gpu.draw(plan, gl.simple_framebuffer(SIZE), 0.0, "none")

        with renderer.gpu.context.current():
            draw(60)
            budget.postpones, budget.elsewhere = True, set(budget.needed)
            draw(100)
            with pytest.raises(PostponedError) as postponed:
                draw(64)
            assert postponed.value.program is not None


def test_what_adds_samples_is_made_in_frames_of_its_own() -> None:
    """Large textures, which drivers clear, and two programs to a driver: what stores the first sample of a pixel, and
    what blends others with it.
    """
    scene, steps = showcase(Sphere().tessellate(8)), list[bool]()
    with tl.Renderer() as renderer, renderer.gpu.context.current():
        renderer.gpu.context.gl.extra = budget = CompileBudget()
        viewport, plan = Viewport(renderer.gpu), renderer.plan(scene)
        viewport.resize(SIZE)
        budget.begin_frame(60.0)
        for _ in range(2):
            viewport.step(0, plan, 1)
        wanted = viewport.mean_radiance()
        viewport.restart()
        viewport._added.clear()  # all else is there
        viewport._sides[0] = None
        budget.postpones = True
        for _ in range(5):
            budget.begin_frame(-1.0)
            before = viewport.steps(0)
            with suppress(PostponedError):
                viewport.step(0, plan, 1)
            steps.append(viewport.steps(0) > before)
        assert viewport.mean_radiance() == pytest.approx(wanted, rel=1e-6)
        viewport.release()
    assert steps == [False, False, True, False, True]


def test_normals_of_a_large_mesh_come_from_another_process(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preparation, "SMOOTHED_AT_ONCE", 100)
    finish(view, work)
    assert work.loaded is not None
    mesh = work.loaded.scene.objects[0].mesh
    assert not has_drawn_normals(mesh)
    wait(work, lambda: work.compiler.lane.task is None)
    here: list[object] = []
    fill = normals._fill
    monkeypatch.setattr(normals, "_fill", lambda *given: (here.append(given), fill(*given)))
    work.do(ChoosePreset("merlot"))
    finish(view, work)
    assert view.problem == ""
    assert not [given for given in here if len(given[2]) == len(mesh.faces)]
    np.testing.assert_array_equal(drawn_normals(mesh), corner_normals(mesh).astype(np.float32))


def test_another_process_tells_what_it_has_compiled(work: Workspace) -> None:
    scene, compiler, found = stand_in(showcase(BALL, stage="none")), Compiler(work.pool), list[Compiled]()
    with tl.Renderer() as renderer:
        plans = [renderer.plan(scene), renderer.plan(scene, tl.DepthPeeling())]
        compiler.device = renderer.gpu.context.renderer
    compiler.request("", plans, found.append)
    until(lambda: compiler.lane.poll(pytest.fail) or found)
    compiler.lane.close()
    assert found == [Compiled(frozenset().union(*(needed(plan)[0] for plan in plans)))]


def test_another_device_is_of_no_use(work: Workspace, near: threading.Event) -> None:
    near.set()
    compiler, found = Compiler(work.pool), list[Compiled]()
    compiler.device = "a card from the future"
    compiler.request("", [], found.append)
    until(lambda: compiler.lane.poll(pytest.fail) or found)
    compiler.lane.close()
    assert found[0].programs is None
    assert "but the window uses a card from the future" in found[0].problem


def test_what_looks_like_the_material_is_on_show_until_its_picture_is_compiled(
    view: ViewportRenderer, work: Workspace, near: threading.Event
) -> None:
    """It needs no program that is not compiled yet, and what is around the body stays as it was."""
    near.set()
    finish(view, work)
    wait(work, lambda: work.compiler.budget.postpones and work.compiler.lane.task is None)
    near.clear()
    before = pixels(view)
    work.do(ChoosePreset("whole_milk"))
    for _ in range(3):
        assert view.draw(work, SIZE)
        work.update()
    assert "preparing the picture" in [task.name for task in work.busy]
    assert view.state == "preparing the new picture; a simple preview is visible"
    stood = pixels(view)
    np.testing.assert_array_equal(stood[:, :8], before[:, :8])
    assert view.draw(work, (2 * SIZE[0], 2 * SIZE[1]))  # larger now, and still a stand-in
    assert np.abs(pixels(view)[::2, ::2] - stood).mean() < 3.0
    view.draw(work, SIZE)
    near.set()
    finish(view, work)
    assert view.problem == ""
    # Without antialiasing, a ray that grazes an edge is the whole pixel: it may go either way in another context.
    differs = (np.abs(pixels(view).astype(int) - drawn_alone(work).astype(int)) > 1).any(axis=-1)
    assert differs.sum() <= 2
    found = pixels(view)
    assert np.abs(stood - found).mean() < 0.25 * np.abs(before - found).mean()


def test_a_frame_that_takes_too_long_goes_on_in_the_next_one(
    view: ViewportRenderer, work: Workspace, near: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    near.set()
    finish(view, work)
    wait(work, lambda: work.compiler.budget.postpones and work.compiler.lane.task is None)
    view.budget = 0.0
    made: list[bool] = []
    draw = view._draw

    def count(*arguments: Any) -> bool:
        try:
            return draw(*arguments)
        except PostponedError as error:
            made.append(error.program is None)
            raise

    monkeypatch.setattr(view, "_draw", count)
    work.do(ChoosePreset("whole_milk"))
    work.do(SetField("look.light", True))
    finish(view, work)
    assert view.problem == ""
    assert sum(made) > 5
    np.testing.assert_allclose(pixels(view), drawn_alone(work), atol=1)


def test_who_does_not_wait_has_the_window_compile(
    view: ViewportRenderer, work: Workspace, near: threading.Event
) -> None:
    near.set()
    finish(view, work)
    wait(work, lambda: work.compiler.budget.postpones and work.compiler.lane.task is None)
    near.clear()
    work.do(ChoosePreset("whole_milk"))
    assert view.draw(work, SIZE)
    for _ in range(60):
        for task in work.busy:
            task.cancel()
        near.set()
        wait(work, lambda: work.compiler.lane.task is None)
        near.clear()
        if view.draw(work, SIZE) and view.viewport.steps(0):
            break
    else:
        pytest.fail("it waits for ever")
    near.set()


def test_a_request_that_cannot_be_made_is_told_once(
    view: ViewportRenderer, work: Workspace, near: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    near.set()
    finish(view, work)

    def fails(_: tl.Scene) -> tl.Scene:
        raise MemoryError

    monkeypatch.setattr(preparation, "stand_in", fails)
    work.do(ChoosePreset("whole_milk"))
    finish(view, work)
    assert view.problem == ""
    assert [m.text for m in work.messages if "in the window" in m.text]


def test_normals_that_two_lanes_ask_for_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, asked, may_end = Sphere().tessellate(8), list[object](), threading.Event()

    class Slow:
        """A pool that makes normals when it may."""

        def call(self, task: Task, work: object, mesh: Mesh, **_: object) -> np.ndarray:
            asked.append(work)
            may_end.wait(PATIENCE)
            return np.zeros((*mesh.faces.shape, 3), np.float32)

    monkeypatch.setattr(preparation, "PATIENCE", 0.001)
    pool: Any = Slow()
    tasks = [Task("", lambda task: preparation.make_normals(task, pool, mesh), print) for _ in range(3)]
    threads = [threading.Thread(target=task.run) for task in tasks]
    for thread in threads:
        thread.start()
    tasks[2].cancel()
    may_end.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert asked == [made_normals]
    assert has_drawn_normals(mesh)
    assert [task.error for task in tasks] == [None] * 3


def test_interfaces_are_those_of_the_screen_until_another_process_has_the_hierarchy(
    view: ViewportRenderer, work: Workspace, near: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preparation, "PACKED_AT_ONCE", 10)
    near.set()
    finish(view, work)
    wait(work, lambda: work.compiler.budget.postpones and work.compiler.lane.task is None)
    near.clear()
    assert work.loaded is not None
    mesh = work.loaded.scene.objects[0].mesh
    work.do(ChoosePreset("merlot"))
    view.draw(work, SIZE)
    assert "The mesh is being prepared for ray tracing" in view.quality.notes[0]
    assert isinstance(view.quality.request.interfaces, tl.ScreenInterfaces)
    assert not has_packed(mesh)
    near.set()
    finish(view, work)
    assert (view.quality.notes[0], view.quality.request.interfaces) == ("", None)
    assert has_packed(mesh)
    assert view.plans[0] is not None
    assert view.plans[0].has(PassName.TRACED)
    differs = (np.abs(pixels(view).astype(int) - drawn_alone(work).astype(int)) > 1).any(axis=-1)
    assert differs.sum() <= 2


def test_nobody_waits_for_what_is_known(view: ViewportRenderer, work: Workspace, near: threading.Event) -> None:
    near.set()
    work.do(SetField("material.distance", 0.004))
    work.do(SetField("material.ior", 1.0))  # or how coarse it is depends on how long tracing takes
    finish(view, work)
    near.clear()
    work.do(SetField("material.distance", 0.003))
    assert view.draw(work, SIZE)
    assert view._rendered
    assert not [task for task in work.busy if task.name == "preparing the picture"]
    near.set()


def test_where_no_process_can_draw_the_window_compiles_by_itself(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def call(*_: Any, **_urgency: Any) -> Any:
        raise tl.RenderError("preparing the picture", "its process ended with status 9", "close other programs")

    monkeypatch.setattr(Pool, "call", call)
    finish(view, work)
    work.do(ChoosePreset("whole_milk"))
    finish(view, work)
    assert view.problem == ""
    told = [message.text for message in work.messages if "shaders are compiled in the window" in message.text]
    assert len(told) == 1
    assert "status 9" in told[0]
    assert "has failed: first guess" in view.quality.notes[1]  # nor is the window to run out of memory
    messages = len(work.messages)
    work.do(SetField("display.method", "depth-peeling"))
    finish(view, work)
    assert len(work.messages) == messages


def test_a_shader_that_does_not_compile_is_told_by_the_process(
    view: ViewportRenderer, work: Workspace, near: threading.Event, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    near.set()
    finish(view, work)
    before = view.renderer
    shutil.copytree(data._folder("shaders"), tmp_path / "shaders")
    monkeypatch.setattr(data, "_folder", lambda kind: tmp_path / kind)
    broken = tmp_path / "shaders" / "thickness" / "signed_depth.frag"
    good = broken.read_text()
    broken.write_text(good + "\nvoid broken( {\n")
    view.reload(work)
    wait(work, lambda: work.compiler.lane.task is None)
    assert "shaders/thickness/signed_depth.frag:" in view.shader_problem
    assert view.renderer is before
    broken.write_text(good)
    view.reload(work)
    wait(work, lambda: work.compiler.lane.task is None)
    assert view.shader_problem == ""
    assert view.renderer is not before
    finish(view, work)
    assert view.problem == ""


def test_programs_of_media_that_scatter_are_compiled_before_one_is_chosen(
    view: ViewportRenderer, work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[tuple[str, list[str]]] = []
    finish(view, work)

    def request(name: str, plans: Any, then: object, **_: object) -> None:
        requested.append((name, [plan.multiple_scattering for plan in plans]))

    monkeypatch.setattr(work.compiler, "request", request)
    for _ in range(2):
        view.foresee(work)
    grid = "diffuses (Diffusion(resolution=12)) in 1 body"
    assert requested == [("", ["leaves as from flat layers in 1 body", grid])]  # once, and nobody waits for it
    work.do(ChoosePreset("wax"))
    monkeypatch.undo()
    finish(view, work)
    monkeypatch.setattr(work.compiler, "request", request)
    view.foresee(work)
    assert len(requested) == 1
