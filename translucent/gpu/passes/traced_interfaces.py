"""Rays traced through the meshes wherever interfaces bend them, over the whole picture."""

from __future__ import annotations

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.gpu.drivers import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform
from translucent.gpu.textures import reflectance_table
from translucent.gpu.uniforms import surface_table
from translucent.planning.passes import PassSpec
from translucent.scene.scene import Scene

_SAMPLERS = (
    "emitted_radiance_sum",
    "straight_transmittance",
    "entered",
    "surface_finish",
    "surface_color",
    "opaque_axial_depth",
    "opaque_radiance",
    "surface_table",
    "traced_bodies",
    "hierarchy_nodes",
    "hierarchy_triangles",
    "reflectance_table",
    "light_map",
    "light_levels",
    "light_irradiance",
    "seen_map",
)
_ENTERED = ("entered", "surface_finish", "surface_color")
_UNITS = {name: unit for unit, name in enumerate(_SAMPLERS)}


class TracedInterfacesPass:
    """Tree of reflected and refracted rays; see ``shaders/transport/traced_interfaces.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/fullscreen.vert", "transport/traced_interfaces.frag", **_UNITS)
        self._reflectance = reflectance_table(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame; for a job of several samples, add a sample's radiance and transmittance instead."""
        gl, scene, environment = job.gl, job.scene, job.scene.environment
        require_interfaces(gl.info)
        sums = job.sums_after(spec.name)
        (job.targets.average() if sums else job.targets.surfaced()).use()
        gl.enable_only(moderngl.BLEND if sums else moderngl.NOTHING)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        seen_map = environment.seen.kind == "image"
        seen_lights = seen_map and environment.seen is environment
        emitted, through, *_ = job.targets.result().color_attachments
        maps = job.resources.environments.light(environment)
        hierarchies = job.resources.hierarchies.of(scene)
        rows, frame = hierarchies.place(scene, media_center(scene), job.features.sheets)
        contents = surface_table(scene, job.features.sheets), rows
        tables = [gl.texture(table.shape[1::-1], 4, table, dtype="f4") for table in contents]
        depth, forks = job.plan.interfaces.tree if job.plan.interfaces else (0, 0)
        textures = {
            "emitted_radiance_sum": emitted,
            "straight_transmittance": through,
            **dict(zip(_ENTERED, job.targets.entered().color_attachments, strict=True)),
            "surface_table": tables[0],
            "traced_bodies": tables[1],
            "hierarchy_nodes": hierarchies.nodes,
            "hierarchy_triangles": hierarchies.triangles,
            "reflectance_table": self._reflectance,
            "light_map": job.resources.environments.sharp(environment),
            "light_levels": maps.levels,
            "light_irradiance": maps.irradiance,
        }
        if job.features.has_opaque:
            textures["opaque_axial_depth"], textures["opaque_radiance"] = job.targets.opaque().color_attachments
        if seen_map:
            textures["seen_map"] = job.resources.environments.sharp(environment.seen)
        for name, texture in textures.items():
            texture.use(_UNITS[name])
        inside = job.placed.starts_inside
        surfaces = [body.surface for body in scene.bodies if body.surface is not None]
        program = self._variants.program(
            FORKS=forks,
            FROM_EYE=inside or any(not (body.has_interface or body.covers) for body in scene.bodies),
            ONE_OBJECT=len(scene.objects) == 1,
            PRIORITY=scene.overlap == "priority",
            UNION=scene.overlap == "union",
            EMISSION=job.features.emits and not job.features.scatters,
            MICROFACETS=any(surface.roughness > 0 for surface in surfaces),
            DISPERSION=any(surface.dispersion > 0 for surface in surfaces),
            OPAQUE=job.features.has_opaque,
            SEEN_MAP=seen_map,
            SEEN_LIGHTS=seen_lights,
            SINGLE_SCATTERING=job.features.scatters,
        )
        set_uniform(program, "most_interfaces", depth)
        if "sample_number" in program:
            set_uniform(program, "sample_number", job.sample)
            set_uniform(program, "blurred_share", blurred_share(job.samples))
        if "start_record" in program:
            set_uniform(program, "start_record", _record_at_eye(job))
        if "object_nodes" in program:
            set_uniform(program, "object_nodes", hierarchies.object_nodes)
            set_uniform(program, "objects_frame", frame)
        self._variants.draw_fullscreen(program)
        for table in tables:
            table.release()


def blurred_share(samples: int) -> float:
    """Share of the variance of microfacets that blurs what is seen in them, 1 for a single sample of a pixel.

    The blur is smooth and somewhat wrong, the samples are right and noisy: their errors balance about so.
    """
    return float(samples**-0.2)


def media_center(scene: Scene) -> Array:
    """(3,): center of the bounds of all bodies, from which positions count."""
    boxes = np.stack([body.bounds for body in scene.bodies])
    return np.asarray(0.5 * boxes[:, 0].min(axis=0) + 0.5 * boxes[:, 1].max(axis=0))


def _record_at_eye(job: FrameJob) -> tuple[int, int, int, int]:
    """The bodies that contain the eye, as the shader keeps them."""
    entries = [
        number + 1
        for number, placement in enumerate(job.placed.placements)
        if number not in job.features.sheets
        for _ in range(round(placement.expected_count[1]))
    ][::-1][:8]
    entries += [0] * (8 - len(entries))
    words = [low | high << 16 for low, high in zip(entries[::2], entries[1::2], strict=True)]
    return words[0], words[1], words[2], words[3]
