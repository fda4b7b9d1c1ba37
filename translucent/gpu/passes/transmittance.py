"""From accumulated paths to radiance, and the mask of what can be trusted."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program
from translucent.plan import PassSpec

_SAMPLERS = ("accumulated", "accumulated_path", "fallback", "fallback_path")


class TransmittancePass:
    """Beer-Lambert over the background, per pixel; see ``shaders/shade/transmittance.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._variants: dict[tuple[bool, ...], moderngl.VertexArray] = {}

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Resolve the frame; for a job of several samples, add a sample's radiance and transmittance instead."""
        gl = job.gl
        fallback = any(step.target == "fallback" for step in job.plan.passes)
        emission = any(body.medium is not None and body.medium.emits for body in job.scene.bodies)
        inputs = [job.accumulator()] + ([job.accumulator("fallback")] if fallback else [])
        if job.samples > 1:
            job.targets.average().use()
            gl.enable_only(moderngl.BLEND)
            gl.blend_equation = moderngl.FUNC_ADD
            gl.blend_func = moderngl.ONE, moderngl.ONE
        else:
            job.targets.result().use()
            gl.enable_only(moderngl.NOTHING)
        for first, framebuffer in zip((0, 2), inputs, strict=False):
            for unit, texture in enumerate(framebuffer.color_attachments, first):
                texture.use(unit)
        variant = self._variant(job.plan.spectral, fallback, job.samples > 1, emission)
        variant.render(moderngl.TRIANGLES, vertices=3)

    def _variant(self, spectral: bool, fallback: bool, average: bool, emission: bool) -> moderngl.VertexArray:
        key = (spectral, fallback, average, emission)
        if key not in self._variants:
            defines = {"SPECTRAL": spectral, "FALLBACK": fallback, "AVERAGE": average, "EMISSION": emission}
            used = [
                name for name in _SAMPLERS if (spectral or "path" not in name) and (fallback or "fallback" not in name)
            ]
            program = build_program(
                self._gl,
                "geometry/fullscreen.vert",
                "shade/transmittance.frag",
                defines,
                **{name: _SAMPLERS.index(name) for name in used},
            )
            self._variants[key] = self._gl.vertex_array(program, [])
        return self._variants[key]
