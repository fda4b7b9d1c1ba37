"""The renderer of scenes with OpenGL: runs the passes of a plan, and reads the result."""

from __future__ import annotations

import os
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.errors import RenderError
from translucent.formulas.sampling import sample_shifts
from translucent.formulas.tone import TONES
from translucent.frames.frame import (
    Deferred,
    Frame,
    copied,
    coverage_of,
    optical_depth_of,
    thickness_of,
    transmittance_of,
    transmitted_of,
    valid_of,
)
from translucent.geometry.ray_caster import embree_versions
from translucent.gpu.adaptive import AdaptiveSampling, is_adaptive, read_averages, traced_samples
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.context import GpuContext, adopt_context, open_context, require_own_process
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.job import FrameJob, TextureBackdrop
from translucent.gpu.pass_costs import PassTimer
from translucent.gpu.passes import PASSES, Pass
from translucent.gpu.passes.caustics import CausticsPass
from translucent.gpu.passes.path_trace import PathTracePass, PathTracer
from translucent.gpu.passes.variants import Variants
from translucent.gpu.placement import COVERAGE_FLOOR
from translucent.gpu.resources import MeshCache, Resources
from translucent.gpu.shaders import before_drawing, before_making, set_uniform
from translucent.gpu.shadow_atlas import ShadowAtlas
from translucent.gpu.targets import SHADER_STORAGE, Targets, read_floats
from translucent.gpu.uniforms import bounded_extinction
from translucent.planning.methods.base import HITS
from translucent.planning.passes import PassName
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.scene.backdrop import Backdrop


