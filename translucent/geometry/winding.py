"""Winding numbers of points, and parts of a mesh that are inside out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.errors import InputError
from translucent.geometry.grouping import CHUNK, sorted_sides
from translucent.geometry.line_crossings import crossings
from translucent.geometry.sample_lines import TURNS

#: Smallest negative volume of an inside-out part, as a share of its cubed size: less is rounding.
_FLAT = 1e-12

#: Pairs of a face and a point that are tested at a time, and at most: parts that all lie one in another have as many as
#: the square of their number.
BLOCK, MOST = 1 << 18, 1 << 25


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
    # Across a face its solid angle jumps from 2 pi to -2 pi: on it, as far as rounding can tell, it is the mean.
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
    for turn in TURNS:
        triangles, places = ((of - middle) / size @ turn for of in (corners[face], points[suspect]))
        for one, other in _pairs(triangles[..., :2], places[:, :2]):
            held = around(part[face[one]], suspect[other])
            one, other = one[held], other[held]
            met, height, sign = crossings(triangles[one, :, :2], triangles[one, :, 2], places[other, :2], other)
            behind = np.where(height < places[met, 2], sign, -sign)
            winding += np.bincount(suspect[met], behind, minlength=len(winding))
    return np.asarray(np.round(winding / (2 * len(TURNS))) != 0)


def _pairs(triangles: Array, points: Array) -> Iterator[tuple[Integers, Integers]]:
    """Numbers of triangles (m, 3, 2), and of points (k, 2) in the boxes around them, in chunks.

    Points are sorted into strips across the first axis, with about as many in each as there are strips, and within
    those along the second axis: a box meets a run of points in each of a few strips.
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
        triangle, strip = _expanded(first, np.searchsorted(walls, high[:, 0], side="right") - first + 1)
        bottom, top = np.searchsorted(heights, low[:, 1]), np.searchsorted(heights, high[:, 1], side="right")
        first = np.searchsorted(key, strip * (count + 1) + bottom[triangle])
        runs = np.searchsorted(key, strip * (count + 1) + top[triangle]) - first
        ends = np.cumsum(runs)
        if (tests := tests + int(ends[-1])) > MOST:
            found = f"{count} of them that look inwards lie one in another"
            raise InputError("parts of a mesh", found, "remove what is there twice, or split the mesh")
        for part in np.split(np.arange(len(runs)), np.searchsorted(ends, np.arange(BLOCK, ends[-1], BLOCK))):
            run, place = _expanded(first[part], runs[part])
            yield begin + triangle[part[run]], order[place]


def _expanded(first: Integers, count: Integers) -> tuple[Integers, Integers]:
    """Number of each run of whole numbers, and the numbers in it, from their first ones and lengths."""
    run = np.repeat(np.arange(len(first)), count)
    return run, np.arange(len(run)) + np.repeat(first - (np.cumsum(count) - count), count)


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
