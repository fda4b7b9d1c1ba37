"""Labels beside the points of a plot, none over another."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array

#: Costs of a candidate for a label, in pixels of distance from its point that would be as bad.
_OUTSIDE, _ON_LABEL, _ON_POINT, _ACROSS_LABEL = 1e5, 1e4, 400.0, 30.0
_ROUNDS = 4


def place_labels(points: Array, sizes: Array, bounds: tuple[float, float, float, float], radii: Array) -> Array:
    """Centers of labels, each near its point.

    Every label in turn goes where the costs are least among candidates around its point at growing distances; a few
    rounds of that settle crowds.

    Parameters
    ----------
    points, sizes : (n, 2)
        In pixels: the points, and width and height of their labels.
    bounds : (left, bottom, right, top)
        That labels stay within.
    radii : (n,)
        Of the symbols at the points.

    Returns
    -------
    (n, 2)
    """
    count = len(points)
    centers = np.full((count, 2), np.inf)
    spots = np.repeat(2.0 * radii[:, None], 2, axis=1)
    crowding = [np.sum(np.hypot(*(points - point).T) < 60.0) for point in points]
    for _ in range(_ROUNDS):
        for i in np.argsort(crowding, kind="stable")[::-1]:
            candidates = _candidates(points[i], sizes[i], radii[i])
            others = np.arange(count) != i
            known = others & np.isfinite(centers[:, 0])
            beyond = np.maximum(np.abs(candidates - points[i]) - sizes[i] / 2, 0.0)
            costs = np.hypot(*beyond.T) + 0.05 * np.arange(len(candidates))
            costs += _ON_LABEL * _overlaps(candidates, sizes[i] + 2.0, centers[known], sizes[known]).sum(axis=1)
            costs += _ON_POINT * _overlaps(candidates, sizes[i], points, spots).sum(axis=1)
            middles = 0.5 * (candidates + points[i])  # where a leader would cross another label
            costs += _ACROSS_LABEL * _overlaps(middles, np.array([2.0, 2.0]), centers[known], sizes[known]).sum(axis=1)
            low, high = candidates - sizes[i] / 2, candidates + sizes[i] / 2
            outside = (low < bounds[:2]).any(axis=1) | (high > bounds[2:]).any(axis=1)
            centers[i] = candidates[np.argmin(costs + _OUTSIDE * outside)]
    return centers


def spread(wanted: Array, gap: float, low: float, high: float) -> Array:
    """Positions on a line, as near as possible to those `wanted`, in order, at least `gap` apart, within bounds."""
    order = np.argsort(wanted, kind="stable")
    positions = np.clip(wanted[order], low, high)
    offsets = gap * np.arange(len(positions))
    # Isotonic regression of what is left without the gaps; blocks that collide share their mean.
    blocks: list[list[float]] = []
    for value in positions - offsets:
        blocks.append([value, 1.0])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            mean, weight = blocks.pop()
            before, count = blocks[-1]
            blocks[-1] = [(before * count + mean * weight) / (count + weight), count + weight]
    settled = np.concatenate([np.full(int(weight), mean) for mean, weight in blocks]) if blocks else positions
    settled = np.clip(settled, low, max(low, high - gap * (len(positions) - 1)))
    found = np.empty_like(positions)
    found[order] = settled + offsets
    return found


def _candidates(point: Array, size: Array, radius: float) -> Array:
    """Centers for a label around a point, the nearest first, at each distance the right and upper ones first."""
    angles = np.deg2rad([0, 45, -45, 90, -90, 135, -135, 180, 22, -22, 67, -67, 112, -112, 157, -157])
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # A label touches the circle of its distance with the side or corner that faces the point.
    reach = np.sign(np.round(directions, 3)) * size / 2
    distances = radius + np.array([2.0, 8.0, 16.0, 26.0, 38.0, 52.0, 70.0, 95.0])
    return np.concatenate([point + directions * distance + reach for distance in distances])


def _overlaps(centers: Array, size: Array, others: Array, other_sizes: Array) -> Array:
    """(centers, others): 1 where two rectangles overlap."""
    apart = np.abs(centers[:, None, :] - others[None, :, :])
    return np.asarray((apart < (size + other_sizes[None]) / 2).all(axis=2), dtype=np.float64)
