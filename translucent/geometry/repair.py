"""Safe repairs of a mesh: welding of coincident vertices, and consistent outward winding.

Nothing here invents geometry. A hole stays a hole, and what is ambiguous stays as it was made.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.geometry.grouping import Numbers, SortedSides, connected, equal_rows, side_blocks, sorted_sides
from translucent.geometry.winding import inside_out_parts

#: Two directions off those along which meshes tend to be built, at right angles to each other.
_FIRST, _SECOND = np.linalg.qr(np.array([[0.71, -0.43], [0.37, 0.83], [0.59, 0.35]]))[0].T.copy()

#: Pairs per point that are tested before all points count as close: more of them are not found faster than by a tree.
_MOST = 64


def near_points(points: Array, distance: float) -> Integers:
    """Indices of the points that have another one within a distance, in ascending order.

    Points are sorted along one direction, where each has few neighbors so close; these are separated along a second
    one. What that leaves are hardly more than the pairs that are looked for.

    Parameters
    ----------
    points : (n, 3) float64
        Finite.
    distance : float
        In the unit of the points. What is off by rounding counts as within it.
    """
    if len(points) < 2:
        return np.empty(0, dtype=np.int64)
    reach = distance + 16 * np.finfo(np.float64).eps * float(np.abs(points).max())
    with np.errstate(under="ignore"):
        along, across = points @ _FIRST, points @ _SECOND
    order = np.argsort(along)
    along = along[order]
    across = across[order]
    found: list[Integers] = []
    one = np.flatnonzero(along[1:] - along[:-1] <= reach)
    tested, lag = len(one), 1
    while len(one):
        if tested > _MOST * len(points):
            return np.arange(len(points))
        close = one[np.abs(across[one + lag] - across[one]) <= reach]
        if len(close):
            first, second = order[close], order[close + lag]
            with np.errstate(under="ignore"):
                apart = np.linalg.norm(points[first] - points[second], axis=1)
            found += [first[apart <= reach], second[apart <= reach]]
        lag += 1
        one = one[: np.searchsorted(one, len(points) - lag)]
        one = one[along[one + lag] - along[one] <= reach]
        tested += len(one)
    return np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.int64)


Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]

#: Welding distance as a fraction of the bounding-box diagonal. Files store float32 at best, whose last bit is 6e-8 of
#: the coordinate: CAD exports differ by some of these between neighboring faces.
WELD_TOLERANCE = 1e-6

#: Largest welding distance as a fraction of the median edge.
WELD_EDGE_FRACTION = 1e-2


#: Smallest welding distance in metres: cells of it are still numbers.
_LEAST = 1e-250

#: Vertices within the welding distance of one another, on average, above which not all pairs of them are looked for;
#: and how many nearest ones are.
_CROWD = 16

#: Vertices at the beginning of a mesh that decide whether it is a soup of triangles, each with corners of its own.
_SAMPLE = 3000


def all_apart(vertices: Vertices, distance: float) -> bool:
    """True if no two vertices are within a distance of each other; all have to be finite."""
    sample = vertices[:_SAMPLE]
    return len(equal_rows(sample).first) == len(sample) and len(near_points(vertices, distance)) == 0


def weld(vertices: Vertices, tolerance: float, limit: Callable[[], float] | None = None) -> npt.NDArray[np.int64]:
    """Index, for each vertex, of the vertex that replaces all those within `tolerance` of one another.

    Parameters
    ----------
    vertices : (n, 3) float64
        Finite positions in metres.
    tolerance : float
        Distance in metres; neighbors of neighbors are joined too.
    limit : callable, optional
        Gives another distance that the tolerance must not exceed; asked for only where it matters.

    Returns
    -------
    (n,) int64
        Index of the first vertex of each group.
    """
    positions = equal_rows(vertices)
    near = near_points(vertices[positions.first], tolerance)
    if len(near) == 0:
        return positions.first[positions.of]
    from scipy.spatial import cKDTree

    if limit is not None:
        tolerance = min(tolerance, limit())
    points = vertices[positions.first[near]]
    tree = cKDTree(points)
    tolerance = max(tolerance, _LEAST)
    # All points in a cell are within the tolerance of its first one.
    cells = equal_rows(np.floor((points - points[0]) * (2.0 / tolerance)))
    if np.square(cells.sizes).sum() <= _CROWD * len(points):
        pairs = tree.query_pairs(tolerance, output_type="ndarray")
    else:  # as many pairs as the square of a crowd: across cells, the nearest neighbors of each point join them
        other = tree.query(points, _CROWD, distance_upper_bound=tolerance)[1]
        one, column = np.nonzero(other < len(points))
        in_cells = np.stack([np.arange(len(points)), cells.first[cells.of]], axis=1)
        pairs = np.concatenate([in_cells, np.stack([one, other[one, column]], axis=1)])
    label = connected(len(positions.first), *near[pairs].T)
    representative = np.full(len(label), len(vertices), dtype=np.int64)
    np.minimum.at(representative, label, positions.first)
    return representative[label][positions.of]


def orient(vertices: Vertices, faces: Faces) -> tuple[Faces, int, int, bool]:
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
    one_closed_part : bool
        Whether every edge had two faces from the beginning, which agreed, and joined all faces.
    """
    part, flip, paired = _spread(faces)
    oriented = np.where(flip[:, None], faces[:, ::-1], faces) if flip.any() else faces
    turned = inside_out_parts(vertices, oriented, part)
    if len(turned):
        oriented = np.where(np.isin(part, turned)[:, None], oriented[:, ::-1], oriented)
    one = paired and not part.any()
    return oriented.astype(np.int32, copy=False), int(flip.sum()), len(turned), one


