"""Depth peeling: every pass over the geometry finds the next crossings of each ray, which are then walked in order."""

from __future__ import annotations

from typing import cast

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS, PEEL_BATCH, PEEL_TILE
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants, walk_switches
from translucent.gpu.shaders import set_uniform
from translucent.planning.methods import DepthPeeling
from translucent.planning.passes import PassSpec

_STATE = ("near_depth", "near_emitted", "layers", "far_depth", "far_emitted", "near_winding", "far_winding")


class DepthPeelingPass:
    """Depth peeling from one end of the rays or from both; see ``shaders/intervals/peel.frag``.

    The first pass counts the crossings of each pixel, which says when all are found: then a depth mask keeps the pixel
    out of further passes.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._peel = Variants(gl, "geometry/body.vert", "intervals/peel.frag", "previous", "opaque_axial_depth")
        self._mask = Variants(gl, "geometry/fullscreen.vert", "intervals/peel_mask.frag", "previous")
        self._remaining = Variants(gl, "geometry/fullscreen.vert", "intervals/peel_remaining.frag", "found")
        self._counted = Variants(gl, "geometry/fullscreen.vert", "intervals/peel_counted.frag", "first")
        batch = (f"pass_{i}" for i in range(PEEL_BATCH))
        self._fold = Variants(gl, "geometry/fullscreen.vert", "intervals/peel_fold.frag", *batch, *_STATE)
        self._any = gl.query(samples=True)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Peel until a pass finds nothing more, or the layers of the method are used up."""
        job.clear_layers()
        if not job.covered:
            return
        method = cast(DepthPeeling, job.plan.method)
        both = method.order == "both-ends"
        ends = {"NEAR": method.order != "back-to-front", "FAR": method.order != "front-to-back"}
        allowed = -(-method.max_layers // 2) if both else method.max_layers
        most = 1
        batch: list[moderngl.Framebuffer] = []
        folds = 0
        number = 0
        while True:
            batch.append(job.targets.peeled(number % PEEL_BATCH))
            self._find(job, spec, batch, ends, number)
            if number == 0:
                needed = self._passes_needed(job, batch[0], both)
                # Where there are more layers than allowed, one more pass counts the faces of the last that is.
                most = needed if needed <= allowed else allowed + 1
            # An opaque surface makes all alike that it hides: fewer passes may do than there are crossings.
            done = job.features.has_opaque and number > 0 and not self._found_any(job, batch[-1])
            number += 1
            last = number == most or done
            if last or len(batch) == PEEL_BATCH:
                walked = len(batch) if last and number <= allowed else len(batch) - 1
                self._go_along(job, batch, ends, folds, walked, last)
                folds += 1
                # The crossings that the last pass has found are walked along when the next has counted their faces.
                batch = [batch[-1]]
            if last:
                return

    def _find(
        self, job: FrameJob, spec: PassSpec, batch: list[moderngl.Framebuffer], ends: dict[str, bool], number: int
    ) -> None:
        """Draw one peeling pass; after the first, only where crossings remain."""
        gl, target = job.gl, batch[-1]
        # Before any state is set: the frame may be postponed here.
        switches = {"FIRST": number == 0, "OPAQUE": job.features.has_opaque, **ends}
        program = self._peel.program(WITH_NORMAL=0, WITH_POSITION=0, **switches)
        target.use()
        if number == 0:
            nothing = float(CONSTANTS["NOTHING"])
            target.clear(nothing, nothing, nothing, 0.0)
            gl.enable_only(moderngl.BLEND)
        else:
            self._peel.bind(previous=batch[-2].color_attachments[0])
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "1"
            self._mask.draw_fullscreen(self._mask.program(FIRST=number == 1, **ends))
            gl.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
            gl.depth_func = "<"
            target.depth_mask = False
        gl.blend_func = moderngl.ONE, moderngl.ONE
        gl.blend_equation = moderngl.MIN, moderngl.FUNC_ADD
        job.bind_opaque(self._peel.units["opaque_axial_depth"])
        job.draw(program, spec.objects)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.enable_only(moderngl.NOTHING)
        target.depth_mask = True

    def _passes_needed(self, job: FrameJob, first: moderngl.Framebuffer, both: bool) -> int:
        """Number of passes that complete every pixel, from the crossing count of the first pass."""
        width, height = (-(-length // PEEL_TILE) for length in first.size)
        tiles = job.targets.peeled(1)
        tiles.scissor = 0, 0, width, height
        tiles.use()
        first.color_attachments[0].use(0)
        self._counted.draw_fullscreen(self._counted.program())
        tiles.scissor = None
        found = np.frombuffer(tiles.read((0, 0, width, height), components=1, alignment=1, dtype="f4"), np.float32)
        layers = round(float(found.max()))
        return max(1, -(-layers // 2) if both else layers)

    def _found_any(self, job: FrameJob, found: moderngl.Framebuffer) -> bool:
        """True if a pass has found a crossing in any pixel."""
        job.targets.nothing().use()
        found.color_attachments[0].use(0)
        with self._any:
            self._remaining.draw_fullscreen(self._remaining.program())
        return bool(self._any.samples)

    def _go_along(
        self,
        job: FrameJob,
        batch: list[moderngl.Framebuffer],
        ends: dict[str, bool],
        folds: int,
        walked: int,
        last: bool,
    ) -> None:
        """Add up optical depth and emission along each ray, through the crossings of the first `walked` passes."""
        framebuffer = job.targets["ordered"] if last else job.targets.peel_state(folds % 2)
        # Samplers of passes that this batch is short of must not stay with what is drawn into.
        for unit in range(PEEL_BATCH):
            batch[min(unit, len(batch) - 1)].color_attachments[0].use(unit)
        if folds:
            for unit, texture in enumerate(job.targets.peel_state((folds - 1) % 2).color_attachments, PEEL_BATCH):
                texture.use(unit)
        # Crossings that an opaque surface hides have been moved onto it: the walks need not know of it.
        switches = {
            **walk_switches(job.features),
            "SCATTER": False,
            "MARCH": False,
            "INTERFACES": False,
            **ends,
            "BEGIN": folds == 0,
            "END": last,
            "OPAQUE": False,
        }
        program = self._fold.program(**switches)
        set_uniform(program, "passes", len(batch))
        set_uniform(program, "walked", walked)
        self._fold.draw_covered(job, program, framebuffer)
