"""Unreal Engine's Substrate: mean free path in centimeters, or transmittance at a thickness.

Formula: MFP = 1 / sigma_t, and for a transmittance T (seen along the normal) at a thickness t: MFP = -t / ln(T).
The node Transmittance-To-MeanFreePath takes T and t in **centimeters** (0.01 by default) and gives the MFP of a slab.
The surface: F0 = ((n - 1) / (n + 1))^2, what a slab reflects at normal incidence, Roughness as here, and the index n
itself for the material's refraction.
Source: Unreal Engine documentation, Substrate Transmittance-To-MeanFreePath, Substrate Slab BSDF, Refraction mode.

Not carried over: scattering as such (a slab derives it from its diffuse albedo), emission of the volume. A channel
without extinction has an infinite mean free path; the text shows `LONGEST_CM` there, as engines take finite numbers.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.materials.snippet import stated
from translucent.media.medium import Medium, color_at

CENTIMETERS_PER_METRE = 100.0
#: Mean free path in cm that the text gives to a channel without extinction: 10 km.
LONGEST_CM = 1e6


def mean_free_path_cm(medium: Medium) -> Array:
    """(3,): mean free path in cm; infinite where there is no extinction."""
    extinction = medium.extinction
    safe = np.where(extinction > 0, extinction, 1.0)
    return np.where(extinction > 0, CENTIMETERS_PER_METRE / safe, math.inf)


def from_mean_free_path_cm(mean_free_path: npt.ArrayLike) -> Medium:
    """Absorbing medium of a mean free path (3,) in cm, > 0; infinity is no extinction."""
    path = np.asarray(mean_free_path, dtype=np.float64)
    if path.shape != (3,) or not (path > 0).all():
        raise InputError(f"mean free path {mean_free_path!r}", "not three lengths above 0", "give them in cm")
    return Medium(absorption=CENTIMETERS_PER_METRE / path)


def unreal_text(medium: Medium, distance: float | None = None, roughness: float = 0.0) -> str:
    """Inputs of the Substrate nodes; the color is stated at `distance` in metres, see `color_at`."""
    color, metres = color_at(medium, distance)
    thickness = CENTIMETERS_PER_METRE * metres if math.isfinite(metres) else 1.0
    path = np.minimum(mean_free_path_cm(medium), LONGEST_CM)
    return (
        "Substrate Transmittance-To-MeanFreePath\n"
        f"  Transmittance Color (linear) = {_triple(color)}\n"
        f"  Thickness (cm)               = {thickness:.9g}\n"
        "or Substrate Slab BSDF\n"
        f"  SSS MFP (cm)                 = {_triple(path)}\n"
        "and of the surface\n"
        f"  F0                           = {((medium.ior - 1.0) / (medium.ior + 1.0)) ** 2:.9g}\n"
        f"  Roughness                    = {roughness:.9g}\n"
        f"  Refraction, index (IOR)      = {medium.ior:.9g}\n"
    )


def read_unreal(text: str) -> Medium:
    """Read the medium of such a text, as far as nine digits go; raises `InputError` if it is none."""
    path = stated("Unreal material", text, "SSS MFP (cm)", 3)
    found = from_mean_free_path_cm(np.where(path >= LONGEST_CM, math.inf, path))
    ior = float(stated("Unreal material", text, "index (IOR)", default=1.0)[0])
    return Medium(absorption=found.absorption, ior=ior)


def _triple(values: Array) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"
