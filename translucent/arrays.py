"""Names of array types for annotations."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Quantities and geometry.
Array = npt.NDArray[np.float64]

#: What goes to the GPU or comes from it, and what files hold.
Floats = npt.NDArray[np.float32]

#: Indices and counts.
Integers = npt.NDArray[np.int64]

Mask = npt.NDArray[np.bool_]

#: Of pictures, 8 bits for each channel.
Pixels = npt.NDArray[np.uint8]
