"""Winding numbers of points, crossings of triangles with lines, and parts of a mesh that are inside out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask, expanded
from translucent.errors import InputError
from translucent.geometry.grouping import CHUNK, extent, sorted_sides, use_mask

#: Pairs of a triangle and a line that are tested at a time: the working arrays take about 100 MB.
CROSSINGS_AT_A_TIME = 1 << 18


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
        Of each face, to keep grids apart that are searched together.

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
    for begin in range(0, total, CROSSINGS_AT_A_TIME):
        pair = np.arange(begin, min(begin + CROSSINGS_AT_A_TIME, total))
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
    """Two times (m,), (m,): the first line that faces may cross along one axis, and how many."""
    found = []
    for column, most in zip(scaled.T, lines, strict=True):
        a, b, c = column[faces].T
        first = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)), 0).astype(np.int64)
        last = np.minimum(np.floor(np.maximum(np.maximum(a, b), c)), most - 1).astype(np.int64)
        found.append((first, np.maximum(last - first + 1, 0)))
    return found


def crossings(triangles: Array, heights: Array, place: Array, line: Integers) -> tuple[Integers, Array, Integers]:
    """Line, height and sign (+1 upwards into the body) of the triangles (k, 3, 2) that lines at places (k, 2) cross."""
    relative = triangles - place[:, None, :]
    x, y = relative[..., 0], relative[..., 1]
    area = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - y[:, [1, 2, 0]] * x[:, [2, 0, 1]]
    total = area.sum(axis=1)
    hit = ((area > 0).all(axis=1) | (area < 0).all(axis=1)) & (total != 0)
    weights = area[hit] / total[hit, None]
    # Counter-clockwise seen from above: the outside is up there, and a line that goes up leaves.
    return line[hit], (weights * heights[hit]).sum(axis=1), -np.sign(total[hit]).astype(np.int64)


#: Lines along each side of the grid of one direction: twice the root of the number of faces, within these bounds.
#: What is smaller than a cell can slip through.
LINES = (12, 96)

#: Pairs of a face and a line that are tested at most; scans need fewer than 100,000 as a rule. Faces that reach across
#: the mesh, such as thousands on one edge, cross most lines, and get fewer of them.
MOST_TESTS = 1 << 21

#: Share of the diagonal on which rounding and welding may wind a surface negatively.
NEGATIVE = 1e-5

#: Number of faces below which it takes no time to test all of them against all lines.
_FEW = 1 << 14

#: Axes (columns) off those along which meshes tend to be built; and the same with each of them as the last, along which
#: the lines run.
_AXES = np.linalg.qr(np.array([[0.9, 0.31, 0.17], [-0.23, 0.87, 0.41], [0.11, -0.37, 0.93]]))[0]
ROTATIONS = np.stack([_AXES, _AXES[:, [1, 2, 0]], _AXES[:, [2, 0, 1]]])


def winds_negatively(vertices: Array, faces: npt.NDArray[np.integer]) -> bool:
    """True if a sample line crosses a place around which the surface winds a negative number of times.

    A closed surface that does not cross itself never does, unless a part of it is inside out; nor does one that only
    overlaps itself. Lines that enter and leave unequally often are no evidence, and are left out.

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
    points = (unit @ ROTATIONS).reshape(-1, 3)
    scaled, copies, direction = _copies(points[:, :2], faces, lines)
    if (tests := line_tests(scaled, copies, (lines, lines))) > MOST_TESTS:
        lines = max(int(lines * np.sqrt(MOST_TESTS / tests)), 1)
        scaled, copies, direction = _copies(points[:, :2], faces, lines)
    found = list(line_crossings(scaled, points[:, 2], copies, (lines, lines), direction))
    if not found:
        return False  # no face is as large as a cell
    line, height, sign = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _winds_below_zero(line, height, sign)


def _copies(points: Array, faces: npt.NDArray[np.integer], lines: int) -> tuple[Array, Integers, Integers]:
    """Points (3 n, 2) in distances between lines; the faces that may cross one, and the direction of each.

    One copy for each direction, the lines of all along the last axis: arrays of small meshes cost more than numbers.
    """
    scaled, count = (points + 0.5) * lines - 0.5, len(points) // 3
    near = [_near_lines(scaled[i * count : (i + 1) * count], faces, lines) for i in range(3)]
    copies = np.concatenate([faces[one] + count * i for i, one in enumerate(near)])
    return scaled, copies, np.repeat(np.arange(3), [len(one) for one in near])


