"""Tables that ``tools/make_tables.py`` has made."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt


@cache
def stored(name: str) -> npt.NDArray[Any]:
    """A table by its name; read-only."""
    table = np.load(Path(__file__).parent / f"{name}.npy", allow_pickle=False)
    table.setflags(write=False)
    return np.asarray(table)
