"""Random paths of light on the GPU: followed some events at a time, tile by tile.

Their state is kept in textures where shaders find what rays hit, and in buffers where Embree does: then each pass
follows the live streams of paths by one event.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import moderngl
import numpy as np

from translucent.errors import RenderError
from translucent.gpu.constants import STORAGE_BINDINGS
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import interface_shadow_switches
from translucent.gpu.passes.traced_interfaces import RAY_SAMPLERS, ray_switches, traced_scene
from translucent.gpu.passes.variants import ComputeVariants, Variants, background_switches, coat_switches
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.targets import SHADER_STORAGE, Storage, add_up
from translucent.gpu.uniforms import media_center
from translucent.planning.methods.path_traced import has_bases, takes_picture
from translucent.planning.passes import PassSpec
from translucent.scene.lights import PositionalLight

_STATE = ("path_origin", "path_direction", "path_light", "path_interior", "path_counts", "path_mean", "path_spread")
_COUNTS = _STATE.index("path_counts")
_UNSIGNED = ("path_interior", "path_counts")
_SAMPLERS = (
    *_STATE,
    *RAY_SAMPLERS,
    "light_map",
    "opaque_axial_depth",
    "opaque_radiance",
    "light_irradiance",
    "light_levels",
    "reflectance_table",
    "seen_map",
    "shadow_sums",
    "shadow_ends",
)

#: Pixels along a side of a tile: 220 bytes each are kept of it.
TILE = 512

#: Largest number of events of a path in one pass: some drivers cut loops short after too many iterations.
MOST_EVENTS = 64

#: Axial depth before the objects at which paths begin.
EYE_MARGIN = 1e-3

#: Seconds that a pass over a tile may take, by which the number of events is chosen; no driver stops that.
PASS_SECONDS = 0.1

#: Streams of paths in a tile, at most: 170 bytes each are kept of them.
MOST_STREAMS = 1 << 17

#: Bytes of what is kept of a stream, by the names of the buffers.
_BYTES = {"path_states": 56, "ended_paths": 32, "live_paths": 16, "path_segments": 28, "next_segments": 28}


@dataclass(frozen=True)
class Progress:
    """State of paths that are being followed.

    Attributes
    ----------
    fraction : float
        Of the work that is done, 0 to 1; within a tile it is updated now and then.
    done : bool
    """

    fraction: float
    done: bool


class PathTracer:
    """Tracer of random paths; see ``shaders/transport/path_trace.frag``.

    Parameters
    ----------
    gl : moderngl.Context
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        vertex = "geometry/fullscreen.vert"
        self._begin = Variants(gl, vertex, "transport/path_begin.frag", "known_mean", "known_spread")
        self._trace = Variants(gl, vertex, "transport/path_trace.frag", *_SAMPLERS)
        self._end = Variants(gl, vertex, "transport/path_end.frag", "path_mean", "path_spread")
        self._streams = PathStreams(gl, {name: self._trace.units[name] for name in _SAMPLERS if name not in _STATE})
        self._picture = Variants(gl, vertex, "transport/path_picture.frag", "path_mean", "straight_transmittance")
        self._unfinished = gl.query(samples=True)
        self._events = 4
        self._rest = gl.framebuffer([gl.texture((1, 1), 1)])

    def steps(
        self, job: FrameJob, last: int, *, spread: bool, seconds: float = PASS_SECONDS, tile: int = TILE
    ) -> Generator[Progress, None, None]:
        """Follow paths of each pixel of a job from `job.paths_traced` on to before the `last`, a pass at a time.

        Between two passes anything else may be drawn, as long as the job stays. `Targets.paths` has what is known of
        tiles that are done.

        Parameters
        ----------
        job : FrameJob
        last : int
        spread : bool
            They start all over their pixels, rather than at the sample point of the job.
        seconds : float
            That a pass may take.
        tile : int
            Pixels along a side of a tile.
        """
        require_interfaces(job.gl.info)
        width, height = job.targets.size
        corners = [(x, y) for y in range(0, height, tile) for x in range(0, width, tile)]
        with ExitStack() as stack:
            by_embree = job.plan.hits == "embree"
            states = [] if by_embree else [self._state(stack, job, tile) for _ in range(2)]
            storage = Storage(self._gl, "random paths")
            stack.callback(storage.release)
            textures, values = traced_scene(job, stack)
            assert job.plan.paths is not None
            values |= {"seed": job.plan.paths.seed, "spread": spread, "path_start": _path_start(job)}
            for number, corner in enumerate(corners):
                size = min(tile, width - corner[0]), min(tile, height - corner[1])
                if by_embree:
                    bind = partial(self._bind, job, textures)
                    parts = self._streams.follow(job, storage, bind, _switches(job), values, corner, size, last)
                else:
                    parts = self._tile(job, states, (textures, values), corner, size, last, seconds)
                for part in parts:
                    yield Progress((number + part) / len(corners), False)
            job.paths_traced = last
        yield Progress(1.0, True)

    def show(self, job: FrameJob) -> None:
        """Write the picture so far, or add the transmittance of a sample where several are being summed up."""
        sums = job.averaging
        framebuffer = job.targets["average"] if sums else job.targets["surfaced"]
        mean, through = job.targets["paths"].color_attachments[0], job.targets["result"].color_attachments[1]
        self._picture.bind(path_mean=mean, straight_transmittance=through)
        program = self._picture.program()
        if sums:
            add_up(self._gl)
        else:
            self._gl.enable_only(moderngl.NOTHING)
        framebuffer.use()
        self._picture.draw_fullscreen(program)

    def _tile(
        self,
        job: FrameJob,
        states: list[moderngl.Framebuffer],
        scene: tuple[dict[str, moderngl.Texture], dict[str, Any]],
        corner: tuple[int, int],
        size: tuple[int, int],
        last: int,
        seconds: float,
    ) -> Iterator[float]:
        """Follow the paths of a tile to their ends; yields the fraction that is done, after each pass."""
        begun = job.paths_traced
        self._start(job, states[1], corner, size)
        looked, fraction, number = time.perf_counter(), 0.0, 0
        program = self._trace.program(**_switches(job), GIVEN_HITS=False)
        while True:
            number += 1
            clock = time.perf_counter()
            into, source = states[(number + 1) % 2], states[number % 2]
            values = {"tile_origin": corner, "last_path": last, "events": self._events, "pass_number": float(number)}
            self._bind(job, scene[0])
            self._trace.bind(**dict(zip(_STATE, source.color_attachments, strict=True)))
            set_used(program, {**scene[1], **values})
            self._aim(into, size)
            with self._unfinished:
                self._trace.draw_fullscreen(program)
            into.scissor = None
            left = self._unfinished.samples
            taken = time.perf_counter() - clock
            self._events = int(np.clip(self._events * np.clip(seconds / max(taken, 1e-6), 0.25, 2.0), 1, MOST_EVENTS))
            if not left:
                break
            if time.perf_counter() - looked > 0.5:
                looked = time.perf_counter()
                fraction = self._ended(into, size, begun, last)
            yield fraction
        self._end_tile(job, source, corner, size)

    def _start(
        self, job: FrameJob, state: moderngl.Framebuffer, corner: tuple[int, int], size: tuple[int, int]
    ) -> None:
        mean, spread = job.targets["paths"].color_attachments
        self._begin.bind(known_mean=mean, known_spread=spread)
        program = self._begin.program()
        set_used(program, {"tile_origin": corner, "first_path": job.paths_traced})
        self._aim(state, size)
        self._begin.draw_fullscreen(program)
        state.scissor = None

    def _end_tile(
        self, job: FrameJob, state: moderngl.Framebuffer, corner: tuple[int, int], size: tuple[int, int]
    ) -> None:
        into = job.targets["paths"]
        mean, spread = state.color_attachments[-2:]
        self._end.bind(path_mean=mean, path_spread=spread)
        program = self._end.program()
        set_uniform(program, "tile_origin", corner)
        into.scissor = *corner, *size
        into.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._end.draw_fullscreen(program)
        into.scissor = None

    def _aim(self, framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> None:
        framebuffer.scissor = 0, 0, *size
        framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)

    def _ended(self, state: moderngl.Framebuffer, size: tuple[int, int], begun: int, last: int) -> float:
        """Fraction of the paths of a tile that have ended."""
        data = state.read((0, 0, *size), components=1, attachment=_COUNTS, alignment=1, dtype="u4")
        ended = float(np.frombuffer(data, np.uint32).mean(dtype=np.float64))
        return (ended - begun) / max(last - begun, 1)

    def _state(self, stack: ExitStack, job: FrameJob, tile: int) -> moderngl.Framebuffer:
        width, height = job.targets.size
        size = min(tile, width), min(tile, height)
        try:
            textures = [self._gl.texture(size, 4, dtype="u4" if name in _UNSIGNED else "f4") for name in _STATE]
            framebuffer = self._gl.framebuffer(textures)
        except moderngl.Error as error:
            found = f"OpenGL does not have enough memory for the paths ({error})"
            raise RenderError(f"path tracing {width}x{height}", found, "choose a smaller picture") from error
        for resource in (framebuffer, *textures):
            stack.callback(resource.release)
        stack.callback(self._rest.use)  # a released framebuffer must not be the bound one
        for texture in textures:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return framebuffer

    def _bind(self, job: FrameJob, traced: dict[str, moderngl.Texture]) -> None:
        environment, resources = job.scene.environment, job.resources
        textures = {
            **traced,
            **resources.light_textures(environment),
            **resources.background_textures(environment),
        }
        if _pictured(job):
            textures["opaque_axial_depth"], textures["opaque_radiance"] = job.targets["opaque"].color_attachments
        self._trace.bind(**textures)
        resources.shadows.use(self._trace.units)


