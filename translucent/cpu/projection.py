"""Projection of a mesh into a picture, in the float64 geometry of the reference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.picture import Band, Picture
from translucent.reference.hits import Hits, camera_vertices, cross_triangles, pixel_span, sorted_hits
from translucent.scene.scene import Object

_Pairs = tuple[Integers, Integers]

#: Largest ratio of sideways distance to depth of a vertex that is projected; beyond, it is too near the eye's plane.
STEEPEST = 1e6

#: Pairs of a pixel and a face that are decided at a time: the working arrays stay in the processor's cache.
PAIRS = 1 << 13


@dataclass(frozen=True, eq=False)
class ProjectedObject:
    """One object, projected into one picture."""

    body: Object
    picture: Picture

    @cached_property
    def vertices(self) -> Array:
        """(n, 3): vertices right of, above and in front of the eye, in metres."""
        return camera_vertices(self.body.mesh, self.body.matrix, self.picture.camera)

    @cached_property
    def corners(self) -> Array:
        """(m, 3, 3): `vertices` of each face."""
        return self.vertices[self.body.mesh.faces]

    @cached_property
    def weight(self) -> Array:
        """(m, 3): perspective divisors of the corners."""
        return self.corners[..., 2] if self.picture.perspective else np.ones(self.corners.shape[:2])

    @cached_property
    def beside(self) -> Mask:
        """(n,): vertices in the plane of the eye, or nearly; they have no place in the picture."""
        if not self.picture.perspective:
            return np.zeros(len(self.vertices), dtype=bool)
        return np.asarray(np.abs(self.vertices[:, :2]).max(axis=1) >= STEEPEST * np.abs(self.vertices[:, 2]))

    @cached_property
    def passing(self) -> Mask:
        """(m,): faces that pass the plane of the eye, or nearly; in the picture they are no triangles."""
        front = self.weight > 0
        return np.asarray(self.beside[self.body.mesh.faces].any(axis=1) | (front.any(axis=1) != front.all(axis=1)))

    @cached_property
    def any_passing(self) -> bool:
        """True if any faces are `passing`."""
        return bool(self.passing.any())

    @cached_property
    def projected(self) -> Array:
        """(n, 2): column and row of the vertices; meaningless for those `beside` the eye."""
        depth = self.vertices[:, 2] if self.picture.perspective else np.ones(len(self.vertices))
        weight = np.where(self.beside, 1.0, depth)
        return np.asarray(self.picture.grid.pixels(self.vertices[:, :2], weight) / weight[:, None])

    def meet(self, band: Band, pairs: Iterator[_Pairs]) -> Hits:
        """Pairs of a pixel and a face in which the ray meets the face, each once, sorted as by `line_hits`."""
        parts = []
        for pixel, face in pairs:
            points = self.picture.points(band, pixel)
            keep, *found = cross_triangles(self.corners[face], self.weight[face], points, self.picture.perspective)
            parts.append((pixel[keep], face[keep], *found))
        return sorted_hits(parts, -1 if self.body.faces_inwards else 1)

    def boxed_pairs(self, band: Band, wanted: Mask, chosen: Mask | None = None) -> Iterator[_Pairs]:
        """Candidate pairs of a `wanted` pixel (pixels,) and a face, or a `chosen` one (m,), by the faces' bounding
        boxes.
        """
        face, top, rows, left, columns = self._boxes
        pixels = np.flatnonzero(wanted)
        before = np.concatenate([[0], np.cumsum(wanted)])
        start = np.clip(top - band.first_row, 0, band.rows)
        stop = np.clip(top + rows - band.first_row, 0, band.rows)
        keep = before[start * band.width] < before[stop * band.width]
        if chosen is not None:
            keep &= chosen[face]
        box = np.flatnonzero(keep)
        part, row = expand(start[box], stop[box] - start[box])
        box = box[part]
        first = row * band.width + left[box]
        low, high = before[first], before[first + columns[box]]
        for some in slices(high - low, PAIRS):
            part, index = expand(low[some], high[some] - low[some])
            yield pixels[index], face[box[some][part]]

    @cached_property
    def _boxes(self) -> tuple[Integers, ...]:
        """Face, first row, rows, first column and columns of the pixels that faces may cover, ahead or behind."""
        parts = []
        # What is behind the eye appears in the picture as well, turned around.
        for side in (1, -1) if self.picture.perspective else (1,):
            pixels = self.picture.grid.pixels(side * self.corners[..., :2], side * self.weight)
            left, columns = pixel_span(pixels[..., 0], side * self.weight, self.picture.size[0])
            top, rows = pixel_span(pixels[..., 1], side * self.weight, self.picture.size[1])
            face = np.flatnonzero((columns > 0) & (rows > 0))
            parts.append((face, *(array[face] for array in (top, rows, left, columns))))
        return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def expand(first: Integers, count: Integers) -> tuple[Integers, Integers]:
    """Ranges first, first + 1, ... of `count` numbers each, one after the other: index of the range, and number."""
    ends = np.cumsum(count)
    part = np.repeat(np.arange(len(count)), count)
    return part, np.arange(len(part)) + np.repeat(first - (ends - count), count)


def slices(count: Integers, most: int) -> Iterator[slice]:
    """Slices of items with a sum of `count` (n,) up to `most`, or of one item."""
    ends = np.cumsum(count)
    begin = 0
    while begin < len(ends):
        before = int(ends[begin - 1]) if begin else 0
        end = max(int(np.searchsorted(ends, before + most, side="right")), begin + 1)
        yield slice(begin, end)
        begin = end
