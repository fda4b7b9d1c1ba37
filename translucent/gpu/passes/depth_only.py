"""Depth-only pass: the baseline that every other cost is measured against."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program


class DepthOnlyPass:
    """Drawing of objects, both sides, into a depth buffer. The job must be placed ``with_depth``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._program = build_program(
            gl, "geometry/body.vert", "thickness/depth_only.frag", {"WITH_NORMAL": 0, "WITH_POSITION": 0}
        )

    def run(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw the objects with the depth test on."""
        framebuffer = job.targets.depth_only()
        framebuffer.use()
        job.gl.enable_only(moderngl.DEPTH_TEST)
        framebuffer.clear(depth=1.0)
        job.draw(self._program, objects)
