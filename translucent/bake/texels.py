"""Surface points of the texels of a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers, Mask

#: Distance, as a share of a texel, within which a texel's center is on a triangle's edge.
ON_EDGE = 1e-7


@dataclass(frozen=True, eq=False)
class Texels:
    """Texels of a strip of a map, and the points that they show.

    Attributes
    ----------
    row, column : (k,) int64
        Each texel once, row by row.
    face : (k,) int64
        The face that has the center of the texel, or is nearest to it among those that touch the texel.
    barycentric : (k, 3) float64
        The point of the face that is nearest to the texel's center in UV.
    inside : (k,) bool
        Whether that is the center itself.
    overlapping : (k,) bool
        Whether the center is inside several faces.
    """

    row: Integers
    column: Integers
    face: Integers
    barycentric: Array
    inside: Mask
    overlapping: Mask


class Atlas:
    """Atlas: triangles in a map, prepared for finding the texels that they touch.

    Parameters
    ----------
    uv : (m, 3, 2) float64
        Texture coordinates at the corners of the faces, v upwards; beyond 0..1 the map repeats.
    width, height : int
        Of the map, in texels.
    """

    def __init__(self, uv: Array, width: int, height: int) -> None:
        self.width, self.height = width, height
        least = np.minimum(np.minimum(uv[:, 0], uv[:, 1]), uv[:, 2])
        shifted = uv - np.floor(least)[:, None]
        # Column and row as real numbers: texel (i, j) is the square from (j, i) to (j + 1, i + 1).
        self.corners = np.stack([shifted[..., 0] * width, (1.0 - shifted[..., 1]) * height], axis=-1)
        # (corner, axis, face): NumPy computes along long rows several times as fast as along short ones.
        self._place = np.ascontiguousarray(self.corners.transpose(1, 2, 0))
        heights = self._place[:, 1]
        self._top, self._bottom = _cells(heights.min(axis=0), heights.max(axis=0))

    def strip(self, begin: int, end: int) -> Texels:
        """Texels of rows `begin` to `end` that any face touches."""
        face, row = self._face_rows(begin, end)
        left, right = self._spans(face, row)
        count = right - left
        pair = np.repeat(np.arange(len(face)), count)
        column = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count) + left[pair]
        return self._nearest(face[pair], row[pair], column, begin, end)

    def _face_rows(self, begin: int, end: int) -> tuple[Integers, Integers]:
        """Pairs of a face and a row, not yet wrapped, of the faces that touch the strip or a repetition of it."""
        faces, rows = [], []
        lowest, highest = int(self._top.min()) // self.height, (int(self._bottom.max()) - 1) // self.height
        for turn in range(lowest, highest + 1):
            first, last = begin + turn * self.height, end + turn * self.height
            face = np.flatnonzero((self._top < last) & (self._bottom > first))
            top = np.maximum(self._top[face], first)
            count = np.minimum(self._bottom[face], last) - top
            faces.append(np.repeat(face, count))
            rows.append(np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(top, count))
        return np.concatenate(faces), np.concatenate(rows)

    def _spans(self, face: Integers, row: Integers) -> tuple[Integers, Integers]:
        """First and last column + 1 in which faces (n,) touch rows (n,): the span of what the row cuts out of them."""
        place = np.take(self._place, face, axis=2)
        low, high = np.full(len(face), np.inf), np.full(len(face), -np.inf)
        for i in range(3):
            (ax, ay), (bx, by) = place[i], place[(i + 1) % 3]
            rise, run = by - ay, bx - ax
            level = rise == 0
            divisor = np.where(level, 1.0, rise)
            # Where the edge meets the upper and lower edge of the row, as a share of its length.
            with np.errstate(over="ignore", under="ignore"):
                upper, lower = (np.clip((row + side - ay) / divisor, 0.0, 1.0) for side in (0.0, 1.0))
                upper = ax + np.where(level, 0.0, upper) * run
                lower = ax + np.where(level, 1.0, lower) * run
            meets = (np.minimum(ay, by) <= row + 1) & (np.maximum(ay, by) >= row)
            np.minimum(low, np.minimum(upper, lower), out=low, where=meets)
            np.maximum(high, np.maximum(upper, lower), out=high, where=meets)
        met = low <= high
        left, right = _cells(np.where(met, low, 0.0), np.where(met, high, 0.0))
        return left, np.where(met, right, left)

    def _nearest(self, face: Integers, row: Integers, column: Integers, begin: int, end: int) -> Texels:
        """Best face for each texel, of all pairs of a face and a texel of the strip that it touches."""
        center = np.stack([column, row], axis=1).astype(np.float64) + 0.5
        area, inside = _areas(np.take(self._place, face, axis=2), center)
        texel = (row % self.height - begin) * self.width + column % self.width
        pairs = np.flatnonzero(inside)
        pairs = pairs[np.argsort(face[pairs], kind="stable")]
        best = np.full((end - begin) * self.width, -1)
        best[texel[pairs[::-1]]] = pairs[::-1]  # the last one stays, which is of the first face
        # Most other pairs are of a texel whose center some face has.
        beside = np.flatnonzero(~inside & (best[texel] < 0))
        distance, share = _closest_on_edges(self.corners[face[beside]], center[beside])
        order = np.lexsort((face[beside], distance, texel[beside]))
        order = order[np.diff(texel[beside[order]], prepend=-1) > 0]
        best[texel[beside[order]]] = beside[order]
        found = np.flatnonzero(best >= 0)
        best, overlapping = best[found], self._overlapping(texel, face, center, pairs, len(best))[found]
        within = inside[best]
        barycentric = np.empty((len(best), 3))
        with np.errstate(under="ignore"):
            shares = area[:, best[within]]
            barycentric[within] = (shares / (shares[0] + shares[1] + shares[2])).T
        barycentric[~within] = share[order]
        rows, columns = np.divmod(found, self.width)
        return Texels(rows + begin, columns, face[best], barycentric, within, overlapping)

    def _overlapping(self, texel: Integers, face: Integers, center: Array, pairs: Integers, count: int) -> Mask:
        """(count,): whether several faces have the center of a texel, of the `pairs` in which the face has it."""
        several = np.bincount(texel[pairs], minlength=count) > 1
        # Most of these are on an edge that two faces share.
        pairs = pairs[several[texel[pairs]]]
        pairs = pairs[self._depth(face[pairs], center[pairs]) > ON_EDGE]
        return np.bincount(texel[pairs], minlength=count) > 1

    def _depth(self, face: Integers, center: Array) -> Array:
        """(n,): depth of the centers inside their faces, in texels; below 0 outside."""
        corners = self.corners[face]
        depth = np.full(len(face), np.inf)
        turn = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for i in range(3):
            along = corners[:, (i + 1) % 3] - corners[:, i]
            length = np.hypot(along[:, 0], along[:, 1])
            offset = np.sign(turn) * _cross(along, center - corners[:, i])
            depth = np.minimum(depth, offset / np.where(length > 0, length, 1.0))
        return depth


def _cells(low: Array, high: Array) -> tuple[Integers, Integers]:
    """First cell, and last + 1, of closed ranges; those that end on a boundary do not touch the cell behind it."""
    first = np.floor(low).astype(np.int64)
    return first, np.maximum(np.ceil(high).astype(np.int64), first + 1)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _areas(place: Array, point: Array) -> tuple[Array, Mask]:
    """Twice the areas (3, n) opposite to the corners that points (n, 2) cut off triangles with corners at (3, 2, n),
    and whether they are inside (n,).
    """
    area = np.empty((3, len(point)))
    x, y = point.T
    with np.errstate(under="ignore"):
        for i in range(3):
            (ax, ay), (bx, by) = place[(i + 1) % 3], place[(i + 2) % 3]
            np.subtract((bx - ax) * (y - ay), (by - ay) * (x - ax), out=area[i])
        total = area[0] + area[1] + area[2]
    least = np.minimum(np.minimum(area[0], area[1]), area[2])
    most = np.maximum(np.maximum(area[0], area[1]), area[2])
    return area, ((least >= 0) & (total > 0)) | ((most <= 0) & (total < 0))


def _closest_on_edges(corners: Array, point: Array) -> tuple[Array, Array]:
    """Squared distance (n,) of points (n, 2) outside triangles (n, 3, 2), and barycentric weights of the nearest."""
    distance, barycentric = np.full(len(point), np.inf), np.zeros((len(point), 3))
    for i in range(3):
        j = (i + 1) % 3
        along = corners[:, j] - corners[:, i]
        square = (along * along).sum(axis=1)
        share = ((point - corners[:, i]) * along).sum(axis=1) / np.where(square > 0, square, 1.0)
        share = np.clip(np.where(square > 0, share, 0.0), 0.0, 1.0)
        offset = corners[:, i] + share[:, None] * along - point
        away = (offset * offset).sum(axis=1)
        nearer = away < distance
        distance = np.where(nearer, away, distance)
        weights = np.zeros_like(barycentric)
        weights[:, i], weights[:, j] = 1.0 - share, share
        barycentric = np.where(nearer[:, None], weights, barycentric)
    return distance, barycentric
