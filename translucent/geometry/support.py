"""Support functions of meshes: their exact extent in any direction, from a few of their vertices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Mask
from translucent.geometry.grouping import use_mask
from translucent.geometry.mesh import Mesh

#: Vertices from which on a mesh is divided into clusters.
_MANY = 1 << 14

#: Cells along each side of its bounds that make these, for the cube root of the number of vertices; and the most, whose
#: numbers have 16 bits.
_CELLS, _MOST_CELLS = 0.25, 31

#: Functions (k,) of points: (n, 3) to (n, k).
Values = Callable[[Array], Array]


class _Clusters:
    """Vertices of a mesh by the cells of a grid in which they lie.

    Attributes
    ----------
    order : (n,) int32
        Numbers of all vertices, one cluster after the other.
    starts : (m + 1,) int64
        Place in it at which each cluster begins, and its end.
    corners : (8, m, 3) float64
        Of the bounds of each.
    whole : bool
        Faces use every vertex.
    """

    def __init__(self, mesh: Mesh) -> None:
        vertices = mesh.vertices
        self.whole = bool(use_mask(mesh.faces, len(vertices)).all())
        low, high = (np.array([bound(side) for side in vertices.T]) for bound in (np.min, np.max))
        side = min(int(_CELLS * np.cbrt(len(vertices))), _MOST_CELLS)
        scale = side / np.where(high > low, high - low, 1.0)
        cell = np.zeros(len(vertices), np.int16)
        for axis in range(3):
            place = ((vertices[:, axis] - low[axis]) * scale[axis]).astype(np.int16)
            cell = cell * np.int16(side) + np.minimum(place, np.int16(side - 1))
        self.order = np.argsort(cell, kind="stable").astype(np.int32)  # which counts 16 bits, in linear time
        counts = np.bincount(cell, minlength=side**3)
        self.starts = np.concatenate([[0], np.cumsum(counts[counts > 0])])
        bounds = np.empty((2, len(self.starts) - 1, 3))
        for axis in range(3):
            ordered = vertices[self.order, axis]
            bounds[:, :, axis] = [bound.reduceat(ordered, self.starts[:-1]) for bound in (np.minimum, np.maximum)]
        self.corners = np.stack([bounds[[i & 1, i >> 1 & 1, i >> 2], :, range(3)].T for i in range(8)])

    def members(self, which: Mask) -> npt.NDArray[np.int32]:
        """Numbers of the vertices of these clusters (m,), m at least 1."""
        numbers = np.flatnonzero(which)
        ends = zip(self.starts[numbers].tolist(), self.starts[numbers + 1].tolist(), strict=True)
        return np.concatenate([self.order[start:end] for start, end in ends])


_CLUSTERS: WeakKeyDictionary[Mesh, _Clusters] = WeakKeyDictionary()


class Support:
    """Vertices of a placed mesh, for the largest values of functions over them.

    Parameters
    ----------
    mesh : Mesh
    matrix : (4, 4) float64
        Mesh to world.
    """

    def __init__(self, mesh: Mesh, matrix: Array) -> None:
        self._mesh, self._matrix = mesh, matrix
        self.many = len(mesh.vertices) >= _MANY
        if self.many and mesh not in _CLUSTERS:
            _CLUSTERS[mesh] = _Clusters(mesh)

    @cached_property
    def points(self) -> Array:
        """(n, 3): all vertices in the world."""
        return self._placed(self._mesh.vertices)

    @property
    def count(self) -> int:
        """Approximate number of points at which functions are evaluated."""
        return _CLUSTERS[self._mesh].corners[..., 0].size if self.many else len(self._mesh.vertices)

    @cached_property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest world coordinates."""
        both = self.largest(lambda points: np.concatenate([-points, points], axis=1))
        return np.stack([-both[:3], both[3:]])

    @property
    def whole(self) -> bool:
        """True if faces use every vertex of a mesh that has clusters."""
        return self.many and _CLUSTERS[self._mesh].whole

    def farthest(self, directions: Array) -> Array:
        """(n, 3): world vertices that are farthest along these directions (k, 3); all vertices if there are few."""
        if not self.many:
            return self.points
        vertices, clusters, found = self._mesh.vertices, _CLUSTERS[self._mesh], []
        for along in directions @ self._matrix[:3, :3]:
            reach = (clusters.corners @ along).max(axis=0)
            best = np.arange(len(reach)) == reach.argmax()  # it has the farthest vertex, or one that is nearly as far
            least = (vertices[clusters.members(best)] @ along).max()
            members = clusters.members(best | (reach > least))
            found.append(members[(vertices[members] @ along).argmax()])
        return self._placed(vertices[found])

    def largest(self, values: Values) -> Array:
        """(k,): largest values over all vertices of functions that, on any box, are largest at one of its corners.

        Linear functions are such, and perspective projections of what is before the eye.
        """
        if not self.many:
            return np.asarray(values(self.points).max(axis=0))
        # One vertex of each cluster bounds the largest value from below. Of no cluster it is larger than its
        # bounds, but for rounding: where none seems to reach it, the vertices have it.
        least = values(self._first).T.max(axis=1)
        most = values(self._corners).T.reshape(len(least), 8, -1).max(axis=1)
        if not (reaching := (most >= least[:, None]).any(axis=0)).any():
            return np.asarray(least)
        found = values(self._placed(self._mesh.vertices[_CLUSTERS[self._mesh].members(reaching)]))
        return np.asarray(np.maximum(found.T.max(axis=1), least))

    @cached_property
    def _first(self) -> Array:
        """(m, 3): a vertex of each cluster in the world."""
        clusters = _CLUSTERS[self._mesh]
        return self._placed(self._mesh.vertices[clusters.order[clusters.starts[:-1]]])

    @cached_property
    def _corners(self) -> Array:
        """(8 m, 3): corners of the bounds of all clusters in the world."""
        return self._placed(_CLUSTERS[self._mesh].corners.reshape(-1, 3))

    def _placed(self, vertices: Array) -> Array:
        return np.asarray(vertices @ self._matrix[:3, :3].T + self._matrix[:3, 3])


def largest_of(supports: Sequence[Support], values: Values) -> Array:
    """(k,): largest values over several meshes; see `Support.largest`."""
    few = [support.points for support in supports if not support.many]
    found = [support.largest(values) for support in supports if support.many]
    if few:
        found.append(values(np.concatenate(few)).max(axis=0))
    return np.asarray(np.max(found, axis=0))
