"""Photons from the lights through interfaces, as points on the picture of the opaque objects.

Where Embree finds what they hit, each pass follows the live ones to their next surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS, MOST_PHOTON_HITS, PHOTON_WIDTH, STORAGE_BINDINGS
from translucent.gpu.context import require_interfaces
from translucent.gpu.embree_hits import Floats, RayHits
from translucent.gpu.job import ROUNDS, ROUNDS_FROM, FrameJob
from translucent.gpu.passes.opaque import SURFACE_SAMPLERS, OpaquePass, set_surface, shadow_switches
from translucent.gpu.passes.traced_interfaces import RAY_SAMPLERS, ray_switches, traced_scene
from translucent.gpu.passes.variants import ComputeVariants, Variants, coat_switches, look_switches
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.targets import add_up
from translucent.gpu.uniforms import media_center
from translucent.planning.caustics import PhotonAim, photon_aims
from translucent.planning.passes import PassSpec
from translucent.scene.scene import Scene

_LANDED = ("landed_point", "landed_power", "landed_normal")
_RECEIVED = ("photon_irradiance", "opaque_axial_depth", "receiver_normal")

#: Photons of a pixel from which on they stay in it; fewer are spread. Each photon is a square that holds as many as the
#: first number, up to a pixel wide. Of polished glass errors of pictures are larger with 8, and with 32 as large;
#: rough interfaces blur caustics, and errors are smaller by up to a third with four times as many.
ENOUGH, ENOUGH_OF_ROUGH = 16.0, 64.0

#: Photons that are followed together: 48 bytes each are kept of them.
BATCH = PHOTON_WIDTH * 512

#: What `start_of` of ``shaders/transport/photon_step.glsl`` adds for each photon to where it is aimed at, and to where
#: it begins on the disc of a light.
_STEP = np.array([3242174889, 2447445414, 1188417451, 3613785483]) / 2.0**32

#: Weight of the distance on the disc of a light, for photons that start side by side: with a quarter of a million they
#: differ by a seventieth of what is aimed at, and by a seventh of the light.
_ON_LIGHT = 0.1

#: Bytes that are kept of a photon, by the names of the buffers.
_BYTES = {"photons": 76, "live_photons": 12, "photon_segments": 24}

#: Largest distance of surfaces that a ray hits in one place, as a fraction of the scene, with room for rounding; see
#: ``path_within`` of ``shaders/transport/surface_hit.glsl``.
_ONE_PLACE = 2e-4


@dataclass(frozen=True, eq=False)
class PhotonTracer:
    """Everything for following the photons of a scene: aims, target for the hits of a batch, programs and textures.

    `channels`: 3 if each photon carries one of three channels, else 1.
    """

    aims: list[PhotonAim]
    landed: moderngl.Framebuffer
    programs: Sequence[Any]
    textures: dict[str, moderngl.Texture]
    channels: int


class CausticsPass:
    """Pass that traces photons through interfaces onto opaque objects; see ``shaders/transport/photon_step.glsl``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._photons = Variants(gl, "geometry/fullscreen.vert", "transport/photons.frag", *RAY_SAMPLERS)
        self._streams = PhotonStreams(gl, self._photons.units, _LANDED)
        self._spread = Variants(gl, "geometry/fullscreen.vert", "shade/photon_spread.frag", *_RECEIVED)
        self._shade = Variants(
            gl, "geometry/fullscreen.vert", "shade/caustics.frag", *_RECEIVED, "photon_spread", "receiver_base"
        )
        self._known = Variants(gl, "geometry/fullscreen.vert", "shade/known_photons.frag", "photon_light")
        self._opaque = OpaquePass(gl)
        self._plain = Variants(gl, "geometry/body.vert", "shade/receiver.frag", *SURFACE_SAMPLERS)
        self._surfaced = Variants(gl, "geometry/interface.vert", "shade/receiver.frag", *SURFACE_SAMPLERS)
        self._splat = Variants(gl, "transport/landed.vert", "transport/landed.frag", *_LANDED, "opaque_axial_depth")

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Follow the photons of this sample, if it has some, and add their light to the opaque objects."""
        if job.photon_light is not None:
            return self._add_known(job, *job.photon_light)
        rounds = _rounds(job.samples)
        if job.sample not in rounds or job.holds_opaque:
            return None
        number = job.sample - rounds.start
        with ExitStack() as stack:
            tracer = self.begin(stack, job, again=job.few_opaque and number > 0)
            for i, aim in enumerate(tracer.aims):
                begin, end = (aim.photons * (number + j) // len(rounds) for j in range(2))
                self.follow(job, tracer, i, begin, end)
        if not job.few_opaque:
            self.draw_base(job, spec.objects)
            return self.shade(job, job.targets.view("opaque", 1))
        if number == len(rounds) - 1:  # where the ground is smooth, the last of them shows all photons
            self.draw_base(job, spec.objects)
            self.shade(job, job.targets["opaque_mean"], len(rounds))
        return None

    def begin(self, stack: ExitStack, job: FrameJob, *, again: bool = False) -> PhotonTracer:
        """Prepare photon tracing in the scene of a job, and clear landed photons, unless more are added to them."""
        require_interfaces(job.gl.info)
        assert job.plan.caustics is not None
        if not again:
            job.targets["photons"].clear()
        aims = photon_aims(job.scene, media_center(job.scene), job.plan.caustics.photons)
        channels = 3 if _disperses(job.scene) else 1
        return PhotonTracer(aims, self._landed(stack), *self._tracer(stack, job), channels)

    def follow(self, job: FrameJob, tracer: PhotonTracer, number: int, begin: int, end: int) -> None:
        """Follow some photons of one aim, and add them to the pixels of the opaque points that they land on."""
        values = {**_aim_values(tracer.aims[number], number, job), "round_begin": begin, "round_photons": end - begin}
        for first in range(begin, end, BATCH):
            count = min(BATCH, end - first)
            self._photons.bind(**tracer.textures)
            for program in tracer.programs:
                set_used(program, {**values, "first_photon": first, "last_photon": first + count})
            if job.plan.hits == "embree":
                self._streams.follow(job, tracer.programs, tracer.landed, count)
            else:
                self._follow(tracer.programs[0], tracer.landed, count)
            first_one, other, area = neighbors(count, tracer.aims[number].light_radius > 0.0)
            apart = ENOUGH * tracer.channels / (area * max(tracer.aims[number].photons, end))
            set_used(self._splat.program(), {"beside": (first_one, other), "footprint": apart})
            self._add(job, tracer.landed, count)

    def _landed(self, stack: ExitStack) -> moderngl.Framebuffer:
        """Textures for a batch of photons where they have landed."""
        try:
            textures = [self._gl.texture((PHOTON_WIDTH, BATCH // PHOTON_WIDTH), 4, dtype="f4") for _ in _LANDED]
            framebuffer = self._gl.framebuffer(textures)
        except moderngl.Error as error:
            raise RenderError(
                "caustics", f"OpenGL does not have enough memory for the photons ({error})", "render without caustics"
            ) from error
        for resource in (framebuffer, *textures):
            stack.callback(resource.release)
        for texture in textures:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return framebuffer

    def _tracer(self, stack: ExitStack, job: FrameJob) -> tuple[Sequence[Any], dict[str, moderngl.Texture]]:
        """Programs that follow photons through the scene of a job, with its uniforms, and their textures."""
        scene = job.scene
        surfaces = [body.surface for body in scene.bodies if body.surface is not None]
        switches: dict[str, bool | int] = {
            **ray_switches(job),
            "TEXTURED": job.features.textured,
            "EMISSION": False,
            "FROM_EYE": False,
            "LIGHTS": False,
            "ROUGH": any(surface.roughness > 0 for surface in surfaces),
            "DISPERSION": _disperses(scene),
            **coat_switches(scene.bodies),
        }
        by_embree = job.plan.hits == "embree"
        programs = self._streams.programs(scene, switches) if by_embree else (self._photons.program(**switches),)
        textures, values = traced_scene(job, stack)
        assert job.plan.caustics is not None
        for program in programs:
            set_used(program, {"seed": job.plan.caustics.seed, **values})
        return programs, textures

    def _follow(self, program: moderngl.Program, landed: moderngl.Framebuffer, count: int) -> None:
        landed.scissor = 0, 0, PHOTON_WIDTH, -(-count // PHOTON_WIDTH)
        landed.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._photons.draw_fullscreen(program)
        landed.scissor = None

    def _add(self, job: FrameJob, landed: moderngl.Framebuffer, count: int) -> None:
        """Add the irradiance of a batch of photons to the pixels that show where they have landed."""
        program = self._splat.program()
        landed_on = dict(zip(_LANDED, landed.color_attachments, strict=True))
        self._splat.bind(**landed_on, opaque_axial_depth=job.targets["opaque"].color_attachments[0])
        job.targets["photons"].use()
        set_used(program, {"landed_count": count, "counted_around": job.pixel_middle})
        add_up(self._gl, moderngl.PROGRAM_POINT_SIZE)
        self._splat.draw_points(program, count)

    def draw_depth(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw the depth of opaque objects."""
        ends = job.targets.opaque_ends()
        ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
        self._opaque.draw_depth(job, objects, ends)

    def draw_base(self, job: FrameJob, objects: tuple[int, ...]) -> None:
        """Draw the diffuse reflectance of opaque objects."""
        framebuffer = job.targets["base"]
        framebuffer.use()
        framebuffer.clear(depth=1.0)
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<="
        unshadowed = shadow_switches(False, job.resources) | {"DIFFUSED": False}
        bare = unshadowed | coat_switches(())
        for i in objects[::-1]:
            body = job.scene.objects[i]
            if (surface := body.surface) is None:
                switches = dict.fromkeys(("SURFACE", "VERTEX_COLORS", "SURFACE_TEXTURES", "OCCLUSION"), 0)
                program = self._plain.program(WITH_NORMAL=1, WITH_POSITION=1, **switches, **bare)
            else:
                program = self._surfaced.program(
                    SURFACE=1, **look_switches(body), **unshadowed, **coat_switches([body])
                )
                self._surfaced.bind(**job.resources.light_textures(job.scene.environment))
                set_surface(job, program, surface, surface.alpha_cutoff)
            job.draw(program, (i,))
        self._gl.depth_func = "<"

    def shade(self, job: FrameJob, into: moderngl.Framebuffer, rounds: int = 1) -> None:
        """Add the light that opaque objects reflect of the photons that have landed, the mean of so many rounds."""
        base, normal = job.targets["base"].color_attachments
        depth = job.targets["opaque"].color_attachments[0]
        photons = job.targets["photons"].color_attachments[0]
        self._spread.bind(photon_irradiance=photons, opaque_axial_depth=depth, receiver_normal=normal)
        program = self._spread.program()
        bending = [body for body in job.scene.bodies if body.has_interface]
        rough = all(body.surface is not None and body.surface.roughness > 0 for body in bending)
        joined = 1 if job.few_opaque else len(_rounds(job.samples))
        set_uniform(program, "enough", (ENOUGH_OF_ROUGH if rough else ENOUGH) / joined)
        job.targets["photon_spread"].use()
        self._gl.enable_only(moderngl.NOTHING)
        self._spread.draw_fullscreen(program)
        self._shade.bind(photon_spread=job.targets["photon_spread"].color_attachments[0], receiver_base=base)
        shading = self._shade.program()
        set_uniform(shading, "photon_weight", 1.0 / rounds)
        into.use()
        add_up(self._gl)
        self._shade.draw_fullscreen(shading)

    def _add_known(self, job: FrameJob, light: moderngl.Texture, stride: int, phase: tuple[int, int]) -> None:
        """Add light of photons to the opaque objects that the larger picture has for these pixels."""
        program = self._known.program()
        set_uniform(program, "stride", stride)
        set_uniform(program, "phase", (phase[0], stride - 1 - phase[1]))  # stored with row 0 at the bottom
        light.use(0)
        job.targets.view("opaque", 1).use()
        add_up(self._gl)
        self._known.draw_fullscreen(program)


