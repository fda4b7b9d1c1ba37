"""Smooth normals: faces that meet at a small angle share one at a corner, whatever their texture coordinates."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.geometry.grouping import position_ids

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Faces that meet at a larger angle have an edge between them; modelling tools offer 30 to 60 degrees.
CREASE = math.radians(40.0)


def corner_angles(corners: Array) -> Array:
    """(m, 3): angles in radians at the corners (m, 3, 3) of triangles."""
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=2), (a * b).sum(axis=2)))


def corner_normals(vertices: Array, faces: npt.NDArray[np.integer], normals: Array, crease: float = CREASE) -> Array:
    """(m, 3, 3): unit normals at the corners of faces (m, 3).

    At a vertex, faces that are linked by edges with an angle below `crease` have the mean of their normals, weighted
    by their angles there. Both sides of a seam in UV have the same, for only positions count.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int
    normals : (m, 3) float64
        Of the faces, of unit length.
    crease : float
        In radians; 0 gives every face its own normal.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = _smooth_links(position_ids(vertices)[faces], normals, crease)
    count = 3 * len(faces)
    graph = coo_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(count, count))
    groups, label = connected_components(graph, directed=False)
    weighted = (normals[:, None] * corner_angles(vertices[faces])[..., None]).reshape(-1, 3)
    summed = np.stack([np.bincount(label, weights=axis, minlength=groups) for axis in weighted.T], axis=1)
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    smooth = summed / np.where(length > 0, length, 1.0)
    return np.asarray(np.where(length > 0, smooth, 0.0)[label].reshape(-1, 3, 3))


def _smooth_links(index: Integers, normals: Array, crease: float) -> tuple[Integers, Integers]:
    """Pairs of corners (numbered 3 face + corner) at one position, of faces that meet at less than `crease`."""
    corner = np.arange(index.size)
    after = corner + np.where(corner % 3 == 2, -2, 1)
    start, end = index.ravel(), index.ravel()[after]
    key = np.minimum(start, end) * (int(index.max()) + 1) + np.maximum(start, end)
    _, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    one, other = order[(uses[edge.ravel()] == 2)[order]].reshape(-1, 2).T
    smooth = (normals[one // 3] * normals[other // 3]).sum(axis=1) > math.cos(crease)
    one, other = one[smooth], other[smooth]
    # Neighbors usually run along their edge in opposite directions; those that do not are linked all the same.
    same = start[one] == start[other]
    begins, ends = np.where(same, other, after[other]), np.where(same, after[other], other)
    return np.concatenate([one, after[one]]), np.concatenate([begins, ends])
