"""Still pictures that get better as long as nobody changes them: more random paths, and more photons."""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.path_trace import TILE, Progress
from translucent.gpu.renderer import GpuRenderer
from translucent.gpu.targets import Targets
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.scene.camera import Lens

#: Largest number of rounds that are followed at once.
MOST_ROUNDS = 256


class PhotonPicture:
    """Light of photons on the opaque objects of a picture: the mean of rounds, each with the photons of the plan.

    Each round follows other photons, and by itself expects the right light everywhere.

    Parameters
    ----------
    engine : GpuRenderer
    plan : RenderPlan
        With caustics.
    size : (width, height)

    Attributes
    ----------
    rounds : int
        Rounds that have ended.
    texture : moderngl.Texture
        RGBA32F: radiance of that light, as of the last call of `show`.
    error : float
        Root mean square over the picture of its standard error, estimated from what the last two calls of `show`
        differ by; infinite before there are two.
    """

    def __init__(self, engine: GpuRenderer, plan: RenderPlan, size: tuple[int, int]) -> None:
        self._pass, gl = engine.photons, engine.context.gl
        self._gl = gl
        self.rounds, self.error = 0, np.inf
        self._at_once, self._before = 1, (0, np.zeros(0, np.float32))
        objects = next(step.objects for step in plan.passes if step.name is PassName.CAUSTICS)
        with ExitStack() as stack:
            self.texture = gl.texture(size, 4, dtype="f4")
            stack.callback(self.texture.release)
            self._into = gl.framebuffer([self.texture])
            stack.callback(self._into.release)
            targets = Targets(gl, size)
            stack.callback(targets.release)
            self._job = engine.prepare(plan, size, targets=targets)
            stack.callback(self._job.release)
            stack.callback(lambda: gl.detect_framebuffer(0).use())  # a released framebuffer must not be the bound one
            self._pass.draw_depth(self._job, objects)
            self._pass.draw_base(self._job, objects)
            self._tracer = self._pass.begin(stack, self._job)
            self._stack = stack.pop_all()

    @property
    def photons(self) -> int:
        """Photons that have been followed."""
        return self.rounds * sum(aim.photons for aim in self._tracer.aims)

    def step(self, seconds: float) -> None:
        """Follow photons for about so many seconds, one round at least."""
        end = time.perf_counter() + seconds
        while True:
            begun = time.perf_counter()
            last = self.rounds + self._at_once
            self._job.uniforms.bind()
            for number, aim in enumerate(self._tracer.aims):
                self._pass.follow(self._job, self._tracer, number, self.rounds * aim.photons, last * aim.photons)
            self._gl.finish()
            self.rounds = last
            spent = time.perf_counter() - begun
            if spent < 0.25 * seconds:
                self._at_once = min(2 * self._at_once, MOST_ROUNDS)
            elif spent > seconds:
                self._at_once = max(self._at_once // 2, 1)
            if time.perf_counter() + spent > end:
                return

    def show(self) -> None:
        """Write the mean of all photons so far into `texture`, and estimate its error."""
        self._job.uniforms.bind()
        self._into.clear()
        self._pass.shade(self._job, self._into, self.rounds)
        before = self._before[1]
        light = np.frombuffer(self._into.read(components=3, dtype="f4"), np.float32).copy()
        if before.size:
            # Half of the rounds were in both: their difference varies as the mean of all does.
            with np.errstate(under="ignore"):
                ratio = self._before[0] / (self.rounds - self._before[0])
                self.error = float(np.sqrt(ratio * np.square(light - before, dtype=np.float64).mean()))
        self._before = self.rounds, light

    def release(self) -> None:
        """Free what belongs to it."""
        self._stack.close()


#: Paths of each pixel after which a picture is done, and most of them between two pictures.
MOST_PATHS, MOST_PATHS_AT_ONCE = 4096, 16

#: Paths of each pixel through a point of a lens, and those points.
LENS_PATHS, LENS_POINTS = 4, 256

#: Noise of the picture, as a fraction of its mean radiance, at which it is done, too.
QUIET = 1e-3

#: Side of tiles where pixels take long, so that a pass over one does not.
SOFTWARE_TILE = 128


class Convergence:
    """Picture of a scene that more and more paths make.

    Parameters
    ----------
    engine : GpuRenderer
        Draws nothing else meanwhile.
    plan : RenderPlan
        With random paths.
    size : (width, height)
    lens : Lens, optional
        Each round has paths through another point of it.

    Attributes
    ----------
    job : FrameJob
        Of the last round, whose `picture` shows the paths of the last round.
    paths : int
        Of each pixel, in that picture.
    error : float
        Root mean square of its standard error, divided by its mean radiance.
    """

    def __init__(self, engine: GpuRenderer, plan: RenderPlan, size: tuple[int, int], lens: Lens | None = None) -> None:
        self._engine, self._size, self._lens = engine, size, lens
        self.plan = plan
        self.paths, self.error = 0, np.inf
        self._tile = SOFTWARE_TILE if "software" in engine.context.renderer else TILE
        self._round: Generator[Progress, None, None] | None = None
        self.job: FrameJob = self._placed()

    def _placed(self) -> FrameJob:
        """Job with all but the paths, from the pinhole or the next point of the lens."""
        plan = self.plan
        if self._lens is not None:
            # Numbers with their binary digits reversed: any first points are spread over the whole lens.
            point = int(f"{self.paths // LENS_PATHS % LENS_POINTS:08b}"[::-1], 2)
            camera = self._lens.camera(plan.scene.camera, self._size, point, LENS_POINTS)
            plan = replace(plan, scene=replace(plan.scene, camera=camera))
        job = self._engine.prepare(plan, self._size)
        job.paths_traced = self.paths
        try:
            self._engine.run(job, leave_out=(PassName.PATH_TRACE,))
            if self.paths:
                self._engine.paths.show(job)
        except BaseException:
            job.release()
            raise
        return job

    @property
    def done(self) -> bool:
        """True if more paths would change nothing visible."""
        return self.paths >= MOST_PATHS or self.error < QUIET

    def step(self, seconds: float) -> bool:
        """Follow paths for about so many seconds; returns whether there is a new picture."""
        end = time.perf_counter() + seconds
        while True:
            if self._round is None:
                last = min(max(2 * self.paths, 2), self.paths + MOST_PATHS_AT_ONCE)
                if self._lens is not None:
                    last = self.paths + LENS_PATHS
                    if self.paths:
                        self.job.release()
                        self.job = self._placed()
                self._round = self._engine.paths.steps(
                    self.job, last, spread=True, seconds=0.5 * seconds, tile=self._tile
                )
            try:
                done = next(self._round).done
            except BaseException:
                self._round = None  # its first tile begins anew, if what it lacks is there
                raise
            if done:
                self._round = None
                self._engine.paths.show(self.job)
                self.paths = self.job.paths_traced
                self.error = self._engine.noise(self.job)
                return True
            if time.perf_counter() > end:
                return False

    def release(self) -> None:
        """Free what belongs to it."""
        if self._round is not None:
            self._round.close()
        self.job.release()
