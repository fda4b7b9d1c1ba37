"""Detection of inside-out surfaces: winding numbers along sample lines in three directions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.geometry.line_crossings import line_crossings

#: Lines along each side of the grid of one direction: twice the root of the number of faces, within these bounds.
#: What is smaller than a cell can slip through.
LINES = (12, 96)

#: Share of the diagonal on which rounding and welding may wind a surface negatively.
NEGATIVE = 1e-5

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
    scaled = (points[:, :2] + 0.5) * lines - 0.5
    direction = np.repeat(np.arange(3), len(faces))
    found = list(line_crossings(scaled, points[:, 2], copies, (lines, lines), direction))
    if not found:
        return False  # no face is as large as a cell
    line, height, sign = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _winds_below_zero(line, height, sign)


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
