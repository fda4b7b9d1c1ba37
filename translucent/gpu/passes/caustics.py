"""Photons from the lights through interfaces, as points on the picture of the opaque objects."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import moderngl
import numpy as np

from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS, PHOTON_WIDTH
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import FINISH_UNITS, FinishMaps, OpaquePass, shadow_switches
from translucent.gpu.passes.traced_interfaces import all_closed
from translucent.gpu.passes.variants import Variants, coat_switches, look_switches
from translucent.gpu.shaders import before_making, build_program, set_uniform
from translucent.gpu.uniforms import media_center
from translucent.planning.caustics import PhotonAim, photon_aims
from translucent.planning.passes import PassSpec

_TRACED = {name: unit for unit, name in enumerate(("object_table", "hierarchy_nodes", "hierarchy_triangles"))}
_LANDED = ("landed_point", "landed_power", "landed_normal")
_RECEIVED = {"photon_irradiance": 0, "opaque_axial_depth": 1, "receiver_normal": 2}
_SPLAT = {name: unit for unit, name in enumerate((*_LANDED, "opaque_axial_depth"))}

#: Photons of a pixel from which on they stay in it; fewer are spread. With 4 and 16 errors of pictures are larger.
ENOUGH = 8.0

#: Photons that are followed together: 48 bytes each are kept of them.
BATCH = PHOTON_WIDTH * 512


@dataclass(frozen=True, eq=False)
class Tracer:
    """Means to follow the photons of a scene: where they aim, where a batch has landed, program and textures."""

    aims: list[PhotonAim]
    landed: moderngl.Framebuffer
    program: moderngl.Program
    textures: tuple[moderngl.Texture, ...]


class CausticsPass:
    """Photons that interfaces turn onto opaque objects; see ``shaders/transport/photons.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._photons = Variants(gl, "geometry/fullscreen.vert", "transport/photons.frag", **_TRACED)
        self._spread = Variants(gl, "geometry/fullscreen.vert", "shade/photon_spread.frag", **_RECEIVED)
        self._shade = Variants(
            gl, "geometry/fullscreen.vert", "shade/caustics.frag", photon_spread=3, receiver_base=4, **_RECEIVED
        )
        self._known = Variants(gl, "geometry/fullscreen.vert", "shade/known_photons.frag", photon_light=0)
        self._opaque = OpaquePass(gl)
        self._plain = Variants(gl, "geometry/body.vert", "shade/receiver.frag", **FINISH_UNITS)
        self._finished = Variants(gl, "geometry/interface.vert", "shade/receiver.frag", **FINISH_UNITS)
        self._maps = FinishMaps(gl)
        self._splat: moderngl.VertexArray | None = None

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Follow the photons of this sample, and add their light to the opaque objects."""
        if job.photon_light is not None:
            return self._add_known(job, *job.photon_light)
        with ExitStack() as stack:
            tracer = self.begin(stack, job)
            for number, aim in enumerate(tracer.aims):
                begin, end = (aim.photons * (job.sample + i) // job.samples for i in range(2))
                self.follow(job, tracer, number, begin, end)
        self.paint(job, spec.objects)
        return self.shade(job, job.targets.view("opaque", 1))

    def begin(self, stack: ExitStack, job: FrameJob) -> Tracer:
        """Get ready to follow photons in the scene of a job, and forget those that have landed."""
        require_interfaces(job.gl.info)
        assert job.plan.caustics is not None
        job.targets.photons().clear()
        aims = photon_aims(job.scene, media_center(job.scene), job.plan.caustics.photons)
        return Tracer(aims, self._landed(stack), *self._tracer(stack, job))

    def follow(self, job: FrameJob, tracer: Tracer, number: int, begin: int, end: int) -> None:
        """Follow photons of the aim of this number, and add up where the picture shows that they have landed."""
        self._aim(tracer.program, tracer.aims[number], number, job)
        for first in range(begin, end, BATCH):
            count = min(BATCH, end - first)
            for unit, texture in enumerate(tracer.textures):
                texture.use(unit)
            self._follow(tracer.program, tracer.landed, first, count)
            self._add(job, tracer.landed, count)

    def _landed(self, stack: ExitStack) -> moderngl.Framebuffer:
        """Textures for a batch of photons where they have landed."""
        try:
            textures = [self._gl.texture((PHOTON_WIDTH, BATCH // PHOTON_WIDTH), 4, dtype="f4") for _ in _LANDED]
            framebuffer = self._gl.framebuffer(textures)
        except moderngl.Error as error:
            raise RenderError("caustics", f"OpenGL has no room for photons ({error})", "leave them out") from error
        for resource in (framebuffer, *textures):
            stack.callback(resource.release)
        for texture in textures:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return framebuffer

    def _tracer(self, stack: ExitStack, job: FrameJob) -> tuple[moderngl.Program, tuple[moderngl.Texture, ...]]:
        """Program that follows photons through the scene of a job, with its uniforms, and its textures."""
        scene = job.scene
        surfaces = [body.surface for body in scene.bodies if body.surface is not None]
        program = self._photons.program(
            ONE_OBJECT=len(scene.objects) == 1,
            PRIORITY=scene.overlap == "priority",
            UNION=scene.overlap == "union",
            EMISSION=False,
            FROM_EYE=False,
            LIGHTS=False,
            ROUGH=any(surface.roughness > 0 for surface in surfaces),
            DISPERSION=any(surface.dispersion > 0 for surface in surfaces),
            **coat_switches(scene.bodies),
        )
        hierarchies = job.resources.hierarchies.of(scene)
        placements, frame = hierarchies.place(scene, media_center(scene))
        bodies = job.object_table(placements)
        stack.callback(bodies.release)
        assert job.plan.caustics is not None
        values = {
            "seed": job.plan.caustics.seed,
            "all_closed": all_closed(scene),
            "object_nodes": hierarchies.object_nodes,
            "objects_frame": frame,
        }
        for name, value in values.items():
            if name in program:
                set_uniform(program, name, value)
        return program, (bodies, hierarchies.nodes, hierarchies.triangles)

    def _aim(self, program: moderngl.Program, aim: PhotonAim, number: int, job: FrameJob) -> None:
        assert job.plan.caustics is not None
        entries = [*(i + 1 for i in aim.inside[:8]), *[0] * (8 - len(aim.inside[:8]))]
        shift = np.random.default_rng((job.plan.caustics.seed, number)).random(2)
        values = {
            "aim": number,
            "aim_shift": tuple(shift),
            "light_from": tuple(aim.light),
            "cone": tuple(aim.cone),
            "aim_middle": tuple(aim.middle),
            "aim_right": tuple(aim.right),
            "aim_up": tuple(aim.up),
            "photon_power": tuple(aim.flux * (job.samples / aim.photons)),
            "light_interior": tuple(low | high << 16 for low, high in zip(entries[::2], entries[1::2], strict=True)),
        }
        for name, value in values.items():
            set_uniform(program, name, value)

    def _follow(self, program: moderngl.Program, landed: moderngl.Framebuffer, first: int, count: int) -> None:
        set_uniform(program, "first_photon", first)
        set_uniform(program, "last_photon", first + count)
        landed.scissor = 0, 0, PHOTON_WIDTH, -(-count // PHOTON_WIDTH)
        landed.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._photons.draw_fullscreen(program)
        landed.scissor = None

    def _add(self, job: FrameJob, landed: moderngl.Framebuffer, count: int) -> None:
        """Add the irradiance of a batch of photons to the pixels that show where they have landed."""
        if self._splat is None:
            before_making(self._gl, (("transport/landed.vert", "transport/landed.frag"), ()))
            program = build_program(self._gl, "transport/landed.vert", "transport/landed.frag", **_SPLAT)
            self._splat = self._gl.vertex_array(program, [])
        textures = *landed.color_attachments, job.targets.opaque().color_attachments[0]
        for unit, texture in enumerate(textures):
            texture.use(unit)
        self._add_up(job.targets.photons())
        self._splat.render(moderngl.POINTS, vertices=count)

    def draw_depth(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw where opaque objects are, and nothing else of them."""
        ends = job.targets.opaque_ends()
        ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
        self._opaque.draw_depth(job, objects, ends)

    def paint(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw what opaque objects reflect diffusely, as `OpaquePass` draws their radiance."""
        framebuffer = job.targets.paint()
        framebuffer.use()
        framebuffer.clear(depth=1.0)
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<="
        unshadowed = shadow_switches(False, job.resources)
        bare = unshadowed | coat_switches(())
        for i in objects[::-1]:
            body = job.scene.objects[i]
            if (surface := body.surface) is None:
                program = self._plain.program(
                    WITH_NORMAL=1, WITH_POSITION=1, SURFACE=0, VERTEX_COLORS=0, OCCLUSION=0, **bare
                )
            else:
                program = self._finished.program(
                    SURFACE=1, **look_switches(body), **unshadowed, **coat_switches([body])
                )
                self._maps.bind(job)
                self._maps.set_finish(job, program, surface, surface.alpha_cutoff)
            job.draw(program, (i,))
        self._gl.depth_func = "<"

    def shade(self, job: FrameJob, into: moderngl.Framebuffer, rounds: int = 1) -> None:
        """Add the light that opaque objects reflect of the photons that have landed, the mean of so many rounds."""
        paint, normal = job.targets.paint().color_attachments
        depth = job.targets.opaque().color_attachments[0]
        for unit, texture in enumerate((job.targets.photons().color_attachments[0], depth, normal)):
            texture.use(unit)
        program = self._spread.program()
        set_uniform(program, "enough", ENOUGH / job.samples)
        job.targets.photon_spread().use()
        self._gl.enable_only(moderngl.NOTHING)
        self._spread.draw_fullscreen(program)
        job.targets.photon_spread().color_attachments[0].use(3)
        paint.use(4)
        shading = self._shade.program()
        set_uniform(shading, "share", 1.0 / rounds)
        self._add_up(into)
        self._shade.draw_fullscreen(shading)

    def _add_known(self, job: FrameJob, light: moderngl.Texture, stride: int, phase: tuple[int, int]) -> None:
        """Add light of photons to the opaque objects that the larger picture has for these pixels."""
        program = self._known.program()
        set_uniform(program, "stride", stride)
        set_uniform(program, "phase", (phase[0], stride - 1 - phase[1]))  # stored with row 0 at the bottom
        light.use(0)
        self._add_up(job.targets.view("opaque", 1))
        self._known.draw_fullscreen(program)

    def _add_up(self, framebuffer: moderngl.Framebuffer) -> None:
        framebuffer.use()
        self._gl.enable_only(moderngl.BLEND)
        self._gl.blend_equation = moderngl.FUNC_ADD
        self._gl.blend_func = moderngl.ONE, moderngl.ONE
