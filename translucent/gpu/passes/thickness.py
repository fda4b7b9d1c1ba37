"""Thickness from draws in any order: signed depth, back-face depth, and thin sheets."""

from __future__ import annotations

import moderngl

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.planning.passes import PassSpec
from translucent.scene.surface import LEAST_COVER


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


class ThinLayerPass:
    """Sum of the paths through each sheet; see ``shaders/thickness/thin_layer.frag``.

    As ``thin_layer_fallback`` it fills a target of its own, from which pixels that do not balance take their path.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        samplers = "opaque_axial_depth", "color_texture"
        self._variants = Variants(gl, "geometry/body.vert", "thickness/thin_layer.frag", *samplers)
        self._with_holes = Variants(gl, "geometry/holes.vert", "thickness/thin_layer.frag", *samplers)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the sheets."""
        job.begin_adding(spec.target)
        job.bind_opaque(0)
        switches = {"SPECTRAL": job.plan.spectral, "OPAQUE": job.features.has_opaque}
        holed = tuple(i for i in spec.objects if job.scene.objects[i].has_holes)
        if whole := tuple(i for i in spec.objects if i not in holed):
            plain = {"WITH_NORMAL": 1, "WITH_POSITION": 0, "HOLES": 0, "VERTEX_COLORS": 0}
            if job.for_map:
                self._variants.program(
                    **plain, **switches | {"OPAQUE": not switches["OPAQUE"]}
                )  # as in SignedDepthPass
            job.draw(self._variants.program(**plain, **switches), whole)
        for i in holed:
            body = job.scene.objects[i]
            assert body.surface is not None
            program = self._with_holes.program(HOLES=1, VERTEX_COLORS=body.mesh.colors is not None, **switches)
            job.resources.textures.bind_holes(body.surface, program, 1)
            set_uniform(program, "hole_below", body.surface.alpha_cutoff or LEAST_COVER)
            job.draw(program, (i,))
