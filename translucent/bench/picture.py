"""Picture in a report."""

from __future__ import annotations

import base64
from dataclasses import dataclass

from translucent.bench.codec import Packed


@dataclass(frozen=True)
class Picture:
    """Picture of one method with its errors; (h, w), row 0 at the top.

    Attributes
    ----------
    method : str
        As in its `Row`, or ``"reference"``: what all others are held against; that one has no error.
    png : str
        The sRGB picture as a PNG file in base64.
    error : Packed, optional
        Signed error in the case's quantity, in its unit, as floats: of radiance and transmittance, of the channel that
        is farthest off; 0 below 5e-8. NaN where nothing is covered, or the method calls the pixel invalid.
    invalid : Packed, optional
        Booleans: pixels that the method marks.
    """

    method: str
    png: str
    error: Packed | None = None
    invalid: Packed | None = None

    def check(self) -> None:
        """Raise `ValueError` if the picture is no base64, or its parts are of different shapes."""
        base64.b64decode(self.png, validate=True)
        if self.error is not None and self.invalid is not None and self.error.shape != self.invalid.shape:
            raise ValueError(f"errors of shape {self.error.shape} and marks of shape {self.invalid.shape}")
