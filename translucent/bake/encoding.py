"""Encoding of thickness in files: metres = offset + scale * stored.

=============  ===========  =======================  =====================================
file           asked        stored                   metres = offset + scale * stored
=============  ===========  =======================  =====================================
float          metric       t                        t = 0 + 1 * stored
float          normalize    t / max                  t = 0 + max * stored
float          invert       1 - t / max              t = max - max * stored
16-bit gray    metric,      round(65535 t / max)     t = 0 + (max / 65535) * stored
               normalize
16-bit gray    invert       65535 - the same         t = max - (max / 65535) * stored
glTF, G        (none)       round(255 t / max)       t = 0 + (max / 255) * stored
=============  ===========  =======================  =====================================

With ``local``, the mode without a unit, read "value" for metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError


@dataclass(frozen=True)
class Encoding:
    """Encoding of values in a file, and its inverse.

    Parameters
    ----------
    scale, offset : float
        value = offset + scale * stored.
    levels : int
        Largest whole number that the file stores; 0 for floats, which are stored as they are.
    unit : str
        Of the values: ``"m"``, or ``"1"`` for those without a unit.
    """

    scale: float = 1.0
    offset: float = 0.0
    levels: int = 0
    unit: str = "m"

    @classmethod
    def of(
        cls, values: npt.ArrayLike, levels: int = 0, *, normalize: bool = False, invert: bool = False, unit: str = "m"
    ) -> Encoding:
        """Encoding for these values; `invert` also normalizes, so that thin parts are 1 and the thickest 0.

        Raises
        ------
        InputError
            If the largest value must divide the others, and is 0.
        """
        if not (levels or normalize or invert):
            return cls(unit=unit)
        largest = float(np.max(values, initial=0.0))
        if largest == 0:
            if normalize or invert:
                raise InputError("values as shares of the largest", "it is 0", "leave --normalize and --invert out")
            largest = 1.0  # what does not matter where all are 0, and yet must not divide by 0
        scale = largest / (levels or 1)
        return cls(-scale, largest, levels, unit) if invert else cls(scale, 0.0, levels, unit)

    @property
    def quantum(self) -> float:
        """Quantization step of the values; 0 for floats."""
        return abs(self.scale) if self.levels else 0.0

    def encode(self, values: npt.ArrayLike) -> npt.NDArray[Any]:
        """Encode values as float32, uint8 or uint16."""
        with np.errstate(under="ignore"):
            stored = (np.asarray(values, dtype=np.float64) - self.offset) / self.scale
            if not self.levels:
                return stored.astype(np.float32)
        whole = np.clip(np.rint(stored), 0, self.levels)
        return whole.astype(np.uint8 if self.levels < 256 else np.uint16)

    def decode(self, stored: npt.ArrayLike) -> Array:
        """Decode values to float64."""
        return self.offset + self.scale * np.asarray(stored, dtype=np.float64)

    def summary(self) -> dict[str, Any]:
        """Formula as values that JSON can hold."""
        return {
            "formula": "value = offset + scale * stored",
            "scale": self.scale,
            "offset": self.offset,
            "unit": self.unit,
            "bits": 32 if not self.levels else self.levels.bit_length(),
            "quantum": self.quantum,
        }
