"""Thin sheets: every face adds its thickness over the cosine."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program
from translucent.plan import PassSpec


class ThinLayerPass:
    """Adds the path through each sheet; see ``shaders/thickness/thin_layer.frag``.

    As ``thin_layer_fallback`` it fills a target of its own, from which pixels that do not balance take their path.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._programs = {
            spectral: build_program(
                gl, "geometry/body.vert", "thickness/thin_layer.frag", {"SPECTRAL": spectral, "WITH_NORMAL": 1}
            )
            for spectral in (False, True)
        }

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the sheets."""
        job.begin_adding(spec.target)
        job.draw(self._programs[job.plan.spectral], spec.objects)
