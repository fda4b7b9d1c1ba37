"""Backdrop pass: opaque objects come as a picture that another renderer has drawn."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from translucent.gpu.backdrop import TextureBackdrop
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.planning.passes import PassSpec
from translucent.scene.backdrop import Backdrop

#: Depth of infinitely far pixels: behind everything, and yet seen.
_BEHIND_ALL = 0.1 * float(CONSTANTS["NOTHING"])

_COLOR, _DEPTH = range(2)


class BackdropPass:
    """Copy of the job's backdrop into the target of opaque objects; see ``shaders/shade/backdrop.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(
            gl, "geometry/fullscreen.vert", "shade/backdrop.frag", backdrop_color=_COLOR, backdrop_depth=_DEPTH
        )

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Fill the target; it is the same for all samples of a pixel."""
        if isinstance(job.backdrop, Backdrop):
            _upload(job, job.backdrop)
        elif job.backdrop is not None:
            self._draw(job, job.backdrop)

    def _draw(self, job: FrameJob, backdrop: TextureBackdrop) -> None:
        job.targets.opaque().use()
        job.gl.enable_only(moderngl.NOTHING)
        backdrop.color.use(_COLOR)
        backdrop.depth.use(_DEPTH)
        program = self._variants.program(ORTHOGRAPHIC=backdrop.orthographic, INFINITE=math.isinf(backdrop.far))
        media = job.placed.media
        set_uniform(program, "near", backdrop.near)
        if not math.isinf(backdrop.far):
            set_uniform(program, "far", backdrop.far)
        set_uniform(program, "media_near", media.near)
        set_uniform(program, "media_length", media.length)
        set_uniform(program, "gamma", backdrop.gamma)
        set_uniform(program, "behind_all", _BEHIND_ALL)
        self._variants.draw_fullscreen(program)


def _upload(job: FrameJob, backdrop: Backdrop) -> None:
    """Upload the arrays; distances are converted to depths in float64, so that far scenes lose no digits."""
    with np.errstate(under="ignore"):
        axial_depth = np.minimum((backdrop.depth - job.placed.media.near) / job.placed.media.length, _BEHIND_ALL)
        axial_depth = axial_depth.astype(np.float32)
    if backdrop.coverage is not None:
        axial_depth = np.where(backdrop.coverage, axial_depth, np.float32(CONSTANTS["NOTHING"]))
    radiance = np.ones((*axial_depth.shape, 4), dtype=np.float32)
    radiance[..., :3] = backdrop.radiance
    for texture, rows in zip(job.targets.opaque().color_attachments, (axial_depth, radiance), strict=True):
        texture.write(np.ascontiguousarray(rows[::-1]))
