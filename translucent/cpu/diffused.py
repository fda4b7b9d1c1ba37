"""Light that leaves bodies in which it has diffused, for rays inside them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.vectors import dot
from translucent.diffusion.field import DiffusionField


class DiffusedLight:
    """Diffused light of the bodies of a scene.

    Parameters
    ----------
    fields : mapping of int to DiffusionField
        By the number of the object.
    """

    def __init__(self, fields: Mapping[int, DiffusionField]) -> None:
        self._fields = dict(fields)

    def __bool__(self) -> bool:
        """True if there is any."""
        return bool(self._fields)

    def leaves(self, before: Integers, after: Integers) -> Mask:
        """(k,): whether it leaves one of two bodies where they meet, bent or not."""
        return np.asarray(np.isin(np.stack([before, after]), list(self._fields)).any(axis=0))

    def haze(self, body: Integers) -> Array:
        """(k, 3, 3): shares of the extinction around rays in bodies (k,) by light that is scattered ahead, and of that
        light which leave on the far side and on the near one.
        """
        found = np.zeros((len(body), 3, 3))
        for number, field in self._fields.items():
            found[body == number] = np.stack([field.ahead, *field.haze])
        return found

    def radiance(self, body: Integers, points: Array, directions: Array, normals: Array) -> Array:
        """(k, 3): basic radiance against rays that start at points (k, 3) of surfaces, inside `body` (k,)."""
        found = np.zeros(points.shape)
        cosine = np.abs(dot(directions, normals))
        for number, field in self._fields.items():
            own = np.flatnonzero(body == number)
            if own.size:
                found[own] = field.radiance(points[own], cosine[own])
        return found
