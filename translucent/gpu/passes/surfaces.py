"""Shading of interfaces, over the whole picture."""

from __future__ import annotations

import moderngl

from translucent.gpu.drivers import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.no_interface import NoInterface
from translucent.gpu.passes.opaque import blurred_opaque, interface_shadow_switches
from translucent.gpu.passes.variants import Variants, coat_switches
from translucent.gpu.textures import reflectance_table
from translucent.planning.passes import PassSpec

_SAMPLERS = (
    "emitted_radiance_sum",
    "straight_transmittance",
    "straight_optical_depth",
    "straight_thickness",
    "entered",
    "surface_parameters",
    "surface_color",
    "left",
    "left_parameters",
    "opaque_axial_depth",
    "opaque_radiance",
    "object_table",
    "reflectance_table",
    "light_map",
    "light_levels",
    "light_irradiance",
    "seen_map",
    "diffused_light",
    "shadow_sums",
    "shadow_ends",
)
_UNITS = {name: unit for unit, name in enumerate(_SAMPLERS)}


class SurfacesPass:
    """Reflection, refraction, paint and diffuse light; see ``shaders/shade/surfaces.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/surfaces.frag", **_UNITS)
        self._no_interface = NoInterface(gl)
        self._reflectance = reflectance_table(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame; for a job of several samples, add a sample's radiance and transmittance instead."""
        gl = job.gl
        require_interfaces(gl.info)
        sums = job.sums_after(spec.name)
        framebuffer = job.targets.average() if sums else job.targets.surfaced()
        blending = moderngl.BLEND if sums else moderngl.NOTHING
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        self._no_interface.draw(job, framebuffer, blending)
        if not job.covered:
            return
        self._bind_paths(job)
        job.resources.shadows.use(_UNITS)
        seen = job.scene.environment.seen
        seen_map = seen.kind == "image"
        if seen_map:
            job.resources.environments.sharp(seen).use(_UNITS["seen_map"])
        program = self._variants.program(
            ONE_INTERFACE=job.features.one_interface,
            OPAQUE=job.features.has_opaque,
            **interface_shadow_switches(job),
            SEEN_MAP=seen_map,
            SEEN_LIGHTS=seen_map and seen is job.scene.environment,
            SINGLE_SCATTERING=job.features.scatters,
            **coat_switches(job.scene.bodies),
            DIFFUSED=job.diffused_light is not None,
        )
        finishes = self._bind_finishes(job)
        self._variants.draw_covered(job, program, framebuffer, top_first=True)
        gl.enable_only(blending)
        finishes.release()

    def _bind_paths(self, job: FrameJob) -> None:
        """Bind what passes before have found: paths, interfaces and opaque surfaces."""
        textures = job.targets.result().color_attachments[:4] + job.targets.entered().color_attachments
        if not job.features.one_interface:
            textures += job.targets.left().color_attachments
        for unit, texture in enumerate(textures):
            texture.use(unit)
        if job.features.has_opaque:
            axial_depth, radiance = blurred_opaque(job)
            axial_depth.use(_UNITS["opaque_axial_depth"])
            radiance.use(_UNITS["opaque_radiance"])

    def _bind_finishes(self, job: FrameJob) -> moderngl.Texture:
        """Bind surfaces and lights; returns the texture of surfaces, which the caller releases."""
        environment = job.scene.environment
        maps = job.resources.environments.light(environment)
        if job.diffused_light is not None:
            job.diffused_light.texture.use(_UNITS["diffused_light"])
        finishes = job.object_table()
        rest = (
            finishes,
            self._reflectance,
            job.resources.environments.sharp(environment),
            maps.levels,
            maps.irradiance,
        )
        for unit, item in enumerate(rest, _UNITS["object_table"]):
            item.use(unit)
        return finishes
