"""Bounding volume hierarchy of triangles, and candidate triangles of lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers

#: Number of children of a node.
BRANCHES = 8

#: Number of lines that walk down the tree together: the working arrays stay below 100 MB.
LINES = 1 << 12

#: Pairs of a line and a node that are tested together: what NumPy keeps of them stays in the caches of a processor.
PAIRS = 1 << 10

#: Enlargement of boxes as a share of the distances, so that rounding loses no triangle.
MARGIN = 1e-13

#: Half size of an empty box, which no line meets.
_NOTHING = -1e300


@dataclass(frozen=True, eq=False)
class Lines:
    """Line segments, each from one distance to another.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In metres, and of unit length.
    start, end : (n,) float64
        Distances from the origin in metres; -inf and inf for all of the line.
    """

    origins: Array
    directions: Array
    start: Array
    end: Array

    def __len__(self) -> int:
        return len(self.directions)

    def where(self, chosen: Integers | slice) -> Lines:
        """Selection of lines by indices or a slice, renumbered."""
        return Lines(self.origins[chosen], self.directions[chosen], self.start[chosen], self.end[chosen])


@dataclass(frozen=True, eq=False)
class BoxTree:
    """Bounding volume hierarchy of triangles.

    Attributes
    ----------
    order : (m,) int64
        The triangle in each box of the lowest level.
    levels : tuple of (nodes, 6, 8) float64
        From the lowest level up: center and half size of the children of each node.
    """

    order: Integers
    levels: tuple[Array, ...]

    @classmethod
    def of(cls, corners: Array) -> BoxTree:
        """Build the tree of triangles (m, 3, 3), in the order of a space-filling curve (Morton 1966)."""
        low, high = corners.min(axis=1), corners.max(axis=1)
        order = np.argsort(_morton_codes(0.5 * (low + high)), kind="stable")
        low, high = low[order], high[order]
        levels = []
        while True:
            starts = np.arange(0, len(low), BRANCHES)
            levels.append(_grouped(0.5 * (low + high), 0.5 * (high - low), len(starts)))
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            if len(starts) == 1:
                return cls(order, tuple(levels))

    def candidates(self, lines: Lines) -> Iterator[tuple[Integers, Integers]]:
        """Chunks of pairs (k,), (k,) of a line and a triangle that may meet; all that do are among them."""
        for begin in range(0, len(lines), LINES):
            line, triangle = self._walk(lines.where(slice(begin, begin + LINES)))
            yield line + begin, triangle

    @np.errstate(under="ignore", over="ignore")
    def _walk(self, lines: Lines) -> tuple[Integers, Integers]:
        line, node = np.arange(len(lines)), np.zeros(len(lines), dtype=np.int64)
        slack = MARGIN * (
            np.abs(lines.origins).sum(axis=1) + np.abs(self.levels[-1][0]).max(where=self._real, initial=0)
        )
        for level in reversed(self.levels):
            met = [np.empty((2, 0), np.int64)]
            for begin in range(0, len(line), PAIRS):
                some, nodes = line[begin : begin + PAIRS], node[begin : begin + PAIRS]
                pair, child = np.nonzero(_meets(lines.where(some), level[nodes], slack[some]))
                met.append(np.array([some[pair], nodes[pair] * BRANCHES + child]))
            line, node = np.concatenate(met, axis=1)
        return line, self.order[node]

    @property
    def _real(self) -> npt.NDArray[np.bool_]:
        """(6, 8): mask of the children that the root has."""
        return np.broadcast_to(self.levels[-1][0, 3] != _NOTHING, (6, BRANCHES))


def _meets(lines: Lines, boxes: Array, slack: Array) -> npt.NDArray[np.bool_]:
    """(k, 8): whether lines may meet boxes (k, 6, 8), by the axes that could separate them (Gottschalk et al. 1996)."""
    x, y, z = (boxes[:, i] - lines.origins[:, i, None] for i in range(3))
    a, b, c = (boxes[:, i] for i in range(3, 6))
    u, v, w = (lines.directions[:, i, None] for i in range(3))
    p, q, r, s = np.abs(u), np.abs(v), np.abs(w), slack[:, None]
    along, reach = x * u + y * v + z * w, a * p + b * q + c * r + s
    meets = (along + reach >= lines.start[:, None]) & (along - reach <= lines.end[:, None])
    meets &= np.abs(y * w - z * v) <= b * r + c * q + s
    meets &= np.abs(z * u - x * w) <= c * p + a * r + s
    meets &= np.abs(x * v - y * u) <= a * q + b * p + s
    return np.asarray(meets)


def _grouped(center: Array, half: Array, nodes: int) -> Array:
    """(nodes, 6, 8): centers and half sizes (n, 3) of neighbors together; the last node may lack some."""
    children = np.zeros((nodes * BRANCHES, 6))
    children[:, 3:] = _NOTHING
    children[: len(center)] = np.hstack([center, half])
    return np.ascontiguousarray(children.reshape(nodes, BRANCHES, 6).transpose(0, 2, 1))


def _morton_codes(points: Array) -> npt.NDArray[np.uint64]:
    """(n,): the bits of the three coordinates (n, 3) in turn, 21 of each."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = max(float((high - low).max()), np.finfo(np.float64).tiny)
    with np.errstate(under="ignore"):
        cells = ((points - low) / extent * (2**21 - 1)).astype(np.uint64)
    code = np.zeros(len(points), dtype=np.uint64)
    for bit in range(21):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
