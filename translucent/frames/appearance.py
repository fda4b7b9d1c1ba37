"""Average color of a medium on a mesh: transmittance averaged over the thickness of each pixel.

A color at one distance is not the color of an object: its thin parts let more light through. Here the distances are
those of a rendered frame, T_mean = mean(exp(-sigma d)), and the inverse finds the extinction for a color as seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.color import to_hex
from translucent.frames.frame import Frame
from translucent.media.colors import html_swatches, parse_color
from translucent.media.conversion import CHANNELS, CLAMP
from translucent.media.medium import Medium

#: Quantiles of the thickness by which a mesh is described.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)

_MAX_STEPS = 200


@dataclass(frozen=True, eq=False)
class Appearance:
    """Appearance of a medium on a mesh before white light.

    Attributes
    ----------
    medium : Medium
        Its extinction counts; light scattered or emitted into the view does not.
    color : (3,) float64
        Linear, averaged over the pixels.
    pixels : int
        How many they are.
    mean_thickness : float
        Metres.
    thickness : (5,) float64
        Metres: `QUANTILES` of the pixels are thinner.
    colors : (5, 3) float64
        Linear, at these thicknesses: from the thin parts to the thick ones.
    thin_share : (3,) float64
        Fraction of the average color that the thinnest 5 % of the pixels bring: 0.05 in a clear medium, and near 1
        where all but the edges is black.
    """

    medium: Medium
    color: Array
    pixels: int
    mean_thickness: float
    thickness: Array
    colors: Array
    thin_share: Array

    def summary(self) -> dict[str, Any]:
        """Summary as values that JSON can hold; lengths in metres."""
        with np.errstate(under="ignore"):
            parts = [
                {"thinner": fraction, "thickness": metres, "color": color, "hex": to_hex(color)}
                for fraction, metres, color in zip(
                    QUANTILES, self.thickness.tolist(), self.colors.tolist(), strict=True
                )
            ]
            return {
                "average_color": self.color.tolist(),
                "average_hex": to_hex(self.color),
                "pixels": self.pixels,
                "mean_thickness": self.mean_thickness,
                "thin_share": self.thin_share.tolist(),
                "parts": parts,
            }

    def _repr_html_(self) -> str:
        """Swatches of the average color, and of the thin to the thick parts, for notebooks."""
        with np.errstate(under="ignore"):
            parts = [(color, f"{metres:.4g} m") for metres, color in zip(self.thickness, self.colors, strict=True)]
            return html_swatches([(self.color, "average"), *parts])


@checked
def appearance_of(seen: Frame | npt.ArrayLike, medium: Medium) -> Appearance:
    """Appearance of a medium on a mesh, from any frame of the mesh or from thickness in metres per pixel.

    Raises
    ------
    InputError
        If nothing is seen, or a thickness is negative or not finite.
    """
    thickness = np.sort(thickness_samples(seen))
    parts, color = np.quantile(thickness, QUANTILES), average_color(thickness, medium)
    thin = max(1, round(QUANTILES[0] * thickness.size))
    with np.errstate(under="ignore"):
        light = average_color(thickness[:thin], medium) * thin / thickness.size
        fraction = np.divide(light, color, out=np.ones(3), where=color > 0)
    return Appearance(
        medium, color, thickness.size, float(thickness.mean()), parts, medium.transmittance(parts), fraction
    )


def thickness_samples(seen: Frame | npt.ArrayLike) -> Array:
    """Thickness samples in metres: the covered and valid pixels of a frame, or a flattened array.

    Raises
    ------
    InputError
        If nothing is seen, or a thickness is negative or not finite.
    """
    if isinstance(seen, Frame):
        thickness = np.asarray(seen.thickness[seen.coverage & seen.valid], dtype=np.float64)
    else:
        thickness = np.asarray(seen, dtype=np.float64).reshape(-1)
    if thickness.size == 0:
        if isinstance(seen, Frame) and seen.coverage.any():
            found = f"all {int(seen.coverage.sum())} pixels that the mesh covers are marked invalid"
            raise InputError(
                "thickness of the visible model",
                found,
                "close the holes of the mesh, which `translucent explain` lists",
            )
        raise InputError(
            "thickness of the visible model",
            "no pixel shows a valid part of the model",
            "move the camera so that the model is in the picture",
        )
    if isinstance(seen, Frame):
        return np.maximum(thickness, 0.0)  # a difference of float32 sums, a rounding below 0 at a silhouette
    if not (np.isfinite(thickness).all() and (thickness >= 0).all()):
        raise InputError(
            "thickness of the visible model", "a value is negative or not finite", "give metres, 0 or above"
        )
    return thickness


@checked
def average_color(seen: Frame | npt.ArrayLike, medium: Medium) -> Array:
    """(3,): linear color of a mesh before white light, averaged over the pixels that it covers.

    Parameters
    ----------
    seen : Frame or array_like
        A frame of one body, or thickness in metres per pixel.
    medium : Medium
        Its extinction counts; light scattered or emitted into the view does not.
    """
    thickness = thickness_samples(seen)
    with np.errstate(under="ignore"):
        return np.array([optics.transmittance(sigma * thickness).mean() for sigma in medium.extinction])


def extinction_for_average_color(seen: Frame | npt.ArrayLike, color: str | npt.ArrayLike) -> Array:
    """(3,): the extinction in 1/m at which a mesh shows `color` on average.

    Per channel the one root of mean(exp(-sigma d)) = t: the mean falls from 1 at sigma = 0 to the fraction of pixels
    without any thickness.

    Parameters
    ----------
    seen : Frame or array_like
        A frame of one body (its medium does not matter), or thickness in metres per pixel.
    color : str or array_like (3,)
        As seen before white light: hex and names are sRGB, bare triples linear; 1e-4 <= t <= 1; 1 gives exactly 0.

    Raises
    ------
    InputError
        If a channel is outside its range, or so dark that the pixels without thickness alone are brighter.
    """
    thickness, triple = thickness_samples(seen), parse_color(color)
    return np.array(
        [_solve(thickness, name, value) for name, value in zip(CHANNELS, triple.tolist(), strict=True)],
        dtype=np.float64,
    )


@checked
def medium_for_average_color(seen: Frame | npt.ArrayLike, color: str | npt.ArrayLike, ior: float = 1.0) -> Medium:
    """Absorbing medium with which a mesh has `color` on average, for a frame or thickness in metres per pixel.

    See `extinction_for_average_color` for ranges and errors. The camera matters: other views see other thickness.
    """
    return Medium(absorption=extinction_for_average_color(seen, color), ior=ior)


def _solve(thickness: Array, name: str, target: float) -> float:
    if not CLAMP <= target <= 1:
        do = "a medium cannot amplify light" if target > 1 else f"use {CLAMP:g} or more: darker colors look black"
        raise InputError(f"average color with {name} = {target:g}", f"the value must satisfy {CLAMP:g} <= t <= 1", do)
    if target == 1:
        return 0.0
    clear = float(np.mean(thickness == 0))
    if target <= clear:
        found = f"{100 * clear:.3g} % of the pixels have a thickness of 0 and stay white"
        raise InputError(f"average color with {name} = {target:g}", found, "choose a brighter color, or another view")
    # Without a unit: lengths as fractions of the mean one, so that neither kilometers nor micrometers overflow.
    scale = float(thickness.mean())
    with np.errstate(under="ignore", over="ignore"):
        solved = _root(thickness / scale, log(target)) / scale if scale > 0 else np.inf
    if not np.isfinite(solved):
        raise InputError(
            f"thickness of {scale:g} m",
            "the model is so thin that the extinction overflows",
            "check the unit of length",
        )
    return float(solved)


def _root(relative: Array, goal: float) -> float:
    """Root x >= 0 of log(mean(exp(-x relative))) = goal: Newton within a bracket, else bisection.

    The logarithm of the mean is convex and falls, so Newton from the left never passes the root; the bracket is for
    rounding. By Jensen's inequality, x = -goal (the mean of `relative` is 1) is at the root or left of it.
    """
    low, high, x = 0.0, np.inf, -goal
    for _ in range(_MAX_STEPS):
        light = optics.transmittance(x * relative)
        mean = light.mean()
        excess = np.log(mean) - goal if mean > 0 else -np.inf
        low, high = (x, high) if excess >= 0 else (low, x)
        slope = (light * relative).mean() / mean if mean > 0 else 0.0
        step = excess / slope if slope > 0 else np.inf
        if abs(step) <= 4e-16 * x:
            break
        x += step
        if not low <= x <= high:
            x = 0.5 * (low + high) if np.isfinite(high) else 2.0 * low
    return x