class PresentPass:
    """Exposure, tone curve and sRGB encoding of the frame's radiance, into any framebuffer of the same size."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._curves = Variants(gl, "geometry/fullscreen.vert", "present/present.frag", "picture")

    def run(self, job: FrameJob, framebuffer: moderngl.Framebuffer, stops: float, tone: str) -> None:
        """Draw the radiance, `stops` brighter, through the curve of that name."""
        program = self._curves.program(TONE=TONES.index(tone))
        framebuffer.use()
        job.gl.enable_only(moderngl.NOTHING)
        self._curves.bind(picture=job.picture.color_attachments[0])
        set_uniform(program, "stops", stops)
        self._curves.draw_fullscreen(program)


#: Largest fraction of a pixel's light that may come along rays that went astray.
MOST_LOST = 0.005

Floats = npt.NDArray[np.float32]


def read_arrays(job: FrameJob, samples: int) -> dict[str, Any]:
    """Arrays of a job's frame by their names in `Frame`, with radiance and transmittance averaged if sampled.

    What is compact is read at once, too, since the next frame is drawn into the same targets; arrays are made from it
    when they are requested.
    """
    found = _compact_arrays(job) if job.compact else _whole_arrays(job)
    trusted = None
    if samples > 1:
        found["radiance"], found["transmittance"], trusted = read_averages(job, samples)
    if job.features.path_traced:
        found["radiance"], found["standard_error"], lost = read_paths(job)
        found["valid"] &= lost <= MOST_LOST
    elif job.features.traced:
        # Rays that end inside a body, or in more of them than they can remember, have no right color.
        trusted = read_floats(job.targets["surfaced"], 1, 4)[..., 3] if trusted is None else trusted
        found["valid"] &= trusted >= np.float32(1.0 - MOST_LOST)
    if job.plan.ordered:
        counts = read_floats(job.targets["ordered"], 2, 4)[::-1]
        found["layers"] = np.rint(counts[..., 0]).astype(np.int32)
        found["truncated"] = np.rint(counts[..., 0] - counts[..., 1]).astype(np.int32)
    if job.features.has_surfaces:
        found["normals"] = _read_normals(job)
    return found


def _whole_arrays(job: FrameJob) -> dict[str, Any]:
    result = job.targets["result"]
    flags = np.empty(job.targets.size[::-1], dtype=np.uint8)
    result.read_into(flags, components=1, attachment=4, alignment=1)
    return {
        "radiance": read_floats(job.picture, 0, 3),
        "transmittance": read_floats(result, 1, 3),
        "optical_depth": read_floats(result, 2, 3),
        "thickness": read_floats(result, 3, 1),
        "coverage": (flags & 1).astype(bool),
        "valid": (flags & 2).astype(bool),
    }


def _compact_arrays(job: FrameJob) -> dict[str, Any]:
    marked = _fixed(read_floats(job.compact_result, 1, 1))
    if job.plan.spectral:
        values = _fixed(read_floats(job.compact_result, 2, 3))
        depth, through = Deferred(copied, values), Deferred(transmittance_of, values)
    else:
        extinction = bounded_extinction(job.scene.bodies[0].medium, job.scene.diagonal).astype(np.float32)
        depth = Deferred(optical_depth_of, marked, extinction)
        through = Deferred(transmitted_of, marked, extinction)
    return {
        "radiance": read_floats(job.compact_result, 0, 3),
        "transmittance": through,
        "optical_depth": depth,
        "thickness": Deferred(thickness_of, marked),
        "coverage": Deferred(coverage_of, marked, COVERAGE_FLOOR * job.scene.diagonal),
        "valid": Deferred(valid_of, marked),
    }


def _fixed(values: Floats) -> Floats:
    """Read-only copy of values, because arrays of frames are computed from them later."""
    values.setflags(write=False)
    return values


def _read_normals(job: FrameJob) -> Floats:
    """(h, w, 3): normals of the interfaces that the interfaces pass has found, 0 where there is none."""
    width, height = job.targets.size
    normals = np.zeros((height, width, 3), dtype=np.float32)
    if job.covered:
        found = read_floats(job.targets["entered"], 0, 4)[::-1]
        np.copyto(normals, found[..., :3], where=found[..., 3:] < float(CONSTANTS["NOTHING"]))
    return normals


def read_paths(job: FrameJob) -> tuple[Floats, Floats, Floats]:
    """Radiance (h, w, 3) of random paths, its standard error, and the fraction (h, w) of them that were lost."""
    count = job.paths_traced
    known = job.targets["paths"]
    mean, squares = read_floats(known, 0, 4), read_floats(known, 1, 3)
    with np.errstate(under="ignore"):
        error = np.sqrt(squares / np.float32(count * (count - 1.0)))
        return np.ascontiguousarray(mean[..., :3]), error, mean[..., 3] / np.float32(count)


#: Passes that make no more than light, which the averages have when the rest is found at the pixel centers.
_LIGHT = (PassName.CAUSTICS, PassName.SURFACES, PassName.TRACED, PassName.PATH_TRACE)


class GpuRenderer:
    """Renderer that runs plans with OpenGL.

    Parameters
    ----------
    backend : {"egl", "window", "osmesa"}, optional
        None picks: EGL, else OSMesa.
    context : moderngl.Context, optional
        Draw with a context that somebody else owns, such as a window's. It must be current during every call, and is
        never released.

    Attributes
    ----------
    context : GpuContext
        The OpenGL context and where it comes from.

    Raises
    ------
    InputError
        If the backend is not known.
    NoContextError
        If there is no OpenGL 3.3; the message lists what was tried.
    """

    def __init__(self, backend: str | None = None, context: moderngl.Context | None = None) -> None:
        self.context: GpuContext = open_context(backend) if context is None else adopt_context(context)
        self._resources = Resources(self.context.gl)
        self._software = "software" in self.context.renderer
        with self.context.current():
            self._timer = PassTimer(self.context.gl)
        self._targets: Targets | None = None
        self._passes: dict[type[Pass], Pass] = {}
        self._present: PresentPass | None = None
        self._adaptive: AdaptiveSampling | None = None
        self._pid = os.getpid()
        self._closed = False
        self._interrupted = False
        self._turn = threading.Lock()
        # A renderer that nobody closed must not keep its memory; the context takes all its objects along.
        self._abandoned = weakref.finalize(self, _release, self.context.gl, os.getpid()) if self.context.owned else None

    @property
    def diffusion(self) -> DiffusionCache:
        """Cache of solutions for the light that diffuses in bodies."""
        return self._resources.diffusion

    @property
    def meshes(self) -> MeshCache:
        """Buffers of meshes."""
        return self._resources.meshes

    @property
    def shadows(self) -> ShadowAtlas:
        """Maps of shadows of the last scene that has any."""
        return self._resources.shadows

    @property
    def provenance(self) -> dict[str, str]:
        """Backend, device and driver, as every frame records them."""
        return self.context.provenance

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this OpenGL for the planner."""
        return Capabilities(
            shader_storage=self.context.gl.version_code >= SHADER_STORAGE,
            texture_units=self._resources.texture_units,
            software=self._software,
        )

    def render(
        self,
        plan: RenderPlan,
        size: tuple[int, int],
        backdrop: Backdrop | TextureBackdrop | None = None,
        report: Callable[[float], None] | None = None,
    ) -> Frame:
        """Run a plan; radiance and transmittance are the mean of the sub-pixel samples that its request has.

        A plan over a backdrop needs it, in the size of the frame. `report` takes the fraction of the work that is done,
        now and then.
        """
        samples = plan.request.samples
        with self._alone(), self.context.current():
            job = self.prepare(plan, size, backdrop, compact=True)
            job.report = report or job.report
            try:
                self._timer.begin_frame()
                if samples > 1:
                    self._average(job, samples)
                    job.averaging, job.averaged, job.sample, job.samples = False, True, 0, 1
                    job.place((0.0, 0.0))
                self._run_passes(job, leave_out=_LIGHT if samples > 1 else ())
                return self.read(job, samples)
            finally:
                job.release()
                self.context.drain()

    def draw(self, plan: RenderPlan, framebuffer: moderngl.Framebuffer, exposure: float, tone: str) -> None:
        """Run a plan and show its radiance, `exposure` stops brighter, in a framebuffer of the context."""
        with self._alone(), self.context.current():
            job = self.prepare(plan, framebuffer.size)
            try:
                self.run(job)
                if self._present is None:
                    self._present = PresentPass(self.context.gl)
                self._present.run(job, framebuffer, exposure, tone)
            finally:
                job.release()
                self.context.drain()

    def prepare(
        self,
        plan: RenderPlan,
        size: tuple[int, int],
        backdrop: Backdrop | TextureBackdrop | None = None,
        targets: Targets | None = None,
        *,
        compact: bool = False,
    ) -> FrameJob:
        """Prepare the job that `run` needs for a frame, placed for the pixel centers. The caller releases it.

        Without `targets` of its own it is drawn into those of the last frame. A `compact` one is for `read` alone.
        """
        self._require_open()
        if targets is not None:
            return FrameJob(self.context.gl, plan, targets, self._resources, backdrop, compact=compact)
        if self._targets is None or self._targets.size != size:
            old, self._targets = self._targets, None
            targets = Targets(self.context.gl, size)
            if old is not None:
                targets.nothing().use()  # a released framebuffer must not be the bound one
                old.release()
            self._targets = targets
        return FrameJob(self.context.gl, plan, self._targets, self._resources, backdrop, compact=compact)

    def run(self, job: FrameJob, *, geometry_only: bool = False, leave_out: tuple[PassName, ...] = ()) -> None:
        """Run the passes of the job's plan, each timed; `geometry_only` leaves out those over pixels."""
        self._timer.begin_frame()
        self._run_passes(job, geometry_only=geometry_only, leave_out=leave_out)

    @property
    def paths(self) -> PathTracer:
        """Tracer of random paths, which `run` takes, too."""
        step = self.step(PathTracePass)
        assert isinstance(step, PathTracePass)
        return step.tracer

    @property
    def photons(self) -> CausticsPass:
        """Follower of photons, which `run` takes, too."""
        step = self.step(CausticsPass)
        assert isinstance(step, CausticsPass)
        return step

    def noise(self, job: FrameJob) -> float:
        """Root mean square of the standard error of a job's random paths so far, divided by their mean radiance."""
        radiance, error, _ = read_paths(job)
        with np.errstate(under="ignore"):
            mean, noise = radiance.mean(dtype=np.float64), np.square(error, dtype=np.float64).mean()
        return float(np.sqrt(noise) / max(mean, np.finfo(np.float32).tiny))

    def _run_passes(self, job: FrameJob, *, geometry_only: bool = False, leave_out: tuple[PassName, ...] = ()) -> None:
        for spec in job.plan.passes:
            if (geometry_only and not spec.geometry_passes) or spec.name in leave_out:
                continue
            before_drawing(self.context.gl)
            step = self.step(PASSES[spec.name])  # compiles on first use, which is no part of the frame
            with self._timer.measure(spec.name):
                step.run(job, spec)

    def pass_seconds(self) -> dict[str, float]:
        """Seconds that the GPU spent on each pass of the last frame; blocks until it is done."""
        return self._timer.seconds()

    def read(self, job: FrameJob, samples: int = 1) -> Frame:
        """Read the frame from the job's targets, with radiance and transmittance averaged if sampled."""
        arrays = read_arrays(job, samples)
        seconds = self._timer.seconds()
        seconds["total"] = time.perf_counter() - job.started
        provenance = dict(self.provenance)
        if job.bent_apart:
            provenance["traced_samples"] = f"{traced_samples(job):.1f} of {samples}"
        if job.plan.hits == "embree":
            provenance["hits"] = "Embree {embree} (embreex {embreex})".format(**embree_versions())
        elif job.plan.hits:
            provenance["hits"] = HITS[job.plan.hits]
        return Frame(plan=job.plan, seconds=seconds, provenance=provenance, **arrays)

    def close(self) -> None:
        """Free all OpenGL objects, and the context if it is ours. Closing twice is fine."""
        if self._closed:
            return
        self._closed = True
        if self._pid != os.getpid():
            return  # they are those of another process
        if not self._interrupted:
            with self.context.current():
                self._resources.release()
                if self._targets is not None:
                    self._targets.release()
                self._passes.clear()
                self._present = self._adaptive = None
                self.context.drain()
        elif self.context.owned:
            # Released while a query runs, or while its threads draw, the context of llvmpipe corrupts the heap.
            with self.context.current():
                self._timer.stop()
                self.context.gl.finish()
        if self._abandoned is not None:
            self._abandoned()

    @property
    def interrupted(self) -> bool:
        """True if a frame was interrupted at an unknown point, as by Ctrl-C."""
        return self._interrupted

    def interrupt(self) -> None:
        """Stop drawing for good, as half-finished work would show up in later frames."""
        self._interrupted = True
        self.context.forget()
        if not self.context.owned and self._pid == os.getpid():
            self._timer.stop()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse to begin a frame during another one, in another thread or in a progress callback."""
        require_own_process()
        if not self._turn.acquire(blocking=False):
            raise RenderError(
                "rendering",
                "this renderer is in the middle of another picture",
                "create one renderer for each thread, and begin no picture in a progress callback",
            )
        try:
            yield
        except moderngl.Error as error:
            if "was released" in str(error):
                raise RenderError(
                    "rendering", "the OpenGL context was released during the frame", "create a new renderer"
                ) from error
            if not any(words in str(error) for words in ("not complete", "cannot create")):
                raise
            raise RenderError(
                "rendering", f"OpenGL does not have enough memory for the picture ({error})", "choose a smaller picture"
            ) from error
        finally:
            self._turn.release()

    def _require_open(self) -> None:
        if self._closed or self._interrupted:
            how = "the renderer was interrupted" if self._interrupted and not self._closed else "the renderer is closed"
            raise RenderError("rendering", how, "create a new renderer")

    def step(self, kind: type[Pass]) -> Pass:
        """The pass of a kind, made when it is first requested, with the context current."""
        if kind not in self._passes:
            before_making(self.context.gl)
            self._passes[kind] = kind(self.context.gl)
        return self._passes[kind]

    def _average(self, job: FrameJob, samples: int) -> None:
        """Render `samples` times with sub-pixel shifts, and add the pictures up."""
        job.averaging = True
        if job.plan.request.adaptive and is_adaptive(job, samples):
            self._adaptive = self._adaptive or AdaptiveSampling(self.context.gl)
            self._adaptive.run(job, samples, lambda leave_out: self._run_passes(job, leave_out=leave_out))
            return
        job.targets["average"].clear()
        for number, (right, down) in enumerate(sample_shifts(samples)):
            job.sample, job.samples = number, samples
            job.place((right, down))
            self._run_passes(job)
            if not job.features.path_traced:  # of these, the fraction of paths is reported
                self.context.gl.finish()
                job.report((number + 1) / samples)


def _release(gl: moderngl.Context, pid: int) -> None:
    """Release a context, but not in a process forked from its owner."""
    if pid == os.getpid():
        gl.release()
