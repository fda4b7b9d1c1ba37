"""Ordered crossings in one draw: a list for each pixel and a walk along each, or the k nearest in a k-buffer."""

from __future__ import annotations

from typing import cast

import moderngl
import numpy as np

from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS, STORAGE_BINDINGS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants, walk_switches
from translucent.gpu.shaders import set_uniform
from translucent.planning.methods import KBuffer, RayMarched
from translucent.planning.passes import PassSpec

#: Bytes of a node: a word and the number of the next node.
_NODE = 8

#: Nodes for each pixel in the first buffer; frames that need more get a larger one, and keep it.
_FIRST_NODES_PER_PIXEL = 2

#: Factor of spare room in a buffer that grows, so that the next frame does not have to grow it again.
_SLACK = 1.25


class FragmentListsPass:
    """A-buffer that never drops a fragment; see ``shaders/intervals/fragment_lists.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._lists = Variants(
            gl, "geometry/body.vert", "intervals/fragment_lists.frag", "opaque_axial_depth", version=430
        )
        self._resolve = Variants(
            gl,
            "geometry/fullscreen.vert",
            "intervals/fragment_lists_resolve.frag",
            *("opaque_axial_depth", "density_grids", "steepest", "scattered_light"),
            version=430,
        )

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw and resolve the frame, in bands of rows where one buffer cannot hold it all."""
        job.clear_layers()
        if not job.covered:
            return
        try:
            self._run_bands(job, spec)
        finally:
            job.targets["steepest"].scissor = None

    def _run_bands(self, job: FrameJob, spec: PassSpec) -> None:
        width, height = job.targets.size
        pending = [(0, height)]
        while pending:
            first, last = pending.pop()
            needed = self._draw(job, spec, first, last)
            capacity = self._nodes(job).size // _NODE
            if needed <= capacity:
                self._walk(job, first, last)
            elif needed * _NODE <= job.targets.buffers.largest:
                size = min(int(needed * _SLACK) * _NODE, job.targets.buffers.largest // _NODE * _NODE)
                job.targets.buffers.get("nodes", size)
                pending.append((first, last))
            elif last - first > 1:
                middle = (first + last) // 2
                pending += [(first, middle), (middle, last)]
            else:
                raise RenderError(
                    f"frame of {width}x{height} with FragmentLists",
                    (
                        f"one row of the picture has {needed} surfaces, but this OpenGL can store only "
                        f"{job.targets.buffers.largest // _NODE}"
                    ),
                    "use the method DepthPeeling",
                )

    def _nodes(self, job: FrameJob) -> moderngl.Buffer:
        width, height = job.targets.size
        first = min(_FIRST_NODES_PER_PIXEL * width * height * _NODE, job.targets.buffers.largest // _NODE * _NODE)
        return job.targets.buffers.get("nodes", max(first, _NODE))

    def _draw(self, job: FrameJob, spec: PassSpec, first: int, last: int) -> int:
        """Build the lists of some rows; returns the number of nodes that they need."""
        gl = job.gl
        width, height = job.targets.size
        count, heads = job.targets.buffers.get("count", 4), job.targets.buffers.get("heads", 4 * width * height)
        count.write(np.zeros(1, np.uint32))
        heads.clear()
        for name, buffer in (("count", count), ("heads", heads), ("nodes", self._nodes(job))):
            buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])
        steepest = job.targets["steepest"]
        steepest.scissor = 0, first, steepest.width, last - first
        steepest.use()
        steepest.clear()
        gl.enable_only(moderngl.BLEND)
        gl.blend_func = moderngl.ONE, moderngl.ONE
        gl.blend_equation = moderngl.MAX
        job.bind_opaque(0)
        program = self._lists.program(WITH_NORMAL=0, WITH_POSITION=0, GRADIENT=0, OPAQUE=job.features.has_opaque)
        set_uniform(program, "cell_offset", 0)
        job.draw(program, spec.objects)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.enable_only(moderngl.NOTHING)
        gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)
        return int(np.frombuffer(count.read(), np.uint32)[0])

    def _walk(self, job: FrameJob, first: int, last: int) -> None:
        job.bind_opaque(0)
        job.bind_grids(1, 3)
        job.targets["steepest"].color_attachments[0].use(2)
        switches = {"OPAQUE": job.features.has_opaque, "INTERFACES": job.features.finds_exits}
        program = self._resolve.program(**walk_switches(job.features), GRADIENT=0, **switches)
        if job.features.marches:
            method = cast(RayMarched, job.plan.method)
            set_uniform(program, "march_steps", method.steps)
            set_uniform(program, "march_rule", int(CONSTANTS[f"MARCH_{method.quadrature.upper()}"]))
            set_uniform(program, "march_seed", method.seed - (1 << 32 if method.seed >= 1 << 31 else 0))
            set_uniform(program, "march_jitter", int(method.jitter))
        self._resolve.draw_covered(job, program, job.targets["ordered"], rows=(first, last))
        # The next lists must not begin before these have been walked along.
        job.gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)


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
