"""Overlapping boxes, found by a sweep along one axis instead of a test of every pair."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

Indices = npt.NDArray[np.intp]

#: Pairs that are compared at a time: few enough for the memory, and enough for NumPy to be quick.
MOST_PAIRS = 1 << 20


def first_overlap(
    boxes: Array, matters: Callable[[Indices, Indices], npt.NDArray[np.bool_]] | None = None
) -> tuple[int, int] | None:
    """Indices of two boxes that share volume, the earlier one first; None if there are none.

    Of few boxes, the pair whose later box comes first. The time grows as n log n and with the pairs that overlap along
    the axis where the fewest do.

    Parameters
    ----------
    boxes : (n, 2, 3) float64
        Smallest and largest coordinates.
    matters : callable, optional
        Gets the numbers of the boxes of many pairs, and says which of the pairs count. Default: all.
    """
    for one, other in _candidates(boxes):
        inside = (boxes[one, 0] < boxes[other, 1]).all(axis=1) & (boxes[one, 1] > boxes[other, 0]).all(axis=1)
        one, other = one[inside], other[inside]
        if matters is not None:
            counted = matters(one, other)
            one, other = one[counted], other[counted]
        if len(one):
            earlier, later = np.minimum(one, other), np.maximum(one, other)
            found = np.lexsort((earlier, later))[0]
            return int(earlier[found]), int(later[found])
    return None


def _candidates(boxes: Array) -> Iterator[tuple[Indices, Indices]]:
    """Pairs of boxes that overlap along the axis where the fewest do, a part at a time."""
    order, partners = min((_along(boxes[..., axis]) for axis in range(3)), key=lambda found: int(found[1].sum()))
    until = np.cumsum(partners)
    first = 0
    while first < len(order):
        done = int(until[first - 1]) if first else 0
        last = max(int(np.searchsorted(until, done + MOST_PAIRS, side="right")), first + 1)
        counts = partners[first:last]
        one = np.repeat(np.arange(first, last), counts)
        # The partners of a box are those that come right after it in the order.
        other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(counts) - counts, counts)
        yield order[one], order[other]
        first = last


def _along(ends: Array) -> tuple[Indices, Indices]:
    """Order in which boxes begin along an axis, and for each the number that begin later and before it ends."""
    order = np.argsort(ends[:, 0], kind="stable")
    begin, end = ends[order].T
    return order, np.maximum(np.searchsorted(begin, end, side="left") - np.arange(len(order)) - 1, 0)
