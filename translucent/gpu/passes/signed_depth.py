"""Signed depth: one draw per body, in any order, added up."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program
from translucent.plan import PassSpec


class SignedDepthPass:
    """Adds sign * distance and sign of every face to the accumulator; see ``shaders/thickness/signed_depth.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._programs = {
            spectral: build_program(
                gl, "geometry/body.vert", "thickness/signed_depth.frag", {"SPECTRAL": spectral, "WITH_NORMAL": 0}
            )
            for spectral in (False, True)
        }

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies."""
        gl = job.gl
        job.accumulator(spec.target).use()
        # No depth test and no culling: every face counts. Order cannot matter to a sum.
        gl.enable_only(moderngl.BLEND)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        job.draw(self._programs[job.plan.spectral], spec.objects)
