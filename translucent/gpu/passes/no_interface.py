"""Pixels whose rays meet no interface: shaded by a cheap program, which keeps the costly one away from them."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants

#: Textures that it reads, and their units.
_UNITS = {
    name: unit
    for unit, name in enumerate(
        (
            "emitted_radiance_sum",
            "straight_transmittance",
            "entered",
            "left",
            "opaque_axial_depth",
            "opaque_radiance",
            "seen_map",
        )
    )
}


class NoInterface:
    """Draw what is behind, through the media on a straight ray; see ``shaders/shade/no_interface.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/no_interface.frag", **_UNITS)

    def draw(self, job: FrameJob, framebuffer: moderngl.Framebuffer, blending: int) -> None:
        """Shade all pixels without an interface.

        Leaves a depth test that lets a program for interfaces, drawn next, pass where there is one. Where it returned
        at once instead, a software rasterizer would go through all of it nevertheless.
        """
        seen = job.scene.environment.seen
        attachments = job.targets.result().color_attachments
        textures = {"emitted_radiance_sum": attachments[0], "straight_transmittance": attachments[1]}
        textures["entered"] = job.targets.entered().color_attachments[0]
        if not job.features.one_interface:
            textures["left"] = job.targets.left().color_attachments[0]
        if job.features.has_opaque:
            textures["opaque_axial_depth"], textures["opaque_radiance"] = job.targets.opaque().color_attachments
        if seen.kind == "image":
            textures["seen_map"] = job.resources.environments.sharp(seen)
        for name, texture in textures.items():
            texture.use(_UNITS[name])
        background = {"OPAQUE": job.features.has_opaque, "SEEN_MAP": seen.kind == "image"}
        job.gl.enable_only(blending)
        rest = self._variants.program(REST=True, ONE_INTERFACE=False, APART=False, **background)
        self._variants.draw_rest(job, rest, framebuffer, top_first=True)
        if job.covered:
            job.gl.enable_only(blending | moderngl.DEPTH_TEST)
            job.gl.depth_func = "1"
            switches = {"ONE_INTERFACE": job.features.one_interface, "APART": job.bent_apart}
            plain = self._variants.program(REST=False, **switches, **background)
            self._variants.draw_covered(job, plain, framebuffer, top_first=True)
            job.gl.depth_func = "<"
