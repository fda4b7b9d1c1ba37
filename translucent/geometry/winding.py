"""Winding numbers of points, and parts of a mesh that are inside out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.geometry.grouping import CHUNK, sorted_sides

#: Smallest negative volume of an inside-out part, as a share of its cubed size: less is rounding.
_FLAT = 1e-12


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
    return np.array([p for p in suspects if not _is_cavity(corners, part, low, high, int(p))], dtype=np.int64)


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


def _is_cavity(corners: Array, part: npt.NDArray[np.signedinteger[Any]], low: Array, high: Array, p: int) -> bool:
    around = (low <= low[p]).all(axis=1) & (high >= high[p]).all(axis=1)
    around[p] = False
    if not around.any():
        return False
    inside = corners[np.flatnonzero(part == p)[0]].mean(axis=0)
    return round(winding_number(corners[around[part]], inside)) != 0


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
