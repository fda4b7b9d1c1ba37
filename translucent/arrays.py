"""Names of array types for annotations."""

from __future__ import annotations

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
