"""Opaque objects: where rays through the media end, and what is seen there."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import CONSTANTS
from translucent.render_plan import PassSpec


class OpaquePass:
    """Draws the nearest opaque surface of each pixel; see ``shaders/shade/opaque.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "shade/opaque.frag")

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the opaque objects with the depth test on."""
        framebuffer = job.targets.opaque()
        framebuffer.use()
        nothing = float(CONSTANTS["NOTHING"])
        framebuffer.clear(nothing, 0.0, 0.0, 0.0, depth=1.0)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        # Surfaces at the very end of the range count, too; and of surfaces in one place, those of the first object.
        job.gl.depth_func = "<="
        job.draw(self._variants.program(WITH_NORMAL=1, WITH_POSITION=1), spec.objects[::-1])
        job.gl.depth_func = "<"
