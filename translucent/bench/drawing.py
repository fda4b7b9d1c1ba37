"""Drawings that are timed: frames prepared once, drawn again and again, and read at the end."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar, cast

from translucent import reference
from translucent.bench.scattering.engines import Engine
from translucent.bench.scattering.shot import shot_of
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
from translucent.planning.methods import RayMarched, SignedDepth
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion, SingleScattering
from translucent.planning.scattering.choice import shown
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

Size = tuple[int, int]

Made = TypeVar("Made")


class Drawing(Protocol):
    """Drawing: a frame that can be drawn again and again."""

    def draw(self) -> Sample:
        """Draw the frame, and return its times."""

    def read(self) -> Frame:
        """Read the frame of the last drawing."""

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers."""

    @property
    def solve_seconds(self) -> float | None:
        """Seconds that were spent on light that diffuses, which is solved for once; None where none does."""

    def release(self) -> None:
        """Free its resources."""


class Studio:
    """Studio: resources that the drawings of one renderer share, such as compiled passes, uploaded meshes and timers.

    Attributes
    ----------
    clock : callable
        By which drawings are compared. Where the CPU draws, it is the processor time of all threads: the work that a
        drawing is, whatever else the machine does meanwhile.
    """

    def __init__(self, renderer: Renderer) -> None:
        self.renderer = renderer
        self.gl = renderer.gpu.context.gl
        self.resources = Resources(self.gl)
        self.timer = PassTimer(self.gl)
        self.clock = time.process_time if is_software(renderer) else time.perf_counter
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

    def timed(self, geometry: Callable[[], None], shading: Callable[[], None]) -> Sample:
        """Draw the part that finds thickness, then the rest of the frame; each until the device has finished."""
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


