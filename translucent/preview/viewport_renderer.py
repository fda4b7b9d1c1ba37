"""Viewport renderer: draws the scene on show in short steps, in the window's context, with shaders that may change."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from translucent.arrays import Array
from translucent.assets import newest_shader
from translucent.errors import InputError, TranslucentError
from translucent.geometry.normals import drawn_normals
from translucent.gpu.context import open_context
from translucent.gpu.shaders import PostponedError, ProgramName
from translucent.gpu.viewport import PixelProbe, Shown, Viewport
from translucent.media.presets import preset
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import ScatteringLayer
from translucent.preview.document import lens_of
from translucent.preview.measuring import ReferencePicture
from translucent.preview.preparation import FRAME, Compiled, Compiler, unsmoothed
from translucent.preview.quality import (
    COARSEST_TRACED,
    FACTORS,
    LENS_SAMPLES,
    PREPARING,
    SCREEN,
    SMALL,
    FrameBudget,
    InteractiveQuality,
    PathRefinement,
    PhotonRefinement,
    StepTimes,
    StepTiming,
    Strides,
    samples_of,
)
from translucent.preview.scenes import method_of, request_of, tone_of
from translucent.preview.tasks import Task
from translucent.preview.workspace import Workspace
from translucent.renderer import Renderer
from translucent.scene.camera import Lens
from translucent.scene.scene import Scene
from translucent.scene.showcase import filled, with_roughness
from translucent.scene.stages import STAGED_TONE

#: Largest time of a step in seconds, where the rest of the window takes little.
BUDGET = 0.045

#: Seconds between checks of the shader files.
WATCH = 0.5

#: Seconds up to which a presentation is quick: every change is shown at once. Others are as many seconds apart, and
#: have frames of their own, as the first of each type has, which is compiled.
QUICK, APART = 0.006, 0.25


class ViewportRenderer:
    """Renderer of a workspace's scene into the texture of a viewport.

    Parameters
    ----------
    context : moderngl.Context, optional
        Context of the window; None opens one without a window.
    compiler : Compiler, optional
        Compiles what a picture needs, from the second one on, while the one before stays on show.

    Attributes
    ----------
    plans : list of RenderPlan or None
        Plans of both sides.
    timings : list of StepTiming
    problem : str
        Why the picture is not what it should be, or nothing.
    shader_problem : str
        The compiler's message, while the last good shaders go on.
    quality, other_quality : InteractiveQuality
        Of the picture, and of the snapshot right of the split.
    paths : PathRefinement
        Paths of the still picture.
    photons : PhotonRefinement
        Photons of the still picture, unless it is made of paths.
    presenter : Presenter
    state : str
        Which picture is on show: one that moves, one that becomes sharp, or the full one.
    simpler : str
        Simplifications while the picture moves, with their reason, or nothing.
    drawing : float
        Seconds that the last call of `draw` took.
    idle : bool
        That call had nothing to draw before other work is done.
    budget, preparing : float
        Largest time of a step in seconds, and the fraction of it that may go to what a picture needs first.
    """

    def __init__(self, context: Any = None, compiler: Compiler | None = None) -> None:
        # Whoever owns the window draws into it next, wherever we have drawn.
        self._window = None if context is None else context.detect_framebuffer()
        self._own = open_context() if context is None else None
        self._gl = context if self._own is None else self._own.gl
        self._compiler = compiler
        self._gl.extra = None if compiler is None else compiler.budget
        with self.current():
            self.renderer = self._new_renderer()
            self.viewport = Viewport(self.renderer.gpu)
        if compiler is not None:
            compiler.device = self.renderer.gpu.context.renderer
        self.plans: list[RenderPlan | None] = [None, None]
        self.timings = [StepTiming(), StepTiming()]
        self.problem = self.shader_problem = self.simpler = self.state = ""
        self.drawing, self.idle, self._begun = 0.0, False, False
        self._moving: RenderPlan | None = None
        self._held: Scene | None = None
        self._rendered: tuple[object, ...] = ()
        self._postponed: tuple[object, ...] = ()
        self._requested: Task | None = None
        self._foreseen: set[tuple[PassName, ...]] = set()
        self.presenter, self._times = Presenter(), StepTimes()
        self._frame_budget, self._left = FrameBudget(), 0.0
        self.budget, self.preparing = BUDGET, PREPARING
        self._strides = Strides(self._times)
        self.quality, self.other_quality = (InteractiveQuality(traced_at_once=compiler is None) for _ in range(2))
        self._lens: Lens | None = None
        self._seen_from: Array | None = None  # pose of the camera of the picture on show
        self.paths, self.photons = PathRefinement(), PhotonRefinement()
        self._watched, self._newest = time.monotonic(), newest_shader()

    def _new_renderer(self) -> Renderer:
        renderer = Renderer(context=self._gl)
        renderer.gpu.diffusion.warm_starts = True  # light changes from frame to frame
        return renderer

    def current(self) -> AbstractContextManager[Any]:
        """Context manager that makes the context current: a window's always is."""
        return nullcontext(self._gl) if self._own is None else self._own.current()

    @property
    def notes(self) -> list[str]:
        """Lines on what is wrong with the picture, or simpler than requested, and on its refinement."""
        others = (f"snapshot: {text}" for text in self.other_quality.notes if text)
        simpler = self.problem, self.shader_problem, self.simpler, *self.quality.notes, *others
        return [text for text in (*simpler, self.paths.note, self.photons.note) if text]

    def draw(self, workspace: Workspace, size: tuple[int, int]) -> bool:
        """Draw a step, if there is one left; returns whether more are.

        If that fails, `problem` says why, and the last picture stays.
        """
        started = time.perf_counter()
        self._left = self._frame_budget.begin(self.budget)
        if self._compiler is not None:
            self._compiler.budget.begin_frame(self.preparing * self._left)
        with self.current():
            try:
                more = self._draw(workspace, size)
                self.problem = ""
            except PostponedError as error:
                if error.program is not None:
                    self._postpone(workspace, self._rendered, error.program)
                more = True
            except TranslucentError as error:
                self.problem, more = str(error), False
            finally:
                if self._window is not None:
                    self._window.use()
        self.drawing = time.perf_counter() - started
        self._frame_budget.end(more=more)
        return more

    def show_in(self, part: tuple[int, int, int, int]) -> None:
        """Show the picture in a part of the window: left and bottom, width and height in pixels."""
        assert self._window is not None
        self.viewport.draw_into(self._window, part)

    def _draw(self, workspace: Workspace, size: tuple[int, int]) -> bool:
        held, self._held, self.idle = self._held, None, False
        scene, display = held or workspace.scene(), workspace.document.display
        self.viewport.resize(size)
        if scene is None:
            return False
        document, other = workspace.document, workspace.compared()
        both = display.compare == "method" or other is not None
        requested = request_of(document)
        second = method_of(display.method_b, document.material) if display.compare == "method" else None
        self._lens = None if document.orbit is None else lens_of(document.look, document.orbit)
        if held is None:
            begun = time.perf_counter()
            self.quality.choose(workspace, scene, requested, self.renderer)
            if other is not None:
                self.other_quality.choose(workspace, other, requested, self.renderer)
            else:
                self.other_quality.notes = ["", ""]
            spent = time.perf_counter() - begun
            if (self.quality.solved or self.other_quality.solved) and spent > self.preparing * self._left:
                self._held = scene  # the next frame draws this one, or what moves all the time would not be drawn
                return True
            self._left -= min(spent, self.preparing * self._left)
        request = self.quality.request
        other_request = replace(request, method=second) if other is None else self.other_quality.request
        target = (scene, request, other, other_request, self.viewport.size, self.renderer, self._lens)
        if self._compiler is not None and self._compiler.lane.task is not None and target == self._postponed:
            self.idle = True
            return True
        fresh = target != self._rendered
        stopped = (fresh or not display.converges) and self.paths.stop()
        stopped |= (fresh or not display.follows_photons) and self.photons.stop(self.viewport)
        if not fresh and not stopped:
            self._begin(workspace, scene)
            self.watch(workspace)
        else:  # or the interactive picture is drawn again
            plan = self.renderer.plan_requested
            self.plans = [plan(scene, request), plan(other or scene, other_request) if both else None]
            self._rendered = target
            self.viewport.restart()
            self.presenter.truth = None
            self._strides.begin(self.plans, self.budget)
            self._moving, self.simpler = None, ""
            if self._compiler is not None and self._compiler.budget.postpones and unsmoothed(self._drawn_plans):
                self._postpone(workspace, target)
                return True
            if display.mode == "picture" and display.compare == "off":
                return self._draw_at_once(scene, workspace)
        # One side at a time, the one that is behind: two would take twice as long.
        sides = sorted((0, 1), key=self.viewport.steps) if both else [0]
        still = (display.converges or display.follows_photons) and self.quality.traceable(workspace, scene)
        lit = still and display.follows_photons and self.viewport.steps(0) >= self._strides.of[0] ** 2
        # A large picture takes as long to be shown as a step: it has a frame for that alone.
        alone = self.presenter.begin(workspace, scene, self.viewport, self._rendered)
        antialias = display.antialias and not workspace.relights
        drawn = not lit and not alone and any(self._step(side, scene, antialias) for side in sides)
        more = drawn or alone or workspace.relights
        self.idle = more and not (drawn or alone or lit)
        if display.converges and still and not more:
            more, drawn = self.paths.step(scene, self.renderer, self.viewport, self._left, workspace, self._lens)
        if lit:
            more, drawn = self._light_by_photons(scene, workspace)
            if self.photons.light is None and not more:  # there are no photons to follow
                more = drawn = self._step(0, scene, display.antialias)
        return self.presenter.present(self.viewport, changed=drawn, last=not more) or more

    def _draw_at_once(self, scene: Scene, workspace: Workspace) -> bool:
        """Draw the picture alone, while things move."""
        look, usual = workspace.document.look, self.plans[0]
        assert usual is not None
        shadows = self.quality.quick_shadows(scene)
        request = replace(self.quality.request, shadows=shadows)
        if shadows is not None:
            self._moving = self.renderer.plan_requested(scene, request)
        traced = [plan for plan in (usual, self._moving or usual) if plan.has(PassName.TRACED)]
        if any(self._times.known(plan, COARSEST_TRACED) > self._left for plan in traced):
            request = replace(request, interfaces=SCREEN)
            self._moving = self.renderer.plan_requested(scene, request)
        begun, factor = time.perf_counter(), self._times.factor(self._moving or usual, FACTORS, self._left)
        try:
            with self.viewport.at_once(factor) as framebuffer:
                plan = self.renderer.draw_requested(scene, framebuffer, request, look.exposure, tone_of(look, scene))
        except PostponedError as error:
            if error.program is None:
                self._rendered = ()  # the same again: what has been made is for pictures of this size
            raise
        self._finish(0, plan, factor, begun)
        self._seen_from = scene.camera.pose
        self.state = "moving" if factor == 1.0 else f"moving, {1 / factor:.0%} of the resolution"
        if request.interfaces is not self.quality.request.interfaces:
            self.simpler = "Approximate reflections while the view moves"
        elif shadows is not None:
            self.simpler = "Approximate shadows while the view moves"
        self.presenter.shown = ()
        return True

    def _step(self, side: int, scene: Scene, antialias: bool) -> bool:
        """Draw the next sample of a side, if there is one left to draw."""
        stride, plan = self._strides.of[side], self.plans[side]
        samples = samples_of(stride, antialias) if self._lens is None else LENS_SAMPLES
        drawn, whole = self.viewport.steps(side), stride * stride
        self.state = "sharpening" if drawn + 1 < whole else f"full picture, {_samples(max(drawn // whole, 1))}"
        if plan is None or drawn >= whole * (1 + samples):
            return False
        self.simpler, begun = "", time.perf_counter()
        self.viewport.step(side, plan, stride, max(samples, 1), lens=self._lens)
        self._finish(side, plan, stride, begun)
        if self._strides.corrected(side, plan, drawn + 1, self.budget):
            self.viewport.restart(side)
        return True

    def _light_by_photons(self, scene: Scene, workspace: Workspace) -> tuple[bool, bool]:
        """Follow photons, or draw a step of the picture with their light; whether more is to come, and it changed."""
        photons, strides = self.photons, self._strides.of
        expected = 0.0 if self.plans[0] is None else self._times.known(self.plans[0])
        request = replace(self.quality.request, interfaces=None)
        if not photons.ready(workspace, scene, self.renderer, self.viewport, request, self._left, expected):
            if (media_plan := photons.show_media(self.viewport)) is not None:
                self.plans[0], strides[0] = media_plan, self._times.stride(media_plan, self._left)
            return False, False
        if not photons.drawing or photons.plan is None or photons.light is None:
            return True, False
        if photons.side == 1 and not self.viewport.steps(1):
            strides[1] = self._times.stride(photons.plan, self._left)
        stride, begun = strides[photons.side], time.perf_counter()
        samples = samples_of(stride, workspace.document.display.antialias) if self._lens is None else LENS_SAMPLES
        light = photons.light.texture
        self.viewport.step(photons.side, photons.plan, stride, max(samples, 1), photons=light, lens=self._lens)
        self._finish(0, photons.plan, stride, begun)
        if photons.take_over(self.viewport, stride, samples, through_lens=self._lens is not None):
            strides[0], self.plans[0] = stride, photons.plan
        return True, photons.side == 0

    def _finish(self, side: int, plan: RenderPlan, stride: float, begun: float) -> None:
        """Wait for a step, and record its time."""
        self.renderer.gpu.context.gl.finish()
        wall = time.perf_counter() - begun
        self._times.note(plan, wall, stride)
        self.timings[side] = StepTiming(wall, self.renderer.gpu.pass_seconds(), 1.0 / stride**2)

    def probe(self, x: int, y: int, side: int = 0) -> PixelProbe | None:
        """Values of a pixel of a side, once it is final."""
        done = self._strides.of[side] ** 2 if side == 0 or self.plans[1] is not None else 1
        if self.viewport.steps(side) < done:
            return None
        with self.current():
            return self.viewport.probe(x, y, side)

    def watch(self, workspace: Workspace) -> None:
        """Reload shaders that have changed on disk, unless they do not compile."""
        if time.monotonic() - self._watched < WATCH:
            return
        self._watched = time.monotonic()
        if (newest := newest_shader()) != self._newest:
            self._newest = newest
            self.reload(workspace)

    def _begin(self, workspace: Workspace, scene: Scene) -> None:
        """Mark the first picture as drawn: from now on, it stays on show while later ones are prepared."""
        if not self._begun:
            self._begun = True
            workspace.prepare()
            if self._compiler is not None:
                self.viewport.prepare_stand_in(scene, {STAGED_TONE, tone_of(workspace.document.look, scene)})
                self._compiler.begin(self._drawn_plans, partial(self._take_compiled, workspace))

    def foresee(self, workspace: Workspace) -> None:
        """Have programs compiled for media that scatter before one is chosen: it is then on show at once."""
        compiler, plan, scene = self._compiler, self.plans[0], workspace.scene()
        if compiler is None or not compiler.budget.postpones or compiler.lane.task is not None or scene is None:
            return
        if plan is None or plan.diffuses or (passes := tuple(step.name for step in plan.passes)) in self._foreseen:
            return
        self._foreseen.add(passes)
        wax = preset("wax")
        waxen = with_roughness(filled(scene, wax.medium), wax.roughness)
        requests = [replace(self.quality.request, scattering=scattering) for scattering in (ScatteringLayer(), SMALL)]
        with suppress(InputError):  # a scene that scatters no light, or a method that cannot
            plans = [self.renderer.plan_requested(waxen, request) for request in requests]
            compiler.request("", plans, partial(self._take_compiled, workspace))

    @property
    def _drawn_plans(self) -> list[RenderPlan]:
        plans = *self.plans, self._moving, self.paths.plan, self.photons.plan
        return [plan for plan in plans if plan is not None]

    def _postpone(self, workspace: Workspace, target: tuple[object, ...], program: ProgramName | None = None) -> None:
        """Request missing programs; until they are there, the same picture is not tried again."""
        compiler, scene = self._compiler, target[0]
        assert compiler is not None
        assert isinstance(scene, Scene)
        self._postponed, self._rendered = target, ()
        self._stand_in(workspace, scene)
        if self._requested is not None and self._requested.cancelled:
            # The user does not wait, so that the window does the work.
            self._requested = None
            self._take_compiled(workspace, Compiled(frozenset()), program)
            for mesh in unsmoothed(self._drawn_plans):
                drawn_normals(mesh)
        elif compiler.lane.task is None or not compiler.lane.task.name:  # work that nobody waits for is replaced
            then = partial(self._take_compiled, workspace, missing=program)
            self._requested = compiler.request("preparing the picture", self._drawn_plans, then)

    def _stand_in(self, workspace: Workspace, scene: Scene) -> None:
        """Show a quick preview picture, or the last picture, while programs compile."""
        display, look = workspace.document.display, workspace.document.look
        self.state = "preparing the new picture; the old picture is still visible"
        if display.mode != "picture" or display.compare != "off" or workspace.shown_bake is not None:
            return
        with self.current():
            moved = self._seen_from is not None and not np.array_equal(self._seen_from, scene.camera.pose)
            self.viewport.stand_in(scene, (look.exposure, tone_of(look, scene)), whole=moved)
        self.presenter.shown = ()
        self.state = "preparing the new picture; a simple preview is visible"

    def _take_compiled(self, workspace: Workspace, found: Compiled, missing: ProgramName | None = None) -> None:
        """Let the context build the programs found, and the one that was `missing`, even if it was not."""
        assert self._compiler is not None
        budget = self._compiler.budget
        budget.elsewhere |= (found.programs or set()) | ({missing} if missing is not None else set())
        if found.programs is None:
            budget.postpones = False
            text = f"shaders are compiled in the window, so the window does not respond for a while: {found.problem}"
            workspace.tell("warning", text)

    def reload(self, workspace: Workspace) -> None:
        """Compile the shaders anew; if that fails, keep the present ones, and set `shader_problem`."""
        compiler, scene = self._compiler, workspace.scene()
        if compiler is None or not compiler.budget.postpones or scene is None:
            return self._rebuild(workspace)

        def take(found: Compiled) -> None:
            if found.programs is not None and found.problem:
                self.shader_problem = found.problem
                return
            compiler.budget.postpones = False  # should anything still be missing
            self._rebuild(workspace)
            compiler.budget.elsewhere.clear()
            compiler.budget.postpones = True
            self._take_compiled(workspace, found)

        compiler.request("preparing the picture", self._drawn_plans, take)
        return None

    def _rebuild(self, workspace: Workspace) -> None:
        """Replace the renderer by one with the shaders as they are, if that can draw the scene."""
        scene, size = workspace.scene(), self.viewport.size
        with self.current():
            fresh = self._new_renderer()
            viewport = None
            try:
                viewport = Viewport(fresh.gpu)
                if scene is not None:
                    viewport.resize(FRAME)
                    for plan in self._drawn_plans:
                        viewport.step(0, fresh.plan_requested(scene, plan.request), 1)
                viewport.resize(size)
            except TranslucentError as error:
                self.shader_problem = str(error)
                if viewport is not None:
                    viewport.release()
                fresh.close()
                return
            self._release()
            self.renderer, self.viewport, self.shader_problem = fresh, viewport, ""
            self._rendered = self.presenter.shown = ()
        workspace.tell("info", "shaders reloaded")

    def _release(self) -> None:
        self.paths.stop()
        self.photons.stop(self.viewport)
        self.viewport.release()
        self.renderer.close()

    def close(self) -> None:
        """Free all resources."""
        with self.current():
            self._release()
        if self._own is not None:
            self._own.gl.release()


