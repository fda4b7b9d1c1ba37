"""Conversion of colors at a distance to extinction and back, over whole arrays, with warnings about the result.

Symbols: transmitted linear color t_c in 0 < t_c <= 1, distance d in m, extinction sigma_t in 1/m. Beer-Lambert:
t_c = exp(-sigma_t d) for white light in a medium without in-scattering.

The transmission distance (TD) of a filament for 3D printers is one length, which HueForge and the tags of spools state
in millimetres. HueForge defines it in words, as the thickness at which no perceptible amount of light passes any more
(HueForge wiki, "Common Terms"), and names no fraction of light. Sources that compute with it differ:
T = 10^(-d / TD), so that 10 % are left (FilaScope, "TD layer simulator"); 5 %, as exp(-3) (others that calibrate it to
the words). So the fraction that is left is a parameter here, `TD_TRANSMITTANCE` unless stated.

Its formula: sigma_t = -ln(T) / TD, the same in all channels. The way back: the thickness after which white light has
kept the luminance T, so that a filament of any color has one TD, as a meter without color filters has it.

What a meter measures has been scattered on its path, too: the extinction is that of light that arrives at all, less
than the sum of absorption and scattering of a filament that scatters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.color import luminance
from translucent.media.colors import html_swatches
from translucent.units import length_text, metres_per_unit

#: Value to which a channel of 0 is clamped if that is requested: an optical depth of 9.2.
CLAMP = 1e-4

#: Fraction of light that is left after one TD: T = 10^(-d / TD).
TD_TRANSMITTANCE = 0.1

#: Halvings of the interval that holds a distance: more change nothing in float64.
_HALVINGS = 60

#: Multiples of the distance at which a medium's colors are shown.
FACTORS = (0.1, 0.5, 1.0, 2.0, 10.0)

#: Range of distances in m of a color at a distance for objects of everyday size.
USUAL_DISTANCES = (1e-5, 1e2)

NEAR_BLACK, NEAR_WHITE = 1e-3, 0.98
CHANNELS = ("red", "green", "blue")

_BLOCK = 8192  # numbers that stay in the first cache between the check, the logarithm and the division


@checked
def extinction_from_colors(colors: npt.ArrayLike, distances: npt.ArrayLike) -> Array:
    """Extinction of many colors, each left of white light after its distance: sigma_t = -log(t_c) / d.

    Parameters
    ----------
    colors : array_like (..., 3)
        Linear, 0 < t_c <= 1; t_c = 1 gives exactly 0. For channels of 0 see `clamp_colors`.
    distances : array_like (...,)
        Metres, > 0, or one number for all; they broadcast over the colors.

    Returns
    -------
    (..., 3) float64
        1/m. Its relative error is that of the color times `condition_number`.

    Raises
    ------
    InputError
        If a channel or a distance is outside its range, or an extinction overflows.
    """
    t, d = _triples(colors), np.asarray(distances, dtype=np.float64)
    if not (d > 0).all():
        raise InputError(
            f"distance {float(d[~(d > 0)].flat[0]):g} m", "a distance must be above 0", "give distances in metres"
        )
    if d.ndim:
        t, d = np.broadcast_arrays(t, d[..., None])
    flat, result = np.ascontiguousarray(t).reshape(-1), np.empty(t.shape)
    out = result.reshape(-1)
    for start in range(0, flat.size, _BLOCK):
        part, into = flat[start : start + _BLOCK], out[start : start + _BLOCK]
        if not (part.min() > 0 and part.max() <= 1):
            raise _outside(t)
        np.log(part, out=into)
        np.subtract(0.0, into, out=into)  # not a negation: the logarithm of white is to be 0, not -0
    with np.errstate(over="ignore", under="ignore"):
        result /= d
    if not np.isfinite(result).all():
        raise InputError(
            "extinction from a color at a distance",
            "the extinction is too large for a number",
            "check the unit of the distance",
        )
    return result


@checked
def clamp_colors(colors: npt.ArrayLike) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Clamp channels of 0 to `CLAMP` (1e-4), which has a finite extinction; returns colors and mask of these channels.

    Parameters
    ----------
    colors : array_like (..., 3)
        Linear. Only channels in 0 <= t < 1e-4 change: a negative one stays, to be refused.

    Returns
    -------
    clamped : (..., 3) float64
    changed : (..., 3) bool
    """
    t = _triples(colors)
    changed = (t >= 0) & (t < CLAMP)
    return np.where(changed, CLAMP, t), changed


@checked
def color_at_distance(extinction: npt.ArrayLike, distances: npt.ArrayLike) -> Array:
    """(..., 3): linear color left of white light after `distances` (...,) metres, >= 0: exp(-sigma_t d).

    Raises
    ------
    InputError
        If a distance is below 0.
    """
    with np.errstate(under="ignore"):
        return optics.transmittance(_triples(extinction) * lengths(distances)[..., None])


