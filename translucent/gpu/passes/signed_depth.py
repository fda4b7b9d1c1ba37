"""Signed depth: one draw per body, in any order, added up."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.planning.passes import PassSpec


class SignedDepthPass:
    """Sum of sign * distance, and of sign, over all faces; see ``shaders/thickness/signed_depth.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "thickness/signed_depth.frag", "opaque_axial_depth")
        self._paths = Variants(gl, "geometry/body.vert", "thickness/signed_path.frag", "opaque_axial_depth")

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies."""
        job.bind_opaque(0)
        spectral = job.plan.spectral and job.media_apart is None
        opaque, plain = job.features.has_opaque, {"WITH_NORMAL": False, "WITH_POSITION": False}
        if job.path_only:
            variants = self._paths
            two = {"TWO_MEDIA": job.two_media}
            kinds = [
                two | {"OPAQUE": kind == 1, "PROJECTED_DEPTH": kind == 2} for kind in range(2 if job.two_media else 3)
            ]
            chosen = kinds[(2 if job.projected_depth else 1) if opaque else 0]
        else:
            variants = self._variants
            kinds = [{"OPAQUE": kind, "SPECTRAL": spectral} for kind in (False, True)]
            chosen = kinds[opaque]
        if job.for_map:
            # Nothing has to be compiled when an opaque object begins or ends to block a light.
            for kind in kinds:
                variants.program(**plain, **kind)
        program = variants.program(**plain, **chosen)
        for objects in job.adding(spec):
            if job.projected_depth:
                job.gl.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
            job.draw(program, objects)
