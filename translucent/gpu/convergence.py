"""A still picture that goes on with random paths of light: a few more with every step, as long as nobody changes it."""

from __future__ import annotations

import time
from collections.abc import Generator

import numpy as np

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.path_trace import TILE, Progress
from translucent.gpu.renderer import GpuRenderer
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan

#: Paths of each pixel after which a picture is done, and most of them between two pictures.
MOST_PATHS, MOST_AT_ONCE = 4096, 16

#: Noise of the picture, as a share of its mean radiance, at which it is done, too.
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

    Attributes
    ----------
    job : FrameJob
        Whose `picture` shows the paths of the last round.
    paths : int
        Of each pixel, in that picture.
    error : float
        Root mean square of its standard error, divided by its mean radiance.
    """

    def __init__(self, engine: GpuRenderer, plan: RenderPlan, size: tuple[int, int]) -> None:
        self._engine = engine
        self.plan = plan
        self.paths, self.error = 0, np.inf
        self._tile = SOFTWARE_TILE if "software" in engine.context.renderer else TILE
        self._round: Generator[Progress, None, None] | None = None
        self.job: FrameJob = engine.prepare(plan, size)
        try:
            engine.run(self.job, leave_out=(PassName.PATH_TRACE,))
        except BaseException:
            self.job.release()
            raise

    @property
    def done(self) -> bool:
        """True if more paths would change nothing to be seen."""
        return self.paths >= MOST_PATHS or self.error < QUIET

    def step(self, seconds: float) -> bool:
        """Follow paths for about so many seconds; returns whether there is a new picture."""
        end = time.perf_counter() + seconds
        while True:
            if self._round is None:
                last = min(max(2 * self.paths, 2), self.paths + MOST_AT_ONCE)
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
