"""The repairs that are safe: weld vertices that are one point, and wind all faces of a part alike, outwards.

Nothing here invents geometry. A hole stays a hole, and what is ambiguous stays as it was made.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]

#: Vertices closer than this share of the bounding-box diagonal are one point. Files store float32 at best, whose last
#: bit is 6e-8 of the coordinate: CAD exports differ by some of these between neighbouring faces.
WELD_TOLERANCE = 1e-6


def weld(vertices: Vertices, tolerance: float) -> npt.NDArray[np.int64]:
    """For each vertex the index of the vertex that stands for all those within `tolerance` of one another.

    Parameters
    ----------
    vertices : (n, 3) float64
        Finite positions in metres.
    tolerance : float
        Distance in metres; neighbours of neighbours are joined too.

    Returns
    -------
    (n,) int64
        Index of the first vertex of each group.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    points, first, inverse = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    count = len(points)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    groups, label = connected_components(graph, directed=False)
    representative = np.full(groups, len(vertices), dtype=np.int64)
    np.minimum.at(representative, label, first)
    return np.asarray(representative[label][inverse.ravel()])


def orient(vertices: Vertices, faces: Faces) -> tuple[Faces, int, int]:
    """Wind the faces of each edge-connected part alike, and turn parts that are inside out.

    A part is turned outwards only if it is closed and lies inside no other part: a shell within another may be meant
    as a cavity, so it keeps the sense that it has.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int32
        Welded: equal positions have equal indices.

    Returns
    -------
    faces : (m, 3) int32
    flipped : int
        Faces turned because their neighbours disagreed.
    turned : int
        Closed parts turned outwards as a whole.
    """
    part, flip = _spread_winding(faces)
    oriented = np.where(flip[:, None], faces[:, ::-1], faces)
    turned = 0
    bounds = [_bounds(vertices[oriented[part == p]]) for p in range(part.max() + 1)]
    for p, box in enumerate(bounds):
        mine = part == p
        own = oriented[mine]
        if not _balanced(own):
            continue
        corners = vertices[own] - vertices[own[0, 0]]
        if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) >= 0:
            continue
        if any(_contains(other, box) for q, other in enumerate(bounds) if q != p):
            continue
        oriented[mine] = own[:, ::-1]
        turned += 1
    return oriented.astype(np.int32), int(flip.sum()), turned


def _spread_winding(faces: Faces) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Part of each face, and whether it must be turned to agree with the majority of its part.

    Each face is two nodes, as it is and turned. A two-face edge links the nodes that fit together; a consistent choice
    is one connected component of that graph.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    _, edge, uses = np.unique(
        np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1),
        axis=0,
        return_inverse=True,
        return_counts=True,
    )
    edge = edge.ravel()
    order = np.argsort(edge, kind="stable")
    pairs = order[(uses[edge] == 2)[order]].reshape(-1, 2)
    one, other = pairs[:, 0] // 3, pairs[:, 1] // 3
    disagree = start[pairs[:, 0]] == start[pairs[:, 1]]
    rows = np.concatenate([one, one + count])
    columns = np.concatenate([np.where(disagree, other + count, other), np.where(disagree, other, other + count)])
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(2 * count, 2 * count))
    _, label = connected_components(graph, directed=False)
    as_is, turned = label[:count], label[count:]
    _, part = np.unique(np.minimum(as_is, turned), return_inverse=True)
    part = part.ravel()
    # A part whose two choices are one component (a Moebius strip) has no consistent winding: leave it.
    orientable = as_is != turned
    in_second = orientable & (as_is > turned)
    share = np.bincount(part, weights=in_second) / np.bincount(part)
    return part, orientable & (in_second != (share > 0.5)[part])


def _balanced(faces: Faces) -> bool:
    """Whether every directed edge has its opposite."""
    start, end = faces[:, [0, 1, 2]].ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    key = start.max() + 1
    return bool(np.array_equal(np.sort(start * key + end), np.sort(end * key + start)))


def _bounds(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    flat = points.reshape(-1, 3)
    return np.stack([flat.min(axis=0), flat.max(axis=0)])


def _contains(outer: npt.NDArray[np.float64], inner: npt.NDArray[np.float64]) -> bool:
    return bool((outer[0] <= inner[0]).all() and (outer[1] >= inner[1]).all())
