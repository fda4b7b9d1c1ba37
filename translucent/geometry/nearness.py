"""Points of a set that have another one close by: few, and found without a tree of all points."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Integers

#: Two directions off those along which meshes tend to be built, at right angles to each other.
_FIRST, _SECOND = np.linalg.qr(np.array([[0.71, -0.43], [0.37, 0.83], [0.59, 0.35]]))[0].T.copy()

#: Pairs per point that are tested before all points count as close: more of them are not found faster than by a tree.
_MOST = 64


def near_points(points: Array, distance: float) -> Integers:
    """Indices of the points that have another one within a distance, in ascending order.

    Points are sorted along one direction, where each has few neighbors so close; these are told apart along a second
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