def _pictured(job: FrameJob) -> bool:
    """True if the picture of opaque objects is seen by paths that hit them first."""
    return job.features.has_opaque and takes_picture(job.scene, textured=job.features.textured)


def _path_start(job: FrameJob) -> float:
    """Axial depth before all objects, and not behind the eye."""
    media, opaque = job.placed.media, job.placed.opaque
    nearest = media.near if opaque is None else min(media.near, opaque.near)
    return max((nearest - media.near) / media.length - EYE_MARGIN, -media.near / media.length)


def _switches(job: FrameJob) -> dict[str, bool | int]:
    """Switches of ``shaders/transport/path_step.glsl``."""
    scene, environment, pictured = job.scene, job.scene.environment, _pictured(job)
    media = [body.medium for body in scene.bodies if body.medium is not None]
    bases = has_bases(scene)
    return {
        "FROM_EYE": job.placed.starts_inside,
        **ray_switches(job),
        "TEXTURED": job.features.textured,
        "SCATTER": any(medium.scatters for medium in media),
        "EMISSION": any(medium.emits for medium in media),
        "LIGHTS": bool(scene.lights),
        "SPHERES": any(light.disc[3] > 0.0 for light in scene.lights if isinstance(light, PositionalLight)),
        "BASES": bases,
        "ROUGH": any(body.surface is not None and body.surface.roughness > 0 for body in scene.bodies),
        "DISPERSION": False,
        "DIFFUSED": False,
        "OPAQUE": pictured,
        "PICTURED": pictured,
        **interface_shadow_switches(job),
        "DIMMED": bases and job.features.dims_interfaces,
        **background_switches(environment),
        **coat_switches(scene.objects),
    }


