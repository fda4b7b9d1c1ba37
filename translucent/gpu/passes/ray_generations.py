"""Trees of rays by generations: the CPU finds what all rays of one hit, then compute shaders let them interact.

A generation has a list of live rays, in the order of their pixels. Each leaves up to two branches at places of its own,
twice its number and one more, and the CPU lists the branches that exist. So pictures are the same each time: no result
depends on the order in which threads run. A frame is traced in portions, which bound the memory.

Once a renderer has traced many rays of a single body, rays that leave it steeply enough to hit nothing end at once;
light is then added in another order, which rounds it differently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.gpu.constants import STORAGE_BINDINGS
from translucent.gpu.embree_hits import EmbreeHits, Floats, RayHits
from translucent.gpu.hierarchies import SceneHierarchies, packed_mesh
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import ComputeVariants
from translucent.gpu.placement import Part
from translucent.gpu.shaders import set_used
from translucent.gpu.uniforms import media_center

#: Bytes of the buffers of rays, however large the frame is.
MOST_BYTES = 32 << 20

#: Places for rays to each pixel of a portion that has rays. Live rays fill no more than half of them: about two rays
#: of a pixel are alive at once, in bodies with many walls three.
PLACES, MORE_PLACES = 6, 8

#: Places at least, to each channel: the tree of one pixel has at most 1024 rays; see
#: ``shaders/transport/ray_step.glsl``.
LEAST_PLACES = 2 * 1024

#: Rays that are traced before the horizons of the triangles of a body are found, and how many more for each triangle:
#: by then, rays that hit nothing have cost as much as the shader that finds horizons takes, with its compilation.
RAYS_BEFORE_HORIZONS, FOR_EACH_TRIANGLE = 1_600_000, 160

#: Rows of the lists of live rays and what they hit; bytes of these, of light, and of the lists of pixels and of ends,
#: for each ray.
_ROWS = 8
_LIVE_BYTES = 4 * _ROWS + 16 + 8 + 4 + 16

#: What the pixel of a place without a ray is; and the bits of the others that are not the channel.
_NO_RAY, _PIXEL = np.uint32(0xFFFFFFFF), np.uint32(0x3FFFFFFF)

#: Columns and rows of pixels, in words: see `pixel_words`.
Pixels: TypeAlias = npt.NDArray[np.uint32]

#: Sums over the samples of a pixel, each with its place for its image unit.
_SUMMED = "summed_light", "summed_spread"

#: Columns and rows of a block of pixels, whose rays are computed together.
_BLOCK = 4, 2


class RayGenerations:
    """Driver of the compute shaders that follow trees of rays; see ``shaders/transport/step_rays.comp``.

    Parameters
    ----------
    gl : moderngl.Context
    samplers : sequence of str
        Names of the samplers of ``shaders/transport/ray_step.glsl``, each with its place for its texture unit.
    straight : sequence of str
        Those of ``shaders/transport/shaded_pixel.glsl``, which come after them.
    """

    def __init__(self, gl: moderngl.Context, samplers: Sequence[str], straight: Sequence[str]) -> None:
        units = {name: unit for unit, name in enumerate(samplers)}
        self._begin = ComputeVariants(gl, "transport/begin_rays.comp", **units)
        self._step = ComputeVariants(gl, "transport/step_rays.comp", **units)
        self._shade = ComputeVariants(gl, "transport/shade_ends.comp", **units)
        self._sum = ComputeVariants(gl, "transport/sum_ray_light.comp")
        self._horizons = ComputeVariants(gl, "transport/horizons.comp")
        units |= {name: unit for unit, name in enumerate(straight, len(samplers))}
        images = {name: unit for unit, name in enumerate(_SUMMED)}
        self._add = ComputeVariants(gl, "transport/add_samples.comp", **units, **images)

    def trace(
        self,
        job: FrameJob,
        part: Part,
        pixels: Pixels,
        switches: Mapping[str, bool | int],
        values: Mapping[str, Any],
    ) -> None:
        """Sum up the light of the rays of some pixels, in the buffer that ``traced_interfaces.frag`` reads.

        Parameters
        ----------
        job : FrameJob
        part : Part
            Of the frame, whose row 0 is the top one.
        pixels : (n,) uint32
            Pixels of the part, as `pixel_words` has them.
        switches, values
            Of the shaders, whose textures are bound.
        """
        if not len(pixels):
            return
        width = job.targets.size[0]
        programs = _Programs(
            self._begin.program(**switches),
            self._step.program(**switches, MISSES=False),
            self._step.program(**switches, MISSES=True),
            self._shade.program(**switches) if switches["OPAQUE"] else None,
            self._sum.program(),
        )
        hierarchies = job.resources.hierarchies.of(job.scene, textured=job.features.textured)
        room = _Room(job, pixels, switches, hierarchies.first_triangles)
        values = {**values, "has_horizons": int(self._has_horizons(job, hierarchies))}
        sizes = {"ray_vectors": room.words // 4, "end_words": room.end_words, "columns": width}
        for program in filter(None, programs):
            set_used(program, {**values, **sizes})
        hits = job.resources.ray_hits.of(job.scene, media_center(job.scene))
        light = job.targets.buffers.get("traced_light", 16 * width * part.scissor[3])
        light.bind_to_storage_buffer(STORAGE_BINDINGS["traced_light"])
        job.gl.memory_barrier()  # light that is drawn by now may not be read yet
        waiting = room.portions(len(pixels))[::-1]
        while waiting:
            portion = waiting.pop()
            parts = self._trace_portion(portion, room, hits, programs)
            if parts > 1:
                assert len(portion) > 1
                waiting += _parts(portion, parts)[::-1]
        hierarchies.traced_rays += room.traced_rays

    def _has_horizons(self, job: FrameJob, hierarchies: SceneHierarchies) -> bool:
        """Bind the horizons of the triangles of a single body; False if these are unknown, or not worth their time."""
        triangles, linear = hierarchies.surface_table // 3, job.scene.objects[0].matrix[:3, :3]
        squared = linear.T @ linear
        keeps_angles = np.allclose(squared, squared[0, 0] * np.eye(3), rtol=0.0, atol=1e-5 * squared[0, 0])
        if hierarchies.traced_rays < RAYS_BEFORE_HORIZONS + FOR_EACH_TRIANGLE * triangles:
            return False
        if len(job.scene.objects) > 1 or not keeps_angles:
            return False
        if hierarchies.horizons is None:
            hierarchies.horizons = self._found_horizons(job.gl, job.scene.objects[0].mesh)
        hierarchies.horizons.bind_to_storage_buffer(STORAGE_BINDINGS["horizons"])
        return True

    def _found_horizons(self, gl: moderngl.Context, mesh: Mesh) -> moderngl.Buffer:
        """Horizons of the triangles of a mesh, by its hierarchy; see ``shaders/transport/horizons.comp``."""
        program, packed = self._horizons.program(), packed_mesh(mesh)
        count, nodes = len(packed.faces), packed.nodes[0]
        sizes = {"node_count": len(nodes), "triangle_count": count}
        set_used(program, {**sizes, "outwards": -1.0 if mesh.diagnosis.inverted else 1.0})
        found = gl.buffer(reserve=4 * count)
        buffers = {
            "mesh_nodes": gl.buffer(nodes),
            "mesh_triangles": gl.buffer(packed.triangles),
            "horizons": found,
        }
        for name, buffer in buffers.items():
            buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])
        self._horizons.run(program, count)
        buffers["mesh_nodes"].release()
        buffers["mesh_triangles"].release()
        return found

    def add(
        self,
        job: FrameJob,
        sums: moderngl.Framebuffer,
        pixels: Pixels,
        switches: Mapping[str, bool | int],
        values: Mapping[str, Any],
    ) -> None:
        """Add a sample of the pixels whose rays were traced last to their sums; arguments as for `trace`."""
        if not len(pixels):
            return
        program = self._add.program(**switches, GENERATIONS=True)
        set_used(program, {**values, "pixel_count": len(pixels)})
        listed = job.resources.rays.get("first_pixels", pixels.nbytes)
        listed.bind_to_storage_buffer(STORAGE_BINDINGS["first_pixels"])
        for unit, texture in enumerate(sums.color_attachments):
            texture.bind_to_image(unit, read=True, write=True)
        job.gl.memory_barrier()
        self._add.run(program, len(pixels))
        job.gl.memory_barrier()  # what is drawn next reads the sums

    def _trace_portion(self, portion: range, room: _Room, hits: EmbreeHits, programs: _Programs) -> int:
        """Trace the rays of some of the pixels; returns into how many parts to divide these, 1 if that is done."""
        begin, step, leave, shade, sum_up = programs
        set_used(begin, {"first_number": portion.start, "pixel_count": len(portion)})
        room.bind_begin()
        self._begin.run(begin, len(portion))
        live = room.turn(len(portion) * room.channels)
        if (parts := -(-PLACES * len(live.places) // room.places)) > 1:
            return parts
        while count := len(live.places):
            if count > room.live:
                return 2
            room.traced_rays += count
            found, pixels = room.put(live, hits.nearest(live.origins, live.directions))
            set_used(step, {"live_count": found, "live_rows": count})
            set_used(leave, {"first_number": found, "live_count": count, "live_rows": count})
            set_used(sum_up, {"pixel_count": pixels})
            room.bind()
            self._step.run(step, found)
            self._step.run(leave, count - found)
            if shade is not None:
                ended = room.put_ended(found)
                set_used(shade, {"ended_count": ended})
                self._shade.run(shade, ended)
            room.bind_sums()
            self._sum.run(sum_up, pixels)
            live = room.turn(2 * found)
        return 1


class _Programs(NamedTuple):
    """Compute shaders of a frame, in the order in which they run; `shade` where there are opaque objects."""

    begin: moderngl.ComputeShader
    step: moderngl.ComputeShader
    leave: moderngl.ComputeShader
    shade: moderngl.ComputeShader | None
    sum_up: moderngl.ComputeShader


class _Live(NamedTuple):
    """Live rays of a generation: their places, pixels, origins and directions."""

    places: npt.NDArray[np.intp]
    pixels: npt.NDArray[np.uint32]
    origins: Floats
    directions: Floats


class _Room:
    """Buffers of the rays of two generations, and of what rays of one hit and of their light."""

    def __init__(
        self,
        job: FrameJob,
        pixels: Pixels,
        switches: Mapping[str, bool | int],
        first_triangles: npt.NDArray[np.int32],
    ) -> None:
        self.channels = 3 if switches["DISPERSION"] else 1
        self.words = _words(switches)
        # Words of the record of an end in shaders/transport/stored_ends.glsl.
        self.end_words = (
            16 + bool(switches["MICROFACETS"]) + 4 * bool(switches["TEXTURED"]) + 5 * bool(switches["AHEAD"])
        )
        branch = 4 * (self.words + 9)
        most = MOST_BYTES // (2 * branch + (_LIVE_BYTES + 8 * self.end_words) // 2)
        self.places = min(self.channels * max(MORE_PLACES * len(pixels), LEAST_PLACES), most)
        self.live = self.places // 2
        storage = job.resources.rays
        self._rays, self._branches = (
            tuple(
                storage.get(f"{name} {side}", size * self.places)
                for name, size in (("records", 4 * self.words), ("segments", 32), ("pixels", 4))
            )
            for side in range(2)
        )
        self._live, self._light, self._sums, self._ends, self._end_counts, self._ended = (
            storage.get(name, size * (self.live + 1))
            for name, size in (
                ("live", 4 * _ROWS),
                ("light", 16),
                ("sums", 8),
                ("ends", 8 * self.end_words),
                ("end_counts", 4),
                ("ended", 16),
            )
        )
        self._pixels = storage.get("first_pixels", pixels.nbytes)
        self._pixels.write(pixels)
        self._numbers = np.zeros(0, np.int32), np.zeros(0, np.int32)
        self._first_triangles = first_triangles
        self.traced_rays = 0

    def portions(self, count: int) -> list[range]:
        """Numbers of so many pixels in portions, each with rays that there is room for at first.

        Most pixels may have no interface, and so no ray.
        """
        most = max(self.places // self.channels, 1)
        return [range(begin, min(begin + most, count)) for begin in range(0, count, most)]

    def bind_begin(self) -> None:
        """Bind the buffers of the first rays."""
        self.bind_branches()
        self._pixels.bind_to_storage_buffer(STORAGE_BINDINGS["first_pixels"])

    def bind_branches(self) -> None:
        """Bind the buffers that rays are written to."""
        for name, buffer in zip(("branches", "branch_segments", "branch_pixels"), self._branches, strict=True):
            buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])

    def bind(self) -> None:
        """Bind the buffers of a step."""
        self.bind_branches()
        read = {
            "rays": self._rays[0],
            "ray_segments": self._rays[1],
            "live_rays": self._live,
            "ray_light": self._light,
            "ray_ends": self._ends,
            "end_counts": self._end_counts,
        }
        for name, buffer in read.items():
            buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])

    def put_ended(self, found: int) -> int:
        """List the first rays with a hit that end on opaque objects; returns their number."""
        counts = np.frombuffer(self._end_counts.read(4 * max(found, 1)), np.uint32)[:found]
        at = np.flatnonzero(counts)
        order, words = self._numbers
        numbers = order.take(at)
        channels = words.take(numbers).view(np.uint32) >> np.uint32(30)
        self._ended.write(np.stack([2 * at, counts.take(at), numbers, channels], axis=1).astype(np.uint32))
        self._ended.bind_to_storage_buffer(STORAGE_BINDINGS["ended_rays"])
        return len(at)

    def bind_sums(self) -> None:
        """Bind the lists of the rays of pixels."""
        self._sums.bind_to_storage_buffer(STORAGE_BINDINGS["pixel_rays"])

    def turn(self, places: int) -> _Live:
        """Make rays of the branches in the first so many places; returns the live ones."""
        self._rays, self._branches = self._branches, self._rays
        _, segments, pixels = self._rays
        # OpenGL reads no 0 bytes.
        words = np.frombuffer(pixels.read(4 * max(places, 1)), np.uint32)[:places]
        found = np.flatnonzero(words != _NO_RAY)
        ends = np.frombuffer(segments.read(32 * max(places, 1)), np.float32).reshape(-1, 8).take(found, axis=0)
        return _Live(found, words.take(found), ends[:, :3], ends[:, 4:7])

    def put(self, live: _Live, hits: RayHits) -> tuple[int, int]:
        """Write what rays hit, their numbers in an order with hits first, and the lists of the rays of pixels.

        Returns
        -------
        found : int
            Number of the rays that hit anything.
        pixels : int
            Number of the pixels.
        """
        exists = hits.object >= 0
        found = np.flatnonzero(exists)
        rows = np.empty((_ROWS, len(exists)), np.int32)
        rows[0, : len(found)], rows[0, len(found) :] = found, np.flatnonzero(~exists)
        rows[1], rows[2], rows[3] = live.places, live.pixels.view(np.int32), hits.path.view(np.int32)
        rows[4], rows[6:] = hits.object, hits.weights.view(np.int32)
        np.add(hits.triangle, self._first_triangles.take(hits.object, mode="clip"), out=rows[5])
        self._live.write(rows)
        self._numbers = rows[0], rows[2]
        pixels = live.pixels & _PIXEL
        changes = np.flatnonzero(pixels[1:] != pixels[:-1]) + 1
        sums = np.empty((len(changes) + 2, 2), np.uint32)
        sums[0, 0], sums[1:-1, 0], sums[-1, 0] = 0, changes, len(pixels)
        sums[:, 1] = pixels.take(sums[:, 0], mode="clip")
        self._sums.write(sums)
        return len(found), len(changes) + 1


def _words(switches: Mapping[str, bool | int]) -> int:
    """Words of the record of a ray in ``shaders/transport/stored_rays.glsl``, in whole vectors."""
    interior = 1 if switches["ONE_OBJECT"] else 4
    outwards = 3 if switches["LAYERED"] or switches["DIFFUSED"] else 0
    words = 3 + interior + 2 * switches["MICROFACETS"] + outwards + 5 * switches["AHEAD"] + 12 * switches["FOOTPRINTS"]
    return -(-words // 4) * 4


def pixel_words(requested: npt.NDArray[np.bool_], left: int = 0, top: int = 0) -> Pixels:
    """Words for the requested pixels, row 0 the top one: those of a block of 4 x 2 pixels follow each other.

    Parameters
    ----------
    requested : (h, w) bool
    left, top : int
        Column and row of the first pixel in the frame.

    Returns
    -------
    (n,) uint32
        Column, and row times 2^15.
    """
    height, width = requested.shape
    columns, rows = _BLOCK
    blocks = np.zeros((-(-height // rows), rows, -(-width // columns), columns), bool)
    np.copyto(blocks.reshape(blocks.shape[0] * rows, -1)[:height, :width], requested)
    down, across, below, beside = np.nonzero(blocks.transpose(0, 2, 1, 3))
    x, y = left + columns * across + beside, top + rows * down + below
    return (x | y << 15).astype(np.uint32)


@lru_cache(maxsize=4)
def all_words(part: Part) -> Pixels:
    """Words of all pixels of a part of a frame, whose row 0 is the top one."""
    left, top, width, height = part.scissor
    return pixel_words(np.ones((height, width), bool), left, top)


def _parts(portion: range, count: int) -> list[range]:
    """So many parts of a range of pixels, one pixel each at least."""
    step = -(-len(portion) // count)
    return [portion[begin : begin + step] for begin in range(0, len(portion), step)]
