"""Values that never change, whose arrays stay read-only when they are copied or sent to another process."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

Value = TypeVar("Value", bound="Frozen")


class Frozen:
    """Base of values with read-only arrays: what is derived from the arrays is kept, and must stay true.

    A copy is the value itself, as of a tuple of numbers: NumPy's copies of its arrays could be written to.
    """

    def __copy__(self: Value) -> Value:
        return self

    def __deepcopy__(self: Value, memo: dict[int, Any]) -> Value:
        return self

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)