def _samples(count: int) -> str:
    return "1 sample" if count == 1 else f"{count} samples"


class Presenter:
    """Presentation of the samples of a viewport as the document asks for it, with the reference beside them.

    Attributes
    ----------
    truth : ReferencePicture, optional
        The reference right of the split.
    shown : tuple
        Key of the picture on show; empty: nothing of the samples.
    """

    def __init__(self) -> None:
        self.truth: ReferencePicture | None = None
        self.shown: tuple[object, ...] = ()
        self._requested: tuple[Shown, tuple[object, ...]] = Shown(), ()
        self._pending = self._alone = False
        self._seconds = self._when = 0.0

    def begin(self, workspace: Workspace, scene: Scene, viewport: Viewport, key: tuple[object, ...]) -> bool:
        """Begin a frame that shows samples of a picture with a key; returns whether it is to do nothing else."""
        display, look, truth = workspace.document.display, workspace.document.look, workspace.truth
        right = {"off": "same", "error": "difference"}.get(display.compare, "second")
        if display.compare in ("reference", "error"):
            straight = display.compare == "error"
            if self.truth is not None and straight and not self.truth.straight:
                self.truth = None
            method = method_of(display.method, workspace.document.material)
            if (
                truth is not None
                and truth is not self.truth
                and (truth.scene is scene and truth.method == method and truth.straight >= straight)
            ):
                viewport.put(truth.frame)
                self.truth, self._pending = truth, True
            right = right if self.truth is not None else "same"
        lengths = thickest(workspace), worst(workspace)
        self._requested = Shown(display.mode, right, display.split, *lengths, look.exposure, tone_of(look, scene)), key
        pending = self._requested != self.shown or (self._pending and time.perf_counter() - self._when > APART)
        first = not viewport.presents_at_once(self._requested[0])
        self._alone = (first or (pending and self._seconds > QUICK)) and viewport.steps(0) > 0
        return self._alone

    def present(self, viewport: Viewport, *, changed: bool, last: bool) -> bool:
        """Show the samples so far, if they are new and time allows; returns whether they must be shown.

        Parameters
        ----------
        viewport : Viewport
        changed : bool
            There are others than before.
        last : bool
            No others are to come.
        """
        self._pending = self._pending or changed
        now = self._alone or last or self._seconds <= QUICK
        if self._requested == self.shown and not (self._pending and now):
            return False
        if not self._alone and not viewport.presents_at_once(self._requested[0]):
            return True
        begun = time.perf_counter()
        viewport.present(self._requested[0])
        viewport.engine.context.gl.finish()
        self.shown, self._pending, self._when = self._requested, False, time.perf_counter()
        self._seconds = self._when - begun
        return False


def thickest(workspace: Workspace) -> float:
    """Length in metres of the last false color: the thickest that was measured, or a guess."""
    measured = workspace.measured
    if measured is not None and measured.seen.thickness.size:
        return float(measured.seen.thickness.max()) or 1.0
    return workspace.loaded.scene.diagonal or 1.0 if workspace.loaded else 1.0


def worst(workspace: Workspace) -> float:
    """Largest error in metres that has a color of its own."""
    measured = workspace.measured
    least = 1e-7 * thickest(workspace)
    return max(measured.errors[0].p99, least) if measured is not None and measured.errors else 10 * least
