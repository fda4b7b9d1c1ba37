"""Recordings of frames as steps: the passes of plans, run without OpenGL, for one scene with a few of its switches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import moderngl

from translucent.arrays import Integers
from translucent.formulas.sampling import sample_shifts
from translucent.gpu.job import CameraView, FrameJob
from translucent.gpu.layout import BODY_STRIDE, SHADOWS
from translucent.gpu.passes import PASSES, Pass
from translucent.gpu.placement import Part
from translucent.gpu.recording.context import RecordedBuffer, RecordedMeshes, RecordingContext
from translucent.gpu.resources import Resources
from translucent.gpu.targets import Targets
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan

#: Size of a recorded frame: prime numbers, so that no texture of another purpose has it.
SIZE = (1021, 769)


class RecordedJob(FrameJob):
    """Job whose passes draw all objects, and over the whole picture, as any camera may see them."""

    any_eye = True

    def place(self, shift: tuple[float, float], *, with_depth: bool = False) -> None:
        """Write the uniforms for samples that are `shift` (right, down) pixels off the pixel centers."""
        super().place(shift, with_depth=with_depth)
        self.covered = Part(0, 0, *self.targets.size)

    def draw(
        self, program: moderngl.Program, objects: tuple[int, ...], faces: Mapping[int, Integers] | None = None
    ) -> None:
        """Draw objects with the current state."""
        CameraView.draw(self, program, objects)


@dataclass(eq=False)
class RecordedFrame:
    """Steps of a frame.

    Attributes
    ----------
    once : list of dict
        Steps that no camera changes: maps of shadows.
    media : list of dict
        Steps that only media change: the map of the environment's shadows on the ground.
    single : list of dict
        Steps of a frame with one sample in the middle of each pixel.
    averaged : list of dict
        Steps that add one of several samples to sums.
    blocks : dict of int to bytes
        Contents of the uniform blocks of `single` by binding.
    bodies : list of bytes
        Contents of the Body block of each object.
    targets : dict of str to int
        Numbers of the textures that hold results, by what they hold.
    plan : RenderPlan
    """

    plan: RenderPlan
    once: list[dict[str, Any]] = field(default_factory=list)
    media: list[dict[str, Any]] = field(default_factory=list)
    single: list[dict[str, Any]] = field(default_factory=list)
    averaged: list[dict[str, Any]] = field(default_factory=list)
    blocks: dict[int, bytes] = field(default_factory=dict)
    bodies: list[bytes] = field(default_factory=list)
    targets: dict[str, int] = field(default_factory=dict)


class FrameRecorder:
    """Recorder of frames with common programs, textures and targets.

    Parameters
    ----------
    samples : int
        Samples of a pixel that are added up.
    most_layers : int
        Crossings of a ray that depth peeling is to find.
    texture_units : int
        Textures that one shader can read, as the planner knows it.
    """

    def __init__(self, samples: int, most_layers: int, texture_units: int) -> None:
        self.gl = RecordingContext(SIZE, most_layers, texture_units)
        self._context = cast(moderngl.Context, self.gl)
        self._samples = samples
        self._targets = Targets(self._context, SIZE)
        self._resources = Resources(self._context)
        self._resources.media_change = True
        self._resources.meshes = RecordedMeshes(self.gl)  # type: ignore[assignment]
        self._passes: dict[type[Pass], Pass] = {}

    @property
    def resources(self) -> Resources:
        """Caches of uploaded textures and meshes."""
        return self._resources

    def record(self, plan: RenderPlan) -> RecordedFrame:
        """Record a frame."""
        job = RecordedJob(self._context, plan, self._targets, self._resources)
        frame = RecordedFrame(plan)
        self.gl.live_blocks = {}
        self._run(job, frame.once, frame.single)
        frame.media = _map_of_ground(frame.once)
        frame.once = [step for step in frame.once if step not in frame.media]
        frame.blocks = dict(self.gl.live_blocks)
        bodies = cast(RecordedBuffer, job.uniforms.bodies)
        frame.bodies = [
            bytes(bodies.content[i * BODY_STRIDE : (i + 1) * BODY_STRIDE]) for i in range(len(plan.scene.objects))
        ]
        job.averaging, job.sample, job.samples = True, 0, self._samples
        self.gl.steps = frame.averaged
        job.place(tuple(sample_shifts(self._samples)[0]))
        again: list[dict[str, Any]] = []
        self._run(job, again, frame.averaged)
        result, picture = self._targets["result"], job.picture
        average = self._targets["average"]
        found = {
            "radiance": picture.color_attachments[0],
            "transmittance": result.color_attachments[1],
            "optical_depth": result.color_attachments[2],
            "thickness": result.color_attachments[3],
            "flags": result.color_attachments[4],
            "average": average.color_attachments[0],
            "average_transmittance": average.color_attachments[1],
        }
        if job.features.accumulates:
            found["count"] = job.accumulator().color_attachments[0]
        if plan.ordered:
            found["layers"] = self._targets["ordered"].color_attachments[2]
        if job.features.has_surfaces:
            found["sound"] = picture.color_attachments[1]
        frame.targets = {name: self.gl.number_of_texture(cast(Any, texture)) for name, texture in found.items()}
        frame.targets["average_target"] = self.gl.number_of_framebuffer(cast(Any, average))
        return frame

    def _run(self, job: RecordedJob, once: list[dict[str, Any]], steps: list[dict[str, Any]]) -> None:
        for spec in job.plan.passes:
            kind = PASSES[spec.name]
            if kind not in self._passes:
                self._passes[kind] = kind(self._context)
            self.gl.live = spec.name is not PassName.SHADOW_MAPS
            self.gl.steps = steps if self.gl.live else once
            before = len(self.gl.steps)
            self._passes[kind].run(job, spec)
            for step in self.gl.steps[before:]:
                step["pass"] = spec.name.value
        self.gl.live = True


def _map_of_ground(steps: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Steps that make the map of shadows on the ground; they read the media as they are when the steps run."""
    targets = {step["target"] for step in steps if "ground_texels" in step.get("uniforms", {})}
    found = [step for step in steps if step.get("target") in targets]
    for step in found:
        step.get("blocks", {}).pop(SHADOWS.name, None)
    return found
