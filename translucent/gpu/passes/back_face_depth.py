"""Back-face depth: nearest front face, then farthest back face."""

from __future__ import annotations

import moderngl

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.planning.passes import PassSpec


class BackFaceDepthPass:
    """Extreme distances by maximum blending, with a count of faces that finds concave pixels."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._faces = Variants(gl, "geometry/body.vert", "thickness/back_face_depth.frag", "opaque_axial_depth")
        combine = "thickness/back_face_combine.frag"
        self._combine = Variants(gl, "geometry/fullscreen.vert", combine, "nearest_and_farthest")

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw front faces, then back faces, then turn both into a path."""
        gl = job.gl
        nothing = -float(CONSTANTS["NOTHING"])
        faces = job.targets["nearest_and_farthest"]
        faces.use()
        faces.clear(nothing, nothing, 0.0, 0.0)
        gl.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        gl.blend_func = moderngl.ONE, moderngl.ONE
        gl.blend_equation = moderngl.MAX, moderngl.FUNC_ADD
        job.bind_opaque(0)
        combine = self._combine.program()
        program = self._faces.program(WITH_NORMAL=0, WITH_POSITION=0, OPAQUE=job.features.has_opaque)
        for culled in ("back", "front"):
            gl.cull_face = culled
            job.draw(program, spec.objects)
        gl.cull_face = "back"
        gl.blend_equation = moderngl.FUNC_ADD
        gl.enable_only(moderngl.NOTHING)
        job.accumulator().use()
        self._combine.bind(nearest_and_farthest=faces.color_attachments[0])
        self._combine.draw_fullscreen(combine)
