"""Thin sheets: every face adds its thickness over the cosine."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.planning.passes import PassSpec
from translucent.scene.surface import LEAST_COVER


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
