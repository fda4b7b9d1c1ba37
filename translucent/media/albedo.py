"""Conversion between single-scattering albedo and the diffuse color of a thick, scattering body.

The color C is the reflectance of a half space under white light: after many events, not one. Two maps are in use:

- "hulst": van de Hulst's fit for isotropic scattering, with the similarity relation for anisotropy g
  (Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks"; van de Hulst 1980): with
  s = sqrt((1 - a) / (1 - a g)), C = (1 - s)(1 - 0.139 s) / (1 + 1.17 s). 0 <= C <= 1 and 0 <= a <= 1.
- "chiang": a = 1 - exp(-5.09406 C + 2.61188 C^2 - 4.31805 C^3), isotropic (Chiang, Kutz & Burley 2016, "Practical
  and Controllable Subsurface Scattering for Production Path Tracing"). 0 <= C <= 1; a <= 0.99888, its value at C = 1.

All functions broadcast over arrays.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.colors import parse_color
from translucent.media.medium import Medium

Model = Literal["hulst", "chiang"]

_CHIANG = (5.09406, -2.61188, 4.31805)

#: Largest albedo that Chiang's map reaches, that of C = 1.
CHIANG_MAX_ALBEDO = float(-np.expm1(-sum(_CHIANG)))


def hulst_albedo(color: npt.ArrayLike, anisotropy: npt.ArrayLike = 0.0) -> Array:
    """Single-scattering albedo a, 0..1, of a half space of diffuse color C, 0..1, with Henyey-Greenstein g.

    The inverse that Kulla & Conty 2017 print with six digits, exactly, and without its cancellation.

    Raises
    ------
    InputError
        If a color is not in 0..1, or an anisotropy not between -1 and 1.
    """
    s, g = _similarity(color), _anisotropy(anisotropy)
    with np.errstate(under="ignore"):
        return (1.0 - s) * (1.0 + s) / (1.0 - g * s * s)


def hulst_color(albedo: npt.ArrayLike, anisotropy: npt.ArrayLike = 0.0) -> Array:
    """Diffuse color C, 0..1, of a half space with single-scattering albedo a, 0..1, and Henyey-Greenstein g.

    Raises
    ------
    InputError
        If an albedo is not in 0..1, or an anisotropy not between -1 and 1.
    """
    a, g = _fraction("albedo", albedo), _anisotropy(anisotropy)
    with np.errstate(under="ignore"):
        s = np.sqrt((1.0 - a) / (1.0 - a * g))
        return (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)


def chiang_albedo(color: npt.ArrayLike) -> Array:
    """Single-scattering albedo a, 0..0.99888, of an isotropic half space of diffuse color C, 0..1.

    Raises
    ------
    InputError
        If a color is not in 0..1.
    """
    with np.errstate(under="ignore"):
        return -np.expm1(-_chiang_depth(_fraction("color", color)))


def chiang_color(albedo: npt.ArrayLike) -> Array:
    """Diffuse color C, 0..1, of an isotropic half space with single-scattering albedo a, 0..0.99888.

    The cubic rises throughout (its slope is 4.56 at least), so Newton's method, kept in 0..1, finds its one root.

    Raises
    ------
    InputError
        If an albedo is not in the map's range.
    """
    a = _fraction("albedo", albedo, CHIANG_MAX_ALBEDO)
    depth, c = -np.log1p(-a), np.array(a)
    p, q, r = _CHIANG
    with np.errstate(under="ignore"):
        for _ in range(8):  # quadratic: from a distance below 1 to below one rounding
            c = np.clip(c - (_chiang_depth(c) - depth) / (p + c * (2.0 * q + 3.0 * r * c)), 0.0, 1.0)
    return c


@checked
def scattering_medium(
    color: str | npt.ArrayLike,
    mean_free_path: npt.ArrayLike,
    anisotropy: float = 0.0,
    ior: float = 1.0,
    model: Model = "hulst",
) -> Medium:
    """Scattering medium with the diffuse color `color` where it is thick.

    Parameters
    ----------
    color : str or array_like (3,)
        Multiple-scattering (diffuse) color, 0..1: hex and names are sRGB, bare triples linear.
    mean_free_path : float or array_like (3,)
        1 / sigma_t in m, > 0; scattering and absorption together.
    anisotropy : float
        Henyey-Greenstein g, -1 < g < 1.
    ior : float
        Index of refraction. The maps leave the boundary out, as if it were index-matched.
    model : {"hulst", "chiang"}
        See the module. "chiang" is for g = 0.

    Raises
    ------
    InputError
        If a value is outside its range.
    """
    path = np.asarray(mean_free_path, dtype=np.float64)
    if path.shape not in ((), (3,)) or not (np.isfinite(path).all() and (path >= 1e-300).all()):
        raise InputError(
            f"mean free path {path.tolist()}",
            "the mean free path must be one length or three lengths above 0",
            "give the mean free path in metres",
        )
    triple, g = parse_color(color), _anisotropy(anisotropy)
    with np.errstate(under="ignore"):
        if model == "hulst":
            s = _similarity(triple)
            albedo, rest = hulst_albedo(triple, g), s * s * (1.0 - g) / (1.0 - g * s * s)
        elif anisotropy != 0:
            raise InputError(
                f"anisotropy {anisotropy}", "Chiang's formula is only for isotropic scattering", 'use model="hulst"'
            )
        else:
            albedo, rest = chiang_albedo(triple), np.exp(-_chiang_depth(_fraction("color", triple)))
        return Medium(absorption=rest / path, scattering=albedo / path, anisotropy=anisotropy, ior=ior)


def _similarity(color: npt.ArrayLike) -> Array:
    """Similarity parameter s in 0..1: the smaller root of 0.139 s^2 - (1.139 + 1.17 C) s + (1 - C) = 0."""
    c = _fraction("color", color)
    b = 1.139 + 1.17 * c
    with np.errstate(under="ignore"):
        return 2.0 * (1.0 - c) / (b + np.sqrt(b * b - 4.0 * 0.139 * (1.0 - c)))


def _chiang_depth(c: Array) -> Array:
    p, q, r = _CHIANG
    with np.errstate(under="ignore"):
        return c * (p + c * (q + c * r))


def _fraction(what: str, values: npt.ArrayLike, most: float = 1.0) -> Array:
    array = np.asarray(values, dtype=np.float64)
    inside = (array >= 0) & (array <= most)
    if not inside.all():
        raise InputError(
            f"{what} {float(array[~inside].flat[0]):g}", f"the value must lie in 0 to {most:g}", f"give a linear {what}"
        )
    return array


def _anisotropy(values: npt.ArrayLike) -> Array:
    g = np.asarray(values, dtype=np.float64)
    if not (np.abs(g) < 1).all():
        raise InputError(
            f"anisotropy {g.tolist()}", "the anisotropy must lie between -1 and 1", "use a value such as 0.8"
        )
    return g
