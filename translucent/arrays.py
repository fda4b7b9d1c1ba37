"""Array types for annotations, ranges of indices, and the base class of immutable values that hold arrays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

#: Quantities and geometry.
Array = npt.NDArray[np.float64]

#: Data to and from the GPU, and of files.
Floats = npt.NDArray[np.float32]

#: Indices and counts.
Integers = npt.NDArray[np.int64]

Mask = npt.NDArray[np.bool_]

#: Pictures with 8 bits for each channel.
Pixels = npt.NDArray[np.uint8]


def expanded(first: Integers, count: Integers) -> tuple[Integers, Integers]:
    """Ranges first, first + 1, ... of `count` numbers each, one after the other: index of the range, and number."""
    part = np.repeat(np.arange(len(count)), count)
    return part, np.arange(len(part)) + np.repeat(first - (np.cumsum(count) - count), count)


def slices(count: Integers, most: int) -> Iterator[slice]:
    """Slices of items with a sum of `count` (n,) up to `most`, or of one item."""
    ends = np.cumsum(count)
    begin = 0
    while begin < len(ends):
        before = int(ends[begin - 1]) if begin else 0
        end = max(int(np.searchsorted(ends, before + most, side="right")), begin + 1)
        yield slice(begin, end)
        begin = end


class Frozen:
    """Base class of immutable values with read-only arrays, so that cached results derived from them stay valid."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state of a copy or a pickle, whose arrays NumPy makes writable, as read-only."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)

    def _freeze(self, field: str, array: npt.NDArray[Any]) -> None:
        """Set a field of a frozen dataclass to an array, and make this read-only."""
        array.setflags(write=False)
        object.__setattr__(self, field, array)
