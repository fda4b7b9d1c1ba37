"""Beams: the segments of a ray tree that are followed together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.media_record import Record


@dataclass(frozen=True, eq=False)
class Beams:
    """Segments of a ray tree, each from its origin to the next surface.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In radii of the scene from its center, and of unit length.
    throughput : (n, 3) float64
        Share of the light that reaches the eye.
    owner : (n,) int64
        Ray of the picture that it is a part of.
    record : (n, MOST) int16
        Bodies that it is inside.
    met : (n,) int64
        Interfaces met before.
    forks : (n,) int64
        Interfaces at which it may still become two.
    last : (n, groups) int64
        Faces that the origin is on, as `Caster.nearest` takes them.
    reflected : (n,) bool
        Whether an interface has reflected it.
    blur : (n,) float64
        Square of the width of what it sees, as of the microfacets of a mirror: the sum over rough interfaces.
    footprint : (n, 2, 2, 3) float64
        Differentials of origins and of directions; (n, 0, 2, 3) where nothing is averaged over footprints.
    """

    origins: Array
    directions: Array
    throughput: Array
    owner: Integers
    record: Record
    met: Integers
    forks: Integers
    last: Integers
    reflected: Mask
    blur: Array
    footprint: Array

    def __len__(self) -> int:
        return len(self.owner)

    def where(self, chosen: Integers | Mask) -> Beams:
        """Selection of beams by ascending indices or a mask."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        if len(index) == len(self):  # all of them, since none is chosen twice
            return self
        return Beams(*(getattr(self, field.name).take(index, axis=0) for field in fields(self)))


def joined(parts: Sequence[Beams]) -> Beams:
    """Concatenate beams; at least one part."""
    parts = [part for part in parts if len(part)] or parts[:1]
    if len(parts) == 1:
        return parts[0]
    return Beams(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Beams)))
