"""A finished frame on a display."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.shaders import build_program, set_uniform
from translucent.tone import TONES


class PresentPass:
    """Exposure, tone curve and sRGB encoding of the frame's radiance, into any framebuffer of the same size."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._program = build_program(gl, "geometry/fullscreen.vert", "present/present.frag", picture=0)
        self._fullscreen = gl.vertex_array(self._program, [])

    def run(self, job: FrameJob, framebuffer: moderngl.Framebuffer, stops: float, tone: str) -> None:
        """Draw the radiance, `stops` brighter, through the curve of that name."""
        framebuffer.use()
        job.gl.enable_only(moderngl.NOTHING)
        job.picture.color_attachments[0].use(0)
        set_uniform(self._program, "stops", stops)
        set_uniform(self._program, "tone", TONES.index(tone))
        self._fullscreen.render(moderngl.TRIANGLES, vertices=3)
