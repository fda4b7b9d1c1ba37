"""Tables of slabs: the errors of each way, by albedo and optical depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from translucent.bench.record import Slab

#: Errors of what is good, and of what is bearable.
GOOD, BEARABLE = 0.03, 0.05


@dataclass(frozen=True)
class SlabTable:
    """Slabs of one anisotropy and one index of refraction.

    Attributes
    ----------
    anisotropy, ior : float
    depths : tuple of float
        Its columns.
    rows : tuple of (albedo, slabs)
    """

    anisotropy: float
    ior: float
    depths: tuple[float, ...]
    rows: tuple[tuple[float, tuple[Slab, ...]], ...]


def slab_tables(slabs: Sequence[Slab]) -> list[SlabTable]:
    """One table for each anisotropy and index, in the order of the record."""
    tables: dict[tuple[float, float], list[Slab]] = {}
    for slab in slabs:
        tables.setdefault((slab.anisotropy, slab.ior), []).append(slab)
    return [SlabTable(*key, *_rows(members)) for key, members in tables.items()]


def _rows(slabs: Sequence[Slab]) -> tuple[tuple[float, ...], tuple[tuple[float, tuple[Slab, ...]], ...]]:
    depths = tuple(sorted({slab.depth for slab in slabs}))
    albedos = sorted({slab.albedo for slab in slabs})
    return depths, tuple((albedo, tuple(slab for slab in slabs if slab.albedo == albedo)) for albedo in albedos)


def mark(error: float) -> str:
    """Class of a cell with an error."""
    return "good" if abs(error) <= GOOD else "" if abs(error) <= BEARABLE else "bad"
