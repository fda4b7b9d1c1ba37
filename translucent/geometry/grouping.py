"""Grouping of equal elements of a mesh: vertices at one position, edges that several faces share.

Sorting whole rows at once, as `numpy.unique` does, takes ten times as long and holds the interpreter's lock meanwhile,
which is felt with millions of faces while a window is open.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Integers


@dataclass(frozen=True)
class Groups:
    """Groups of equal elements.

    Attributes
    ----------
    of : (n,) int64
        Number of each one's group, from 0.
    first : (k,) int64
        The first thing of each group.
    """

    of: Integers
    first: Integers

    @cached_property
    def sizes(self) -> Integers:
        """(k,): number of elements in each group."""
        return np.bincount(self.of, minlength=len(self.first))


def equal_rows(rows: npt.NDArray[Any]) -> Groups:
    """Group the equal rows of an (n, k) array. -0.0 equals 0.0, and what is not a number equals itself."""
    if np.issubdtype(rows.dtype, np.floating):
        rows = (rows.astype(np.float64) + 0.0).view(np.int64)
    # Stable: of equal rows the first comes first.
    order = np.lexsort(rows.T)
    return _groups(order, (rows[order[1:]] != rows[order[:-1]]).any(axis=1))


def position_ids(vertices: npt.NDArray[np.float64]) -> Integers:
    """Position id of each vertex: the first index of all vertices at exactly the same position."""
    groups = equal_rows(vertices)
    return groups.first[groups.of]


def shared_edges(faces: npt.NDArray[np.integer]) -> Groups:
    """Group the sides of faces (m, 3) that join the same two vertices.

    Side 3 f + i is that of face f from its corner i to the next one.
    """
    start, end = side_ends(faces)
    key = np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    return _groups(order, np.diff(key[order]) != 0)


def side_ends(faces: npt.NDArray[np.integer]) -> tuple[Integers, Integers]:
    """(3 m,): vertices where the sides of faces (m, 3) start and end."""
    return faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)


def used_vertices(faces: npt.NDArray[np.integer]) -> Integers:
    """Numbers of the vertices that faces use, in order."""
    used = np.zeros(int(faces.max(initial=-1)) + 1, dtype=bool)
    used[faces] = True
    return np.flatnonzero(used)


def _groups(order: npt.NDArray[np.intp], changes: npt.NDArray[np.bool_]) -> Groups:
    """Groups of sorted elements, from where the next element differs."""
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = changes
    of = np.empty(len(order), dtype=np.int64)
    of[order] = np.cumsum(begins) - 1
    return Groups(of, order[begins].astype(np.int64))