class PathTracePass:
    """Paths of each pixel, spread over the samples of a frame; see ``shaders/transport/path_trace.frag``.

    Attributes
    ----------
    tracer : PathTracer
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self.tracer = PathTracer(gl)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Trace the paths of this sample, or of all samples at once if no other pass depends on it.

        The picture of opaque objects that paths do not see whole is drawn for each sample.
        """
        assert job.plan.paths is not None
        paths, pictured = job.plan.paths.paths, _pictured(job)
        if pictured:
            begun, last = (paths * (job.sample + i) // job.samples for i in range(2))
        else:
            begun, last = 0, 0 if job.sample < job.samples - 1 else paths
        if last > job.paths_traced:
            for progress in self.tracer.steps(job, last, spread=job.samples > 1 and not pictured):
                job.report((begun + progress.fraction * (last - begun)) / paths)
        self.tracer.show(job)


class PathStreams:
    """Driver of ``shaders/transport/path_streams.comp``.

    Each stream follows every so-many-th path of a pixel. So the same paths are followed as in one pass after the other,
    and no result depends on the order in which invocations run.

    Parameters
    ----------
    gl : moderngl.Context
    units : dict of str to int
        Texture unit of each sampler of ``shaders/transport/path_step.glsl``.
    """

    def __init__(self, gl: moderngl.Context, units: Mapping[str, int]) -> None:
        self._gl = gl
        self._known = {name: max(units.values()) + 1 + i for i, name in enumerate(("known_mean", "known_spread"))}
        self._step = ComputeVariants(gl, "transport/path_streams.comp", **units, **self._known)
        self._sums = Variants(gl, "geometry/fullscreen.vert", "transport/path_sums.frag", version=SHADER_STORAGE)

    def follow(
        self,
        job: FrameJob,
        storage: Storage,
        bind: Callable[[], None],
        switches: Mapping[str, bool | int],
        values: Mapping[str, Any],
        corner: tuple[int, int],
        size: tuple[int, int],
        last: int,
    ) -> Iterator[float]:
        """Follow the paths of a tile to their ends; yields the fraction that is done, after each event.

        Parameters
        ----------
        job : FrameJob
            Its `paths_traced` have been followed before.
        storage : Storage
            Nobody else's, while paths are followed.
        bind : callable
            Binds the textures of the shader.
        switches, values
            Of the shader.
        corner, size : (int, int)
            Column and row, width and height of the tile.
        last : int
            Path of each pixel before which they end.
        """
        each = max(min(last - job.paths_traced, MOST_STREAMS // (size[0] * size[1])), 1)
        room = size[0] * size[1] * each
        buffers = {name: storage.get(name.replace("_", " "), size * room) for name, size in _BYTES.items()}
        first = job.paths_traced
        tile = {"tile_origin": corner, "tile_size": size, "streams": each, "first_path": first, "last_path": last}
        program = self._step.program(**switches, GIVEN_HITS=True)
        caster = job.resources.ray_hits.of(job.scene, media_center(job.scene))
        hierarchies = job.resources.hierarchies.of(job.scene, textured=job.features.textured)
        count, streams, begins = room, np.arange(room, dtype=np.int32), 1
        while True:
            # Anything else may have been drawn since, other paths among it.
            bind()
            for unit, texture in zip(self._known.values(), job.targets["paths"].color_attachments, strict=True):
                texture.use(unit)
            for name, buffer in buffers.items():
                buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])
            set_used(program, {**values, **tile, "live_room": room, "begins": begins, "live_count": count})
            self._step.run(program, count)
            begins = 0
            buffers["path_segments"], buffers["next_segments"] = buffers["next_segments"], buffers["path_segments"]
            segments = buffers["path_segments"]
            left = np.frombuffer(segments.read(4 * count, offset=24 * room), np.float32)
            found = np.flatnonzero(left)
            if not found.size:
                break
            yield 1.0 - float(left.sum()) / (room * -(-(last - first) // each))
            ends = [
                np.frombuffer(segments.read(12 * count, offset=12 * room * i), np.float32).reshape(-1, 3)
                for i in range(2)
            ]
            if len(found) < count:
                streams, (origins, directions) = streams.take(found), (part.take(found, axis=0) for part in ends)
            else:
                origins, directions = ends
            hits = caster.nearest(origins, directions)
            triangles = hits.triangle + hierarchies.first_triangles.take(hits.object, mode="clip")
            for number, row in enumerate((streams, found.astype(np.int32), hits.object, triangles)):
                buffers["live_paths"].write(row, offset=4 * room * number)
            count = len(found)
        buffers["ended_paths"].bind_to_storage_buffer(STORAGE_BINDINGS["ended_paths"])
        self._sum_up(job, tile)

    def _sum_up(self, job: FrameJob, tile: Mapping[str, Any]) -> None:
        """Write the statistics of a tile's paths."""
        into = job.targets["paths"]
        program = self._sums.program()
        set_used(program, tile)
        into.scissor = *tile["tile_origin"], *tile["tile_size"]
        into.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._sums.draw_fullscreen(program)
        into.scissor = None
