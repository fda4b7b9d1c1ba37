"""Random paths whose hits Embree finds: each pass follows the live streams of paths by one event."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import moderngl
import numpy as np

from translucent.gpu.constants import STORAGE_BINDINGS
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import ComputeVariants, Variants
from translucent.gpu.shaders import set_used
from translucent.gpu.targets import SHADER_STORAGE, Storage
from translucent.gpu.uniforms import media_center

#: Streams of paths in a tile, at most: 170 bytes each are kept of them.
MOST_STREAMS = 1 << 17

#: Bytes of what is kept of a stream, by the names of the buffers.
_BYTES = {"path_states": 56, "ended_paths": 32, "live_paths": 16, "path_segments": 28, "next_segments": 28}


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
