"""Records of the bodies that rays are inside: their order decides the medium of light, and what a segment absorbs.

A record is a row of `MOST` indices of `Scene.objects`, in the order of entering, then `NOTHING`. A body that winds
around a place more than once stands there as often; its further windings go first, where they do not count as entered
last.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.reference.interfaces import AIR, Optics
from translucent.scene.scene import Scene

Record = npt.NDArray[np.int16]
Items = npt.NDArray[np.int16] | Integers

#: Entries of a record.
MOST = 8

#: Entry where no body is.
NOTHING = -1


def empty_records(count: int) -> Record:
    """(count, MOST): records of rays outside all bodies."""
    return np.full((count, MOST), NOTHING, dtype=np.int16)


def enter(record: Record, ray: Integers, item: Items) -> Mask:
    """Enter bodies, item (k,) on ray (k,), each ray once; returns which records (k,) are full and left as they are."""
    rows = record[ray]
    full = rows[:, -1] != NOTHING
    count = (rows != NOTHING).sum(axis=1)
    again = (rows == item[:, None]).any(axis=1)
    first = np.flatnonzero(again & ~full)
    rows[first, 1:] = rows[first, :-1]
    rows[first, 0] = item[first]
    new = np.flatnonzero(~again & ~full)
    rows[new, count[new]] = item[new]
    record[ray] = rows
    return np.asarray(full)


def leave(record: Record, ray: Integers, item: Items) -> Mask:
    """Leave bodies, item (k,) on ray (k,), each ray once; returns which records (k,) did not have them."""
    rows = record[ray]
    there = rows == item[:, None]
    missing = ~there.any(axis=1)
    kept = np.arange(MOST) < there.argmax(axis=1)[:, None]
    moved = np.concatenate([rows[:, 1:], np.full((len(rows), 1), NOTHING, dtype=np.int16)], axis=1)
    record[ray] = np.where(kept | missing[:, None], rows, moved)
    return np.asarray(missing)


def has(record: Record, item: Items) -> Mask:
    """(k,): whether records (k, MOST) have the bodies item (k,)."""
    return np.asarray((record == item[:, None]).any(axis=1))


class RecordedMedia:
    """Media of the places that records stand for, by the overlap policy of a scene.

    Parameters
    ----------
    scene : Scene
    own : Optics
        Which bodies decide the medium of light.
    """

    def __init__(self, scene: Scene, own: Optics) -> None:
        self.overlap = scene.overlap
        media = [body.medium for body in scene.objects]
        # One row more, at index NOTHING.
        self.extinction = np.zeros((len(media) + 1, 3))
        self.emission = np.zeros((len(media) + 1, 3))
        for i in own.solids:
            medium = media[i]
            assert medium is not None
            self.extinction[i], self.emission[i] = medium.extinction, scene.source(scene.objects[i])
        self.emits = bool((self.emission > 0).any())
        _, rank = np.unique([body.priority for body in scene.objects], return_inverse=True)
        # A higher priority goes first, then the later entry; 0 is nobody.
        self._keys = np.append(np.where(own.decides, (rank + 1) * MOST, 0), 0)
        together = np.hstack([self.extinction, self.emission])
        self._slot = np.unique(together, axis=0, return_inverse=True)[1].ravel()

    def dominant(self, record: Record) -> Integers:
        """(k,): body that decides what light is in, or `AIR`."""
        rows = _used(record)
        if rows.shape[1] == 0:
            return np.full(len(record), AIR)
        keys = self._keys[rows]
        keys = np.where(keys > 0, keys + np.arange(rows.shape[1]), 0)
        best = keys.argmax(axis=1)[:, None]
        item = np.take_along_axis(rows, best, axis=1)[:, 0]
        return np.where(np.take_along_axis(keys, best, axis=1)[:, 0] > 0, item, AIR).astype(np.int64)

    def coefficients(self, record: Record) -> tuple[Array, Array]:
        """Extinction and emission (k, 3) around rays with these records."""
        rows = _used(record)
        if rows.shape[1] == 0:
            return np.zeros((len(record), 3)), np.zeros((len(record), 3))
        if self.overlap == "priority":
            item = self.dominant(record)
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


def _used(record: Record) -> Record:
    """The columns of records in which any has an entry."""
    return record[:, : int((record != NOTHING).any(axis=0).sum())]
