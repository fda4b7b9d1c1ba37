"""Random paths of light over the whole picture, to their ends."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.path_tracer import PathTracer
from translucent.planning.passes import PassSpec


class PathTracePass:
    """Paths of each pixel, spread over the samples of a frame; see ``shaders/transport/path_trace.frag``.

    Attributes
    ----------
    tracer : PathTracer
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self.tracer = PathTracer(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Follow the paths of this sample, or where nothing else depends on it those of all samples at once.

        Opaque objects are drawn for each sample; paths that meet them first see that picture.
        """
        assert job.plan.paths is not None
        paths = job.plan.paths.paths
        if job.features.has_opaque:
            begun, last = (paths * (job.sample + i) // job.samples for i in range(2))
        else:
            begun, last = 0, 0 if job.sample < job.samples - 1 else paths
        if last > job.paths_traced:
            for progress in self.tracer.steps(job, last, spread=job.samples > 1 and not job.features.has_opaque):
                job.report((begun + progress.share * (last - begun)) / paths)
        self.tracer.show(job)
