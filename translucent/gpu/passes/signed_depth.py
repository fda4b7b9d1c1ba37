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
        self._paths = Variants(gl, "geometry/body.vert", "thickness/signed_path.frag", opaque_axial_depth=0)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies."""
        job.begin_adding(spec.target)
        job.bind_opaque(0)
        switches = {"WITH_NORMAL": False, "WITH_POSITION": False, "OPAQUE": job.features.has_opaque}
        program = (
            self._paths.program(**switches)
            if job.path_only
            else self._variants.program(SPECTRAL=job.plan.spectral, **switches)
        )
        job.draw(program, spec.objects)
