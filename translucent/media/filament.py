"""Transmission distance of 3D printers' filaments, to and from extinction.

Transmission distance (TD) is one length for a filament, which HueForge and the tags of spools state in millimetres.
HueForge defines it in words, as the thickness at which no perceptible amount of light passes any more (HueForge wiki,
"Common Terms"), and names no fraction of light. Sources that compute with it differ: T = 10^(-d / TD), so that 10 % are
left (FilaScope, "TD layer simulator"); 5 %, as exp(-3) (others that calibrate it to the words). So the fraction that is
left is a parameter here, `TD_TRANSMITTANCE` unless stated.

Formula: sigma_t = -ln(T) / TD, the same in all channels. The way back: the thickness after which white light has kept
the luminance T, so that a filament of any color has one TD, as a meter without color filters has it.

What a meter measures has been scattered on its path, too: the extinction is that of light that arrives at all, less
than the sum of absorption and scattering of a filament that scatters.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.color import luminance
from translucent.media.medium import Medium

#: Fraction of light that is left after one TD: T = 10^(-d / TD).
TD_TRANSMITTANCE = 0.1

#: Halvings of the interval that holds a distance: more change nothing in float64.
_HALVINGS = 60


def medium_of_td(td: float, transmittance: float = TD_TRANSMITTANCE) -> Medium:
    """Gray absorbing medium that lets the fraction `transmittance` of light pass after `td` metres.

    Raises
    ------
    InputError
        If the distance is not positive and finite, or the fraction not between 0 and 1.
    """
    return Medium.from_color(np.full(3, _fraction(transmittance)), td)


def td_of(extinction: npt.ArrayLike, transmittance: float = TD_TRANSMITTANCE) -> float:
    """Thickness in metres after which white light has kept the luminance `transmittance`; infinite if it always does.

    Parameters
    ----------
    extinction : array_like (3,)
        1/m, >= 0.
    transmittance : float
        Between 0 and 1.

    Raises
    ------
    InputError
        If the fraction is not between 0 and 1.
    """
    sigma, depth = np.asarray(extinction, dtype=np.float64), -math.log(_fraction(transmittance))
    if luminance(sigma == 0) >= transmittance:
        return math.inf
    with np.errstate(under="ignore", over="ignore"):
        near, far = depth / sigma.max(), depth / sigma[sigma > 0].min()
        if not math.isfinite(far):
            return math.inf
        # Channels that never darken keep their part of the luminance; with them, the others must darken further.
        while luminance(optics.transmittance(sigma * far)) > transmittance:
            far *= 2.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (near + far)
            bright = luminance(optics.transmittance(sigma * middle)) > transmittance
            near, far = (middle, far) if bright else (near, middle)
    return float(0.5 * (near + far))


def _fraction(transmittance: float) -> float:
    if not 0 < transmittance < 1:
        do = "give the fraction of light that is left after one TD, for example 0.1"
        raise InputError(
            f"transmission distance at a transmittance of {transmittance!r}",
            "the transmittance must lie between 0 and 1",
            do,
        )
    return float(transmittance)
