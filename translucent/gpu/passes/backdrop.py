"""Backdrop pass: opaque objects come as a picture that another renderer has drawn."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob, TextureBackdrop
from translucent.gpu.passes.opaque import shadow_switches
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.media.colors import ColorLike
from translucent.planning.passes import PassSpec
from translucent.scene.backdrop import Backdrop

#: Depth of infinitely far pixels: behind everything, and yet visible.
_BEHIND_ALL = 0.1 * float(CONSTANTS["NOTHING"])

#: Samplers of ``shaders/shade/backdrop_shadows.frag``.
_SHADOW_SAMPLERS = ("opaque_axial_depth", "light_irradiance", "shadow_sums", "shadow_ends")


class BackdropPass:
    """Copy of the job's backdrop into the target of opaque objects, with the shadows of bodies on it; see
    ``shaders/shade/backdrop.frag`` and ``shaders/shade/backdrop_shadows.frag``.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        samplers = "backdrop_color", "backdrop_depth"
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/backdrop.frag", *samplers)
        self._shadows = Variants(gl, "geometry/fullscreen.vert", "shade/backdrop_shadows.frag", *_SHADOW_SAMPLERS)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Fill the target; but for shadows of the environment, it is the same for all samples of a pixel."""
        if isinstance(job.backdrop, Backdrop):
            _upload(job, job.backdrop)
        elif job.backdrop is not None:
            self._draw(job, job.backdrop)
        if job.backdrop is not None and job.features.shadows_backdrop:
            self._shadow(job, job.backdrop.ambient)

    def _draw(self, job: FrameJob, backdrop: TextureBackdrop) -> None:
        job.targets["opaque"].use()
        job.gl.enable_only(moderngl.NOTHING)
        self._variants.bind(backdrop_color=backdrop.color, backdrop_depth=backdrop.depth)
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

    def _shadow(self, job: FrameJob, ambient: ColorLike | None) -> None:
        """Multiply the radiance by the fraction of its light that reaches it."""
        axial_depth = job.targets["opaque"].color_attachments[0]
        job.targets.view("opaque", 1).use()  # what is read may not be attached
        job.gl.enable_only(moderngl.BLEND)
        job.gl.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
        environment = job.scene.environment
        light_map = ambient is None and environment.kind == "image"
        program = self._shadows.program(
            LIGHT_MAP=light_map, EVEN_LIGHT=ambient is not None, **shadow_switches(True, job.resources)
        )
        self._shadows.bind(opaque_axial_depth=axial_depth)
        job.resources.shadows.use(self._shadows.units)
        if light_map:
            self._shadows.bind(light_irradiance=job.resources.environments.light(environment).irradiance)
        set_uniform(program, "behind_all", _BEHIND_ALL)
        if ambient is not None:
            set_uniform(program, "even_light", ambient)
        self._shadows.draw_fullscreen(program)


def _upload(job: FrameJob, backdrop: Backdrop) -> None:
    """Upload the arrays; distances are converted to depths in float64, so that far scenes lose no digits."""
    with np.errstate(under="ignore"):
        axial_depth = np.minimum((backdrop.depth - job.placed.media.near) / job.placed.media.length, _BEHIND_ALL)
        axial_depth = axial_depth.astype(np.float32)
    if backdrop.coverage is not None:
        axial_depth = np.where(backdrop.coverage, axial_depth, np.float32(CONSTANTS["NOTHING"]))
    radiance = np.ones((*axial_depth.shape, 4), dtype=np.float32)
    radiance[..., :3] = backdrop.radiance
    for texture, rows in zip(job.targets["opaque"].color_attachments, (axial_depth, radiance), strict=True):
        texture.write(np.ascontiguousarray(rows[::-1]))
