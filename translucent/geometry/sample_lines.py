"""Detection of inside-out surfaces: winding numbers along sample lines in three directions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers

#: Lines along each side of the grid of one direction: twice the root of the number of faces, within these bounds.
#: What is smaller than a cell can slip through.
LINES = (12, 96)

#: Share of the diagonal on which rounding and welding may wind a surface negatively.
NEGATIVE = 1e-5

#: Pairs of a triangle and a line that are tested at a time: the working arrays stay below 100 MB.
CHUNK = 1 << 20

#: Axes (columns) off those along which meshes tend to be built; and the same with each of them as the last, along which
#: the lines run.
_AXES = np.linalg.qr(np.array([[0.9, 0.31, 0.17], [-0.23, 0.87, 0.41], [0.11, -0.37, 0.93]]))[0]
_TURNS = np.stack([_AXES, _AXES[:, [1, 2, 0]], _AXES[:, [2, 0, 1]]])


def winds_negatively(vertices: Array, faces: npt.NDArray[np.integer]) -> bool:
    """Whether a sample line crosses a place around which the surface winds a negative number of times.

    A closed surface that does not cross itself never does, unless a part of it is inside out; nor does one that only
    overlaps itself. Lines that enter and leave unequally often tell nothing, and are left out.

    Parameters
    ----------
    vertices : (n, 3) float64
        Finite.
    faces : (m, 3) int
        Counter-clockwise seen from outside.
    """
    low, high = vertices[faces].min(axis=(0, 1)), vertices[faces].max(axis=(0, 1))
    diagonal = float(np.linalg.norm(high - low))
    if not 0 < diagonal < np.inf:
        return False
    unit = (vertices - (low / 2 + high / 2)) / diagonal
    lines = int(np.clip(2 * np.sqrt(len(faces)), *LINES))
    # One copy for each direction, the lines of all along the last axis: arrays of small meshes cost more than numbers.
    points = (unit @ _TURNS).reshape(-1, 3)
    copies = (faces + len(unit) * np.arange(3)[:, None, None]).reshape(-1, 3)
    found = list(_chunks(points, copies, lines, np.repeat(np.arange(3), len(faces))))
    if not found:
        return False  # no face is as large as a cell
    line, height, sign = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _winds_below_zero(line, height, sign)


def _chunks(
    points: Array, faces: npt.NDArray[np.integer], lines: int, direction: Integers
) -> Iterator[tuple[Integers, Array, Integers]]:
    """Crossings, in chunks, of the lines along the last axis with faces within -0.5 to 0.5; see `_crossings`."""
    scaled = (points[:, :2] + 0.5) * lines - 0.5
    first, count = zip(*(_span(column[faces]) for column in scaled.T), strict=True)
    pairs = count[0] * count[1]
    near = np.flatnonzero(pairs)
    ends = np.cumsum(pairs[near])
    for begin in range(0, int(ends[-1]) if len(ends) else 0, CHUNK):
        pair = np.arange(begin, min(begin + CHUNK, int(ends[-1])))
        entry = np.searchsorted(ends, pair, side="right")
        face = near[entry]
        inside = pair - (ends[entry] - pairs[face])
        rows = count[1][face]
        cell = np.stack([first[0][face] + inside // rows, first[1][face] + inside % rows], axis=1)
        corners = faces[face]
        line = (direction[face] * lines + cell[:, 0]) * lines + cell[:, 1]
        yield _crossings(scaled[corners], points[corners, 2], cell, line)


def _span(coordinate: Array) -> tuple[Integers, Integers]:
    """(m,), (m,): the first line that triangles (m, 3) may meet along one axis, and how many."""
    a, b, c = coordinate.T
    first = np.ceil(np.minimum(np.minimum(a, b), c)).astype(np.int64)
    last = np.floor(np.maximum(np.maximum(a, b), c)).astype(np.int64)
    return first, np.maximum(last - first + 1, 0)


def _crossings(triangles: Array, heights: Array, cell: Integers, line: Integers) -> tuple[Integers, Array, Integers]:
    """Line, height and sign (+1 upwards into the body) of the triangles (k, 3, 2) that the lines at the cells meet."""
    relative = triangles - cell[:, None, :]
    x, y = relative[..., 0], relative[..., 1]
    area = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - y[:, [1, 2, 0]] * x[:, [2, 0, 1]]
    total = area.sum(axis=1)
    met = ((area > 0).all(axis=1) | (area < 0).all(axis=1)) & (total != 0)
    weights = area[met] / total[met, None]
    # Counter-clockwise seen from above: the outside is up there, and a line that goes up leaves.
    return line[met], (weights * heights[met]).sum(axis=1), -np.sign(total[met]).astype(np.int64)


def _winds_below_zero(line: Integers, height: Array, sign: Integers) -> bool:
    """Whether a balanced line winds negatively for longer than rounding explains."""
    if len(line) == 0:
        return False
    order = np.lexsort((height, line))
    line, height, sign = line[order], height[order], sign[order]
    winding = np.cumsum(sign)
    begins = np.flatnonzero(np.diff(line, prepend=-1) != 0)
    of = np.cumsum(np.diff(line, prepend=-1) != 0) - 1
    before = winding[begins] - sign[begins]
    last = np.append(begins[1:], len(line)) - 1
    balanced = winding[last] == before
    inner = np.append(line[1:] == line[:-1], False) & balanced[of] & (winding < before[of])
    lengths = np.diff(height, append=0.0)[inner]
    return bool(np.bincount(of[inner], lengths).max(initial=0.0) > NEGATIVE)
