"""Bounding volume hierarchies of meshes, for rays that no rasterizer can follow.

Built from the bottom up by parallel locally-ordered clustering (Meister & Bittner 2018, "Parallel Locally-Ordered
Clustering for Bounding Volume Hierarchy Construction"): triangles are sorted along a space-filling curve; in each round
every cluster finds the one among its neighbors on the curve with which its bounds are smallest, and two that have found
each other become one. All clusters of a round are handled at once, so that NumPy is fast enough for millions. Its trees
are as good as those of the surface area heuristic. Which subtrees become leaves is decided by that heuristic
(MacDonald & Booth 1990).

Nodes are visited depth-first with skip links (Smits 1998, "Efficiency issues for ray tracing"): a ray that hits the
bounds of a node goes on to the next node, any other to the node behind the subtree; no stack is needed. There is an
order for each octant of directions, in which the nearer child comes first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Integers

Floats = npt.NDArray[np.float32]

#: Coordinates of any precision.
Reals = npt.NDArray[np.floating]

#: Neighbors on either side among which a cluster looks for its partner.
REACH = 8

#: Largest number of triangles in a leaf.
LEAF_SIZE = 4

#: Largest number of children of a node.
MOST_CHILDREN = 4

#: Cost of testing a box, relative to that of a triangle.
BOX_COST = 1.0

#: Share of the clusters of a round that must find a partner; else neighbors pair up whatever their bounds.
LEAST_MERGED = 0.05

#: Bits of each coordinate along the space-filling curve.
_CURVE_BITS = 20

#: Boxes along the curve that have a tree of their own, so that building the trees of many takes little memory.
BLOCK = 1 << 17

#: Boxes whose places along the curve are found at a time.
_CHUNK = 1 << 15


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Bounding volume hierarchy of a mesh.

    Attributes
    ----------
    low, high : (n, 3) float32
        Bounds of the nodes, parents before children; the first is the root.
    size : (n,) int32
        Number of nodes in the subtree of each.
    first : (n,) int32
        First triangle of a leaf, in the order of `faces`; 0 for an inner node.
    count : (n,) int32
        Number of triangles of a leaf; 0 for an inner node.
    orders : (8, n) int32
        Place of each node in the depth-first order for an octant of directions; bit k of the octant is set where axis k
        is negative. A ray goes on `size` places farther where it misses a node's bounds.
    faces : (m,) int32
        Faces of the mesh in the order in which leaves hold them.
    """

    low: Floats
    high: Floats
    size: npt.NDArray[np.int32]
    first: npt.NDArray[np.int32]
    count: npt.NDArray[np.int32]
    orders: npt.NDArray[np.int32]
    faces: npt.NDArray[np.int32]


def build_hierarchy(low: Floats, high: Floats, leaf_size: int = LEAF_SIZE) -> Hierarchy:
    """Build a bounding volume hierarchy over boxes, such as the boxes of triangles.

    Parameters
    ----------
    low, high : (m, 3) float32
        Bounds of each, about as large as 1 together, so that areas are finite; m >= 1.
    leaf_size : int
        Largest number of boxes in a leaf.
    """
    with np.errstate(under="ignore"):  # areas of the smallest boxes count as 0
        order = curve_order(low, high)
        parts = [_built(low, high, order[begin : begin + BLOCK], leaf_size) for begin in range(0, len(order), BLOCK)]
        return parts[0] if len(parts) == 1 else _joined(parts)


def _built(low: Floats, high: Floats, order: Integers, leaf_size: int) -> Hierarchy:
    """Hierarchy of some boxes, in their order along the curve."""
    tree = _BinaryTree(np.ascontiguousarray(low[order].T), np.ascontiguousarray(high[order].T))
    return _laid_out(tree, order, leaf_size)


def _joined(parts: list[Hierarchy]) -> Hierarchy:
    """Top-level hierarchy over the boxes of several hierarchies, with these in place of its leaves."""
    roots = np.stack([part.low[0] for part in parts]), np.stack([part.high[0] for part in parts])
    top = _built(*roots, np.arange(len(parts)), 1)
    inner, leaf = np.flatnonzero(top.count == 0), np.flatnonzero(top.count)
    weight = np.ones(len(top.size), np.int64)
    weight[leaf] = [len(parts[part].size) for part in top.faces[top.first[leaf]]]
    places = np.empty((8, len(weight)), np.int32)
    for place, order in zip(places, top.orders, strict=True):
        at = np.argsort(order)
        ends = np.cumsum(weight[at])
        place[at] = ends - weight[at]
    last = ends[top.orders[-1][inner] + top.size[inner] - 1]
    begins = np.cumsum([0, *(len(part.faces) for part in parts)])
    node = np.empty(len(parts), np.int64)  # that each is in place of
    node[top.faces[top.first[leaf]]] = leaf
    firsts = [np.where(part.count > 0, part.first + begin, 0) for part, begin in zip(parts, begins, strict=False)]
    return Hierarchy(
        np.concatenate([top.low[inner], *(part.low for part in parts)]),
        np.concatenate([top.high[inner], *(part.high for part in parts)]),
        np.concatenate([(last - places[-1][inner]).astype(np.int32), *(part.size for part in parts)]),
        np.concatenate([np.zeros(len(inner), np.int32), *(first.astype(np.int32) for first in firsts)]),
        np.concatenate([np.zeros(len(inner), np.int32), *(part.count for part in parts)]),
        np.concatenate([places[:, inner], *(p.orders + places[:, [i]] for p, i in zip(parts, node, strict=True))], 1),
        np.concatenate([part.faces for part in parts]),
    )