class _OnGpu:
    """Drawing with OpenGL, into shared targets."""

    solve_seconds: float | None = None

    def __init__(
        self, studio: Studio, scene: Scene, targets: Targets, plan: RenderPlan, *, compact: bool = False
    ) -> None:
        self._studio = studio
        scene = shown(scene, plan.given_back)
        resources = copy.copy(studio.resources)
        if plan.given_back.solved:
            resources.diffusion = studio.light(plan.given_back.diffusion)
            began = time.perf_counter()
            resources.diffusion.solve(scene, plan.given_back.diffusion)
            self.solve_seconds = time.perf_counter() - began
        self._job = FrameJob(studio.gl, scene, plan, targets, resources, compact=compact)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        return self._studio.renderer.gpu.read(self._job)

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers of this size."""
        width, height = self._job.targets.size
        lights = self._job.resources.light_lists.size // (width * height) if self._job.features.scatters else 0
        return self._job.targets.bytes_per_pixel() + lights

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


class Floor:
    """Floor: translucent objects drawn into a depth buffer alone, the least cost of any rasterized method.

    Opaque objects are staging, which every method draws before and which is in all costs: it is in the floor, too.
    """

    def __init__(self, studio: Studio, scene: Scene, targets: Targets) -> None:
        self._bodies = tuple(i for i, item in enumerate(scene.objects) if item.medium is not None)
        opaque = tuple(i for i, item in enumerate(scene.objects) if item.medium is None)
        self._staging = (PassSpec(PassName.OPAQUE, "staging", opaque, 1),) if opaque else ()
        self._studio = studio
        self._job = FrameJob(studio.gl, scene, RenderPlan(SignedDepth(), self._staging), targets, studio.resources)
        self._pass = studio.own(DepthOnlyPass)

    def draw(self) -> Sample:
        """Draw the floor."""

        def geometry() -> None:
            for spec in self._staging:
                self._job.place((0.0, 0.0))
                with self._studio.timer.measure("staging"):
                    self._studio.step(spec.name).run(self._job, spec)
            self._job.place((0.0, 0.0), with_depth=True)
            self._studio.gl.viewport = (0, 0, *self._job.targets.size)
            with self._studio.timer.measure("depth_only"):
                self._pass.run(self._job, self._bodies)

        return self._studio.timed(geometry, _nothing)

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


class Planned(_OnGpu):
    """Planned drawing: a plan of the public API, pass by pass as the renderer runs it."""

    def __init__(self, studio: Studio, scene: Scene, targets: Targets, plan: RenderPlan) -> None:
        super().__init__(studio, scene, targets, plan, compact=True)
        self._geometry = [spec for spec in plan.passes if spec.geometry_passes]
        self._shading = [spec for spec in plan.passes if not spec.geometry_passes]

    def draw(self) -> Sample:
        """Draw the plan; paths that have been followed before are no part of it."""
        self._job.paths_traced = 0

        def geometry() -> None:
            self._job.place((0.0, 0.0))
            self._run(self._geometry, "geometry")

        return self._studio.timed(geometry, lambda: self._run(self._shading, None))

    def _run(self, specs: list[PassSpec], prefix: str | None) -> None:
        for spec in specs:
            step = self._studio.step(spec.name)
            if prefix is None:
                step.run(self._job, spec)
            else:
                with self._studio.timer.measure(f"{prefix}/{spec.name}"):
                    step.run(self._job, spec)


#: Passes of a plan that shade what a shortcut has found, those that find and shade an interface included.
_AFTER_SHORTCUTS = (PassName.INTERFACES, PassName.TRANSMITTANCE, PassName.SURFACES)


class Short(_OnGpu):
    """Drawing of a shortcut: it replaces the passes that find thickness, with the shading of signed depth."""

    def __init__(self, studio: Studio, scene: Scene, targets: Targets, plan: RenderPlan, shortcut: Shortcut) -> None:
        shading = tuple(spec for spec in plan.passes if spec.name in _AFTER_SHORTCUTS)
        short = RenderPlan(SignedDepth(), shading, plan.spectral, interfaces=plan.interfaces)
        super().__init__(studio, scene, targets, short)
        self._shortcut = shortcut

    def draw(self) -> Sample:
        """Draw the shortcut."""
        job = self._job

        def geometry() -> None:
            job.place((0.0, 0.0), with_depth=self._shortcut.with_depth)
            job.accumulator()
            with self._studio.timer.measure("shortcut"):
                self._shortcut.run(job)

        def shading() -> None:
            self._shortcut.hand_over(job)
            for spec in job.plan.passes:
                self._studio.step(spec.name).run(job, spec)

        return self._studio.timed(geometry, shading)


class OnProcessor:
    """Drawing without OpenGL: of the backend ``cpu``, or where it is given a way to march, of the reference's march."""

    bytes_per_pixel = None
    solve_seconds = None

    def __init__(
        self, studio: Studio, renderer: Renderer, scene: Scene, size: Size, march: RayMarched | None = None
    ) -> None:
        self._clock = studio.clock
        self._renderer = renderer
        self._scene = scene
        self._size = size
        self._march = march
        self._frame: Frame | None = None

    def draw(self) -> Sample:
        """Draw the frame, with thickness and shading in one time."""
        began, work = time.perf_counter(), self._clock()
        if self._march is None:
            self._frame = self._renderer.render(self._scene, self._size, scattering=SingleScattering())
        else:
            self._frame = reference.march(self._scene, self._size, self._march)
        seconds, spent = time.perf_counter() - began, self._clock() - work
        return Sample(seconds, seconds, None, spent, spent)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        if self._frame is None:
            self.draw()
        assert self._frame is not None
        return self._frame

    def release(self) -> None:
        """Nothing to free: the renderer is shared."""


class OfEngine:
    """Drawing of what an engine would show: of NumPy in place of its shaders, on a frame of our own."""

    bytes_per_pixel = None
    solve_seconds = None

    def __init__(self, studio: Studio, scene: Scene, size: Size, engine: Engine) -> None:
        self._clock = studio.clock
        self._renderer = studio.renderer
        self._scene, self._size, self._engine = scene, size, engine
        self._frame: Frame | None = None

    def draw(self) -> Sample:
        """Draw the frame, with all of it in one time."""
        began, work = time.perf_counter(), self._clock()
        shot = shot_of(self._renderer, self._scene, self._size)
        self._frame = shot.frame(self._engine.light(shot))
        seconds, spent = time.perf_counter() - began, self._clock() - work
        return Sample(seconds, seconds, None, spent, spent)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        assert self._frame is not None, "drawn before"
        return self._frame

    def release(self) -> None:
        """Nothing to free: the renderer is shared."""


def is_software(renderer: Renderer) -> bool:
    """True if OpenGL runs on a software rasterizer."""
    return "software" in renderer.provenance["renderer"]


def _nothing() -> None:
    pass
