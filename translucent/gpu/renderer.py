"""The renderer: plans a scene, runs the passes, reads the result."""

from __future__ import annotations

import sys
import time
import warnings
import weakref
from functools import cached_property
from importlib.metadata import version
from types import TracebackType
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.camera import check_size
from translucent.errors import InputError, RenderError, TranslucentWarning
from translucent.frame import Frame
from translucent.gpu.buffers import MeshCache
from translucent.gpu.context import GpuContext, adopt_context, open_context
from translucent.gpu.job import FrameJob
from translucent.gpu.passes import PASSES, Pass
from translucent.gpu.passes.present import PresentPass
from translucent.gpu.targets import Targets
from translucent.gpu.timer import PassTimer
from translucent.plan import RenderPlan, plan
from translucent.scene import Scene
from translucent.thickness import Method

#: More samples per pixel change nothing that 8 bits could show.
MAX_SAMPLES = 4096


class Renderer:
    """Renders scenes with OpenGL. Use it as a context manager: leaving it frees everything.

    Parameters
    ----------
    backend : {"egl", "window", "osmesa"}, optional
        None picks: EGL, else OSMesa.
    context : moderngl.Context, optional
        Draw with a context that somebody else owns, such as a window's. It must be current during every call, and is
        never released.

    Raises
    ------
    InputError
        If the backend is not known.
    NoContextError
        If there is no OpenGL 3.3; the message lists what was tried.
    """

    def __init__(self, backend: str | None = None, context: moderngl.Context | None = None) -> None:
        if context is not None and backend is not None:
            raise InputError(f"backend {backend!r}", "a context is given, too", "give one of the two")
        self._gpu: GpuContext = open_context(backend) if context is None else adopt_context(context)
        self._meshes = MeshCache(self._gpu.gl)
        with self._gpu.current():
            self._timer = PassTimer(self._gpu.gl)
        self._targets: Targets | None = None
        self._passes: dict[type[Pass], Pass] = {}
        self._present: PresentPass | None = None
        self._plans: WeakKeyDictionary[Scene, dict[Method | None, RenderPlan]] = WeakKeyDictionary()
        self._closed = False
        # A renderer that nobody closed must not keep its memory; the context takes all its objects along.
        self._abandoned = weakref.finalize(self, self._gpu.gl.release) if self._gpu.owned else None

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def gpu(self) -> GpuContext:
        """The OpenGL context and where it comes from."""
        return self._gpu

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Backend, driver and versions, as every frame records them."""
        return {
            **self._gpu.provenance,
            "numpy": np.__version__,
            "python": sys.version.split()[0],
            "translucent": version("translucent-shading"),
        }

    def render(self, scene: Scene, size: tuple[int, int], method: Method | None = None, samples: int = 1) -> Frame:
        """Render a scene.

        Parameters
        ----------
        scene : Scene
        size : (width, height)
            In pixels.
        method : Method, optional
            How to find thickness; None lets the planner pick.
        samples : int
            Sub-pixel samples over which radiance and transmittance are averaged, for smooth edges. The other arrays
            belong to the ray through the pixel center, as all do with 1.

        Returns
        -------
        Frame
            With float32 arrays. Pixels that cannot be trusted are False in `valid`, and one `TranslucentWarning`
            counts them.

        Raises
        ------
        InputError
            If the size is not positive, or no method can render the scene.
        RenderError
            If the frame is larger than this OpenGL allows.
        """
        if not isinstance(samples, int) or not 1 <= samples <= MAX_SAMPLES:
            raise InputError(f"samples {samples!r}", f"not a whole number in 1 to {MAX_SAMPLES}", "give for example 16")
        self._require_open()
        with self._gpu.current():
            job = self.prepare(scene, size, method)
            try:
                self.run(job)
                if samples > 1:
                    self._average(job, samples)
                frame = self.read(job)
            finally:
                job.release()
                self._gpu.drain()
        self._warn(frame)
        return frame

    def draw(
        self,
        scene: Scene,
        framebuffer: moderngl.Framebuffer,
        method: Method | None = None,
        exposure: float = 0.0,
    ) -> RenderPlan:
        """Render a scene into a framebuffer of this renderer's context, sRGB-encoded, without reading anything back.

        Parameters
        ----------
        scene : Scene
        framebuffer : moderngl.Framebuffer
            Its size is the frame's.
        method : Method, optional
        exposure : float
            Stops brighter.
        """
        self._require_open()
        with self._gpu.current():
            job = self.prepare(scene, framebuffer.size, method)
            try:
                self.run(job)
                if self._present is None:
                    self._present = PresentPass(self._gpu.gl)
                self._present.run(job, framebuffer, exposure)
            finally:
                job.release()
                self._gpu.drain()
        return job.plan

    def prepare(self, scene: Scene, size: tuple[int, int], method: Method | None = None) -> FrameJob:
        """Everything that `run` needs for a frame, placed for the pixel centers. The caller releases it."""
        self._require_open()
        size = check_size(size)
        if method is not None and not isinstance(method, Method):
            raise InputError(f"method {method!r}", "not a thickness method", "give for example tl.SignedDepth()")
        plans = self._plans.setdefault(scene, {})
        if method not in plans:
            plans[method] = plan(scene, method)
        if self._targets is None or self._targets.size != size:
            if self._targets is not None:
                self._targets.release()
                self._targets = None
            self._targets = Targets(self._gpu.gl, size)
        return FrameJob(self._gpu.gl, scene, plans[method], self._targets, self._meshes)

    def run(self, job: FrameJob, *, geometry_only: bool = False) -> None:
        """Run the passes of the job's plan, each timed; `geometry_only` leaves out those over pixels."""
        gl = self._gpu.gl
        gl.viewport = (0, 0, *job.targets.size)
        self._timer.begin_frame()
        for spec in job.plan.passes:
            if geometry_only and not spec.geometry_passes:
                continue
            step = self._pass(PASSES[spec.name])  # compiles on first use, which is no part of the frame
            with self._timer.measure(spec.name):
                step.run(job, spec)

    def read(self, job: FrameJob) -> Frame:
        """The frame that the passes have left in the job's targets."""
        result = job.targets.result()
        if job.samples > 1:
            averages = job.targets.average()
            with np.errstate(under="ignore"):
                radiance, transmittance = (_read_floats(averages, i, 3) / np.float32(job.samples) for i in range(2))
        else:
            radiance, transmittance = (_read_floats(result, i, 3) for i in range(2))
        flags = np.empty(job.targets.size[::-1], dtype=np.uint8)
        result.read_into(flags, components=1, attachment=4, alignment=1)
        optical_depth, thickness = _read_floats(result, 2, 3), _read_floats(result, 3, 1)
        seconds = self._timer.seconds()
        seconds["total"] = time.perf_counter() - job.started
        return Frame(
            radiance=radiance,
            transmittance=transmittance,
            optical_depth=optical_depth,
            thickness=thickness,
            coverage=(flags & 1).astype(bool),
            valid=(flags & 2).astype(bool),
            plan=job.plan,
            seconds=seconds,
            provenance=dict(self.provenance),
        )

    def close(self) -> None:
        """Free all OpenGL objects, and the context if it is ours. Closing twice is fine."""
        if self._closed:
            return
        self._closed = True
        with self._gpu.current():
            self._meshes.release()
            if self._targets is not None:
                self._targets.release()
            self._passes.clear()
            self._present = None
            self._gpu.drain()
        if self._abandoned is not None:
            self._abandoned()

    def _require_open(self) -> None:
        if self._closed:
            raise RenderError("rendering", "the renderer is closed", "make a new one")

    def _pass(self, kind: type[Pass]) -> Pass:
        if kind not in self._passes:
            self._passes[kind] = kind(self._gpu.gl)
        return self._passes[kind]

    def _average(self, job: FrameJob, samples: int) -> None:
        """Add up `samples` shifted renderings in the target for averages."""
        job.targets.average().clear()
        job.samples = samples
        for right, down in sample_shifts(samples):
            job.place((right, down))
            for spec in job.plan.passes:
                self._pass(PASSES[spec.name]).run(job, spec)

    def _warn(self, frame: Frame) -> None:
        if invalid := int(np.count_nonzero(~frame.valid)):
            covered = int(np.count_nonzero(frame.coverage))
            why = "; ".join(frame.plan.limits) or "a surface that does not balance"
            warnings.warn(
                f"{invalid} pixels are not valid ({covered} are covered): {why}", TranslucentWarning, stacklevel=3
            )


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns that numbers other than powers of 2 lose the balance of the sequence; they are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        points = qmc.Sobol(2, scramble=False).random(samples)
    shifts = points + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))


def _read_floats(framebuffer: moderngl.Framebuffer, attachment: int, components: int) -> npt.NDArray[np.float32]:
    width, height = framebuffer.size
    shape = (height, width) if components == 1 else (height, width, components)
    array = np.empty(shape, dtype=np.float32)
    framebuffer.read_into(array, components=components, attachment=attachment, alignment=1, dtype="f4")
    return array