def curve_order(low: Reals, high: Reals) -> Integers:
    """Order of the centers of boxes (n, 3) along a Morton curve through their bounds (Morton 1966)."""
    chunks = [slice(begin, begin + _CHUNK) for begin in range(0, len(low), _CHUNK)]
    ends = [(found.min(axis=0), found.max(axis=0)) for found in (_centers(low[part], high[part]) for part in chunks)]
    start = np.min([least for least, _ in ends], axis=0)
    extent = np.maximum(np.max([most for _, most in ends], axis=0) - start, np.finfo(np.float32).tiny)
    keys = np.empty(len(low), np.uint64)
    for part in chunks:
        cells = (_centers(low[part], high[part]) - start) / extent * low.dtype.type((1 << _CURVE_BITS) - 1)
        x, y, z = (_spread(cell) for cell in cells.astype(np.uint64).T)
        keys[part] = x | y << np.uint64(1) | z << np.uint64(2)
    return np.argsort(keys)


def _centers(low: Reals, high: Reals) -> Reals:
    """(n, 3): centers of boxes."""
    return 0.5 * low + 0.5 * high


def _spread(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Bits of integers below 2^21, three apart."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
    return bits


class _BinaryTree:
    """Binary tree over boxes (3, m): nodes 0 to m - 1 are the boxes, the others follow in the order of merging.

    Attributes
    ----------
    low, high : (3, 2m - 1) float32
    children : (2, 2m - 1) int32
        -1 for the boxes.
    rounds : list of (int, int)
        First node of each round of merging, and the one after its last.
    """

    def __init__(self, low: Floats, high: Floats) -> None:
        leaves = low.shape[1]
        total = 2 * leaves - 1
        self.low, self.high = np.empty((2, 3, total), np.float32)
        self.low[:, :leaves], self.high[:, :leaves] = low, high
        self.children = np.full((2, total), -1, np.int32)
        self.rounds: list[tuple[int, int]] = []
        clusters = np.arange(leaves, dtype=np.int32)
        end = leaves
        while len(clusters) > 1:
            partner = _partners(low, high)
            here = np.arange(len(clusters))
            mutual = partner[partner] == here
            if np.count_nonzero(mutual) < LEAST_MERGED * len(clusters):
                partner = np.minimum(here ^ 1, len(clusters) - 1)
                mutual = partner != here
            one = np.flatnonzero(mutual & (here < partner))
            other = partner[one]
            begin, end = end, end + len(one)
            self.children[0, begin:end], self.children[1, begin:end] = clusters[one], clusters[other]
            low[:, one] = np.minimum(low[:, one], low[:, other])
            high[:, one] = np.maximum(high[:, one], high[:, other])
            self.low[:, begin:end], self.high[:, begin:end] = low[:, one], high[:, one]
            clusters[one] = np.arange(begin, end, dtype=np.int32)
            stays = np.ones(len(clusters), bool)
            stays[other] = False
            clusters, low, high = clusters[stays], low[:, stays], high[:, stays]
            self.rounds.append((begin, end))


def _partners(low: Floats, high: Floats) -> Integers:
    """Neighbor of each cluster (3, n) on the curve with which the half area of the common bounds is smallest."""
    count = low.shape[1]
    here = np.arange(count)
    best = np.full(count, np.inf, np.float32)
    partner = np.empty(count, np.int64)
    for step in range(1, min(REACH, count - 1) + 1):
        size = np.maximum(high[:, step:], high[:, :-step]) - np.minimum(low[:, step:], low[:, :-step])
        area = size[0] * size[1] + (size[0] + size[1]) * size[2]
        if step == 1:
            # Equal boxes pair up with their even or odd neighbor, not all of them with the next.
            best[:-1:2], partner[:-1:2] = area[::2], here[1::2]
            best[1::2], partner[1::2] = area[::2], here[:-1:2]
        for own, found in ((slice(None, -step), slice(step, None)), (slice(step, None), slice(None, -step))):
            nearer = area < best[own]
            np.copyto(best[own], area, where=nearer)
            np.copyto(partner[own], here[found], where=nearer)
    return partner


def _laid_out(tree: _BinaryTree, order: Integers, leaf_size: int) -> Hierarchy:
    """Depth-first layout of a tree, with its nodes collapsed to wide ones."""
    leaves, total = len(order), len(tree.low[0])
    counts = np.ones(total, np.int32)
    for begin, end in tree.rounds:
        left, right = tree.children[:, begin:end]
        counts[begin:end] = counts[left] + counts[right]
    replacements = _replacements(tree, counts, leaf_size)
    kept = replacements == 1
    nodes = kept.astype(np.int32)
    for begin, end in tree.rounds:
        left, right = tree.children[:, begin:end]
        nodes[begin:end] += nodes[left] + nodes[right]
    first = np.zeros(total, np.int32)
    for begin, end in reversed(tree.rounds):
        left, right = tree.children[:, begin:end]
        first[left] = first[begin:end]
        first[right] = first[begin:end] + counts[left]
    faces = np.empty(leaves, np.int32)
    faces[first[:leaves]] = order
    chosen = np.flatnonzero(kept)[::-1]  # the root was made last
    leaf = nodes[chosen] == 1
    return Hierarchy(
        np.ascontiguousarray(tree.low[:, chosen].T),
        np.ascontiguousarray(tree.high[:, chosen].T),
        nodes[chosen],
        np.where(leaf, first[chosen], 0).astype(np.int32),
        np.where(leaf, counts[chosen], 0).astype(np.int32),
        _depth_first(tree, nodes, kept)[:, chosen],
        faces,
    )


def _replacements(tree: _BinaryTree, counts: npt.NDArray[np.int32], leaf_size: int) -> npt.NDArray[np.int8]:
    """(n,): 1 for nodes of a tree that are kept, 0 for nodes within leaves; others are replaced by that many.

    Skip links let a node have any number of children. One whose bounds are hardly smaller than those of the node above
    it costs every ray a test and spares few of them the others, so its children take its place. Dynamic programming
    finds the choice of least cost, as Ylitie et al. (2017, "Efficient Incoherent Ray Traversal on GPUs Through
    Compressed Wide BVHs", section 3.1) do for wide nodes: ``best[k - 1]`` is the least cost below a node that is
    replaced by k others, ``best[0]`` that of the node itself, and tests of those k are paid for above.
    """
    size = tree.high - tree.low
    area = size[0] * size[1] + (size[0] + size[1]) * size[2]
    total = len(area)
    best = np.full((MOST_CHILDREN, total), np.inf, np.float32)
    best[0] = area
    taken = np.zeros((MOST_CHILDREN, total), np.int8)  # how many of k come from the left child
    children = np.zeros(total, np.int8)  # 0 for leaves
    for begin, end in tree.rounds:
        left, right = tree.children[:, begin:end]
        below_left, below_right = best[:, left], best[:, right]
        own, own_taken = best[:, begin:end], taken[:, begin:end]
        cost = area[begin:end] * counts[begin:end]
        cost[counts[begin:end] > leaf_size] = np.inf
        for k in range(2, MOST_CHILDREN + 1):
            for i in range(1, k):
                below = below_left[i - 1] + below_right[k - i - 1]
                less = below < own[k - 1]
                np.copyto(own[k - 1], below, where=less)
                np.copyto(own_taken[k - 1], i, where=less)
            with_tests = own[k - 1] + BOX_COST * k * area[begin:end]
            less = with_tests < cost
            np.copyto(cost, with_tests, where=less)
            np.copyto(children[begin:end], k, where=less)
        own[0] = cost
    replacements = np.zeros(total, np.int8)
    replacements[-1] = 1
    for begin, end in reversed(tree.rounds):
        left, right = tree.children[:, begin:end]
        replaced = replacements[begin:end]
        split = np.where(replaced == 1, children[begin:end], replaced)
        from_left = np.take_along_axis(taken[:, begin:end], np.maximum(split, 1)[None].astype(np.int64) - 1, axis=0)[0]
        replacements[left], replacements[right] = from_left, split - from_left
    return replacements


def _depth_first(tree: _BinaryTree, nodes: npt.NDArray[np.int32], kept: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
    """(8, n): place of each node in the order for each octant; `nodes` counts the nodes kept in each subtree."""
    center = tree.low + tree.high
    orders = np.zeros((8, len(nodes)), np.int32)
    octants = np.arange(8)
    for begin, end in reversed(tree.rounds):
        left, right = tree.children[:, begin:end]
        apart = center[:, right] - center[:, left]
        axis = np.abs(apart).argmax(axis=0)
        swapped = np.take_along_axis(apart, axis[None], axis=0)[0] < 0
        swap = swapped ^ (octants[:, None] >> axis & 1).astype(bool)
        place = orders[:, begin:end] + kept[begin:end]
        orders[:, left] = place + np.where(swap, nodes[right], 0)
        orders[:, right] = place + np.where(swap, 0, nodes[left])
    return orders
