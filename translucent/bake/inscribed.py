"""The largest sphere inside a mesh that touches the surface at a point (mode "inscribed").

The sphere at p has its center p - r n on the inward normal, and is empty: with m = -n and s(q) = m . (q - p),

    2 r(p) = min over q of |q - p|^2 / s(q),

over the points q of the surface in the cone of `SPHERE_CONE` around m. Where a sphere touches beyond it, seen from the
center less than the crease angle away from p, is the smooth surface around p, where each edge of its tessellation would
otherwise end the sphere.

The quotient is quasi-convex: spheres that touch at p lie within one another. So its minimum in a face is where a sphere
touches the plane, or the edge of the cone crosses it, or, if that is not in the face, on an edge, where it is the root
of a quadratic equation, moved into the cone. Nothing is iterated, where Ma, Bae and Choi (2012) let a ball shrink until
it is empty. A few rays give a first radius, and a tree of boxes the faces that such a sphere may touch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Integers
from translucent.bake.rays import SPHERE_CONE, Points, PreparedMesh
from translucent.geometry.bvh import curve_order

#: Children of a box, and the largest number of boxes at the top of the tree.
CHILDREN, TOP = 4, 16

#: Level from which a face in each box makes spheres smaller, so that fewer boxes are tested on the next one.
NARROWING = 3

#: Coordinate of boxes that are none, in radii: no sphere touches them.
FAR = 10.0

#: Largest number of pairs of a point and a box that are looked at at a time.
MOST_PAIRS = 1 << 16

#: Number of faces of a large mesh, and the fraction by which spheres may be too large: round bodies have spheres that
#: nearly touch all faces.
LARGE, LARGE_SLACK = 50_000, 0.002

#: Distance from a plane, in radii of the mesh, up to which a point is on it: rounding of float64.
ON_PLANE = 1e-10

#: Rounding of the distances of hits, relative and in radii.
LOOSE = 1e-5

_CONE, _CONE_SINE = math.cos(SPHERE_CONE), math.sin(SPHERE_CONE)
#: Least cosine between m and the normal of a plane that a sphere touches within the cone.
_FACING = math.cos(2.0 * SPHERE_CONE)


class InscribedSpheres:
    """Finder of inscribed spheres. Any number of threads may ask at once.

    Parameters
    ----------
    surface : PreparedMesh
    """

    def __init__(self, surface: PreparedMesh) -> None:
        self._planes = surface.planes
        self._corners = surface.corners
        self._sides = _sides(surface.corners, surface.planes[:, :3])
        self._middles = surface.corners.mean(axis=1)
        self._tree = _BoxTree.of(surface)
        self._slack = LARGE_SLACK if len(surface.corners) > LARGE else 0.0

    def diameters(self, points: Points, radius: Array) -> Array:
        """(k,): diameters in radii of the mesh; no sphere is larger than with `radius` (k,), its first one."""
        radius = radius.copy()
        self._descend(points, np.arange(len(points)), np.zeros(len(points), dtype=np.int64), 0, radius)
        return 2.0 * radius

    def _descend(self, points: Points, pair: Integers, parent: Integers, level: int, radius: Array) -> None:
        """Shrink spheres by the bounding boxes of one tree level, for pairs of a point and a box."""
        boxes = self._tree.levels[level]
        most = MOST_PAIRS // boxes.width
        if len(pair) > most:
            for begin in range(0, len(pair), most):
                part = slice(begin, begin + most)
                self._descend(points, pair[part], parent[part], level, radius)
            return
        pair, node = boxes.touched(pair, parent, points, (1.0 - self._slack) * radius)
        if level + 1 == len(self._tree.levels):
            self._touch(points, pair, self._tree.order[node], radius)
            return
        if level >= NARROWING:
            self._narrow(points, pair, boxes.sample[node], radius)
        self._descend(points, pair, node, level + 1, radius)

    def _narrow(self, points: Points, pair: Integers, face: Integers, radius: Array) -> None:
        """Shrink spheres by the centers of faces, for pairs of a point and a face."""
        away = self._middles.take(face, axis=0)
        away -= points.start.take(pair, axis=0)
        along = -_dot(away, points.normal.take(pair, axis=0))
        square = _dot(away, away)
        counts = np.flatnonzero(
            (along * along > _CONE * _CONE * square) & (along > 0) & (face != points.face.take(pair))
        )
        np.minimum.at(radius, pair.take(counts), (0.5 * (1.0 + LOOSE)) * square.take(counts) / along.take(counts))

    def _touch(self, points: Points, pair: Integers, face: Integers, radius: Array) -> None:
        """Shrink the sphere of each pair of a point and a face until it touches the face, if it reaches it."""
        other = face != points.face.take(pair)
        pair, face = pair[other], face[other]
        point, inward = points.start.take(pair, axis=0), -points.normal.take(pair, axis=0)
        plane = self._planes.take(face, axis=0)
        height, facing = plane[:, 3] - _dot(plane, point), _dot(plane, inward)
        side = np.where(height < -ON_PLANE, -1.0, 1.0)
        touching, touch = _on_plane(side[:, None] * plane[:, :3], np.abs(height), side * facing, inward)
        # Where the sphere that touches the plane is too large, a smaller one touches no part of the face.
        kept = np.flatnonzero(touching < radius[pair])
        pair, face, point, inward = pair[kept], face[kept], point[kept], inward[kept]
        found = touching[kept]
        sides, touched = self._sides.take(face, axis=0), point + touch[kept]
        a, b, c = (_dot(sides[:, i], touched) > sides[:, i, 3] for i in range(3))
        outside = np.flatnonzero(~(a & b & c))
        corners = self._corners.take(face[outside], axis=0) - point[outside, None]
        found[outside] = _smallest(corners, inward[outside])
        np.minimum.at(radius, pair, found)

    def first(self, points: Points, directions: Floats, distance: Array, face: npt.NDArray[np.int32]) -> Array:
        """(k,): radii that no inscribed sphere exceeds, from the hits of rays along `directions` (3, k, r)
        at a `distance` (k, r), on faces (k, r); 1 where they hit nothing.
        """
        n = points.normal[..., None]
        along = -(n[:, 0] * directions[0] + n[:, 1] * directions[1] + n[:, 2] * directions[2])
        counts = (face >= 0) & (face != points.face[:, None]) & (distance > 0)
        # Rays lie in the cone around the normal, so that no cosine is near 0.
        radius = np.where(counts, 0.5 * distance / along, 1.0).min(axis=1)
        return np.asarray(np.minimum((1.0 + LOOSE) * radius + LOOSE, 1.0))


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Bounding boxes and bounding planes of groups of neighboring faces.

    Attributes
    ----------
    low, high : (3, parents, width) float64
        Those of the last parent that are none are far away.
    normal : (3, parents, width) float64
        About that of the faces.
    offset : (parents, width) float64
        Least normal . x in a box.
    sample : (n,) int64
        A face in each.
    """

    low: Array
    high: Array
    normal: Array
    offset: Array
    sample: Integers

    @classmethod
    def of(cls, corners: Array, normals: Array, order: Integers, size: int, width: int) -> _Boxes:
        """Boxes of `size` faces each; corners (m, 3, 3) and normals (m, 3) are in this order of the faces."""
        starts = np.arange(0, len(corners), size)
        normal = np.add.reduceat(normals, starts)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.where(length > 0, length, 1.0)
        along = (corners * np.repeat(normal, size, axis=0)[: len(corners), None]).sum(axis=2)
        low, high = np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts)
        offset = np.minimum.reduceat(along.min(axis=1), starts)
        sample = order[np.minimum(starts + size // 2, len(order) - 1)]
        wide = [_in_parents(values, width) for values in (low.T, high.T, normal.T, offset)]
        return cls(wide[0], wide[1], wide[2], wide[3], sample)

    @property
    def width(self) -> int:
        """Number of boxes in each one of the level above."""
        return int(self.offset.shape[1])

    def touched(self, pair: Integers, parent: Integers, points: Points, radius: Array) -> tuple[Integers, Integers]:
        """Pairs of a point and a box that the sphere of `radius` there may touch."""
        start, normal, reach = points.start.take(pair, axis=0), points.normal.take(pair, axis=0), radius.take(pair)
        reach = reach[:, None]
        center = start - reach * normal
        away, across = np.zeros((len(pair), self.width)), self.offset.take(parent, axis=0)
        for axis in range(3):
            here = center[:, axis, None]
            across -= here * self.normal[axis].take(parent, axis=0)
            beside = np.maximum(self.low[axis].take(parent, axis=0) - here, here - self.high[axis].take(parent, axis=0))
            np.maximum(beside, 0.0, out=beside)
            beside *= beside
            away += beside
        near = np.flatnonzero((away < reach * reach) & (across < reach))
        row = near // self.width
        return pair[row], parent[row] * self.width + near % self.width


def _in_parents(values: Array, width: int) -> Array:
    """(..., parents, width) of values (..., n)."""
    missing = -values.shape[-1] % width
    filled = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)], constant_values=FAR)
    return np.ascontiguousarray(filled.reshape(*values.shape[:-1], -1, width))


