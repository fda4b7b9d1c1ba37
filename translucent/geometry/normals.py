"""Normals for shading: smooth over curved parts of a mesh, and broken at its creases."""

from __future__ import annotations

import math
from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.geometry.grouping import connected, equal_rows, sorted_sides
from translucent.geometry.mesh import Mesh, unit_normals

#: Smallest angle between the faces of a crease, in radians; modeling tools offer 30 to 60 degrees.
CREASE = math.radians(40.0)


#: Faces that are handled at a time, so that little memory is taken meanwhile.
BLOCK = 1 << 15


def corner_normals(mesh: Mesh) -> Array:
    """(m, 3, 3): a unit normal for each corner of each face, see `smooth_normals`; 0 where a face has no area."""
    return smooth_normals(mesh.vertices, mesh.faces, unit_normals(mesh.vertices, mesh.faces))


def vertex_normals(mesh: Mesh) -> Array:
    """(n, 3): sums of the `corner_normals` at each vertex, across creases; 0 where no face uses it."""
    corners, at_corners = mesh.faces.ravel(), corner_normals(mesh).reshape(-1, 3)
    sums = (np.bincount(corners, at_corners[:, axis], len(mesh.vertices)) for axis in range(3))
    return np.stack(tuple(sums), axis=1)


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
    found = np.empty((*faces.shape, 3))
    _fill(found, vertices, faces, normals)
    return found


def _fill(found: npt.NDArray[np.floating], vertices: Array, faces: npt.NDArray[np.integer], normals: Array) -> None:
    """Write `smooth_normals` into an array of any precision."""
    group = _smooth_groups(equal_rows(vertices).of.astype(np.int32)[faces], normals)
    sums = np.zeros((3, int(group.max()) + 1))
    for block in _blocks(len(faces)):
        angles = corner_angles(vertices.take(faces[block], axis=0))
        for axis in range(3):
            np.add.at(sums[axis], group[block].ravel(), (normals[block, axis, None] * angles).ravel())
    with np.errstate(under="ignore"):
        for block in _blocks(len(faces)):
            x, y, z = smooth = sums.take(group[block], axis=1)
            length = np.sqrt(x * x + y * y + z * z)
            usable = length > 1e-12
            divisor = np.where(usable, length, 1.0)
            for axis in range(3):
                found[block, :, axis] = np.where(usable, smooth[axis] / divisor, normals[block, axis, None])


def _blocks(count: int) -> Iterator[slice]:
    """Slices of `count` faces in blocks of `BLOCK`."""
    return (slice(begin, begin + BLOCK) for begin in range(0, count, BLOCK))


def corner_angles(corners: Array) -> Array:
    """(m, 3): angles in radians at the corners (m, 3, 3) of triangles."""
    place = np.ascontiguousarray(corners.T)  # (axis, corner, face): long rows, which NumPy computes faster
    angles = np.empty(corners.shape[:2])
    for i in range(3):
        a, b = place[:, (i + 1) % 3] - place[:, i], place[:, i - 1] - place[:, i]
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        angles[:, i] = np.arctan2(np.sqrt(x * x + y * y + z * z), cosine)
    return angles


#: Cached normals of meshes that have been drawn, or are about to be.
_drawn: WeakKeyDictionary[Mesh, npt.NDArray[np.float32]] = WeakKeyDictionary()


def drawn_normals(mesh: Mesh) -> npt.NDArray[np.float32]:
    """`corner_normals` in the precision of the GPU: made once for each mesh, in a second for a million."""
    if mesh not in _drawn:
        keep_drawn_normals(mesh, made_normals(mesh))
    return _drawn[mesh]


def made_normals(mesh: Mesh) -> npt.NDArray[np.float32]:
    """`corner_normals` in the precision of the GPU."""
    found = np.empty((*mesh.faces.shape, 3), np.float32)
    _fill(found, mesh.vertices, mesh.faces, unit_normals(mesh.vertices, mesh.faces))
    return found


def keep_drawn_normals(mesh: Mesh, normals: npt.NDArray[np.floating]) -> None:
    """Cache these `drawn_normals`, which have been made elsewhere."""
    with np.errstate(under="ignore"):
        _drawn[mesh] = normals.astype(np.float32, copy=False)


def has_drawn_normals(mesh: Mesh) -> bool:
    """True if `drawn_normals` have been made."""
    return mesh in _drawn


def _smooth_groups(faces: npt.NDArray[np.int32], normals: Array) -> npt.NDArray[np.int32]:
    """(m, 3): number of each corner's group: the corners at its vertex that smooth edges join to it."""
    sides = sorted_sides(faces)
    same = np.flatnonzero(sides.edge[1:] == sides.edge[:-1])
    sorted_ = sides.number.astype(np.int32)  # edges as 3 face + number of their first corner
    del sides
    one, other = sorted_[same], sorted_[same + 1]
    del same, sorted_
    smooth = np.empty(len(one), dtype=bool)
    for block in _blocks(len(one)):
        cosine = np.einsum("ij,ij->i", normals[one[block] // 3], normals[other[block] // 3])
        smooth[block] = cosine >= math.cos(CREASE)
    one, other = one[smooth], other[smooth]
    # An edge joins its two corners of one face to those of the other at the same vertices.
    corner = faces.ravel()
    alike = corner[one] == corner[other]
    behind, after = _following(one), _following(other)
    first = np.concatenate([one, behind])
    second = np.concatenate([np.where(alike, other, after), np.where(alike, after, other)])
    del one, other, behind, after, alike
    return np.asarray(connected(faces.size, first, second), np.int32).reshape(faces.shape)


def _following(corner: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """The next corner of the same face, of corners as 3 face + number."""
    return corner + np.where(corner % 3 == 2, np.int32(-2), np.int32(1))
