"""k-buffer: one draw in which each pixel keeps the k nearest crossings in order."""

from __future__ import annotations

from typing import cast

import moderngl
import numpy as np

from translucent.gpu.constants import STORAGE_BINDINGS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants, walk_switches
from translucent.gpu.shaders import set_uniform
from translucent.planning.methods import KBuffer
from translucent.planning.passes import PassSpec


class KBufferPass:
    """k-buffer filled with atomic minima; see ``shaders/intervals/k_buffer.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._insert = Variants(gl, "geometry/body.vert", "intervals/k_buffer.frag", "opaque_axial_depth", version=430)
        self._resolve = Variants(
            gl,
            "geometry/fullscreen.vert",
            "intervals/k_buffer_resolve.frag",
            "opaque_axial_depth",
            "steepest",
            version=430,
        )

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies, then walk along the crossings that were kept."""
        job.clear_layers()
        if not job.covered:
            return
        gl, k = job.gl, cast(KBuffer, job.plan.method).k
        width, height = job.targets.size
        words = job.targets.buffers.get("words", 4 * (k + 1) * width * height)
        # A count of 0, and k times no crossing.
        words.clear(chunk=np.array([0] + [0xFFFFFFFF] * k, np.uint32).tobytes(), size=4 * (k + 1) * width * height)
        words.bind_to_storage_buffer(STORAGE_BINDINGS["words"])
        steepest = job.targets["steepest"]
        steepest.use()
        steepest.clear()
        gl.enable_only(moderngl.BLEND)
        gl.blend_func = moderngl.ONE, moderngl.ONE
        gl.blend_equation = moderngl.MAX
        job.bind_opaque(0)
        program = self._insert.program(WITH_NORMAL=0, WITH_POSITION=0, OPAQUE=job.features.has_opaque)
        set_uniform(program, "k", k)
        job.draw(program, spec.objects)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.enable_only(moderngl.NOTHING)
        gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
        steepest.color_attachments[0].use(1)
        program = self._resolve.program(
            **walk_switches(job.features), OPAQUE=job.features.has_opaque, INTERFACES=job.features.finds_exits
        )
        set_uniform(program, "k", k)
        self._resolve.draw_covered(job, program, job.targets["ordered"])
        # The next frame must not clear the words before these have been walked along.
        gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)
