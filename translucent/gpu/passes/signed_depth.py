"""Signed depth: one draw per body, in any order, added up."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.planning.passes import PassSpec


class SignedDepthPass:
    """Sum of sign * distance, and of sign, over all faces; see ``shaders/thickness/signed_depth.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "thickness/signed_depth.frag", opaque_axial_depth=0)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies."""
        job.begin_adding(spec.target)
        job.bind_opaque(0)
        switches = {"SPECTRAL": job.plan.spectral, "OPAQUE": job.features.has_opaque, "PATH_ONLY": job.path_only}
        job.draw(self._variants.program(WITH_NORMAL=0, WITH_POSITION=0, **switches), spec.objects)
