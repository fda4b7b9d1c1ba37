"""Interfaces drawn, and shaded in screen space; pixels without one are shaded by a cheap program of their own."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import bind_light, interface_shadow_switches
from translucent.gpu.passes.variants import Variants, background_switches, coat_switches, look_switches
from translucent.gpu.placement import Part
from translucent.gpu.shaders import set_uniform, set_used
from translucent.planning.interfaces import picture_cuts
from translucent.planning.passes import PassSpec
from translucent.scene.surface import SMOOTH, TEXTURE_FIELDS, Surface

_DRAWN_SAMPLERS = ("opaque_axial_depth", "entered", "ordered_layers")


class InterfacesPass:
    """Nearest interface that faces the eye, then the nearest that faces away; see ``shaders/shade/interface.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(
            gl, "geometry/interface.vert", "shade/interface.frag", *_DRAWN_SAMPLERS, *TEXTURE_FIELDS
        )

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the bodies for each interface, with the depth test on; sheets have one, visible from both sides."""
        if not job.covered:
            return
        nothing = float(CONSTANTS["NOTHING"])
        thin = job.features.sheets
        sheets = tuple(i for i in spec.objects if i in thin)
        solids = tuple(i for i in spec.objects if i not in thin)
        # In one sample after another, only what is covered changes; single pixels are drawn anywhere.
        cleared = job.covered.scissor if job.rest_is_clear and job.averaging and job.enlarged is None else None
        starts_inside = job.placed.starts_inside or any(picture_cuts(job.scene, job.scene.objects[i]) for i in solids)
        for back in (False,) if job.features.one_interface else (False, True):
            framebuffer = job.targets["left"] if back else job.targets["entered"]
            framebuffer.use()
            framebuffer.clear(0.0, 0.0, 0.0, nothing, depth=1.0, viewport=cleared)
            job.gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            job.gl.depth_func = "<="
            job.gl.cull_face = "front" if back else "back"
            job.bind_opaque(0)
            exits = back and job.features.finds_exits
            beyond = back and not exits and not starts_inside
            if beyond:
                self._variants.bind(entered=job.targets["entered"].color_attachments[0])
            if exits:
                self._variants.bind(ordered_layers=job.targets["ordered"].color_attachments[2])
            switches = {"BACK": back, "BEYOND": beyond, "EXITS": exits, "OPAQUE": job.features.has_opaque}
            switches["LIGHTS"] = bool(job.scene.lights)
            self._draw(job, switches, solids)
            if not back:
                job.gl.enable_only(moderngl.DEPTH_TEST)
                self._draw(job, switches, sheets)
        job.rest_is_clear = job.shows_ground_alone and job.enlarged is None
        job.gl.cull_face = "back"
        job.gl.depth_func = "<"

    def _draw(self, job: FrameJob, switches: dict[str, bool], objects: tuple[int, ...]) -> None:
        held: tuple[moderngl.Program, Surface] | None = None
        for i in objects:
            body = job.scene.objects[i]
            surface = body.surface or SMOOTH
            holes = not switches["BACK"] and body.has_holes
            program = self._variants.program(**switches, **look_switches(body), HOLES=holes)
            # Many bodies have one surface in common, or none.
            if held is None or held[0] is not program or held[1] is not surface:
                job.resources.textures.bind(surface, program, len(_DRAWN_SAMPLERS))
                set_uniform(program, "surface_color", (*np.asarray(surface.color), surface.transmission))
                set_uniform(program, "surface_roughness", surface.roughness)
                set_used(program, {"sample_area": 1.0 if job.enlarged else 1.0 / job.samples})
                held = program, surface
            if holes:
                set_uniform(program, "hole_below", surface.alpha_cutoff)
            job.draw(program, (i,), job.faces)


_PLAIN_SAMPLERS = (
    "emitted_radiance_sum",
    "straight_transmittance",
    "entered",
    "left",
    "opaque_axial_depth",
    "opaque_radiance",
    "seen_map",
    "surface_parameters",
    "surface_color",
    "object_table",
    "reflectance_table",
)


class NoInterface:
    """Draw the background through media along straight rays; see ``shaders/shade/no_interface.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/no_interface.frag", *_PLAIN_SAMPLERS)

    def draw(self, job: FrameJob, framebuffer: moderngl.Framebuffer, blending: int) -> None:
        """Shade all pixels without an interface, by one program, as each takes time to compile.

        Leaves a depth test that lets a program for interfaces, drawn next, pass where there is one. Where it returned
        at once instead, a software rasterizer would go through all of it nevertheless.
        """
        maps = job.resources.background_textures(job.scene.environment)
        emitted, through, *_ = job.targets["result"].color_attachments
        textures = {"emitted_radiance_sum": emitted, "straight_transmittance": through, **maps}
        textures["entered"], parameters, color = job.targets["entered"].color_attachments
        straight = bool(job.covered) and job.bent_apart and job.features.straight_light
        if straight:
            textures |= {"surface_parameters": parameters, "surface_color": color, "object_table": job.object_table()}
            textures["reflectance_table"] = job.resources.textures.reflectance
        if not job.features.one_interface:
            textures["left"] = job.targets["left"].color_attachments[0]
        if job.features.has_opaque:
            textures["opaque_axial_depth"], textures["opaque_radiance"] = job.targets["opaque"].color_attachments
        self._variants.bind(**textures)
        switches = {"OPAQUE": job.features.has_opaque, "SEEN_MAP": bool(maps), "REST": not job.covered}
        switches |= {"STRAIGHT_LIGHT": straight, **coat_switches(job.scene.bodies if straight else ())}
        if job.covered:
            switches |= {"ONE_INTERFACE": job.features.one_interface, "APART": job.bent_apart}
            job.gl.enable_only(blending | moderngl.DEPTH_TEST)
        else:
            switches |= {"ONE_INTERFACE": False, "APART": False}
            job.gl.enable_only(blending)
        job.gl.depth_func = "1"
        program = self._variants.program(**switches)
        set_uniform(program, "weight", 1.0)
        if not job.shows_ground_alone:
            self._variants.draw_part(Part(0, 0, *job.targets.size), program, framebuffer)
        else:
            self._variants.draw_covered(job, program, framebuffer, top_first=True)
            if job.sample == 0:  # the rest is the same in all samples
                set_uniform(program, "weight", float(job.samples))
                self._variants.draw_rest(job, program, framebuffer, top_first=True)
        if straight:
            textures["object_table"].release()
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


