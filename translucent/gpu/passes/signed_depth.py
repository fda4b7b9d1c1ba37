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
        job.begin_adding(spec.target)
        job.draw(self._programs[job.plan.spectral], spec.objects)
