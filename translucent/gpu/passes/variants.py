"""Variants of one pair of shaders, by their switches; each is compiled when a scene first needs it."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl

from translucent.gpu.constants import COMPUTE_GROUP
from translucent.gpu.features import FrameFeatures
from translucent.gpu.job import FrameJob
from translucent.gpu.placement import Part
from translucent.gpu.shaders import before_making, build_compute, build_program
from translucent.gpu.textures import AnyTexture, has_textures
from translucent.scene.environment import Environment
from translucent.scene.scene import Object


class Variants:
    """Programs that differ in their switches only.

    Parameters
    ----------
    gl : moderngl.Context
    vertex, fragment : str
        Files under ``shaders/``.
    samplers : str
        Names of the samplers; each has its place among them for its texture unit.
    version : int
        Of GLSL.

    Attributes
    ----------
    units : dict of str to int
        Texture unit of each sampler.
    """

    def __init__(self, gl: moderngl.Context, vertex: str, fragment: str, *samplers: str, version: int = 330) -> None:
        self._gl = gl
        self._files = vertex, fragment
        self._version = version
        self.units = {name: unit for unit, name in enumerate(samplers)}
        self._programs: dict[tuple[tuple[str, int], ...], moderngl.Program] = {}
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def program(self, **switches: bool | int) -> moderngl.Program:
        """The program with these switches; raises `PostponedError` if the context's compile budget is spent."""
        key = tuple(sorted((name, int(value)) for name, value in switches.items()))
        if key not in self._programs:
            before_making(self._gl, (self._files, key))
            made = build_program(self._gl, *self._files, dict(key), self._version, **self.units)
            made.extra = self._files, key
            self._programs[key] = made
        return self._programs[key]

    def bind(self, **textures: AnyTexture) -> None:
        """Bind textures to the units of the samplers of these names."""
        for name, texture in textures.items():
            texture.use(self.units[name])

    def draw_fullscreen(self, program: moderngl.Program) -> None:
        """Run one of the programs for every pixel of the current framebuffer."""
        self._vertices(program).render(moderngl.TRIANGLES, vertices=3)

    def draw_points(self, program: moderngl.Program, count: int) -> None:
        """Draw so many points without attributes by one of the programs."""
        self._vertices(program).render(moderngl.POINTS, vertices=count)

    def draw_covered(
        self,
        job: FrameJob,
        program: moderngl.Program,
        framebuffer: moderngl.Framebuffer,
        *,
        top_first: bool = False,
        rows: tuple[int, int] | None = None,
    ) -> None:
        """Run one of the programs for the pixels of `job.covered` alone: those where a ray may cross a medium.

        The contract of a pass over pixels: it runs its program here, and gives the other pixels by `draw_rest`, or by
        clearing them, what that program would have written without a medium. What is read beyond `job.covered` was
        never written by `draw_covered`. Both use the framebuffer and leave it without a scissor; they change no other
        state, so that blending and the depth test are the caller's.

        Parameters
        ----------
        job : FrameJob
        program : moderngl.Program
            Of ``geometry/fullscreen.vert``.
        framebuffer : moderngl.Framebuffer
            Of the size of the frame.
        top_first : bool
            Row 0 of what is written is the top one, as in `Targets.result`; else the bottom one.
        rows : (int, int), optional
            Only rows from the first to before the second, counted as they are written.
        """
        part = job.covered.flipped(job.targets.size[1]) if top_first else job.covered
        self._draw_parts(program, framebuffer, (part if rows is None else part.rows(*rows),))

    def draw_part(self, part: Part, program: moderngl.Program, framebuffer: moderngl.Framebuffer) -> None:
        """Run one of the programs for the pixels of a part; rows of the part count up as in the framebuffer."""
        self._draw_parts(program, framebuffer, (part,))

    def draw_rest(
        self, job: FrameJob, program: moderngl.Program, framebuffer: moderngl.Framebuffer, *, top_first: bool = False
    ) -> None:
        """Run one of the programs for the pixels that `draw_covered` leaves out, each once."""
        part = job.covered.flipped(job.targets.size[1]) if top_first else job.covered
        self._draw_parts(program, framebuffer, part.rest(job.targets.size))

    def _vertices(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Vertices without attributes."""
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self._gl.vertex_array(program, [])
        return self._arrays[program.glo]

    def _draw_parts(
        self, program: moderngl.Program, framebuffer: moderngl.Framebuffer, parts: tuple[Part, ...]
    ) -> None:
        for part in parts:
            if part:
                framebuffer.scissor = part.scissor
                framebuffer.use()
                self.draw_fullscreen(program)
        framebuffer.scissor = None
        framebuffer.use()


class ComputeVariants:
    """Compute shaders of one file that differ in their switches only; each is compiled when a scene first needs it.

    Parameters
    ----------
    gl : moderngl.Context
    file : str
        Under ``shaders/``; its groups have `COMPUTE_GROUP` invocations.
    units : int
        Texture unit of each sampler.
    """

    def __init__(self, gl: moderngl.Context, file: str, **units: int) -> None:
        self._gl, self._file, self._units = gl, file, units
        self._programs: dict[tuple[tuple[str, int], ...], moderngl.ComputeShader] = {}

    def program(self, **switches: bool | int) -> moderngl.ComputeShader:
        """The compute shader with these switches; raises `PostponedError` as `Variants.program` does."""
        key = tuple(sorted((name, int(value)) for name, value in switches.items()))
        if key not in self._programs:
            before_making(self._gl, (("", self._file), key))
            self._programs[key] = build_compute(self._gl, self._file, dict(key), **self._units)
        return self._programs[key]

    def run(self, program: moderngl.ComputeShader, count: int) -> None:
        """Run one of the shaders for so many invocations, which see the results of all runs before."""
        if not count:
            return
        program.run(-(-count // COMPUTE_GROUP))
        self._gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)


def walk_switches(features: FrameFeatures) -> dict[str, bool | int]:
    """Switches of ``shaders/intervals/walk.glsl`` for a frame: the kinds of media, and the number of slots."""
    return {
        # Powers of two, so that scenes which differ by a medium use the same programs.
        "SLOTS": 1 << max(len(features.slots) - 1, 0).bit_length(),
        "UNION": features.scene.overlap == "union",
        "PRIORITY": features.scene.overlap == "priority",
        "EMISSION": features.emits,
        "SCATTER": features.straight_light,
        "MARCH": features.marches,
        "VARIES": features.varies,
        "SCATTERS_AGAIN": features.scatters_again,
        # One set of points serves all channels where light fares alike in them.
        "GRAY": all((slot.medium.extinction == slot.medium.extinction[0]).all() for slot in features.slots),
        "SHADOWS": bool(features.scene.opaque),
    }


def look_switches(body: Object) -> dict[str, bool]:
    """Switches of ``geometry/interface.vert`` and ``shade/surface_textures.glsl``: features that few objects have."""
    occluded = body.surface is not None and body.surface.occlusion_texture is not None
    return {
        "VERTEX_COLORS": body.mesh.colors is not None,
        "SURFACE_TEXTURES": has_textures(body.surface),
        "OCCLUSION": occluded,
    }


def background_switches(environment: Environment) -> dict[str, int]:
    """Switches for rays that end in the environment: its type, and whether the background emits light."""
    picture, lights = environment.seen.kind == "image", environment.seen is environment
    return {
        "SEEN_MAP": picture + (picture and lights),
        "SEEN_LIGHTS": picture and lights,
        "CHECKERBOARD": environment.seen.kind == "checkerboard",
    }


def coat_switches(objects: Iterable[Object]) -> dict[str, bool]:
    """Switches of what lies on the surfaces of objects: thin films and clear coats."""
    surfaces = [body.surface for body in objects if body.surface is not None]
    return {
        "THIN_FILM": any(surface.iridescence > 0 for surface in surfaces),
        "CLEAR_COAT": any(surface.clearcoat > 0 for surface in surfaces),
    }
