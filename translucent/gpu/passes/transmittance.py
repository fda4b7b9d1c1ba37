"""Radiance from accumulated path lengths, and the mask of valid pixels."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.targets import add_up
from translucent.gpu.uniforms import bounded_extinction, view_span
from translucent.planning.passes import PassSpec
from translucent.scene.scene import Scene

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
    "accumulated_second",
    "accumulated_third",
)

#: Samplers of the media that have an accumulator each.
_APART = ("accumulated", "accumulated_second", "accumulated_third")


class TransmittancePass:
    """Beer-Lambert transmittance over the background, per pixel; see ``shaders/shade/transmittance.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "shade/transmittance.vert", "shade/transmittance.frag", *_SAMPLERS)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame from its accumulated paths; for a job of several samples, add a sample's radiance and
        transmittance instead.
        """
        features = job.features
        maps = {} if features.has_surfaces else job.resources.background_textures(job.scene.environment)
        self._variants.bind(**maps)
        sums = job.sums_after(spec.name)
        into = job.targets["average"] if sums else job.compact_result if job.compact else job.targets["result"]
        into.use()
        if sums:
            add_up(job.gl)
        else:
            job.gl.enable_only(moderngl.NOTHING)
        paths = self._bind_paths(job)
        switches = {
            "MAP": False,
            "AVERAGE": sums,
            "COMPACT": job.compact and not sums,
            "SURFACES": features.has_surfaces,
            "SEEN_MAP": bool(maps),
            # Where others look at the targets, they may change the environment, too.
            "SEEN_KIND": 1 + int(CONSTANTS[f"ENVIRONMENT_{job.scene.environment.seen.kind.upper()}"])
            if job.compact
            else 0,
            "OPAQUE": features.has_opaque,
        }
        program = self._variants.program(**switches, **paths)
        # Where there is no medium no path is read, and all of it is 0. So are sums: one program does for both where
        # interfaces take most of the time, and not where none is in view.
        without = {name: False for name in paths if name != "SPECTRAL" or not job.compact}
        one_program = features.has_surfaces and not job.plan.ordered and job.covered
        empty = program if one_program else self._variants.program(**switches, **(paths | without))
        self._set_loose(job, (program, empty))
        self._variants.draw_covered(job, program, into, top_first=True)
        if sums or not (job.averaging and job.shows_ground_alone and job.sample):  # else it is there, as in all samples
            self._variants.draw_rest(job, empty, into, top_first=True)

    def run_map(
        self, job: FrameJob, into: moderngl.Framebuffer, corner: tuple[int, int], ahead: tuple[float, float]
    ) -> None:
        """Write optical depths, and where the first opaque surface is, into the map of shadows with this corner.

        `ahead` is metres ahead of the center of the media at axial depth 0, and from there to axial depth 1.
        """
        paths = self._bind_paths(job) | {"UNLIT": False, "EMISSION": False}
        opaque = job.features.has_opaque
        unused = dict.fromkeys(("AVERAGE", "COMPACT", "SURFACES", "SEEN_MAP", "SEEN_KIND"), 0)
        switches = {"MAP": True, "OPAQUE": opaque, **unused}
        x, y, *extent = job.covered.scissor
        into.use()
        job.gl.enable_only(moderngl.NOTHING)
        into.viewport = (*corner, *job.targets.size)
        for found, scissor in (
            (dict.fromkeys(paths, False), (*corner, *job.targets.size)),
            (paths, (corner[0] + x, corner[1] + y, *extent)),
        ):
            into.scissor = scissor
            program = self._variants.program(**switches, **found)
            set_uniform(program, "map_place", (*corner, *ahead))
            self._variants.draw_fullscreen(program)
        into.scissor = None
        into.viewport = (0, 0, *into.size)

    def _set_loose(self, job: FrameJob, programs: tuple[moderngl.Program, ...]) -> None:
        """Set the uniforms that some variants have outside of blocks."""
        values: dict[str, Any] = {"view_span": view_span(job.view)}
        if job.media_apart is not None:
            values["media_extinction"] = _extinctions(job.scene, job.media_apart)
        for program in programs:
            set_used(program, values)

    def _bind_paths(self, job: FrameJob) -> dict[str, bool | int]:
        """Bind the results of earlier passes, and the matching switches."""
        plan, features, apart = job.plan, job.features, job.media_apart
        inputs = {
            "accumulated": job.accumulator() if features.accumulates and apart is None else None,
            "fallback": job.accumulator("fallback") if features.has_fallback else None,
            "unlit": job.accumulator("unlit") if features.has_unlit else None,
            "ordered_depth": job.targets["ordered"] if plan.ordered else None,
            "opaque_axial_depth": job.targets["opaque"] if features.has_opaque else None,
        }
        for first, framebuffer in inputs.items():
            if framebuffer is not None:
                for unit, texture in enumerate(framebuffer.color_attachments, self._variants.units[first]):
                    texture.use(unit)
        if apart is not None:
            for name, framebuffer in zip(_APART, job.accumulators_apart, strict=False):
                self._variants.bind(**{name: framebuffer.color_attachments[0]})
        return {
            "SPECTRAL": plan.spectral if apart is None else int(apart.max()) + 1,
            "FALLBACK": features.has_fallback,
            "UNLIT": features.has_unlit,
            "EMISSION": features.emits and not plan.ordered,
            "ORDERED": plan.ordered,
            "ACCUMULATED": features.accumulates,
        }


def _extinctions(scene: Scene, media: npt.NDArray[np.intp]) -> tuple[float, ...]:
    """Columns of a matrix (3, 3): extinction in 1/m of the medium with each number."""
    columns = np.zeros((3, 3))
    for number, body in zip(media[scene.filled], scene.bodies, strict=True):
        columns[number] = bounded_extinction(body.medium, scene.diagonal)
    return tuple(columns.ravel().tolist())
