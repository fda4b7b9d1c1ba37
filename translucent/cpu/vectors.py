"""Sums over the columns of narrow arrays, for which NumPy's own reductions are slow."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array


def dot(a: Array, b: Array) -> Array:
    """(k,): scalar products of vectors (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def unit(vectors: Array) -> Array:
    """Vectors (k, 3) with their length made 1, or left at 0."""
    length = np.sqrt(dot(vectors, vectors))
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def largest(values: Array) -> Array:
    """(k,): largest of the columns of (k, n), n at least 1."""
    found = values[:, 0]
    for column in values.T[1:]:
        found = np.maximum(found, column)
    return np.asarray(found)
