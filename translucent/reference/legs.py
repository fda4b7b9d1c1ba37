"""Ray segments: straight parts of refracted rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.reference.interfaces import Inside
from translucent.reference.rays import Rays


@dataclass(frozen=True, eq=False)
class Legs:
    """Ray segments: straight parts of refracted rays.

    Attributes
    ----------
    rays : Rays
        From where each begins.
    owner : (k,) int64
        Number of the ray of the picture that it is a part of.
    throughput : (k, 3) float64
        Share of its light that reaches the eye.
    inside : Inside
        What it begins in.
    bent : (k,) bool
        Whether it has met an interface.
    reflected : (k,) bool
        Whether an interface has reflected it.
    """

    rays: Rays
    owner: Integers
    throughput: Array
    inside: Inside
    bent: Mask
    reflected: Mask

    def __len__(self) -> int:
        return len(self.owner)

    def where(self, chosen: Integers | Mask) -> Legs:
        """Selection of ray segments by indices or a mask."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else np.asarray(chosen, np.int64)
        return Legs(
            self.rays.where(index),
            self.owner[index],
            self.throughput[index],
            self.inside.where(index),
            self.bent[index],
            self.reflected[index],
        )

    def turned(self, directions: Array, share: Array, inside: Inside, *, bent: bool, reflected: Mask | bool) -> Legs:
        """Ray segments from the same origins in other directions (k, 3), with a share (k, 3) of the light."""
        rays = Rays(self.rays.origins, directions, self.rays.backdrop)
        with np.errstate(under="ignore"):
            throughput = self.throughput * share
        return Legs(rays, self.owner, throughput, inside, self.bent | bent, self.reflected | reflected)


def joined(parts: Sequence[Legs]) -> Legs:
    """Concatenate ray segments; at least one part."""
    rays = Rays(
        np.concatenate([part.rays.origins for part in parts]),
        np.concatenate([part.rays.directions for part in parts]),
        np.concatenate([part.rays.backdrop for part in parts]),
    )
    inside = Inside(
        np.concatenate([part.inside.windings for part in parts]), np.concatenate([part.inside.since for part in parts])
    )
    return Legs(
        rays,
        np.concatenate([part.owner for part in parts]),
        np.concatenate([part.throughput for part in parts]),
        inside,
        np.concatenate([part.bent for part in parts]),
        np.concatenate([part.reflected for part in parts]),
    )
