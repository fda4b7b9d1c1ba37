"""Random paths of light over the whole picture, to their ends."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.path_tracer import PathTracer
from translucent.planning.passes import PassSpec


class PathTracePass:
    """Paths of each pixel, spread over the samples of a frame; see ``shaders/transport/path_trace.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._tracer = PathTracer(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Follow the paths that belong to this sample."""
        assert job.plan.paths is not None
        paths = job.plan.paths.paths
        last = paths * (job.sample + 1) // job.samples if job.averaging else paths
        if last > job.paths_traced:
            for progress in self._tracer.steps(job, last):
                job.report((job.sample + progress.share) / job.samples)
        self._tracer.show(job)
