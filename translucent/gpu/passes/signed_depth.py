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
        opaque, switches = job.features.has_opaque, {"WITH_NORMAL": False, "WITH_POSITION": False}
        variants = self._paths if job.path_only else self._variants
        if not job.path_only:
            switches["SPECTRAL"] = job.plan.spectral
        if job.for_map:
            # Nothing has to be compiled when an opaque object gets into the way of a light, or out of it.
            variants.program(OPAQUE=not opaque, **switches)
        job.draw(variants.program(OPAQUE=opaque, **switches), spec.objects)
