"""Absorption and emission of media along the segments of a ray tree, and of sheets that bend nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from translucent.arrays import Array, Integers
from translucent.cpu.media_record import NOTHING, Record, RecordedMedia
from translucent.formulas import optics
from translucent.reference.compositing import composite
from translucent.reference.emission import emission_of_mixtures
from translucent.reference.hits import Hits
from translucent.reference.interfaces import Optics
from translucent.reference.intervals import Intervals
from translucent.reference.rays import Rays
from translucent.reference.sheets import scene_crossings
from translucent.reference.surface_light import SurfaceLight
from translucent.reference.volume import Volume, volume_segments
from translucent.scene.scene import Scene


class LegMedia:
    """Media of a scene, as segments of rays cross them.

    Parameters
    ----------
    scene : Scene
    own : Optics
    media : RecordedMedia
    light : SurfaceLight
        On layers.
    """

    def __init__(self, scene: Scene, own: Optics, media: RecordedMedia, light: SurfaceLight) -> None:
        self.scene, self.media, self.light, self.volume = scene, media, light, Volume(scene)
        #: Sheets without an interface.
        self.films = tuple(None if i in own.walls else metres for i, metres in enumerate(own.sheets))

    def along(self, rays: Rays, record: Record, length: Array) -> tuple[Array | None, Array]:
        """Emitted radiance, None if there is none, and transmittance (k, 3) over `length` metres (k,) of rays."""
        if self.scene.varies:
            return self._varied(rays, record, length)
        extinction, emission = self.media.coefficients(record)
        with np.errstate(over="ignore", under="ignore"):
            passed = np.exp(-extinction * length[:, None])
            if not self.media.emits:
                return None, passed
            return optics.emitted_radiance(emission, extinction, length[:, None]), passed

    def _varied(self, rays: Rays, record: Record, length: Array) -> tuple[Array, Array]:
        """The same where densities vary."""
        ray, entry = np.nonzero(record != NOTHING)
        # One interval for each entry, however often a body winds around the segment.
        intervals = Intervals(
            ray, np.zeros(len(ray)), length[ray], record[ray, entry].astype(np.int64), np.ones(len(ray), dtype=np.int64)
        )
        return self._composited(rays, intervals, [_no_hits()] * len(self.films), (None,) * len(self.films))

    def through_films(self, rays: Rays, item: Integers, seen: Hits) -> tuple[Array, Array]:
        """Emitted radiance and transmittance (k, 3) of sheets, item (k,), at the origins of rays; a hit on each."""
        hits = [_no_hits()] * len(self.films)
        for i in np.unique(item):
            hits[i] = seen.where(item == i)
        none = np.empty(0, np.int64)
        return self._composited(rays, Intervals(none, np.empty(0), np.empty(0), none, none), hits, self.films)

    def _composited(
        self, rays: Rays, intervals: Intervals, hits: Sequence[Hits], sheets: Sequence[float | None]
    ) -> tuple[Array, Array]:
        end = np.full(len(rays), np.inf)
        crossings = scene_crossings(self.scene, rays, hits, sheets, end, self.light.on_interfaces)
        segments, filling = volume_segments(self.scene, self.volume, rays, intervals, crossings)
        emitted, depth = composite(emission_of_mixtures(self.volume, rays, segments, filling), len(rays))
        return emitted, optics.transmittance(depth)


def _no_hits() -> Hits:
    none = np.empty(0, np.int64)
    return Hits(none, np.empty(0), np.empty(0, np.int8), none, np.empty((0, 3)))
