"""Crossings of triangles with the parallel lines of a grid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers

#: Pairs of a triangle and a line that are tested at a time: the working arrays take about 100 MB.
CHUNK = 1 << 18


def line_tests(scaled: Array, faces: npt.NDArray[np.integer], lines: tuple[int, int]) -> int:
    """Number of pairs of a face and a line that `line_crossings` would test."""
    (_, columns), (_, rows) = _spans(scaled, faces, lines)
    return int((columns * rows).sum())


def line_crossings(
    scaled: Array,
    heights: Array,
    faces: npt.NDArray[np.integer],
    lines: tuple[int, int],
    group: Integers | None = None,
) -> Iterator[tuple[Integers, Array, Integers]]:
    """Crossings of faces with lines at whole numbers of two coordinates, in chunks; none for a line through an edge.

    Parameters
    ----------
    scaled : (n, 2) float64
        Vertices across the lines, in distances between these.
    heights : (n,) float64
        Vertices along the lines.
    faces : (m, 3) int
        Counter-clockwise seen from outside.
    lines : (int, int)
        Lines are at 0 to below these.
    group : (m,) int, optional
        Of each face, to tell apart grids that are searched together.

    Yields
    ------
    line : (k,) int64
        Number of the line, along the second coordinate first; of a group, from there on.
    height : (k,) float64
    sign : (k,) int64
        +1 where a line that goes up enters the body, -1 where it leaves.
    """
    first, count = zip(*_spans(scaled, faces, lines), strict=True)
    pairs = count[0] * count[1]
    near = np.flatnonzero(pairs)
    ends = np.cumsum(pairs[near])
    total = int(ends[-1]) if len(ends) else 0
    for begin in range(0, total, CHUNK):
        pair = np.arange(begin, min(begin + CHUNK, total))
        entry = np.searchsorted(ends, pair, side="right")
        face = near[entry]
        inside = pair - (ends[entry] - pairs[face])
        rows = count[1][face]
        cell = np.stack([first[0][face] + inside // rows, first[1][face] + inside % rows], axis=1)
        before = 0 if group is None else group[face] * lines[0]
        line = (before + cell[:, 0]) * lines[1] + cell[:, 1]
        corners = faces[face]
        yield crossings(scaled[corners], heights[corners], cell, line)


def _spans(scaled: Array, faces: npt.NDArray[np.integer], lines: tuple[int, int]) -> list[tuple[Integers, Integers]]:
    """Two times (m,), (m,): the first line that faces may meet along one axis, and how many."""
    found = []
    for column, most in zip(scaled.T, lines, strict=True):
        a, b, c = column[faces].T
        first = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)), 0).astype(np.int64)
        last = np.minimum(np.floor(np.maximum(np.maximum(a, b), c)), most - 1).astype(np.int64)
        found.append((first, np.maximum(last - first + 1, 0)))
    return found


def crossings(triangles: Array, heights: Array, place: Array, line: Integers) -> tuple[Integers, Array, Integers]:
    """Line, height and sign (+1 upwards into the body) of the triangles (k, 3, 2) that lines at places (k, 2) meet."""
    relative = triangles - place[:, None, :]
    x, y = relative[..., 0], relative[..., 1]
    area = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - y[:, [1, 2, 0]] * x[:, [2, 0, 1]]
    total = area.sum(axis=1)
    met = ((area > 0).all(axis=1) | (area < 0).all(axis=1)) & (total != 0)
    weights = area[met] / total[met, None]
    # Counter-clockwise seen from above: the outside is up there, and a line that goes up leaves.
    return line[met], (weights * heights[met]).sum(axis=1), -np.sign(total[met]).astype(np.int64)
