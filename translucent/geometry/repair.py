"""Safe repairs of a mesh: welding of coincident vertices, and consistent outward winding.

Nothing here invents geometry. A hole stays a hole, and what is ambiguous stays as it was made.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.geometry.grouping import equal_rows, shared_edges, side_ends
from translucent.geometry.winding import inside_out_parts

Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]

#: Welding distance as a share of the bounding-box diagonal. Files store float32 at best, whose last bit is 6e-8 of the
#: coordinate: CAD exports differ by some of these between neighboring faces.
WELD_TOLERANCE = 1e-6

#: Largest welding distance as a share of the median edge.
WELD_EDGE_SHARE = 1e-2


def weld(vertices: Vertices, tolerance: float) -> npt.NDArray[np.int64]:
    """Index, for each vertex, of the vertex that replaces all those within `tolerance` of one another.

    Parameters
    ----------
    vertices : (n, 3) float64
        Finite positions in metres.
    tolerance : float
        Distance in metres; neighbors of neighbors are joined too.

    Returns
    -------
    (n,) int64
        Index of the first vertex of each group.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    positions = equal_rows(vertices)
    points = vertices[positions.first]
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs) == 0:
        return np.asarray(positions.first[positions.of])
    count = len(points)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    groups, label = connected_components(graph, directed=False)
    representative = np.full(groups, len(vertices), dtype=np.int64)
    np.minimum.at(representative, label, positions.first)
    return np.asarray(representative[label][positions.of])


def orient(vertices: Vertices, faces: Faces) -> tuple[Faces, int, int]:
    """Wind the faces of each edge-connected part consistently, and flip parts that are inside out.

    A part is turned outwards only if it is closed and lies inside no other part: a shell within another is a cavity,
    and keeps the sense that it has.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int32
        Welded: equal positions have equal indices.

    Returns
    -------
    faces : (m, 3) int32
    flipped : int
        Faces turned because their neighbors disagreed.
    turned : int
        Closed parts turned outwards as a whole.
    """
    part, flip = spread_winding(faces)
    oriented = np.where(flip[:, None], faces[:, ::-1], faces)
    turned = inside_out_parts(vertices, oriented, part)
    mine = np.isin(part, turned)
    oriented[mine] = oriented[mine][:, ::-1]
    return oriented.astype(np.int32), int(flip.sum()), len(turned)


def spread_winding(faces: npt.NDArray[np.integer]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Part of each face, and whether the face must be flipped to agree with the majority of its part.

    Each face is two nodes, as it is and turned. A two-face edge links the nodes that fit together; a consistent choice
    is one connected component of that graph.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    start, _ = side_ends(faces)
    edges = shared_edges(faces)
    order = np.argsort(edges.of, kind="stable")
    pairs = order[(edges.sizes[edges.of] == 2)[order]].reshape(-1, 2)
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
