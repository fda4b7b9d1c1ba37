"""Shortcuts of other renderers, drawn and timed like the methods that they are compared with; in no plan."""

from __future__ import annotations

from typing import Protocol
from weakref import WeakKeyDictionary

import moderngl

from translucent.gpu.job import FrameJob
from translucent.gpu.passes.thickness import BackFaceDepthPass
from translucent.gpu.passes.variants import Variants
from translucent.gpu.shaders import build_program, set_uniform
from translucent.gpu.targets import Targets, add_up
from translucent.planning.passes import PassName, PassSpec


class DepthOnlyPass:
    """Drawing of objects, both sides, into a depth buffer. The job must be placed ``with_depth``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._program = build_program(
            gl, "geometry/body.vert", "thickness/depth_only.frag", {"WITH_NORMAL": 0, "WITH_POSITION": 0}
        )

    def run(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw the objects with the depth test on."""
        framebuffer = job.targets.depth_only()
        framebuffer.use()
        job.gl.enable_only(moderngl.DEPTH_TEST)
        framebuffer.clear(depth=1.0)
        job.draw(self._program, objects)


class Shortcut(Protocol):
    """Base class of shortcuts: fills the accumulator by a shortcut that no plan uses."""

    with_depth: bool  # how the job has to be placed

    def run(self, job: FrameJob) -> None:
        """Draw the bodies."""

    def hand_over(self, job: FrameJob) -> None:
        """Copy the result to the accumulator, if it is elsewhere."""


class NearestFacePass:
    """Drawing of `NearestFace`, whatever its size; see ``shaders/thickness/nearest_face.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "thickness/nearest_face.frag")
        self._with_depth: WeakKeyDictionary[Targets, dict[bool, moderngl.Framebuffer]] = WeakKeyDictionary()

    def run(self, job: FrameJob, *, sphere: bool, size: float) -> None:
        """Draw the bodies: where several are, the nearest hides the others, as in viewers of glTF."""
        framebuffer = self._framebuffer(job)
        framebuffer.use()
        framebuffer.clear(depth=1.0)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        program = self._variants.program(WITH_NORMAL=sphere, WITH_POSITION=0, SPHERE=sphere, SPECTRAL=job.plan.spectral)
        set_uniform(program, "size", size)
        job.draw(program, _bodies(job))
        job.gl.enable_only(moderngl.NOTHING)

    def _framebuffer(self, job: FrameJob) -> moderngl.Framebuffer:
        """The accumulator with a depth buffer."""
        made = self._with_depth.setdefault(job.targets, {})
        if job.plan.spectral not in made:
            depth = job.gl.depth_renderbuffer(job.targets.size)
            made[job.plan.spectral] = job.gl.framebuffer(job.accumulator().color_attachments, depth)
        return made[job.plan.spectral]


class NearestFace:
    """Thickness from the nearest face alone, constant or that of a ball.

    Parameters
    ----------
    drawing : NearestFacePass
        That draws it.
    sphere : bool
        The thickness is `size` times n.v; else `size` everywhere.
    size : float
        In metres.
    """

    with_depth = True

    def __init__(self, drawing: NearestFacePass, *, sphere: bool, size: float) -> None:
        self._drawing, self._sphere, self._size = drawing, sphere, size

    def run(self, job: FrameJob) -> None:
        """Draw the bodies."""
        self._drawing.run(job, sphere=self._sphere, size=self._size)

    def hand_over(self, job: FrameJob) -> None:
        """Nothing to do: the result is in the accumulator."""


class UnmarkedBackFacePass:
    """Farthest back face minus nearest front face, without marking pixels that have a gap in between."""

    with_depth = False

    def __init__(self, gl: moderngl.Context) -> None:
        self._pass = BackFaceDepthPass(gl)

    def run(self, job: FrameJob) -> None:
        """Draw the bodies."""
        self._pass.run(job, PassSpec(PassName.BACK_FACE_DEPTH, "for comparison", _bodies(job), 2))

    def hand_over(self, job: FrameJob) -> None:
        """Clear the count of entries and exits, which would mark pixels invalid."""
        framebuffer = job.accumulator()
        framebuffer.use()
        framebuffer.color_mask = (False, True, False, False)
        framebuffer.clear()
        framebuffer.color_mask = (True, True, True, True)


class HalfFloatPass:
    """Signed depth into a target of float16, which takes half the memory and has 11 bits."""

    with_depth = False

    def __init__(self, gl: moderngl.Context) -> None:
        self._variants = Variants(gl, "geometry/body.vert", "thickness/signed_depth.frag", "opaque_axial_depth")
        self._halves: WeakKeyDictionary[Targets, dict[bool, list[moderngl.Framebuffer]]] = WeakKeyDictionary()
        self._wholes: WeakKeyDictionary[Targets, dict[bool, list[moderngl.Framebuffer]]] = WeakKeyDictionary()

    def run(self, job: FrameJob) -> None:
        """Draw the bodies."""
        half = self._half(job)[0]
        half.use()
        half.clear()
        gl = job.gl
        add_up(gl)
        job.draw(
            self._variants.program(WITH_NORMAL=0, WITH_POSITION=0, SPECTRAL=job.plan.spectral, OPAQUE=0), _bodies(job)
        )
        gl.enable_only(moderngl.NOTHING)

    def hand_over(self, job: FrameJob) -> None:
        """Copy into the accumulator."""
        whole = self._wholes.setdefault(job.targets, {})
        if job.plan.spectral not in whole:
            parts = job.accumulator().color_attachments
            whole[job.plan.spectral] = [job.gl.framebuffer([part]) for part in parts]
        for source, target in zip(self._half(job)[1:], whole[job.plan.spectral], strict=True):
            job.gl.copy_framebuffer(target, source)

    def _half(self, job: FrameJob) -> list[moderngl.Framebuffer]:
        """Framebuffers of the float16 target: one with all attachments, and one for each."""
        made = self._halves.setdefault(job.targets, {})
        if job.plan.spectral not in made:
            components = (4, 1) if job.plan.spectral else (2,)
            parts = [job.gl.texture(job.targets.size, count, dtype="f2") for count in components]
            made[job.plan.spectral] = [job.gl.framebuffer(parts), *(job.gl.framebuffer([part]) for part in parts)]
        return made[job.plan.spectral]


def _bodies(job: FrameJob) -> tuple[int, ...]:
    return tuple(i for i, item in enumerate(job.scene.objects) if item.medium is not None)
