"""Immutable values whose arrays stay read-only when they are copied or pickled."""

from __future__ import annotations

from typing import Any

import numpy as np


class Frozen:
    """Base class of immutable values with read-only arrays, so that cached results derived from them stay valid."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state of a copy or a pickle, whose arrays NumPy makes writable, as read-only."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)