def _near_lines(scaled: Array, faces: npt.NDArray[np.integer], lines: int) -> Integers:
    """Numbers of the faces that may cross a line at whole numbers of both coordinates; most of a fine mesh do not."""
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


#: Smallest negative volume of an inside-out part, as a fraction of its cubed size: less is rounding.
_FLAT = 1e-12

#: Pairs of a face and a point that are tested at a time, and at most: parts that all lie one in another have as many as
#: the square of their number.
BLOCK, MOST_PAIRS = 1 << 18, 1 << 25


def winding_number(corners: Array, point: npt.ArrayLike) -> float:
    """Winding number of triangles: the sum of their solid angles over 4 pi (van Oosterom & Strackee 1983).

    Parameters
    ----------
    corners : (m, 3, 3) float64
    point : array_like (3,)

    Returns
    -------
    float
        0 outside of a closed surface, 1 inside, a fraction on it or near a hole.
    """
    a, b, c = (corners - np.asarray(point, dtype=np.float64)).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    with np.errstate(under="ignore"):
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a))]
        lengths = la * lb * lc
        half_angle = np.arctan2(triple, lengths + dots[0] * lc + dots[1] * la + dots[2] * lb)
    # Across a face its solid angle jumps from 2 pi to -2 pi: on it, as far as rounding can resolve, it is the mean.
    half_angle[np.abs(triple) <= 16 * np.finfo(np.float64).eps * lengths] = 0.0
    return float(half_angle.sum() / (2.0 * np.pi))


def inside_out_parts(
    vertices: Array, faces: npt.NDArray[np.integer], part: npt.NDArray[np.signedinteger[Any]]
) -> npt.NDArray[np.int64]:
    """Closed parts that face inwards without being a cavity: they lie inside no other part.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int
        Welded: equal positions have equal indices.
    part : (m,) int64
        Part of each face, from 0.

    Returns
    -------
    (k,) int64
        Their numbers.
    """
    count = int(part.max()) + 1
    volume = part_volumes(vertices, faces, part, count)
    if not (volume < 0).any():
        return np.empty(0, dtype=np.int64)
    corners = vertices[faces]
    order = np.argsort(part, kind="stable")
    starts = np.searchsorted(part[order], np.arange(count))
    low = np.minimum.reduceat(corners.min(axis=1)[order], starts)
    high = np.maximum.reduceat(corners.max(axis=1)[order], starts)
    with np.errstate(under="ignore", over="ignore"):
        negative = volume < -_FLAT * np.linalg.norm(high - low, axis=1) ** 3
    if not negative.any():
        return np.empty(0, dtype=np.int64)
    suspects = np.flatnonzero(negative & _balanced_parts(faces, part, count))
    points = corners[order[starts[suspects]]].mean(axis=1)
    return suspects[~_are_cavities(corners, part, np.stack([low, high], axis=1), suspects, points)]


def part_volumes(
    vertices: Array, faces: npt.NDArray[np.integer], part: npt.NDArray[np.signedinteger[Any]], count: int
) -> Array:
    """(count,): signed volumes of the parts of a mesh; meaningful for closed ones.

    By the divergence theorem, about a corner of each part, so that far-away ones lose no digits.
    """
    first = np.zeros(count, dtype=np.int64)
    if count > 1:
        first[part[::-1]] = np.arange(len(part) - 1, -1, -1)
    origins = vertices[faces[first, 0]]
    volume = np.zeros(count)
    with np.errstate(under="ignore", over="ignore", invalid="ignore"):
        x, y, z = (vertices[:, i] - origins[0, i] if count == 1 else vertices[:, i].copy() for i in range(3))
        for begin in range(0, len(faces), CHUNK):
            corners, of = faces[begin : begin + CHUNK].T.copy(), part[begin : begin + CHUNK]
            a, b, c = x.take(corners), y.take(corners), z.take(corners)
            if count > 1:
                a, b, c = a - origins[of, 0], b - origins[of, 1], c - origins[of, 2]
            triple = triple_products(a, b, c)
            volume += np.bincount(of, weights=triple, minlength=count) if count > 1 else triple.sum()
    return volume / 6.0


def one_volume(vertices: Array, faces: npt.NDArray[np.integer]) -> float:
    """Signed volume of a mesh in cubic metres; meaningful for closed ones."""
    return float(part_volumes(vertices, faces, np.zeros(len(faces), dtype=np.int64), 1)[0])


def triple_products(x: Array, y: Array, z: Array) -> Array:
    """(m,): six times the signed volume between the origin and each triangle, of coordinates (3 corners, m)."""
    triple: Array = x[0] * (y[1] * z[2] - z[1] * y[2])
    triple += y[0] * (z[1] * x[2] - x[1] * z[2])
    triple += z[0] * (x[1] * y[2] - y[1] * x[2])
    return triple