def lengths(metres: npt.ArrayLike) -> Array:
    """Lengths of paths through a medium in metres, as they are: more light than white would be left of a negative one.

    Raises
    ------
    InputError
        If one is below 0.
    """
    found = np.asarray(metres, dtype=np.float64)
    if (below := found < 0).any():
        raise InputError(
            f"transmittance after {float(found[below].flat[0]):g} m",
            f"the length is below 0{('' if found.ndim == 0 else f' at {int(below.sum())} of {found.size} places')}",
            "give lengths of paths through the medium, 0 or above",
        )
    return found


@checked
def condition_number(colors: npt.ArrayLike) -> Array:
    """Relative error of sigma_t per relative error of t_c: 1 / -log(t_c).

    It is infinite at t_c = 1 (near white, rounding a color to 8 bits changes everything), and below 1 for t_c < 1/e.
    The way back multiplies by -log(t_c): a relative error e of sigma_t is one of e -log(t_c) in the color.
    """
    found = np.asarray(colors, dtype=np.float64)
    if (found < 0).any():
        raise InputError(
            "condition number of a color", "a channel of the color is below 0", "give linear colors, from 0 to 1"
        )
    with np.errstate(divide="ignore"):
        return 1.0 / np.abs(np.log(found))


def mean_free_path(extinction: npt.ArrayLike) -> Array:
    """Mean free path 1 / sigma_t in m, after which 1/e (37 %) of the light is left; inf where sigma_t = 0."""
    with np.errstate(divide="ignore", over="ignore"):
        return 1.0 / np.asarray(extinction, dtype=np.float64)


