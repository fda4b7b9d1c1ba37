"""Interfaces drawn, and shaded in screen space; pixels without one are shaded by a cheap program of their own."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import blurred_opaque, interface_shadow_switches
from translucent.gpu.passes.variants import Variants, coat_switches, look_switches
from translucent.gpu.shaders import set_uniform
from translucent.gpu.textures import reflectance_table, texture_units
from translucent.planning.interfaces import picture_cuts
from translucent.planning.passes import PassSpec
from translucent.scene.surface import SMOOTH, Surface

_FIRST_TEXTURE = 3
_DRAWN_UNITS = {"opaque_axial_depth": 0, "entered": 1, "ordered_layers": 2} | texture_units(_FIRST_TEXTURE)


class InterfacesPass:
    """Nearest interface that faces the eye, then the nearest that faces away; see ``shaders/shade/interface.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/interface.vert", "shade/interface.frag", **_DRAWN_UNITS)

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
            job.bind_opaque(_DRAWN_UNITS["opaque_axial_depth"])
            exits = back and job.features.finds_exits
            beyond = back and not exits and not starts_inside
            if beyond:
                job.targets.entered().color_attachments[0].use(_DRAWN_UNITS["entered"])
            if exits:
                job.targets.ordered().color_attachments[2].use(_DRAWN_UNITS["ordered_layers"])
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


#: Textures that it reads, and their units.
_PLAIN_UNITS = {
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
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/no_interface.frag", **_PLAIN_UNITS)

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
            texture.use(_PLAIN_UNITS[name])
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