def _are_cavities(
    corners: Array, part: npt.NDArray[np.signedinteger[Any]], boxes: Array, suspects: Integers, points: Array
) -> Mask:
    """(k,): whether other parts, with boxes (n, 2, 3) around that of a suspect (k,), wind around a point (k, 3) of it.

    Lines through each point in three directions count the faces before and behind it. The winding number is the mean of
    all counts, so that a line through an edge does not decide.
    """

    def around(one: Integers, other: Integers) -> Mask:
        (low, high), (inner_low, inner_high) = (boxes[of].transpose(1, 0, 2) for of in (one, suspects[other]))
        return np.asarray(((low <= inner_low) & (high >= inner_high)).all(axis=1) & (one != suspects[other]))

    outer, inner = np.zeros(len(boxes), dtype=bool), np.zeros(len(suspects), dtype=bool)
    for one, other in _pairs(boxes[..., :2], points[:, :2]):
        held = around(one, other)
        outer[one[held]] = inner[other[held]] = True
    face, suspect = np.flatnonzero(outer[part]), np.flatnonzero(inner)
    low, high = boxes.min(axis=(0, 1)), boxes.max(axis=(0, 1))
    middle, size = low / 2 + high / 2, float((high - low).max())
    winding = np.zeros(len(suspects))
    for rotation in ROTATIONS:
        triangles, places = ((of - middle) / size @ rotation for of in (corners[face], points[suspect]))
        for one, other in _pairs(triangles[..., :2], places[:, :2]):
            held = around(part[face[one]], suspect[other])
            one, other = one[held], other[held]
            hit, height, sign = crossings(triangles[one, :, :2], triangles[one, :, 2], places[other, :2], other)
            behind = np.where(height < places[hit, 2], sign, -sign)
            winding += np.bincount(suspect[hit], behind, minlength=len(winding))
    return np.asarray(np.round(winding / (2 * len(ROTATIONS))) != 0)


def _pairs(triangles: Array, points: Array) -> Iterator[tuple[Integers, Integers]]:
    """Numbers of triangles (m, 3, 2), and of points (k, 2) in the boxes around them, in chunks.

    Points are sorted into strips across the first axis, with about as many in each as there are strips, and within
    those along the second axis: a box crosses a run of points in each of a few strips.
    """
    count, tests = len(points), 0
    if not count:
        return
    strips = math.isqrt(count)
    walls = np.sort(points[:, 0])[np.arange(1, strips) * count // strips]
    heights = np.sort(points[:, 1])
    key = np.searchsorted(walls, points[:, 0], side="right") * (count + 1) + np.searchsorted(heights, points[:, 1])
    order = np.argsort(key)
    key = key[order]
    for begin in range(0, len(triangles), CHUNK):
        low, high = triangles[begin : begin + CHUNK].min(axis=1), triangles[begin : begin + CHUNK].max(axis=1)
        first = np.searchsorted(walls, low[:, 0], side="right")
        triangle, strip = expanded(first, np.searchsorted(walls, high[:, 0], side="right") - first + 1)
        bottom, top = np.searchsorted(heights, low[:, 1]), np.searchsorted(heights, high[:, 1], side="right")
        first = np.searchsorted(key, strip * (count + 1) + bottom[triangle])
        runs = np.searchsorted(key, strip * (count + 1) + top[triangle]) - first
        ends = np.cumsum(runs)
        if (tests := tests + int(ends[-1])) > MOST_PAIRS:
            found = f"{count} parts with faces that point inwards are nested"
            raise InputError("connected parts of a mesh", found, "remove duplicate faces, or split the mesh")
        for part in np.split(np.arange(len(runs)), np.searchsorted(ends, np.arange(BLOCK, ends[-1], BLOCK))):
            run, place = expanded(first[part], runs[part])
            yield begin + triangle[part[run]], order[place]


def _balanced_parts(
    faces: npt.NDArray[np.integer], part: npt.NDArray[np.signedinteger[Any]], count: int
) -> npt.NDArray[np.bool_]:
    """True if every directed edge of a part has its opposite."""
    sides = sorted_sides(faces)
    unbalanced = np.zeros(count, dtype=bool)
    if not sides.paired:
        net = np.add.reduceat(np.where(sides.ascending, 1, -1), sides.begins)
        unbalanced[part[sides.face[np.repeat(net != 0, sides.sizes)]]] = True
    return ~unbalanced
