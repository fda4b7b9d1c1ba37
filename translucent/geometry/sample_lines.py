"""Detection of inside-out surfaces: winding numbers along sample lines in three directions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.geometry.grouping import extent, use_mask
from translucent.geometry.line_crossings import line_crossings, line_tests

#: Lines along each side of the grid of one direction: twice the root of the number of faces, within these bounds.
#: What is smaller than a cell can slip through.
LINES = (12, 96)

#: Pairs of a face and a line that are tested at most; scans need fewer than 100,000 as a rule. Faces that reach across
#: the mesh, such as thousands on one edge, meet most lines, and get fewer of them.
MOST = 1 << 21

#: Share of the diagonal on which rounding and welding may wind a surface negatively.
NEGATIVE = 1e-5

#: Number of faces below which it takes no time to test all of them against all lines.
_FEW = 1 << 14

#: Axes (columns) off those along which meshes tend to be built; and the same with each of them as the last, along which
#: the lines run.
_AXES = np.linalg.qr(np.array([[0.9, 0.31, 0.17], [-0.23, 0.87, 0.41], [0.11, -0.37, 0.93]]))[0]
TURNS = np.stack([_AXES, _AXES[:, [1, 2, 0]], _AXES[:, [2, 0, 1]]])


def winds_negatively(vertices: Array, faces: npt.NDArray[np.integer]) -> bool:
    """True if a sample line crosses a place around which the surface winds a negative number of times.

    A closed surface that does not cross itself never does, unless a part of it is inside out; nor does one that only
    overlaps itself. Lines that enter and leave unequally often tell nothing, and are left out.

    Parameters
    ----------
    vertices : (n, 3) float64
        Finite.
    faces : (m, 3) int
        Counter-clockwise seen from outside.
    """
    if not (used := use_mask(faces, len(vertices))).all():
        vertices, faces = vertices[used], (np.cumsum(used) - 1)[faces]
    low, high = extent(vertices)
    diagonal = float(np.linalg.norm(high - low))
    if not 0 < diagonal < np.inf:
        return False
    unit = (vertices - (low / 2 + high / 2)) / diagonal
    lines = int(np.clip(2 * np.sqrt(len(faces)), *LINES))
    points = (unit @ TURNS).reshape(-1, 3)
    scaled, copies, direction = _copies(points[:, :2], faces, lines)
    if (tests := line_tests(scaled, copies, (lines, lines))) > MOST:
        lines = max(int(lines * np.sqrt(MOST / tests)), 1)
        scaled, copies, direction = _copies(points[:, :2], faces, lines)
    found = list(line_crossings(scaled, points[:, 2], copies, (lines, lines), direction))
    if not found:
        return False  # no face is as large as a cell
    line, height, sign = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _winds_below_zero(line, height, sign)


def _copies(points: Array, faces: npt.NDArray[np.integer], lines: int) -> tuple[Array, Integers, Integers]:
    """Points (3 n, 2) in distances between lines; the faces that may meet one, and the direction of each.

    One copy for each direction, the lines of all along the last axis: arrays of small meshes cost more than numbers.
    """
    scaled, count = (points + 0.5) * lines - 0.5, len(points) // 3
    near = [_near_lines(scaled[i * count : (i + 1) * count], faces, lines) for i in range(3)]
    copies = np.concatenate([faces[one] + count * i for i, one in enumerate(near)])
    return scaled, copies, np.repeat(np.arange(3), [len(one) for one in near])


def _near_lines(scaled: Array, faces: npt.NDArray[np.integer], lines: int) -> Integers:
    """Numbers of the faces that may meet a line at whole numbers of both coordinates; most of a fine mesh do not."""
    near = np.arange(len(faces))
    if len(faces) < _FEW:
        return near
    for column in scaled.T:
        held = column.clip(-0.5, lines - 0.5)
        # Odd between two lines, and even on one; a face that lies on one has no area across the lines.
        step = (np.ceil(held) + np.floor(held)).astype(np.int16)
        a, b, c = (step.take(faces[near, i]) for i in range(3))
        near = near[(a != b) | (b != c)]
    return near


def _winds_below_zero(line: Integers, height: Array, sign: Integers) -> bool:
    """True if a balanced line winds negatively for longer than rounding explains."""
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
