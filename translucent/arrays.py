"""Array types for annotations, and the base class of immutable values that hold arrays."""

from __future__ import annotations

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


class Frozen:
    """Base class of immutable values with read-only arrays, so that cached results derived from them stay valid."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state of a copy or a pickle, whose arrays NumPy makes writable, as read-only."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)
