"""Order in which the pixels and samples of a progressive picture are drawn."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.formulas.sampling import sample_shifts

#: Strides of steps; the sides of pictures are multiples of the largest.
STRIDES = (1, 2, 4, 8, 16)


@lru_cache(maxsize=4)
def shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts of a pixel's later samples."""
    return sample_shifts(samples)


@lru_cache(maxsize=len(STRIDES))
def phases(stride: int) -> list[tuple[tuple[int, int], int]]:
    """Phases: pixels within stride x stride pixels, in drawing order, and the side of the square that each fills."""
    order: list[tuple[tuple[int, int], int]] = [((0, 0), stride)]
    block = stride // 2
    while block:
        # Diagonals first: half of the new pixels already make the picture look sharper in both directions.
        known = {phase for phase, _ in order}
        fresh = [(x, y) for y in range(0, stride, block) for x in range(0, stride, block) if (x, y) not in known]
        fresh.sort(key=lambda phase: (phase[0] % (2 * block) == 0) + (phase[1] % (2 * block) == 0))
        order += [(phase, block) for phase in fresh]
        block //= 2
    return order
