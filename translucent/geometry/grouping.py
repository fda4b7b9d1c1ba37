"""Grouping of equal elements of a mesh: vertices at one position, edges that several faces share.

All of it sorts single 64-bit integers, which NumPy does with vector instructions: a key above the index of the element,
so that one sort of values gives the order, too, and of equal elements the first comes first. Sorting rows, or indices
by their keys, takes five to fifty times as long.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask

Keys = npt.NDArray[np.uint64]

#: Indices that may be of 32 bits, which take half the time.
Numbers = npt.NDArray[np.signedinteger[Any]]

#: Odd multiplier that spreads the bits of a hash: 2^64 over the golden ratio (Knuth 1973, section 6.4).
_SPREAD = np.uint64(0x9E3779B97F4A7C15)

#: Elements that are compared at a time, so that what is made in between stays in the cache.
CHUNK = 1 << 13

#: Sides of faces that are sorted at a time: this takes 16 bytes for each, and as much again meanwhile.
BLOCK = 1 << 22


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


@dataclass(frozen=True)
class SortedSides:
    """Sides of faces, sorted by edge, and within an edge by number.

    Attributes
    ----------
    edge : (s,) uint64
        Key of each side's edge: its lower vertex times `vertices`, plus the higher one.
    side : (s,) uint64
        Its face times 8, plus the corner where it starts times 2, plus 1 if it runs from the lower vertex upwards.
    vertices : int
        More than the largest vertex.
    """

    edge: Keys
    side: Keys
    vertices: int

    @property
    def face(self) -> Integers:
        """(s,): face of each side."""
        return (self.side >> np.uint64(3)).view(np.int64)

    @property
    def number(self) -> Integers:
        """(s,): 3 times its face, plus the corner where it starts."""
        return 3 * self.face + ((self.side >> np.uint64(1)) & np.uint64(3)).view(np.int64)

    @cached_property
    def ascending(self) -> Mask:
        """(s,): whether it runs from the lower vertex to the higher one."""
        return (self.side & np.uint64(1)).astype(bool)

    @cached_property
    def begins(self) -> Integers:
        """(k,): where the sides of each edge begin, in ascending order of the edges' keys."""
        return _begins(self.edge[1:] != self.edge[:-1])

    @cached_property
    def sizes(self) -> Integers:
        """(k,): number of sides of each edge."""
        return np.diff(self.begins, append=len(self.edge))

    @property
    def paired(self) -> bool:
        """True if every edge has two sides, which run along it in opposite directions."""
        if len(self.edge) % 2:
            return False
        one, other = self.edge[::2], self.edge[1::2]
        alike = bool((one == other).all()) and bool((one[1:] != other[:-1]).all())
        return alike and bool((self.ascending[::2] != self.ascending[1::2]).all())

    def ends(self, edges: Integers) -> Integers:
        """(k, 2): lower and higher vertex of edges by their numbers."""
        lower, higher = np.divmod(self.edge[self.begins[edges]], np.uint64(self.vertices))
        return np.stack([lower, higher], axis=1).astype(np.int64)


def sorted_sides(faces: npt.NDArray[np.integer]) -> SortedSides:
    """Sort the sides of faces (m, 3) by the vertices that they join."""
    count = int(faces.max(initial=0)) + 1
    key = np.empty((3, len(faces)), dtype=np.uint64)
    side = np.empty((3, len(faces)), dtype=np.uint64)
    for begin in range(0, len(faces), CHUNK):
        part = slice(begin, begin + CHUNK)
        lower, higher, number = _sides(faces[part], begin)
        key[:, part], side[:, part] = lower * count + higher, number
    return SortedSides(*sorted_pairs(key.ravel(), side.ravel(), (count * count - 1).bit_length()), count)


def side_blocks(faces: npt.NDArray[np.integer], most: int = BLOCK) -> Iterator[SortedSides]:
    """Sort the sides of faces (m, 3) in blocks, each with all sides of some edges; those of an edge in any order.

    More than `most` are sorted about so many at a time, which takes less memory.
    """
    if 3 * len(faces) <= most:
        yield sorted_sides(faces)
        return
    count = int(faces.max()) + 1
    shift = max(count.bit_length() - 12, 0)
    sides = np.zeros((count >> shift) + 1, dtype=np.int64)
    for begin in range(0, len(faces), CHUNK):
        lower, _, _ = _sides(faces[begin : begin + CHUNK], begin)
        sides += np.bincount((lower >> shift).ravel(), minlength=len(sides))
    block = (np.cumsum(sides) - 1) // most
    for number in np.unique(block):
        mine = np.flatnonzero(block == number)
        yield _block(faces, int(mine[0]) << shift, (int(mine[-1]) + 1) << shift, int(sides[mine].sum()), count)