def half_value_thickness(extinction: npt.ArrayLike) -> Array:
    """Half-value thickness ln 2 / sigma_t in m, after which half the light is left; inf where sigma_t = 0."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(np.log(2.0) / np.asarray(extinction, dtype=np.float64))


@dataclass(frozen=True)
class DistanceMatch:
    """Distance at which a medium best matches a color.

    Attributes
    ----------
    distance : float
        Metres, >= 0: the best for all channels, by least squares in log space.
    per_channel : tuple of (float or None)
        Metres at which each channel has its value; inf if it never darkens so far, None if any distance does.
    residual : tuple of float
        log(color at `distance` / color) per channel, 0 where it is met.
    color : tuple of float
        The linear color that was requested.
    """

    distance: float
    per_channel: tuple[float | None, ...]
    residual: tuple[float, ...]
    color: tuple[float, ...]

    def _repr_html_(self) -> str:
        """Swatches of the color that was requested and of the one that is found, for notebooks."""
        with np.errstate(under="ignore"):
            found = np.array(self.color) * np.exp(self.residual)
        return html_swatches([(self.color, "requested"), (found, f"after {length_text(self.distance)}")])


@checked
def distance_for_color(extinction: npt.ArrayLike, color: npt.ArrayLike) -> DistanceMatch:
    """Distance after which a medium leaves `color` of white light: the d that minimizes sum (sigma_t d + log t_c)^2.

    Parameters
    ----------
    extinction : array_like (3,)
        1/m, >= 0, with at least one channel above 0.
    color : array_like (3,)
        Linear, each channel in 0 < t_c <= 1.

    Raises
    ------
    InputError
        If the medium extinguishes nothing, or a channel is outside its range.
    """
    sigma, depth = _triples(extinction), extinction_from_colors(color, 1.0)
    if sigma.shape != (3,) or not (np.isfinite(sigma).all() and (sigma >= 0).all() and (sigma > 0).any()):
        raise InputError(
            f"extinction {sigma.tolist()}",
            "the extinction must be three numbers >= 0, of which at least one is above 0",
            "use a medium that absorbs or scatters light",
        )
    peak = sigma.max()
    with np.errstate(under="ignore", over="ignore"):  # relative to the largest channel, no square can overflow
        relative = sigma / peak
        distance = float((relative * depth).sum() / (relative * relative).sum() / peak)
        if not np.isfinite(distance):
            raise InputError(
                f"distance for color {np.asarray(color).tolist()}",
                "the distance is too large for a number",
                "check the extinction",
            )
        per_channel = tuple(
            (float(x / s) if s > 0 else np.inf if x > 0 else None) for s, x in zip(sigma, depth, strict=True)
        )
        residual = tuple((depth - sigma * distance).tolist())
        return DistanceMatch(distance, per_channel, residual, tuple(_triples(color).tolist()))


def doubts(color: npt.ArrayLike, distance: float) -> tuple[str, ...]:
    """Warnings about a color at a distance: ill-conditioned channels, a unit that looks wrong.

    Parameters
    ----------
    color : array_like (3,)
        Linear, each channel in 0 < t_c <= 1.
    distance : float
        Metres, > 0.

    Returns
    -------
    tuple of str
        One line each; empty if there is nothing to say.
    """
    t = _triples(color)
    lines = [line for name, value in zip(CHANNELS, t.tolist(), strict=True) if (line := _channel_doubt(name, value))]
    low, high = USUAL_DISTANCES
    if not low <= distance <= high:
        lines.append(f"the distance {distance:g} m is outside {low:g} to {high:g} m; check the unit")
    near, far = (color_at_distance(extinction_from_colors(t, 1.0), factor) for factor in (FACTORS[0], FACTORS[-1]))
    if near.max() < 0.01:
        lines.append("nearly black even at a tenth of the distance; check the unit, or use a lighter color")
    if far.min() > 0.9 and t.min() < 1:
        lines.append("nearly clear even at ten times the distance; check the unit, or use a darker color")
    return tuple(lines)


def summary(color: npt.ArrayLike, distance: float, extinction: npt.ArrayLike, unit: str = "m") -> dict[str, Any]:
    """Summary of one color at a distance as values that JSON can hold: None is infinity. Lengths in metres.

    Parameters
    ----------
    color : array_like (3,)
        Linear, after `distance`, each channel in 0 < t_c <= 1.
    distance : float
        Metres, > 0.
    extinction : array_like (3,)
        1/m, as converted.
    unit : str
        ``extinction_per_unit`` is per this unit.
    """
    t, sigma = _triples(color), _triples(extinction)
    with np.errstate(over="ignore"):
        distances = np.minimum(np.array(FACTORS) * distance, np.finfo(np.float64).max)
    colors = color_at_distance(sigma, distances)
    with np.errstate(under="ignore"):
        per_unit = sigma * metres_per_unit(unit)
    return {
        "color": t.tolist(),
        "distance": distance,
        "extinction": sigma.tolist(),
        "mean_free_path": _finite_or_none(mean_free_path(sigma)),
        "half_value_thickness": _finite_or_none(half_value_thickness(sigma)),
        "condition_number": _finite_or_none(condition_number(t)),
        "transmittance": {f"{factor:g}": row.tolist() for factor, row in zip(FACTORS, colors, strict=True)},
        "unit": unit,
        "extinction_per_unit": per_unit.tolist(),
        "warnings": list(doubts(t, distance)),
    }


def _finite_or_none(values: Array) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _channel_doubt(name: str, value: float) -> str | None:
    if value == 1:
        return f"{name} is 1, so the medium absorbs nothing of it; if the value was clipped, use a lower one"
    if value > NEAR_WHITE:
        # Next to white, a step of 1/255 in sRGB is one of 2.4 / 1.055 / 255 = 0.9 % in the linear value.
        percent = 100 * 0.5 * 2.4 / 1.055 / 255 * float(condition_number(value))
        return f"{name} {value:g} is near white: rounding to 8 bits changes the extinction by up to {percent:.0f} %"
    if value < NEAR_BLACK:
        return f"{name} {value:g} is near black: 8 bits hardly distinguish it from 0, with an infinite extinction"
    return None


def _triples(values: npt.ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(
            f"colors of shape {array.shape}",
            "the last axis must have three numbers: (..., 3)",
            "put red, green and blue on the last axis",
        )
    return array


def _outside(t: Array) -> InputError:
    wrong = ~((t > 0) & (t <= 1))
    first = tuple(np.argwhere(wrong)[0].tolist())
    where = f" in color {', '.join(str(i) for i in first[:-1])}" if len(first) > 1 else ""
    return InputError(
        f"{int(wrong.sum())} of {t.size} channels",
        (
            f"transmitted colors must satisfy 0 < t <= 1, but the first wrong value is {CHANNELS[first[-1]]} "
            f"= {t[first]:g}{where}"
        ),
        "replace zeros on purpose (tl.clamp_colors), and scale colors to at most 1",
    )


def html_strip(extinction: npt.ArrayLike, distance: float | None = None) -> str:
    """Swatches of white light after 0.1 to 10 times a distance in a medium, each with its distance and hex color.

    Parameters
    ----------
    extinction : array_like (3,)
        1/m.
    distance : float, optional
        Metres. Default: where 1/e is left of the channels' mean exponent; 1 m for a medium without extinction.
    """
    sigma = np.asarray(extinction, dtype=np.float64)
    if distance is None:
        mean = float(sigma.mean())
        distance = min(1.0 / mean, 1e300) if mean > 1e-300 else 1.0
    return html_swatches(
        (color_at_distance(sigma, factor * distance), length_text(factor * distance)) for factor in FACTORS
    )


def extinction_of_td(td: float, transmittance: float = TD_TRANSMITTANCE) -> Array:
    """(3,) 1/m: gray extinction that lets the fraction `transmittance` of light pass after `td` metres.

    Raises
    ------
    InputError
        If the distance is not positive and finite, or the fraction not between 0 and 1.
    """
    return extinction_from_colors(np.full(3, _fraction(transmittance)), td)


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
