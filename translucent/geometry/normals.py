"""Normals for shading: smooth over curved parts of a mesh, and broken at its creases."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.geometry.grouping import equal_rows
from translucent.geometry.mesh import Mesh

#: Smallest angle between the faces of a crease, in radians; modeling tools offer 30 to 60 degrees.
CREASE = math.radians(40.0)


def corner_normals(mesh: Mesh) -> Array:
    """(m, 3, 3): a unit normal for each corner of each face, see `smooth_normals`; 0 where a face has no area."""
    return smooth_normals(mesh.vertices, mesh.faces, mesh.face_normals)


def smooth_normals(vertices: Array, faces: npt.NDArray[np.integer], normals: Array) -> Array:
    """(m, 3, 3): a unit normal for each corner of faces (m, 3).

    The mean of the normals of those faces at the vertex that are joined to this one over edges that are no creases,
    weighted by their angle at the vertex (Thuermer & Wuethrich 1998). Vertices in one place count as one: seams of
    texture coordinates are no creases.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int
    normals : (m, 3) float64
        Of the faces, of unit length; 0 of those without area.
    """
    corner_group = _smooth_groups(equal_rows(vertices).of[faces], normals)
    weighted = normals[:, None] * corner_angles(vertices[faces])[..., None]
    smooth = np.empty_like(weighted)
    for axis in range(3):
        smooth[..., axis] = np.bincount(corner_group.ravel(), weighted[..., axis].ravel())[corner_group]
    length = np.linalg.norm(smooth, axis=2, keepdims=True)
    return np.where(length > 1e-12, smooth / np.where(length > 1e-12, length, 1.0), normals[:, None])


def corner_angles(corners: Array) -> Array:
    """(m, 3): angles in radians at the corners (m, 3, 3) of triangles."""
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=2), (a * b).sum(axis=2)))


#: Cached normals of meshes that have been drawn, or are about to be.
_drawn: WeakKeyDictionary[Mesh, npt.NDArray[np.float32]] = WeakKeyDictionary()


def drawn_normals(mesh: Mesh) -> npt.NDArray[np.float32]:
    """`corner_normals` in the precision of the GPU: made once for each mesh, in a second for a million."""
    if mesh not in _drawn:
        keep_drawn_normals(mesh, corner_normals(mesh))
    return _drawn[mesh]


def keep_drawn_normals(mesh: Mesh, normals: npt.NDArray[np.floating]) -> None:
    """Cache these `drawn_normals`, which have been made elsewhere."""
    with np.errstate(under="ignore"):
        _drawn[mesh] = normals.astype(np.float32, copy=False)


def has_drawn_normals(mesh: Mesh) -> bool:
    """Whether `drawn_normals` have been made."""
    return mesh in _drawn


def _smooth_groups(faces: Integers, normals: Array) -> Integers:
    """(m, 3): number of each corner's group: the corners at its vertex that smooth edges join to it."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    start, end = faces, np.roll(faces, -1, axis=1)
    low, high = np.minimum(start, end).ravel(), np.maximum(start, end).ravel()
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    one, other = order[:-1][same], order[1:][same]  # edges as 3 face + number of their first corner
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[other // 3]) >= math.cos(CREASE)
    one, other = one[smooth], other[smooth]
    follows = np.arange(3 * count).reshape(count, 3)
    following = np.roll(follows, -1, axis=1).ravel()
    # An edge joins its two corners of one face to those of the other at the same vertices.
    corner = faces.ravel()
    alike = corner[one] == corner[other]
    first = np.concatenate([one, following[one]])
    second = np.concatenate([np.where(alike, other, following[other]), np.where(alike, following[other], other)])
    graph = coo_matrix((np.ones(len(first), dtype=bool), (first, second)), shape=(3 * count, 3 * count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64).reshape(count, 3)