def _block(faces: npt.NDArray[np.integer], low: int, high: int, size: int, count: int) -> SortedSides:
    """Sort the `size` sides whose lower vertex is at least `low` and below `high`."""
    key, side = np.empty(size, dtype=np.uint64), np.empty(size, dtype=np.uint64)
    end = 0
    for begin in range(0, len(faces), CHUNK):
        lower, higher, number = _sides(faces[begin : begin + CHUNK], begin)
        mine = (lower >= low) & (lower < high)
        begun, end = end, end + int(np.count_nonzero(mine))
        key[begun:end] = (lower[mine] - low) * count + higher[mine]
        side[begun:end] = number[mine]
    place = np.arange(size, dtype=np.uint64)
    key, place = sorted_pairs(key, place, ((high - low) * count - 1).bit_length())
    key += np.uint64(low * count)
    return SortedSides(key, side.take(place.view(np.int64)), count)


def _sides(faces: npt.NDArray[np.integer], begin: int) -> tuple[Integers, Integers, Integers]:
    """(3, k): lower vertex, higher vertex and number, as in `SortedSides`, of the sides of faces from `begin` on."""
    start = faces.T.astype(np.int64)
    end = start[[1, 2, 0]]
    number = (np.arange(begin, begin + len(faces)) << 3) + np.array([[0], [2], [4]])
    return np.minimum(start, end), np.maximum(start, end), number + (start < end)


def sorted_pairs(key: Keys, tail: Keys, bits: int) -> tuple[Keys, Keys]:
    """Sort unique pairs by key, and by tail where keys are equal; works on its arguments.

    Parameters
    ----------
    key, tail : (n,) uint64
    bits : int
        That the keys have at most.
    """
    below = np.uint64(int(tail.max(initial=0)).bit_length())
    if bits + int(below) > 64:
        order = np.argsort(key)
        key = key[order]
        group = np.cumsum(np.concatenate([[False], key[1:] != key[:-1]])[: len(key)]).astype(np.uint64)
        tail = np.sort((group << below) | tail[order])
        return key, tail & ((np.uint64(1) << below) - np.uint64(1))
    key <<= below
    key |= tail
    key.sort()
    np.bitwise_and(key, (np.uint64(1) << below) - np.uint64(1), out=tail)
    key >>= below
    return key, tail


def equal_rows(rows: npt.NDArray[Any]) -> Groups:
    """Group the equal rows of an (n, k) array. -0.0 equals 0.0, and what is not a number equals itself."""
    if np.issubdtype(rows.dtype, np.floating):
        rows = (rows.astype(np.float64, copy=False) + 0.0).view(np.int64)
    below = len(rows).bit_length()
    index = np.arange(len(rows), dtype=np.uint64)
    key, index = sorted_pairs(_hashes(rows) >> np.uint64(below), index, 64 - below)
    order = index.view(np.int64)
    equal = key[1:] == key[:-1]
    differ = _differ(rows, order, equal)
    if differ.any():
        _separate(rows, key, order, equal, differ)
    return _groups(order, ~equal)


def _hashes(rows: npt.NDArray[Any]) -> Keys:
    """(n,): a hash of each row, whose upper bits are the best."""
    found = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.T:
        found ^= column.astype(np.int64, copy=False).view(np.uint64)
        found *= _SPREAD
        found ^= found >> np.uint64(32)
    found *= _SPREAD
    return found


def _differ(rows: npt.NDArray[Any], order: Integers, equal: Mask) -> Integers:
    """Places where the next row in this order has an equal hash, and is another one."""
    places = np.flatnonzero(equal)
    found = [np.empty(0, dtype=np.int64)]
    for begin in range(0, len(places), CHUNK):
        at = places[begin : begin + CHUNK]
        unequal = rows.take(order[at], axis=0) != rows.take(order[at + 1], axis=0)
        if unequal.any():
            found.append(at[unequal.any(axis=1)])
    return np.concatenate(found)