@dataclass(frozen=True, eq=False)
class _BoxTree:
    """Tree of boxes: each has `CHILDREN` of the next level.

    Attributes
    ----------
    order : (m,) int64
        Faces along the curve.
    levels : tuple of _Boxes
        Those of single faces are the last.
    """

    order: Integers
    levels: tuple[_Boxes, ...]

    @classmethod
    def of(cls, surface: PreparedMesh) -> _BoxTree:
        """Tree of the faces of a surface."""
        corners = surface.corners
        order = curve_order(*(end.astype(np.float32) for end in (corners.min(axis=1), corners.max(axis=1))))
        corners, normals = corners[order], surface.planes[order, :3]
        sizes = [1]
        while -(-len(order) // sizes[-1]) > TOP:
            sizes.append(sizes[-1] * CHILDREN)
        widths = [CHILDREN] * (len(sizes) - 1) + [-(-len(order) // sizes[-1])]
        levels = [_Boxes.of(corners, normals, order, *shape) for shape in zip(sizes, widths, strict=True)]
        return cls(order, tuple(reversed(levels)))


def _on_plane(normal: Array, height: Array, facing: Array, inward: Array) -> tuple[Array, Array]:
    """Radii (n,) of the smallest spheres at the origin that touch planes within the cone, inf where none, and where (n,
    3) they do.

    The planes lie at a `height` along their normals, whose cosines to `inward` are `facing`.
    """
    across = np.sqrt(np.maximum(1.0 - facing * facing, 0.0))
    # Of normals too far from m it is the edge of the cone that touches the plane first.
    beside = facing < _FACING
    toward = facing * _CONE + across * _CONE_SINE
    slope = np.where(beside, 2.0 * _CONE * toward, 1.0 + facing)
    touches = slope > 1e-9
    radius = np.where(touches, height / np.where(touches, slope, 1.0), np.inf)
    finite = np.where(touches, radius, 0.0)
    aside = (normal - facing[:, None] * inward) / np.maximum(across, 1e-12)[:, None]
    rim = 2.0 * _CONE * (_CONE * inward + _CONE_SINE * aside)
    return radius, finite[:, None] * np.where(beside[:, None], rim, inward + normal)


def _smallest(corners: Array, inward: Array) -> Array:
    """(n,): radii of the smallest spheres at the origin that touch edges of triangles (n, 3, 3) within the cone; inf
    where none.
    """
    least = np.full(len(corners), np.inf)
    for i in range(3):
        np.minimum(least, _on_edge(corners[:, i], corners[:, (i + 1) % 3] - corners[:, i], inward), out=least)
    return least


def _sides(corners: Array, normals: Array) -> Array:
    """(m, 3, 4): normals and offsets of the planes through the sides of triangles, which look inwards."""
    along = np.roll(corners, -1, axis=1) - corners
    inward = np.cross(normals[:, None], along)
    return np.concatenate([inward, (inward * corners).sum(axis=2, keepdims=True)], axis=2)


def _on_edge(start: Array, along: Array, inward: Array) -> Array:
    """(n,): as `_smallest`, of the edges from `start` to `start + along`.

    At start + t along, s = a + b t and |q|^2 = d + 2 e t + f t^2. Of this quotient the derivative is 0 where
    s^2 = a^2 + b (d b - 2 a e) / f.
    """
    a, b = _dot(start, inward), _dot(along, inward)
    d, e, f = _dot(start, start), _dot(start, along), _dot(along, along)
    with np.errstate(all="ignore"):
        # s at the minimum, as a square.
        best = np.sqrt(np.maximum(a * a + b * (d * b - 2.0 * e * a) / f, 0.0))
        t = np.where(a > 0, (d * b - 2.0 * e * a) / (f * (best + a)), (best - a) / b)
        # Within the cone: (a + b t)^2 >= cos^2 (d + 2 e t + f t^2), a + b t > 0.
        square = _CONE * _CONE
        u, v, w = b * b - square * f, a * b - square * e, a * a - square * d
        root = v * v - u * w
        low, high = _interval(u, v, w, np.sqrt(np.maximum(root, 0.0)), a, b)
        t = np.clip(np.clip(t, np.maximum(low, 0.0), np.minimum(high, 1.0)), 0.0, 1.0)
        s = a + b * t
        empty = (np.maximum(low, 0.0) > np.minimum(high, 1.0)) | ((root < 0) & (u < 0)) | ~(s > 0)
        return np.where(empty, np.inf, 0.5 * (d + t * (2.0 * e + f * t)) / np.where(empty, 1.0, s))


def _interval(u: Array, v: Array, w: Array, root: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Interval of t with u t^2 + 2 v t + w >= 0 and a + b t > 0."""
    q = -(v + np.where(v < 0, -root, root))
    one, two = q / u, np.where(q != 0, w / np.where(q != 0, q, 1.0), np.inf)
    low, high = np.minimum(one, two), np.maximum(one, two)
    # u < 0: between the roots. u > 0: beyond one of them, on the side where s grows.
    closed = u < 0
    return (
        np.where(closed, low, np.where(b > 0, high, -np.inf)),
        np.where(closed, high, np.where(b > 0, np.inf, low)),
    )


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
