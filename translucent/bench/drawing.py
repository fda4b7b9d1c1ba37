"""Drawings that are timed: frames prepared once, drawn again and again, and read at the end."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, cast

from translucent.bench.timing import Sample
from translucent.frames.frame import Frame
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.job import FrameJob
from translucent.gpu.passes import PASSES, Pass
from translucent.gpu.passes.depth_only import DepthOnlyPass
from translucent.gpu.passes.shortcuts import Shortcut
from translucent.gpu.resources import Resources
from translucent.gpu.targets import Targets
from translucent.gpu.timer import PassTimer
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion
from translucent.planning.scattering.choice import shown
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

Size = tuple[int, int]

Made = TypeVar("Made")

#: Passes of a plan that shade the thickness of a shortcut, those that find and shade an interface included.
_AFTER_SHORTCUTS = (PassName.INTERFACES, PassName.TRANSMITTANCE, PassName.SURFACES)


@dataclass(frozen=True)
class Effort:
    """Effort of a measurement.

    Attributes
    ----------
    case_seconds, step_seconds : float
        Of timing, for each case and for each step of a scaling axis.
    compared : float
        Width and height of the frames that are compared with the reference, as a fraction of those of the case.
    patience, long : float
        As in `translucent.bench.timing.interleaved`.
    """

    case_seconds: float
    step_seconds: float
    compared: float
    patience: float = 1.0
    long: float = 0.3


FULL = Effort(12.0, 2.5, 1.0, patience=3.0)
QUICK = Effort(0.6, 0.15, 0.4, long=0.1)


class BenchContext:
    """Resources that all measurements of one run share: renderers, compiled passes, uploaded meshes, timers, effort.

    Parameters
    ----------
    renderer : Renderer
        With OpenGL.
    cpu : Renderer, optional
        Of the backend ``cpu``, where it works.
    size : (width, height)
        Of the timed frames.
    effort : Effort

    Attributes
    ----------
    clock : callable
        By which drawings are compared. Where the CPU draws, it is the processor time of all threads: the work that a
        drawing is, whatever else the machine does meanwhile.
    """

    def __init__(
        self, renderer: Renderer, cpu: Renderer | None = None, size: Size = (256, 256), effort: Effort = QUICK
    ) -> None:
        self.renderer, self.cpu, self.size, self.effort = renderer, cpu, size, effort
        self.gl = renderer.gpu.context.gl
        self.resources = Resources(self.gl)
        self.timer = PassTimer(self.gl)
        self.software = is_software(renderer)
        self.clock = time.process_time if self.software else time.perf_counter
        self._own: dict[Callable[[Any], Any], Any] = {}
        self._light: dict[Diffusion, DiffusionCache] = {}

    def step(self, name: PassName) -> Pass:
        """Pass with this name in plans: that of the renderer, as another would compile its programs again."""
        return self.renderer.gpu.step(PASSES[name])

    def own(self, kind: Callable[[Any], Made]) -> Made:
        """Object in no plan, made of the context alone, and once: its programs are compiled once, too."""
        if kind not in self._own:
            self._own[kind] = kind(self.gl)
        return cast("Made", self._own[kind])

    def light(self, diffusion: Diffusion) -> DiffusionCache:
        """Light that diffuses on grids of one size, for all drawings of a scene: it is solved for once."""
        if diffusion not in self._light:
            self._light[diffusion] = DiffusionCache(self.gl)
        return self._light[diffusion]

    def forget_light(self) -> None:
        """Free the light that diffuses, which is another in each scene."""
        for light in self._light.values():
            light.release()
        self._light.clear()

    def timed(self, geometry: Callable[[], None], shading: Callable[[], None] = lambda: None) -> Sample:
        """Draw the passes that find thickness, then the rest of the frame; each until the device has finished."""
        self.timer.begin_frame()
        self.gl.finish()
        began, work = time.perf_counter(), self.clock()
        geometry()
        self.gl.finish()
        wall, part = time.perf_counter() - began, self.clock() - work
        shading()
        self.gl.finish()
        frame, whole = time.perf_counter() - began, self.clock() - work
        return Sample(wall, frame, sum(self.timer.seconds().values()), part, whole)

    def release(self) -> None:
        """Free all resources."""
        self.forget_light()
        self.resources.release()
        self._own.clear()


class Drawing(Protocol):
    """Frame that can be drawn again and again.

    Attributes
    ----------
    solve_seconds : float or None
        Seconds of the diffusion solve, which is done once; None without diffusion.
    """

    solve_seconds: float | None

    def draw(self) -> Sample:
        """Draw the frame, and return its times."""

    def read(self) -> Frame:
        """Read the frame of the last drawing."""

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers."""

    def release(self) -> None:
        """Free its resources."""


