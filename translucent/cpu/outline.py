"""Number of surfaces on each pixel's ray, from the outline of a mesh alone.

In the picture every face is a triangle, and the number of faces over a pixel is the sum of their winding numbers around
it, those of faces that appear counter-clockwise counted negatively. Along an edge between two faces that both appear
clockwise, or neither, the terms cancel; what remains is the outline. So this number is known before any ray is cast,
and a ray that has found as many surfaces has found all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.picture import Band
from translucent.cpu.projection import ProjectedObject, expand, slices
from translucent.geometry.mesh import Mesh

#: Generous bound of the relative rounding of positions in the picture: doubt costs time, and errors lose surfaces.
ROUNDING = 1e-11

#: Pairs of an edge and a row that are handled at a time: the working arrays stay below 10 MB.
CROSSINGS = 1 << 16


@dataclass(frozen=True, eq=False)
class Edges:
    """Unique edges of a mesh.

    Attributes
    ----------
    ends : (e, 2) int64
        Vertices, the lower number first.
    edge : (m, 3) int64
        Number of the edge that follows each corner of a face.
    turn : (m, 3) int8
        1 where the face runs along it from the first vertex to the second, -1 where against it.
    """

    ends: Integers
    edge: Integers
    turn: npt.NDArray[np.int8]

    @classmethod
    def of(cls, mesh: Mesh) -> Edges:
        """The edges of a mesh."""
        start = mesh.faces.astype(np.int64)
        end = np.roll(start, -1, axis=1)
        key = np.minimum(start, end) * len(mesh.vertices) + np.maximum(start, end)
        keys, edge = np.unique(key, return_inverse=True)
        ends = np.stack(np.divmod(keys, len(mesh.vertices)), axis=1)
        return cls(ends, edge.reshape(-1, 3), np.where(start < end, 1, -1).astype(np.int8))


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of a mesh: edges across which the number of faces changes.

    Attributes
    ----------
    start, end : (e, 2) float64
        Column and row; `start` is the upper one.
    change : (e,) float64
        How many faces more there are to the right of the edge than to the left.
    """

    start: Array
    end: Array
    change: Array

    @classmethod
    def of(cls, seen: ProjectedObject, edges: Edges) -> Outline:
        """Outline of the object in the picture, without the faces that pass the eye."""
        a, b, c = seen.projected[seen.body.mesh.faces].transpose(1, 2, 0)
        with np.errstate(under="ignore"):
            clockwise = np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).astype(np.int8)
        clockwise[seen.passing] = 0
        net = np.bincount(edges.edge.ravel(), (clockwise[:, None] * edges.turn).ravel(), len(edges.ends))
        chosen = np.flatnonzero(net)
        first, second = seen.projected[edges.ends[chosen]].transpose(1, 0, 2)
        # Rows count downwards: a face that appears clockwise lies to the right of its sides that go up.
        upwards = second[:, 1] < first[:, 1]
        start, end = np.where(upwards[:, None], (second, first), (first, second))
        return cls(start, end, np.where(upwards, net[chosen], -net[chosen]))

    def counts(self, band: Band) -> tuple[Integers, Mask]:
        """(pixels,), (pixels,): number of faces over each pixel, and mask of pixels next to the outline, where it is in
        doubt.
        """
        tolerance = ROUNDING * (band.width + np.abs(self.start).max(axis=1) + np.abs(self.end).max(axis=1))
        past = band.first_row + band.rows
        first = np.ceil(np.clip(self.start[:, 1] - tolerance, band.first_row, past)).astype(np.int64)
        last = np.floor(np.clip(self.end[:, 1] + tolerance, band.first_row - 1, past - 1)).astype(np.int64)
        rows = np.maximum(last - first + 1, 0)
        # A column more, for what changes to the right of the picture.
        change = np.zeros((2, band.rows * (band.width + 1)))
        for some in slices(rows, CROSSINGS):
            edge, row = expand(first[some], rows[some])
            self._add_changes(change, band, edge + some.start, row, tolerance[some][edge])
        number, doubt = np.cumsum(change.reshape(2, band.rows, band.width + 1), axis=2)[..., :-1].reshape(2, -1)
        return number.astype(np.int64), doubt > 0

    def _add_changes(self, change: Array, band: Band, edge: Integers, row: Integers, tolerance: Array) -> None:
        """Add what changes at each column from that to the left of it, where edges (k,) cross rows (k,)."""
        line = (row - band.first_row) * (band.width + 1)
        size = change.shape[1]
        crossed = (self.start[edge, 1] <= row) & (row < self.end[edge, 1])
        column = np.ceil(np.clip(self._column(edge, row), 0, band.width)).astype(np.int64)
        change[0] += np.bincount((line + column)[crossed], self.change[edge[crossed]], size)
        level = self.start[edge, 1] == self.end[edge, 1]
        near = self._column(edge, row - tolerance), self._column(edge, row + tolerance)
        left, right = np.sort([near[0], np.where(level, self.end[edge, 0], near[1])], axis=0)
        first = np.ceil(np.clip(left - tolerance, 0, band.width)).astype(np.int64)
        past = np.floor(np.clip(right + tolerance, -1, band.width - 1)).astype(np.int64) + 1
        some = first < past
        change[1] += np.bincount((line + first)[some], minlength=size)
        change[1] -= np.bincount((line + past)[some], minlength=size)

    def _column(self, edge: Integers, row: Array | Integers) -> Array:
        """(k,): where edges are at rows (k,), or at the end that is nearest to there."""
        start, end = self.start[edge], self.end[edge]
        height = end[:, 1] - start[:, 1]
        share = (np.clip(row, start[:, 1], end[:, 1]) - start[:, 1]) / np.where(height > 0, height, 1.0)
        return np.asarray(start[:, 0] + share * (end[:, 0] - start[:, 0]))
