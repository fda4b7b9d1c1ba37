"""Radiance from accumulated path lengths, and the mask of valid pixels."""

from __future__ import annotations

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.planning.passes import PassSpec

_SAMPLERS = (
    "accumulated",
    "accumulated_path",
    "fallback",
    "fallback_path",
    "ordered_depth",
    "ordered_emitted",
    "ordered_layers",
    "opaque_axial_depth",
    "opaque_radiance",
    "seen_map",
    "unlit",
    "unlit_path",
)


class TransmittancePass:
    """Beer-Lambert transmittance over the background, per pixel; see ``shaders/shade/transmittance.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        units = {name: unit for unit, name in enumerate(_SAMPLERS)}
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/transmittance.frag", **units)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame from its accumulated paths; for a job of several samples, add a sample's radiance and
        transmittance instead.
        """
        gl, plan, features = job.gl, job.plan, job.features
        inputs = {
            "accumulated": job.accumulator() if features.accumulates else None,
            "fallback": job.accumulator("fallback") if features.has_fallback else None,
            "unlit": job.accumulator("unlit") if features.has_unlit else None,
            "ordered_depth": job.targets.ordered() if plan.ordered else None,
            "opaque_axial_depth": job.targets.opaque() if features.has_opaque else None,
        }
        seen = job.scene.environment.seen
        seen_map = seen.kind == "image" and not features.has_surfaces
        if seen_map:
            job.resources.environments.sharp(seen).use(_SAMPLERS.index("seen_map"))
        sums = job.sums_after(spec.name)
        into = job.targets.average() if sums else job.targets.result()
        into.use()
        if sums:
            gl.enable_only(moderngl.BLEND)
            gl.blend_equation = moderngl.FUNC_ADD
            gl.blend_func = moderngl.ONE, moderngl.ONE
        else:
            gl.enable_only(moderngl.NOTHING)
        for first, framebuffer in inputs.items():
            if framebuffer is not None:
                for unit, texture in enumerate(framebuffer.color_attachments, _SAMPLERS.index(first)):
                    texture.use(unit)
        paths = {
            "SPECTRAL": plan.spectral,
            "FALLBACK": features.has_fallback,
            "UNLIT": features.has_unlit,
            "EMISSION": features.emits and not plan.ordered,
            "ORDERED": plan.ordered,
            "ACCUMULATED": features.accumulates,
        }
        switches = {
            "AVERAGE": sums,
            "SURFACES": features.has_surfaces,
            "SEEN_MAP": seen_map,
            "OPAQUE": features.has_opaque,
        }
        program = self._variants.program(**switches, **paths)
        # Where there is no medium no path is read, and all of it is 0.
        empty = self._variants.program(**switches, **dict.fromkeys(paths, False))
        self._variants.draw_covered(job, program, into, top_first=True)
        self._variants.draw_rest(job, empty, into, top_first=True)
