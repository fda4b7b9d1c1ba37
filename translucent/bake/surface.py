"""Mesh prepared for baking: Embree's scene, exact planes of the faces, and smooth normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.geometry.embree import EmbreeMesh
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import smooth_normals
from translucent.geometry.winding import one_volume

#: Smallest distance of a ray's start from the edges of its triangle, as a share of its height: a ray that runs down an
#: adjacent wall would otherwise run in it.
INSET = 1e-3

#: Smallest area of a triangle, as a share of the squared diagonal, that float64 can tell from rounding.
NO_AREA = 1e-24


@dataclass(frozen=True, eq=False)
class Points:
    """Origins of rays: points of a surface, in the unit ball around it.

    Attributes
    ----------
    face : (k,) int64
    exact : (k, 3) float64
        The point itself; points on a seam are equal from both sides.
    start : (k, 3) float64
        The point, kept off the edges of its face.
    normal : (k, 3) float64
        Smooth, of unit length, outwards.
    """

    face: Integers
    exact: Array
    start: Array
    normal: Array

    def __len__(self) -> int:
        return len(self.face)

    def __getitem__(self, index: slice | Integers) -> Points:
        return Points(self.face[index], self.exact[index], self.start[index], self.normal[index])


@dataclass(frozen=True, eq=False)
class Surface:
    """Mesh data that rays and points need. Lengths are in the unit ball around it.

    Attributes
    ----------
    embree : EmbreeMesh
    faces : (m,) int64
        Indices of the mesh's faces that have an area; everywhere else a face is an index into this.
    corners : (m, 3, 3) float64
    planes : (m, 4) float64
        Unit normal and offset: n . p = w on the face.
    normals : (m, 3, 3) float64
        Smooth, at the corners.
    """

    embree: EmbreeMesh
    faces: Integers
    corners: Array
    planes: Array
    normals: Array

    @classmethod
    def of(cls, mesh: Mesh) -> Surface:
        """Prepare a mesh.

        Parameters
        ----------
        mesh : Mesh

        Raises
        ------
        InputError
            If the mesh is not finite, has no area, or all its faces look inwards.
        RenderError
            If embreex cannot be imported.
        """
        mesh.require_finite()
        # All faces of a mesh without a negative volume cannot look inwards, and to examine it takes longer.
        if one_volume(mesh.vertices, mesh.faces) < 0 and mesh.diagnosis.inverted:
            raise InputError(
                f"mesh {mesh.name!r}", "all its faces look inwards", "turn it (tl.load_mesh does), or export it again"
            )
        corners = ((mesh.vertices - mesh.center) / (0.5 * mesh.diagonal)).take(mesh.faces, axis=0)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        twice_area = np.sqrt(_dot(cross, cross))
        faces = np.flatnonzero(twice_area > NO_AREA)
        if not faces.size:
            raise InputError(f"mesh {mesh.name!r}", "no face has an area", "give a triangle mesh")
        corners, normals = corners[faces], cross[faces] / twice_area[faces, None]
        offset = _dot(normals, (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0)
        with_area = Mesh(mesh.vertices, mesh.faces[faces], name=mesh.name)
        return cls(
            EmbreeMesh(with_area),
            faces,
            corners,
            np.column_stack([normals, offset]),
            smooth_normals(mesh.vertices, mesh.faces[faces], normals),
        )

    @property
    def radius(self) -> float:
        """Metres per unit of length."""
        return self.embree.radius

    @cached_property
    def plane_columns(self) -> Array:
        """(4, m): `planes`, of which one number of each is taken at a time."""
        return np.ascontiguousarray(self.planes.T)

    def points(self, face: Integers, barycentric: Array) -> Points:
        """Points of faces (k,) with barycentric weights (k, 3)."""
        corners = np.take(self.corners, face, axis=0)
        exact = blend(corners, barycentric)
        start = exact.copy()
        least = np.minimum(np.minimum(barycentric[:, 0], barycentric[:, 1]), barycentric[:, 2])
        near = np.flatnonzero(least < INSET)
        start[near] = blend(corners[near], INSET + (1.0 - 3.0 * INSET) * barycentric[near])
        return Points(face, exact, start, self.smooth_normals(face, barycentric))

    def smooth_normals(self, face: Integers, barycentric: Array) -> Array:
        """(k, 3): unit normals; the face's own where the smooth one does not look to its outside."""
        smooth = blend(np.take(self.normals, face, axis=0), barycentric)
        own = np.take(self.planes, face, axis=0)[:, :3]
        # Much faster than reductions along an axis of three.
        length = np.sqrt(_dot(smooth, smooth))
        usable = _dot(smooth, own) > 1e-3 * length
        smooth /= np.where(usable, length, 1.0)[:, None]
        np.copyto(smooth, own, where=~usable[:, None])
        return smooth


def barycentric(corners: Array, point: Array) -> Array:
    """(k, 3): weights of points (k, 3) on the planes of triangles (k, 3, 3), moved into them where rounding led out."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    areas = [np.cross(q - p, point - p) for p, q in ((b, c), (c, a), (a, b))]
    weights = np.stack([np.maximum((area * normal).sum(axis=1), 0.0) for area in areas], axis=1)
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(weights / np.where(total > 0, total, 1.0))


def _dot(a: Array, b: Array) -> Array:
    """(k,): dot products of the rows of (k, 3) and (k, 3)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def blend(corners: Array, barycentric: Array) -> Array:
    """(k, 3): interpolation of (k, 3, 3) with barycentric weights (k, 3).

    Written out: sums of products over arrays may round according to where an element stands.
    """
    return np.asarray(
        corners[:, 0] * barycentric[:, :1] + corners[:, 1] * barycentric[:, 1:2] + corners[:, 2] * barycentric[:, 2:]
    )
