from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def strict_floats() -> Iterator[None]:
    with np.errstate(all="raise"):
        yield
