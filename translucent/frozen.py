"""Values that never change, whose arrays stay read-only when they are copied or sent to another process."""

from __future__ import annotations

from typing import Any

import numpy as np


class Frozen:
    """Base of values with read-only arrays: what is derived from the arrays is kept, and must stay true."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over what a copy or a pickle holds; NumPy makes arrays in it that can be written to."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)
