"""Opaque objects: where rays through the media end, and what is seen there."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import CONSTANTS, set_uniform
from translucent.gpu.textures import reflectance_table, texture_units
from translucent.render_plan import PassSpec
from translucent.surface import Surface

_MAPS = ("light_irradiance", "light_map", "light_levels", "reflectance_table")
_FIRST_TEXTURE = len(_MAPS)
_UNITS = {name: unit for unit, name in enumerate(_MAPS)} | texture_units(_FIRST_TEXTURE)


class OpaquePass:
    """Draws the nearest opaque surface of each pixel; see ``shaders/shade/opaque.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._plain = Variants(gl, "geometry/body.vert", "shade/opaque.frag", **_UNITS)
        self._finished = Variants(gl, "geometry/border.vert", "shade/opaque.frag", **_UNITS)
        self._reflectance: moderngl.Texture | None = None

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the opaque objects with the depth test on."""
        framebuffer = job.targets.opaque()
        framebuffer.use()
        _clear(framebuffer)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        # Surfaces at the very end of the range count, too; and of surfaces in one place, those of the first object.
        job.gl.depth_func = "<="
        environment = job.scene.environment
        light_map = environment.kind == "image"
        if light_map:
            job.resources.environments.light(environment).irradiance.use(_UNITS["light_irradiance"])
        for i in spec.objects[::-1]:
            if (surface := job.scene.objects[i].surface) is None:
                program = self._plain.program(WITH_NORMAL=1, WITH_POSITION=1, SURFACE=0, LIGHT_MAP=light_map)
            else:
                program = self._finished.program(SURFACE=1, LIGHT_MAP=light_map)
                self._bind_maps(job)
                self._set_finish(job, program, surface)
            job.draw(program, (i,))
        job.gl.depth_func = "<"

    def _bind_maps(self, job: FrameJob) -> None:
        if self._reflectance is None:
            self._reflectance = reflectance_table(job.gl)
        environment = job.scene.environment
        maps = job.resources.environments.light(environment)
        textures = maps.irradiance, job.resources.environments.sharp(environment), maps.levels, self._reflectance
        for unit, texture in enumerate(textures):
            texture.use(unit)

    def _set_finish(self, job: FrameJob, program: moderngl.Program, surface: Surface) -> None:
        job.resources.textures.bind(surface, program, _FIRST_TEXTURE)
        passed = surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color)
        finish = surface.metallic, surface.roughness, surface.ior, surface.alpha_cutoff
        set_uniform(program, "opaque_finish", finish)
        set_uniform(program, "opaque_passed", (*passed, surface.double_sided))
        set_uniform(program, "opaque_passed_share", surface.diffuse_transmission)
        set_uniform(program, "opaque_emissive", tuple(np.asarray(surface.emissive)))


def _clear(framebuffer: moderngl.Framebuffer) -> None:
    """No surface anywhere, and no light, which is blurred where refraction is."""
    on, off = (True,) * 4, (False,) * 4
    framebuffer.color_mask = on, off
    framebuffer.clear(float(CONSTANTS["NOTHING"]), 0.0, 0.0, 0.0, depth=1.0)
    framebuffer.color_mask = off, on
    framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    framebuffer.color_mask = on, on