class SurfacesPass:
    """Reflection, refraction and diffuse light at interfaces; see ``shaders/shade/surfaces.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/surfaces.frag", *_SAMPLERS)
        self._no_interface = NoInterface(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame; for a job of several samples, add a sample's radiance and transmittance instead."""
        gl = job.gl
        require_interfaces(gl.info)
        sums = job.sums_after(spec.name)
        framebuffer = job.targets["average"] if sums else job.targets["surfaced"]
        blending = moderngl.BLEND if sums else moderngl.NOTHING
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        self._no_interface.draw(job, framebuffer, blending)
        if not job.covered:
            return
        table = job.object_table()
        self._bind(job, table)
        program = self._variants.program(
            ONE_INTERFACE=job.features.one_interface,
            OPAQUE=job.features.has_opaque,
            **interface_shadow_switches(job),
            **background_switches(job.scene.environment),
            SINGLE_SCATTERING=job.features.scatters,
            **coat_switches(job.scene.bodies),
            DIFFUSED=job.diffused_light is not None,
        )
        set_used(program, {"sample_area": 1.0 / job.samples})
        self._variants.draw_covered(job, program, framebuffer, top_first=True)
        gl.enable_only(blending)
        table.release()

    def _bind(self, job: FrameJob, table: moderngl.Texture) -> None:
        """Bind the results of earlier passes (paths, interfaces, opaque surfaces), and objects and lights."""
        found = job.targets["result"].color_attachments[:4] + job.targets["entered"].color_attachments
        if not job.features.one_interface:
            found += job.targets["left"].color_attachments
        bind_light(job, self._variants, {**dict(zip(_SAMPLERS, found, strict=False)), "object_table": table})
