"""Interior lists of rays: the bodies that each is inside (Schmidt & Budge 2002); branches of a ray tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.diffusion.interfaces import AIR, InterfaceTable

InteriorList = npt.NDArray[np.int16]
Items = npt.NDArray[np.int16] | Integers

#: Entries of an interior list.
MOST = 8

#: Entry where no body is.
NOTHING = -1


def empty_interior_lists(count: int) -> InteriorList:
    """(count, MOST): interior lists of rays outside all bodies."""
    return np.full((count, MOST), NOTHING, dtype=np.int16)


def enter(interior: InteriorList, ray: Integers, item: Items) -> Mask:
    """Enter bodies `item` (k,) on rays (k,), each ray once; return which interior lists (k,) are full and stay."""
    rows = interior[ray]
    full = rows[:, -1] != NOTHING
    count = (rows != NOTHING).sum(axis=1)
    again = (rows == item[:, None]).any(axis=1)
    first = np.flatnonzero(again & ~full)
    rows[first, 1:] = rows[first, :-1]
    rows[first, 0] = item[first]
    new = np.flatnonzero(~again & ~full)
    rows[new, count[new]] = item[new]
    interior[ray] = rows
    return np.asarray(full)


def leave(interior: InteriorList, ray: Integers, item: Items) -> Mask:
    """Leave bodies, item (k,) on ray (k,), each ray once; returns which interior lists (k,) did not have them."""
    rows = interior[ray]
    there = rows == item[:, None]
    missing = ~there.any(axis=1)
    kept = np.arange(MOST) < there.argmax(axis=1)[:, None]
    moved = np.concatenate([rows[:, 1:], np.full((len(rows), 1), NOTHING, dtype=np.int16)], axis=1)
    interior[ray] = np.where(kept | missing[:, None], rows, moved)
    return np.asarray(missing)


def has(interior: InteriorList, item: Items) -> Mask:
    """(k,): whether interior lists (k, MOST) have the bodies item (k,)."""
    return np.asarray((interior == item[:, None]).any(axis=1))


class InteriorMedia:
    """Media at points with given interior lists, by the overlap policy of a scene.

    Parameters
    ----------
    table : InterfaceTable
    """

    def __init__(self, table: InterfaceTable) -> None:
        self.table, scene = table, table.scene
        self.overlap = scene.overlap
        media = [body.medium for body in scene.objects]
        # One row more, at index NOTHING.
        self.extinction = np.zeros((len(media) + 1, 3))
        self.emission = np.zeros((len(media) + 1, 3))
        for i in np.flatnonzero(table.is_solid).tolist():
            medium = media[i]
            assert medium is not None
            self.extinction[i], self.emission[i] = medium.extinction, scene.source(scene.objects[i])
        self.emits = bool((self.emission > 0).any())
        # A higher priority goes first, then the later entry; 0 is nobody.
        self._keys = np.append(np.where(table.decides, (table.rank + 1) * MOST, 0), 0)
        together = np.hstack([self.extinction, self.emission])
        self._slot = np.unique(together, axis=0, return_inverse=True)[1].ravel()

    def effective(self, interior: InteriorList) -> Integers:
        """(k,): body of the effective medium, the one of highest priority, or `AIR`."""
        rows = _used(interior)
        if rows.shape[1] == 0:
            return np.full(len(interior), AIR)
        keys = self._keys[rows]
        keys = np.where(keys > 0, keys + np.arange(rows.shape[1]), 0)
        best = keys.argmax(axis=1)[:, None]
        item = np.take_along_axis(rows, best, axis=1)[:, 0]
        return np.where(np.take_along_axis(keys, best, axis=1)[:, 0] > 0, item, AIR).astype(np.int64)

    def coefficients(self, interior: InteriorList) -> tuple[Array, Array]:
        """Extinction and emission (k, 3) around rays with these interior lists."""
        rows = _used(interior)
        if rows.shape[1] == 0:
            return np.zeros((len(interior), 3)), np.zeros((len(interior), 3))
        if self.overlap == "priority":
            item = self.effective(interior)
            return self.extinction[item], self.emission[item]
        extinction, emission = self.extinction[rows[:, 0]], self.emission[rows[:, 0]]
        for i in range(1, rows.shape[1]):
            chosen = np.flatnonzero(rows[:, i] != NOTHING)
            if self.overlap == "union":
                slots = self._slot[rows[chosen, : i + 1]]
                chosen = chosen[(slots[:, :-1] != slots[:, -1:]).all(axis=1)]
            extinction[chosen] += self.extinction[rows[chosen, i]]
            emission[chosen] += self.emission[rows[chosen, i]]
        return extinction, emission


def _used(interior: InteriorList) -> InteriorList:
    """The columns of interior lists in which any has an entry."""
    return interior[:, : int((interior != NOTHING).any(axis=0).sum())]


@dataclass(frozen=True, eq=False)
class Branches:
    """Segments of a ray tree, each from its origin to the next surface.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In radii of the scene from its center, and of unit length.
    throughput : (n, 3) float64
        Fraction of the light that reaches the eye.
    owner : (n,) int64
        Ray of the picture that it is a part of.
    interior : (n, MOST) int16
        Bodies that it is inside.
    depth : (n,) int64
        Number of interfaces before.
    forks : (n,) int64
        Interfaces at which it may still become two.
    last : (n, groups) int64
        Faces that the origin is on, as `SceneRayCaster.nearest` takes them.
    reflected : (n,) bool
        Whether an interface has reflected it.
    blur : (n,) float64
        Squared width of its lobe, as of the microfacets of a mirror: the sum over rough interfaces.
    footprint : (n, 2, 2, 3) float64
        Differentials of origins and of directions; (n, 0, 2, 3) where nothing is averaged over footprints.
    outwards : (n, 3) float64
        Normal of the body in which it begins, there, outwards; 0 where it has none.
    ahead : (n, 3) float64
        Optical depth of scattering events that its light counts as going straight on. It sees the environment as sharp
        as without them by exp(-ahead), and else blurred.
    ahead_body : (n,) int64
        Body in which they were last, NOTHING for none.
    """

    origins: Array
    directions: Array
    throughput: Array
    owner: Integers
    interior: InteriorList
    depth: Integers
    forks: Integers
    last: Integers
    reflected: Mask
    blur: Array
    footprint: Array
    outwards: Array
    ahead: Array
    ahead_body: Integers

    def __len__(self) -> int:
        return len(self.owner)

    def where(self, chosen: Integers | Mask) -> Branches:
        """Selection of branches by ascending indices or a mask."""
        index = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        if len(index) == len(self):  # all of them, since none is chosen twice
            return self
        return Branches(*(getattr(self, field.name).take(index, axis=0) for field in fields(self)))


def joined(parts: Sequence[Branches]) -> Branches:
    """Concatenate branches; at least one part."""
    parts = [part for part in parts if len(part)] or parts[:1]
    if len(parts) == 1:
        return parts[0]
    return Branches(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Branches)))