def _disperses(scene: Scene) -> bool:
    return any(body.surface is not None and body.surface.dispersion > 0 for body in scene.bodies)


@lru_cache(maxsize=16)
def neighbors(count: int, sized: bool) -> tuple[int, int, float]:
    """Photons of a batch that start side by side: what their numbers differ by, in two directions, and by which area.

    Starts are a lattice: any photon has these neighbors where the batch has their numbers. They are the nearest ones
    among those whose numbers differ by at most a quarter of the batch, and by multiples of 3: these carry the same
    channel of light. Of a light with a size, they begin at nearly the same point of it, too: the distance of others
    where they land would be that of images of the light, and not of what is between photons.

    Returns
    -------
    one, other : int
    area : float
        Of the parallelogram of the steps to both, as a fraction of the area in which photons start.
    """
    numbers = np.arange(3, max(count // 4, 30) + 1, 3)
    steps = (numbers[:, None] * _STEP + 0.5) % 1.0 - 0.5
    aside = np.hypot(steps[:, 0], steps[:, 1])
    length = np.hypot(aside, _ON_LIGHT * np.hypot(steps[:, 2], steps[:, 3])) if sized else aside
    one = int(length.argmin())
    areas = np.abs(steps[one, 0] * steps[:, 1] - steps[one, 1] * steps[:, 0])
    other = int(np.where(areas > 0.5 * aside[one] * aside, length, np.inf).argmin())
    return int(numbers[one]), int(numbers[other]), float(areas[other])


def _rounds(samples: int) -> range:
    """Samples of a frame that have photons."""
    return ROUNDS if samples >= ROUNDS_FROM else range(samples)


def _aim_values(aim: PhotonAim, number: int, job: FrameJob) -> dict[str, Any]:
    """Loose uniforms of photons with an aim of that number."""
    assert job.plan.caustics is not None
    entries = [*(i + 1 for i in aim.inside[:8]), *[0] * (8 - len(aim.inside[:8]))]
    shift = np.random.default_rng((job.plan.caustics.seed, number)).random(4)
    return {
        "aim": number,
        "aim_shift": tuple(shift),
        "light_from": tuple(aim.light),
        "cone": tuple(aim.cone),
        "light_radius": aim.light_radius,
        "aim_middle": tuple(aim.middle),
        "aim_right": tuple(aim.right),
        "aim_up": tuple(aim.up),
        "photon_power": tuple(aim.flux * (job.opaque_samples / aim.photons)),
        "light_interior": tuple(low | high << 16 for low, high in zip(entries[::2], entries[1::2], strict=True)),
    }


class PhotonStreams:
    """Driver of ``shaders/transport/photon_streams.comp``.

    Parameters
    ----------
    gl : moderngl.Context
    units : dict of str to int
        Texture unit of each sampler of ``shaders/transport/photon_step.glsl``.
    landed : sequence of str
        Names of the images that take where photons land; each has its place for its image unit.
    """

    def __init__(self, gl: moderngl.Context, units: Mapping[str, int], landed: Sequence[str]) -> None:
        self._gl = gl
        images = {name: unit for unit, name in enumerate(landed)}
        self._step = ComputeVariants(gl, "transport/photon_streams.comp", **units, **images)

    def programs(self, scene: Scene, switches: Mapping[str, bool | int]) -> tuple[moderngl.ComputeShader, ...]:
        """Compute shaders of a scene: for new photons, for hits of one object, and where objects may overlap."""
        alone = {**switches, "ONE_SURFACE": True}
        programs = [self._step.program(**alone, BEGINS=begins) for begins in (True, False)]
        if _shared_bounds(scene) is not None:
            programs.append(self._step.program(**switches, BEGINS=False))
        return tuple(programs)

    def follow(
        self, job: FrameJob, programs: Sequence[moderngl.ComputeShader], landed: moderngl.Framebuffer, count: int
    ) -> None:
        """Follow the first so many photons of a batch to where they land.

        Parameters
        ----------
        job : FrameJob
        programs : sequence of moderngl.ComputeShader
            Those of `programs`, with their uniforms and textures.
        landed : moderngl.Framebuffer
            With the images.
        count : int
        """
        scene, center = job.scene, media_center(job.scene)
        buffers = {name: job.resources.rays.get(name, size * count) for name, size in _BYTES.items()}
        for name, buffer in buffers.items():
            buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])
        landed.clear()
        for unit, texture in enumerate(landed.color_attachments):
            texture.bind_to_image(unit, read=False, write=True)
        caster = job.resources.ray_hits.of(scene, center)
        first = job.resources.hierarchies.of(scene, textured=job.features.textured).first_triangles
        segments, live = buffers["photon_segments"], buffers["live_photons"]
        begin, *steps = programs
        for program in programs:
            set_used(program, {"photon_room": count, "live_count": count})
        self._step.run(begin, count)
        shared = None if len(steps) == 1 else _shared_bounds(scene)
        # Until an interface has turned them, photons end at what is opaque on both sides.
        ends = np.array(
            [body.medium is None and (body.surface is None or body.surface.double_sided) for body in scene.objects]
        )
        places = np.arange(count, dtype=np.int32)
        for surface in range(MOST_PHOTON_HITS):
            origins, directions = (
                np.frombuffer(segments.read(12 * len(places), offset=12 * count * i), np.float32).reshape(-1, 3)
                for i in range(2)
            )
            if not (lives := directions.any(axis=1)).all():
                places, origins, directions = places[lives], origins[lives], directions[lives]
            if not len(places):
                break
            hits = caster.nearest(origins, directions)
            goes_on = hits.object >= 0
            if surface == 0:
                goes_on &= ~ends.take(hits.object, mode="clip")
            found = np.flatnonzero(goes_on)
            several = 0
            if shared is not None:
                found, several = _by_place(found, origins, directions, hits, shared - center)
            if not found.size:
                break
            places, objects = places.take(found), hits.object.take(found)
            for row, values in enumerate((places, objects, hits.triangle.take(found) + first.take(objects))):
                live.write(values, offset=4 * count * row)
            for program, begun, ended in zip(steps, (several, 0), (len(found), several), strict=False):
                set_used(program, {"first_live": begun, "live_count": ended})
                self._step.run(program, ended - begun)
        self._gl.memory_barrier()  # what is drawn next reads the images


