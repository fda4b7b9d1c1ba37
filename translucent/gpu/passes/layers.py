"""Partly transparent layers, and the emission of interfaces."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import SURFACE_SAMPLERS, set_surface
from translucent.gpu.passes.variants import Variants, coat_switches, look_switches
from translucent.gpu.shaders import set_uniform
from translucent.planning.passes import PassSpec
from translucent.scene.scene import Object
from translucent.scene.surface import LEAST_COVER

_OWN = ("opaque_axial_depth", "entered", "fronts")
_SAMPLERS = ("layers_in_front", "layers_behind", "straight_transmittance", "shaded_radiance", "shaded_transmittance")


class LayersPass:
    """Layers, drawn far objects first and composited over the picture; see ``shaders/shade/layer.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._layers = Variants(gl, "geometry/interface.vert", "shade/layer.frag", *SURFACE_SAMPLERS, *_OWN)
        self._fronts = Variants(gl, "geometry/body.vert", "shade/fronts.frag")
        self._over = Variants(gl, "geometry/fullscreen.vert", "shade/layers_over.frag", *_SAMPLERS)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the layers over the picture; for a job of several samples, add the sample's radiance
        and transmittance.
        """
        bodies = tuple(i for i, item in enumerate(job.scene.objects) if item.medium is not None and not item.covers)
        if bodies:
            self._find_fronts(job, bodies)
        self._draw(job, spec, bool(bodies))
        self._put_over(job, job.sums_after(spec.name))

    def _find_fronts(self, job: FrameJob, bodies: tuple[int, ...]) -> None:
        """Draw the depth at which each ray first hits a body: at once, if it starts inside one."""
        framebuffer = job.targets["fronts"]
        framebuffer.use()
        nothing = float(CONSTANTS["NOTHING"])
        framebuffer.clear(-nothing if job.placed.starts_inside else nothing, depth=1.0)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        if not job.placed.starts_inside:
            job.draw(self._fronts.program(WITH_NORMAL=0, WITH_POSITION=0), bodies)

    def _draw(self, job: FrameJob, spec: PassSpec, bodies: bool) -> None:
        gl, framebuffer = job.gl, job.targets["layers"]
        framebuffer.use()
        framebuffer.clear()
        gl.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._layers.bind(**job.resources.light_textures(job.scene.environment))
        job.bind_opaque(self._layers.units["opaque_axial_depth"])
        if job.features.has_surfaces:
            job.targets["entered"].color_attachments[0].use(self._layers.units["entered"])
        if bodies:
            job.targets["fronts"].color_attachments[0].use(self._layers.units["fronts"])
        for i in sorted(spec.objects, key=lambda i: _distance(job, i), reverse=True):
            self._draw_layer(job, i, bodies)
        gl.cull_face = "back"

    def _draw_layer(self, job: FrameJob, number: int, bodies: bool) -> None:
        body = job.scene.objects[number]
        surface = body.surface
        assert surface is not None
        program = self._layers.program(
            EMITS=not body.covers,
            OPAQUE=job.features.has_opaque,
            BODIES=bodies,
            SHADOW_MAPS=0,
            SHADOW_SPECTRAL=0,
            GROUND_SHADOWS=0,
            DIFFUSED=0,
            **look_switches(body),
            **coat_switches([body]),
        )
        set_surface(job, program, surface, surface.alpha_cutoff or (LEAST_COVER if body.covers else 0.0))
        if body.covers:
            set_uniform(program, "layer_opacity", surface.opacity)
        # The far side first, as in viewers of glTF; a sheet that emits does so on both sides.
        back = surface.double_sided if body.covers else number in job.features.sheets
        for culled in ("front", "back") if back else ("back",):
            job.gl.cull_face = culled
            job.draw(program, (number,))

    def _put_over(self, job: FrameJob, sums: bool) -> None:
        gl, targets = job.gl, job.targets
        gl.enable_only(moderngl.BLEND)
        in_front, behind = targets["layers"].color_attachments
        transmittance = targets["result"].color_attachments[1]
        read = in_front, behind, transmittance, *job.picture.color_attachments[:2]
        self._over.bind(**dict(zip(_SAMPLERS, read, strict=True)))
        radiance = "surfaced" if job.features.has_surfaces else "result"
        steps = (
            ("RADIANCE", targets.view(radiance, 0), (moderngl.ONE, moderngl.SRC_ALPHA, moderngl.ZERO, moderngl.ONE)),
            ("SHARE", targets.view("result", 1), (moderngl.ZERO, moderngl.SRC_ALPHA, moderngl.ZERO, moderngl.ONE)),
            ("DEPTH", targets.view("result", 2), (moderngl.ONE, moderngl.ONE)),
            ("SUM", targets["average"] if sums else None, (moderngl.ONE, moderngl.ONE)),
        )
        for step, framebuffer, blending in steps:
            if framebuffer is not None:
                framebuffer.use()
                gl.blend_func = blending
                switches = {name: name == step for name, _, _ in steps}
                self._over.draw_fullscreen(self._over.program(**switches))


def _distance(job: FrameJob, number: int) -> float:
    body: Object = job.scene.objects[number]
    camera = job.scene.camera
    center = body.bounds.mean(axis=0) - camera.eye
    return float(center @ camera.forward if camera.fov_y is None else np.linalg.norm(center))
