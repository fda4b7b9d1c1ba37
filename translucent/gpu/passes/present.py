"""Tone mapping of a finished frame for display."""

from __future__ import annotations

import moderngl

from translucent.formulas.tone import TONES
from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program, set_uniform


class PresentPass:
    """Exposure, tone curve and sRGB encoding of the frame's radiance, into any framebuffer of the same size."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._curves: dict[str, tuple[moderngl.Program, moderngl.VertexArray]] = {}

    def run(self, job: FrameJob, framebuffer: moderngl.Framebuffer, stops: float, tone: str) -> None:
        """Draw the radiance, `stops` brighter, through the curve of that name."""
        if tone not in self._curves:
            defines = {"TONE": TONES.index(tone)}
            program = build_program(self._gl, "geometry/fullscreen.vert", "present/present.frag", defines, picture=0)
            self._curves[tone] = program, self._gl.vertex_array(program, [])
        program, fullscreen = self._curves[tone]
        framebuffer.use()
        job.gl.enable_only(moderngl.NOTHING)
        job.picture.color_attachments[0].use(0)
        set_uniform(program, "stops", stops)
        fullscreen.render(moderngl.TRIANGLES, vertices=3)
