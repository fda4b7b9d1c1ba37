"""Media as a color at a distance, which is how glTF, OpenPBR, Unity and Unreal store them.

Formula: T = exp(-sigma_t d) per channel, with sigma_t = sigma_a + sigma_s. The same sigma_t has a color at every
distance; the choice matters only for rounding. A color of 1/e in the densest channel is well conditioned: nearer to
white, digits of sigma_t are lost; nearer to black, the color leaves the range that 32-bit readers keep.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.media.medium import Medium

#: Darkest channel that is written, and the value that a channel of 0 is read as: no finite extinction makes black.
BLACKEST = 1e-5


def color_at(medium: Medium, distance: float | None = None) -> tuple[Array, float]:
    """Color that white light has after `distance` of the medium, and the distance.

    Parameters
    ----------
    medium : Medium
    distance : float, optional
        In metres, > 0. None, or a distance that leaves a channel darker than `BLACKEST`: where the densest channel
        lets 1/e pass.

    Returns
    -------
    (3,) float64, float
        Linear color, 0 < T <= 1, and metres. A medium without extinction is white after `distance`, or at infinity.

    Raises
    ------
    InputError
        If the distance is not positive.
    """
    if distance is not None and not distance > 0:
        raise InputError(f"distance {distance!r}", "not above 0", "give the distance in metres, for example 0.02")
    densest = float(medium.extinction.max())
    if densest == 0:
        return np.ones(3), math.inf if distance is None else float(distance)
    metres = 1.0 / densest if distance is None or densest * distance > -math.log(BLACKEST) else float(distance)
    color = medium.transmittance(metres)
    # 15 digits turn what a logarithm and an exponential made of 0.18 back into 0.18.
    return np.array([float(f"{value:.15g}") for value in color]), metres


def extinction_at(color: npt.ArrayLike, distance: float) -> Array:
    """(3,): sigma_t in 1/m of a stored color; a channel of 0 counts as `BLACKEST`, an infinite distance gives 0.

    Stored files may hold black, which has no finite extinction. Renderers differ there: undefined, clamped, or opaque
    from the surface on. Here it is always clamped, so that the result is finite.
    """
    triple = np.asarray(color, dtype=np.float64)
    if math.isinf(distance):
        return np.zeros(3)
    with np.errstate(under="ignore", over="ignore"):  # a medium refuses infinity
        return optics.extinction_from_color(np.where(triple == 0, BLACKEST, triple), distance)
