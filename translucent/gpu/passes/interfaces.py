"""Interfaces: where each ray first enters a body, and, if exits refract, where it first leaves one beyond."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants, look_switches
from translucent.gpu.shaders import set_uniform
from translucent.gpu.textures import texture_units
from translucent.planning.interfaces import picture_cuts
from translucent.planning.passes import PassSpec
from translucent.scene.surface import SMOOTH, Surface

_FIRST_TEXTURE = 3
_UNITS = {"opaque_axial_depth": 0, "entered": 1, "ordered_layers": 2} | texture_units(_FIRST_TEXTURE)


class InterfacesPass:
    """Nearest interface that faces the eye, then the nearest that faces away; see ``shaders/shade/interface.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/interface.vert", "shade/interface.frag", **_UNITS)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies for each interface, with the depth test on; sheets have one, seen from either side."""
        if not job.covered:
            return
        nothing = float(CONSTANTS["NOTHING"])
        thin = job.features.sheets
        sheets = tuple(i for i in spec.objects if i in thin)
        solids = tuple(i for i in spec.objects if i not in thin)
        starts_inside = job.placed.starts_inside or any(picture_cuts(job.scene, job.scene.objects[i]) for i in solids)
        for back in (False,) if job.features.one_interface else (False, True):
            framebuffer = job.targets.left() if back else job.targets.entered()
            framebuffer.use()
            framebuffer.clear(0.0, 0.0, 0.0, nothing, depth=1.0)
            job.gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            job.gl.depth_func = "<="
            job.gl.cull_face = "front" if back else "back"
            job.bind_opaque(_UNITS["opaque_axial_depth"])
            exits = back and job.features.finds_exits
            beyond = back and not exits and not starts_inside
            if beyond:
                job.targets.entered().color_attachments[0].use(_UNITS["entered"])
            if exits:
                job.targets.ordered().color_attachments[2].use(_UNITS["ordered_layers"])
            switches = {"BACK": back, "BEYOND": beyond, "EXITS": exits, "OPAQUE": job.features.has_opaque}
            self._draw(job, switches, solids)
            if not back:
                job.gl.enable_only(moderngl.DEPTH_TEST)
                self._draw(job, switches, sheets)
        job.gl.cull_face = "back"
        job.gl.depth_func = "<"

    def _draw(self, job: FrameJob, switches: dict[str, bool], objects: tuple[int, ...]) -> None:
        finished: tuple[moderngl.Program, Surface] | None = None
        for i in objects:
            body = job.scene.objects[i]
            surface = body.surface or SMOOTH
            holes = not switches["BACK"] and body.has_holes
            program = self._variants.program(**switches, **look_switches(body), HOLES=holes)
            # Many bodies share a surface, or have none.
            if finished is None or finished[0] is not program or finished[1] is not surface:
                self._set_finish(job, program, surface)
                finished = program, surface
            if holes:
                set_uniform(program, "hole_below", surface.alpha_cutoff)
            job.draw(program, (i,))

    def _set_finish(self, job: FrameJob, program: moderngl.Program, surface: Surface) -> None:
        job.resources.textures.bind(surface, program, _FIRST_TEXTURE)
        set_uniform(program, "surface_color", (*np.asarray(surface.color), surface.transmission))
        set_uniform(program, "surface_roughness", surface.roughness)
