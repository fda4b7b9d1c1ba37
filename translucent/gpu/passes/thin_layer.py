"""Thin sheets: every face adds its thickness over the cosine."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.render_plan import PassSpec


class ThinLayerPass:
    """Adds the path through each sheet; see ``shaders/thickness/thin_layer.frag``.

    As ``thin_layer_fallback`` it fills a target of its own, from which pixels that do not balance take their path.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "thickness/thin_layer.frag", opaque_place=0)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the sheets."""
        job.begin_adding(spec.target)
        job.bind_opaque(0)
        switches = {"SPECTRAL": job.plan.spectral, "OPAQUE": job.has_opaque}
        job.draw(self._variants.program(WITH_NORMAL=1, WITH_POSITION=0, **switches), spec.objects)
