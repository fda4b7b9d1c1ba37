"""Padding of a map's charts, for bilinear filtering and mipmaps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Number of rows whose distances are computed at a time.
ROWS = 256


def pad(values: npt.NDArray[np.float32], valued: npt.NDArray[np.bool_], padding: int) -> None:
    """Give texels up to `padding` texels from a texel with a value that of the nearest, in place.

    Between two charts each thus keeps the half of the gap that is next to it, and covers nothing of the other.

    Parameters
    ----------
    values : (h, w, ...) float32
    valued : (h, w) bool
    padding : int
    """
    if padding == 0 or valued.all() or not valued.any():
        return
    from scipy.ndimage import distance_transform_edt

    row, column = distance_transform_edt(~valued, return_distances=False, return_indices=True)
    columns = np.arange(values.shape[1])
    for begin in range(0, len(values), ROWS):
        part = slice(begin, begin + ROWS)
        rows = np.arange(begin, min(begin + ROWS, len(values)))[:, None]
        far = (row[part] - rows) ** 2 + (column[part] - columns) ** 2 > padding * padding
        # Only texels without a value change, and only those with one are read.
        new = ~(far | valued[part])
        values[part][new] = values[row[part][new], column[part][new]]