def _separate(rows: npt.NDArray[Any], key: Keys, order: Integers, equal: Mask, differ: Integers) -> None:
    """Sort different rows with equal hashes, which are rare, by their values."""
    shared = np.flatnonzero(np.isin(key, key[differ]))
    mine = order[shared]
    order[shared] = mine[np.lexsort([*rows[mine].T, key[shared]])]
    inner = shared[:-1][np.diff(shared) == 1]
    equal[inner] &= (rows[order[inner]] == rows[order[inner + 1]]).all(axis=1)


def position_ids(vertices: npt.NDArray[np.float64]) -> Integers:
    """Position id of each vertex: the first index of all vertices at exactly the same position."""
    groups = equal_rows(vertices)
    return groups.first[groups.of]


def shared_edges(faces: npt.NDArray[np.integer]) -> Groups:
    """Group the sides of faces (m, 3) that join the same two vertices.

    Side 3 f + i is that of face f from its corner i to the next one.
    """
    sides = sorted_sides(faces)
    return _groups(sides.number, sides.edge[1:] != sides.edge[:-1])


def used_vertices(faces: npt.NDArray[np.integer]) -> Integers:
    """Numbers of the vertices that faces use, in order."""
    return np.flatnonzero(use_mask(faces, int(faces.max(initial=-1)) + 1))


def use_mask(faces: npt.NDArray[np.integer], count: int) -> Mask:
    """(count,): whether faces use a vertex."""
    used = np.zeros(count, dtype=bool)
    for begin in range(0, len(faces), CHUNK):
        used[faces[begin : begin + CHUNK]] = True
    return used


def connected(count: int, one: Numbers, other: Numbers) -> Numbers:
    """(count,): number of the component of each node, in the order of their lowest nodes, where edges join the nodes
    `one` and `other` (k,).

    Every node points to a lower neighbor, so that those of a tree lead to one root; what still joins roots is a smaller
    graph. In that, as lower ends may be few, every node joins its lowest neighbor: at most half of them stay (Sollin's
    algorithm, in JaJa 1992, section 5.1).
    """
    root = np.arange(count, dtype=one.dtype)
    root[np.maximum(one, other)] = np.minimum(one, other)
    joined = found = _numbered(root)
    while True:
        one, other = joined.take(one), joined.take(other)
        apart = one != other
        if not apart.any():
            return found
        one, other = one[apart], other[apart]
        joined = _numbered(_lowest_neighbors(int(joined.max()) + 1, one, other))
        found = joined.take(found)


def _lowest_neighbors(count: int, one: Numbers, other: Numbers) -> Numbers:
    """(count,): lowest neighbor of each node; itself if it has none, or is the lower one of two that have each other.

    No longer circles are left: the neighbor of a node's neighbor is that node or a lower one.
    """
    node = np.arange(count, dtype=one.dtype)
    near = np.full(count, count, dtype=one.dtype)
    np.minimum.at(near, one, other)
    np.minimum.at(near, other, one)
    near = np.where(near == count, node, near)
    return np.where((near.take(near) == node) & (node < near), node, near)


def _numbered(root: Numbers) -> Numbers:
    """(n,): number of each node's tree in a forest of parent pointers; trees are in the order of their lowest nodes."""
    while not np.array_equal(above := root.take(root), root):
        root = above
    node = np.arange(len(root), dtype=root.dtype)
    if (root > node).any():
        lowest = node.copy()
        np.minimum.at(lowest, root, node)
        root = lowest.take(root)
    return (np.cumsum(root == node, dtype=root.dtype) - root.dtype.type(1)).take(root)


def extent(points: Array) -> Array:
    """(2, k): smallest and largest coordinates of points (n, k); not a number where one of them is not."""
    count, columns = points.shape
    # Rows of many points each: NumPy reduces long rows by vector instructions, and short ones element by element.
    size = 256
    whole = points[: count // size * size].reshape(-1, size * columns)
    found = []
    for ufunc in (np.minimum, np.maximum):
        parts = [points[len(whole) * size :]]
        if len(whole):
            parts.append(ufunc.reduce(whole, axis=0).reshape(size, columns))
        found.append(ufunc.reduce(np.concatenate(parts), axis=0))
    return np.stack(found)


def _begins(changes: Mask) -> Integers:
    """Start indices of groups of equal sorted elements."""
    return np.concatenate([[0], np.flatnonzero(changes) + 1])


def _groups(order: Integers, changes: Mask) -> Groups:
    """Group number of each sorted element."""
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = changes
    of = np.empty(len(order), dtype=np.int64)
    of[order] = np.cumsum(begins) - 1
    return Groups(of, order[begins])