def spread_winding(faces: npt.NDArray[np.integer]) -> tuple[Numbers, Mask]:
    """Part of each face, and whether the face must be flipped to agree with the majority of its part."""
    part, flip, _ = _spread(faces)
    return part, flip


def _spread(faces: npt.NDArray[np.integer]) -> tuple[Numbers, Mask, bool]:
    """`spread_winding`, and whether every edge has two faces that agree."""
    part: Numbers = np.arange(len(faces), dtype=np.int32)
    paired = True
    for sides in side_blocks(faces):
        one, other, disagree = _neighbors(sides)
        if disagree.any():
            return *_flips(len(faces), *_neighbors(sorted_sides(faces))), False
        paired &= 2 * len(one) == len(sides.edge)
        del sides  # before the next block is made
        part = connected(int(part.max()) + 1, part[one], part[other])[part]
    return part, np.zeros(len(faces), dtype=bool), paired


def _neighbors(sides: SortedSides) -> tuple[Numbers, Numbers, Mask]:
    """(k,): the faces on either side of the edges with two of them, and whether these disagree about the winding."""
    face, ascending = (sides.side >> np.uint64(3)).astype(np.int32), sides.ascending
    if sides.paired:
        return face[::2], face[1::2], ascending[::2] == ascending[1::2]
    first = sides.begins[sides.sizes == 2]
    return face[first], face[first + 1], ascending[first] == ascending[first + 1]


def _flips(count: int, one: Numbers, other: Numbers, disagree: Mask) -> tuple[Numbers, Mask]:
    """Part of each face, and whether it must be flipped, from pairs of neighbors that agree or not.

    Each face is two nodes, as it is and turned. A two-face edge links the nodes that fit together; a consistent choice
    is one connected component of that graph.
    """
    rows = np.concatenate([one, one + count])
    columns = np.concatenate([np.where(disagree, other + count, other), np.where(disagree, other, other + count)])
    label = connected(2 * count, rows, columns)
    as_is, turned = label[:count], label[count:]
    _, part = np.unique(np.minimum(as_is, turned), return_inverse=True)
    part = part.ravel()
    # A part whose two choices are one component (a Moebius strip) has no consistent winding: leave it.
    orientable = as_is != turned
    in_second = orientable & (as_is > turned)
    fraction = np.bincount(part, weights=in_second) / np.bincount(part)
    return part, orientable & (in_second != (fraction > 0.5)[part])