class PlanDrawing:
    """Drawing of a plan, pass by pass as the renderer runs it, into shared targets."""

    def __init__(self, bench: BenchContext, scene: Scene, targets: Targets, plan: RenderPlan) -> None:
        self._bench = bench
        self._geometry = [spec for spec in plan.passes if spec.geometry_passes]
        self._shading = [spec for spec in plan.passes if not spec.geometry_passes]
        scene = shown(scene, plan.given_back)
        resources = copy.copy(bench.resources)
        self.solve_seconds: float | None = None
        if plan.given_back.solved:
            resources.diffusion = bench.light(plan.given_back.diffusion)
            began = time.perf_counter()
            resources.diffusion.solve(scene, plan.given_back.diffusion)
            self.solve_seconds = time.perf_counter() - began
        self._job = FrameJob(bench.gl, scene, plan, targets, resources, compact=self._compact)

    _compact = True

    def draw(self) -> Sample:
        """Draw the plan; paths that have been followed before are no part of it."""
        self._job.paths_traced = 0

        def geometry() -> None:
            self._job.place((0.0, 0.0))
            for spec in self._geometry:
                with self._bench.timer.measure(f"geometry/{spec.name}"):
                    self._bench.step(spec.name).run(self._job, spec)

        return self._bench.timed(geometry, self._shade)

    def _shade(self) -> None:
        for spec in self._shading:
            self._bench.step(spec.name).run(self._job, spec)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        return self._bench.renderer.gpu.read(self._job)

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers of this size."""
        width, height = self._job.targets.size
        lights = self._job.resources.light_lists.size // (width * height) if self._job.features.scatters else 0
        return self._job.targets.bytes_per_pixel() + lights

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


class ShortcutDrawing(PlanDrawing):
    """Drawing of a shortcut: it replaces the passes that find thickness, with the shading of signed depth."""

    _compact = False

    def __init__(
        self, bench: BenchContext, scene: Scene, targets: Targets, plan: RenderPlan, shortcut: Shortcut
    ) -> None:
        after = tuple(spec for spec in plan.passes if spec.name in _AFTER_SHORTCUTS)
        short = RenderPlan(SignedDepth(), after, plan.spectral, interfaces=plan.interfaces)
        super().__init__(bench, scene, targets, short)
        self._shading, self._shortcut = list(after), shortcut

    def draw(self) -> Sample:
        """Draw the shortcut."""

        def geometry() -> None:
            self._job.place((0.0, 0.0), with_depth=self._shortcut.with_depth)
            self._job.accumulator()
            with self._bench.timer.measure("shortcut"):
                self._shortcut.run(self._job)

        def shading() -> None:
            self._shortcut.hand_over(self._job)
            self._shade()

        return self._bench.timed(geometry, shading)


class FrameDrawing:
    """Drawing by a function that returns a frame, without OpenGL or with what an engine would show: one time in all."""

    bytes_per_pixel = None
    solve_seconds: float | None = None

    def __init__(self, bench: BenchContext, make: Callable[[], Frame]) -> None:
        self._clock, self._make = bench.clock, make
        self._frame: Frame | None = None

    def draw(self) -> Sample:
        """Draw the frame."""
        began, work = time.perf_counter(), self._clock()
        self._frame = self._make()
        seconds, spent = time.perf_counter() - began, self._clock() - work
        return Sample(seconds, seconds, None, spent, spent)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        assert self._frame is not None, "drawn before"
        return self._frame

    def release(self) -> None:
        """Nothing to free: renderers are shared."""


class FloorDrawing:
    """Translucent objects drawn into a depth buffer alone, the least cost of any rasterized method.

    Opaque objects are staging, which every method draws before and which is in all costs: it is in the floor, too.
    """

    def __init__(self, bench: BenchContext, scene: Scene, targets: Targets) -> None:
        self._bodies = tuple(i for i, item in enumerate(scene.objects) if item.medium is not None)
        opaque = tuple(i for i, item in enumerate(scene.objects) if item.medium is None)
        self._staging = (PassSpec(PassName.OPAQUE, "staging", opaque, 1),) if opaque else ()
        self._bench = bench
        self._job = FrameJob(bench.gl, scene, RenderPlan(SignedDepth(), self._staging), targets, bench.resources)
        self._pass = bench.own(DepthOnlyPass)

    def draw(self) -> Sample:
        """Draw the floor."""

        def geometry() -> None:
            for spec in self._staging:
                self._job.place((0.0, 0.0))
                with self._bench.timer.measure("staging"):
                    self._bench.step(spec.name).run(self._job, spec)
            self._job.place((0.0, 0.0), with_depth=True)
            self._bench.gl.viewport = (0, 0, *self._job.targets.size)
            with self._bench.timer.measure("depth_only"):
                self._pass.run(self._job, self._bodies)

        return self._bench.timed(geometry)

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


def is_software(renderer: Renderer) -> bool:
    """True if OpenGL runs on a software rasterizer."""
    return "software" in renderer.provenance["renderer"]
