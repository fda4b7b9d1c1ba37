"""Projection from a low-poly to a high-poly mesh: points of the detailed mesh for the texels of the simple one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bake.surface import Points, Surface, blend
from translucent.bake.unwrap import Unwrapped
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh

#: Default distance on either side of the low mesh within which the high one is searched, as a share of the diagonal.
SEARCH = 0.02


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of points of a low-poly mesh to a high-poly one, along its smooth normals or from a cage.

    Attributes
    ----------
    low, high : Surface
    cage : (m, 3, 3) float64 or None
        Corners of the cage's faces in metres, one for each face of `low`.
    distance : float
        In metres, to either side, where there is no cage.
    """

    low: Surface
    high: Surface
    cage: Array | None
    distance: float

    @classmethod
    def of(
        cls, low: Surface, unwrapped: Unwrapped, high: Surface, given: Mesh, cage: Mesh | None, distance: float | None
    ) -> Projection:
        """For a `given` mesh that was `unwrapped`.

        Raises
        ------
        InputError
            If the cage has not the vertices and faces of the given mesh.
        """
        corners = None
        if cage is not None:
            if len(cage.vertices) != len(given.vertices) or len(cage.faces) != len(given.faces):
                raise InputError(
                    f"cage {cage.name!r}",
                    f"{len(cage.vertices)} vertices and {len(cage.faces)} faces, but mesh {given.name!r} has "
                    f"{len(given.vertices)} and {len(given.faces)}",
                    "make the cage by moving the mesh's vertices outwards",
                )
            corners = cage.vertices[unwrapped.vertex][unwrapped.mesh.faces[low.faces]]
        return cls(low, high, corners, SEARCH * given.diagonal if distance is None else distance)

    def points(self, points: Points, barycentric: Array) -> tuple[Points, npt.NDArray[np.bool_]]:
        """Points on the high mesh for those of the low one, and (k,) where one was found; only these are returned.

        Parameters
        ----------
        points : Points
            Of the low mesh (k).
        barycentric : (k, 3) float64
            Where they are on their faces.
        """
        middle = points.exact * self.low.radius + self.low.embree.center
        if self.cage is None:
            begin = middle + self.distance * points.normal
            along, reach = -points.normal, np.full(len(points), 2.0 * self.distance)
        else:
            begin = blend(self.cage[points.face], barycentric)
            along = middle - begin
            length = np.sqrt((along**2).sum(axis=1))
            along = along / np.where(length > 0, length, 1.0)[:, None]
            reach = 2.0 * length
        return self._meet(begin, along, reach)

    def _meet(self, begin: Array, along: Array, reach: Array) -> tuple[Points, npt.NDArray[np.bool_]]:
        """First points of the high mesh on rays in metres, from outside and within `reach`."""
        high = self.high
        origin = (begin - high.embree.center) / high.radius
        face, _ = high.embree.first_hits(origin, along)
        plane = high.planes[np.maximum(face, 0)]
        normal = plane[:, :3]
        cosine = (normal * along).sum(axis=1)
        facing = (face >= 0) & (cosine < 0)
        distance = (plane[:, 3] - (normal * origin).sum(axis=1)) / np.where(facing, cosine, 1.0)
        found = facing & (distance >= 0) & (distance * high.radius <= reach)
        face, point = face[found], (origin + distance[:, None] * along)[found]
        return high.points(face, _barycentric(high.corners[face], point)), found


def _barycentric(corners: Array, point: Array) -> Array:
    """(k, 3): weights of points on the planes of triangles, moved into them where rounding has led them out."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    areas = [np.cross(q - p, point - p) for p, q in ((b, c), (c, a), (a, b))]
    weights = np.stack([np.maximum((area * normal).sum(axis=1), 0.0) for area in areas], axis=1)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
