"""Cut cells of a closed mesh: the volume inside each cell of a grid, and the open area between neighbors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, expanded
from translucent.geometry.winding import line_crossings

#: Lines through each cell along each axis, on a square of this side.
LINES = 4

#: Shift of the lines, as a fraction of the distance between them, so that they miss what is modelled on a grid.
_SHIFT = (0.0312, 0.0187)

#: Of lines that hit nothing.
_NO_CROSSINGS: tuple[Integers, Array, Integers] = np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)


@dataclass(frozen=True)
class Voxels:
    """Grid cells that a closed surface cuts: volume inside each, and open area between them.

    Attributes
    ----------
    low : (3,) float64
        Corner of the grid; a cell on each side is empty.
    step : float
        Side of a cell.
    inside : (x, y, z) float64
        Fraction of each cell that is inside, 0 to 1.
    center : (x, y, z, 3) float64
        Centroid of that fraction, in cells from `low`; of empty cells, their middle.
    open_area : tuple of 3 arrays
        Fraction of the face towards the previous cell that is inside, along each axis: (x + 1, y, z) and so on.
    """

    low: Array
    step: float
    inside: Array
    center: Array
    open_area: tuple[Array, Array, Array]

    @property
    def volume(self) -> float:
        """Volume of all fractions."""
        return float(self.inside.sum()) * self.step**3


def voxels(vertices: Array, faces: npt.NDArray[np.integer], step: float) -> Voxels:
    """Cut cells of a closed mesh, from the intervals of lines through each cell along each axis.

    Intervals come from winding numbers, as thickness does: what overlaps counts once. Volumes are exact to the spacing
    of the lines, a quarter of a cell; lengths along a line are exact.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int
        Counter-clockwise seen from outside.
    step : float
        Side of a cell, above 0.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = np.ceil((high - low) / step - 1e-9).astype(int) + 2
    return cut_cells(vertices, faces, step, 0.5 * (low + high) - 0.5 * step * size, size)


def cut_cells(
    vertices: Array, faces: npt.NDArray[np.integer], step: float, origin: Array, size: npt.NDArray[np.integer]
) -> Voxels:
    """Cut cells of a closed mesh in a grid of this corner and size; what is beyond it does not count."""
    units = (vertices - origin) / step
    inside, center, areas = np.zeros(size), np.zeros((*size, 3)), []
    for axis in range(3):
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        lengths, moments, crossed = _along_last_axis(units[:, order], faces, size[order])
        back = np.argsort(order)
        lengths, moments, crossed = (part.transpose(back) for part in (lengths, moments, crossed))
        inside += lengths / 3.0
        center[..., axis] = moments / np.where(lengths > 0.0, lengths, 1.0)
        areas.append(crossed)
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), axis=-1)
    center = np.clip(np.where(center > 0.0, center, corner + 0.5), corner, corner + 1.0)
    return Voxels(origin, step, np.minimum(inside, 1.0), center, (areas[0], areas[1], areas[2]))


def without(cells: Voxels, inner: Voxels) -> Voxels:
    """Cut cells of a body, minus the cells of an object inside it, on the same grid.

    Where both surfaces cut a cell, as little of it is taken as the two fractions allow.
    """
    taken = np.maximum(cells.inside + inner.inside - 1.0, 0.0)
    inside = cells.inside - taken
    moved = (cells.inside[..., None] * cells.center - taken[..., None] * inner.center) / np.maximum(inside, 1e-9)[
        ..., None
    ]
    corner = np.stack(np.meshgrid(*(np.arange(n) for n in inside.shape), indexing="ij"), axis=-1)
    center = np.where((taken > 0.0)[..., None] & (inside > 1e-6)[..., None], moved, cells.center)
    areas = [
        area - np.maximum(area + other - 1.0, 0.0) for area, other in zip(cells.open_area, inner.open_area, strict=True)
    ]
    center = np.clip(center, corner, corner + 1.0)
    return Voxels(cells.low, cells.step, inside, center, (areas[0], areas[1], areas[2]))


def _along_last_axis(
    points: Array, faces: npt.NDArray[np.integer], size: npt.NDArray[np.integer]
) -> tuple[Array, Array, Array]:
    """Length inside each cell, its first moment, and fraction of each cell's lower and upper face that is inside."""
    lines = size[:2] * LINES
    scaled = points[:, :2] * LINES - 0.5 - np.array(_SHIFT)
    found = [_NO_CROSSINGS, *line_crossings(scaled, points[:, 2], faces, (int(lines[0]), int(lines[1])))]
    line, height, sign = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((height, line))
    line, height, sign = line[order], height[order], sign[order]
    begin, end = _intervals(line, height, sign)
    deep = int(size[2])
    low, high = np.clip(height[begin], 0.0, deep - 1e-9), np.clip(height[end], 0.0, deep - 1e-9)
    first, last = low.astype(int), high.astype(int)
    of, cell = expanded(first, last - first + 1)
    at = line[begin][of]
    column = at // lines[1] // LINES * size[1] + at % lines[1] // LINES
    place, shape = column * deep + cell, tuple(size.tolist())
    lower, upper = np.maximum(low[of], cell), np.minimum(high[of], cell + 1)

    def summed(values: Array) -> Array:
        """Mean over the lines of each cell."""
        return np.asarray(np.bincount(place, values, int(size.prod())).reshape(shape) / LINES**2)

    lengths, moments = summed(upper - lower), summed(0.5 * (upper - lower) * (upper + lower))
    crossed = np.minimum(summed((cell > first[of]).astype(np.float64)), 1.0)
    return lengths, moments, np.concatenate([crossed, np.zeros((*shape[:2], 1))], axis=2)


def _intervals(line: Integers, height: Array, sign: Integers) -> tuple[Integers, Integers]:
    """Indices of the crossings at which lines enter and leave the mesh; unbalanced lines have none."""
    winding = np.cumsum(sign)
    first = np.flatnonzero(np.diff(line, prepend=-1) != 0)
    of = np.cumsum(np.diff(line, prepend=-1) != 0) - 1
    before = (winding[first] - sign[first])[of] if len(line) else winding
    last = np.append(first[1:], len(line)) - 1
    balanced = (winding[last] == winding[first] - sign[first])[of] if len(line) else np.zeros(0, bool)
    depth = winding - before
    begins = balanced & (depth > 0) & (depth - sign <= 0)
    ends = balanced & (depth <= 0) & (depth - sign > 0)
    return np.flatnonzero(begins), np.flatnonzero(ends)