def _shared_bounds(scene: Scene) -> Array | None:
    """(2, 3): bounds of the places that two objects may share; None where there are none."""
    boxes = np.array([body.bounds for body in scene.objects])
    low, high = boxes[:, 0] - _ONE_PLACE * scene.diagonal, boxes[:, 1] + _ONE_PLACE * scene.diagonal
    one, other = np.triu_indices(len(boxes), 1)
    lower, upper = np.maximum(low[one], low[other]), np.minimum(high[one], high[other])
    if not (meet := (lower < upper).all(axis=1)).any():
        return None
    return np.stack([lower[meet].min(axis=0), upper[meet].max(axis=0)])


def _by_place(
    found: npt.NDArray[np.intp], origins: Floats, directions: Floats, hits: RayHits, bounds: Array
) -> tuple[npt.NDArray[np.intp], int]:
    """Numbers of rays, those whose hits lie within bounds first, and how many these are."""
    inside, outside = found, []
    for axis in np.argsort(bounds[1] - bounds[0]).tolist():  # most are outside of the narrowest
        at = origins[inside, axis] + hits.path[inside] * directions[inside, axis]
        within = (at >= bounds[0, axis]) & (at <= bounds[1, axis])
        outside.append(inside[~within])
        inside = inside[within]
    return np.concatenate([inside, *outside]), len(inside)
