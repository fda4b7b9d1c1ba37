"""Photons whose hits Embree finds: each pass follows the live ones to their next surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.gpu.constants import MOST_PHOTON_HITS, STORAGE_BINDINGS
from translucent.gpu.embree_hits import Floats, RayHits
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.variants import ComputeVariants
from translucent.gpu.shaders import set_used
from translucent.gpu.uniforms import media_center
from translucent.scene.scene import Scene

#: Bytes that are kept of a photon, by the names of the buffers.
_BYTES = {"photons": 72, "live_photons": 12, "photon_segments": 24}

#: Largest distance of surfaces that a ray hits in one place, as a fraction of the scene, with room for rounding; see
#: ``path_within`` of ``shaders/transport/surface_hit.glsl``.
_ONE_PLACE = 2e-4


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
        """The compute shaders of a scene with these switches: they begin, go on where one surface lies, and where
        several may, if there is such a place.
        """
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
