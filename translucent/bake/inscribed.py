"""The largest sphere inside a mesh that touches the surface at a point (mode "inscribed").

The sphere at p has its center c = p - r n on the inward normal, and r is the largest for which no point q of the
surface is inside:

    2 r(p) = min over q of |q - p|^2 / ((p - q) . n),  (p - q) . n > 0.

Rays give a first radius: where one along w ends at the distance d, 2 r <= d / cos(theta). From there the ball shrinks
(Ma, Bae and Choi 2012): the point of the surface that is nearest to the center gives the next radius, until none is
inside. It ends, too, where that point is seen from the center less than the crease angle away from p: then it belongs
to the smooth surface around p, each edge of whose tessellation would otherwise end the ball.
"""

from __future__ import annotations

import math

import numpy as np

from translucent.arrays import Array, Floats, Integers
from translucent.bake.surface import Points, Surface, blend
from translucent.bake.texels import closest
from translucent.geometry.normals import CREASE

#: Approximate number of points of the surface in the search tree, beyond one for each face, and how many of them are
#: tried around a center. The center of a round body is as far from all points, so that a search looks at every one.
TREE_POINTS, TRIED = 20_000, 6

#: Relative error of the distance in searches of larger trees, for the same reason.
LARGE_TREE, LARGE_TREE_ERROR = 50_000, 0.005

#: Largest number of rounds of shrinking, and the relative change of the radius at convergence.
ROUNDS, AT_REST = 32, 1e-7


class InscribedSpheres:
    """Finder of inscribed spheres. Any number of threads may ask at once.

    Parameters
    ----------
    surface : Surface
    """

    def __init__(self, surface: Surface) -> None:
        from scipy.spatial import cKDTree

        self._surface = surface
        corners, normals = surface.corners, surface.planes[:, :3]
        across = corners[:, 1] - corners[:, 0]
        across = across / np.linalg.norm(across, axis=1, keepdims=True)
        self._axes = np.stack([across, np.cross(normals, across)], axis=1)
        self._flat = np.stack([_flatten(self._axes, corners[:, i] - corners[:, 0]) for i in range(3)], axis=1)
        points, self._face = _spread(corners)
        self._tree = cKDTree(points)
        self._error = LARGE_TREE_ERROR if len(points) > LARGE_TREE else 0.0

    def diameters(self, points: Points, directions: Floats, distance: Array) -> Array:
        """(k,): diameters in radii of the mesh, from the `distance` (k, r) of rays along `directions` (3, k, r)."""
        n = points.normal[..., None]
        cosine = -(n[:, 0] * directions[0] + n[:, 1] * directions[1] + n[:, 2] * directions[2])
        # Rays lie in a cone around the normal, so that no cosine is near 0.
        radius = np.minimum((0.5 * distance / cosine).min(axis=1), 1.0)
        live = np.flatnonzero(radius > 0)
        for _ in range(ROUNDS):
            if not live.size:
                break
            smaller = self._shrunk(points.start[live], points.normal[live], radius[live])
            shrinks = smaller < radius[live] * (1.0 - AT_REST)
            radius[live] = smaller
            live = live[shrinks]
        return np.asarray(2.0 * radius)

    def _shrunk(self, point: Array, normal: Array, radius: Array) -> Array:
        """(k,): radii with which the balls touch what of the surface is found in them; as before where nothing is."""
        to_point = radius[:, None] * normal
        center = point - to_point
        _, found = self._tree.query(center, k=min(TRIED, self._tree.n), eps=self._error)
        touched, away = center, np.full(len(center), np.inf)
        for column in found.reshape(len(center), -1).T:
            face = self._face[column]
            corners = self._surface.corners[face]
            _, weights = closest(self._flat[face], _flatten(self._axes[face], center - corners[:, 0]))
            here = blend(corners, weights)
            square = _dot(here - center, here - center)
            touched = np.where((square < away)[:, None], here, touched)
            away = np.minimum(away, square)
        from_point, from_center = touched - point, touched - center
        below = -_dot(from_point, normal)
        beside = _dot(from_center, to_point) > math.cos(CREASE) * np.sqrt(away) * radius
        inside = (away < radius * radius) & (below > 0) & ~beside
        ratio = 0.5 * _dot(from_point, from_point) / np.where(inside, below, 1.0)
        return np.where(inside, np.minimum(radius, ratio), radius)


def _flatten(axes: Array, vectors: Array) -> Array:
    """(k, 2): vectors (k, 3) along two axes (k, 2, 3)."""
    return np.stack([_dot(axes[:, 0], vectors), _dot(axes[:, 1], vectors)], axis=1)


def _spread(corners: Array) -> tuple[Array, Integers]:
    """Points (n, 3) all over the faces (m, 3, 3), about as dense everywhere, and the face (n,) of each."""
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    longest = length.argmax(axis=1)
    order = (longest[:, None] + np.arange(3)) % 3
    start, end, tip = np.take_along_axis(corners, order[..., None], axis=1).transpose(1, 0, 2)
    base = length.max(axis=1)
    twice_area = np.linalg.norm(np.cross(end - start, tip - start), axis=1)
    spacing = math.sqrt(float(twice_area.sum()) / TREE_POINTS)
    along = np.ceil(base / spacing).astype(np.int64)
    count = along * np.ceil(twice_area / base / spacing).astype(np.int64)
    face = np.repeat(np.arange(len(corners)), count)
    number = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    u = (number % along[face] + 0.5) / along[face]
    v = (number // along[face] + 0.5) / (count // along)[face]
    level = start[face] + u[:, None] * (end - start)[face]
    return level + v[:, None] * (tip[face] - level), face


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
