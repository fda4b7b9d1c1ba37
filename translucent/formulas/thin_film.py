"""Formulas of light at an interface under a thin film, in float64.

Each has a twin in ``shaders/lib/thin_film.glsl``.

All functions are pure and broadcast; results are linear Rec.709 (..., 3). A film so thin that light reflected at its
two sides interferes is colored, as soap bubbles and oxide layers are. Amplitudes are exact (Fresnel, both
polarizations); what spectra do to colors is in Gaussians of the wave number, fitted to the sensitivity of the eye, in
whose Fourier transforms each order of the interference is a closed form. Light has equal energy at all wavelengths, and
is adapted to the white of Rec.709, so that a film which reflects all of them alike is gray.

References
----------
Belcour and Barla 2017, "A practical extension to microfacet theory for the modeling of varying iridescence", with their
Gaussians; Khronos Group 2022, KHR_materials_iridescence; Airy 1833; Stokes 1862.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics

#: Centers in 1/m, and half the variances in 1/m^2, of the Gaussians of X, Y and Z.
FILM_CENTERS = (1.6810e6, 1.7953e6, 2.2084e6)
FILM_WIDTHS = (4.3278e9, 9.3046e9, 6.6121e9)

#: The same of the second maximum of X, at 446 nm.
FILM_BLUE_CENTER = 2.2399e6
FILM_BLUE_WIDTH = 4.5282e9

_PEAKS = 5.4856e-13 * np.sqrt(4.3278e9), 9.7470e-14 * np.sqrt(4.5282e9)
#: Fraction of the second maximum in X.
FILM_BLUE_SHARE = float(_PEAKS[1] / (_PEAKS[0] + _PEAKS[1]))

_XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
_ADAPTED = _XYZ_TO_RGB * (0.95047, 1.0, 1.08883)
#: Rec.709 of X, Y and Z in fractions of white; rows add up to 1.
FILM_TO_RGB = _ADAPTED / _ADAPTED.sum(axis=1, keepdims=True)

#: Optical paths in m up to which all orders are added up as if light had one wavelength for each channel, and from
#: which on `FILM_ORDERS` orders are, each with its spectrum.
FILM_COHERENT = (200e-9, 500e-9)
FILM_ORDERS = 3


@np.errstate(under="ignore")
def film_interference(optical_path: npt.ArrayLike) -> Array:
    """Mean of cos(2 pi path / wavelength) over what each channel sees, (..., 3): 1 at 0, and 0 for long paths.

    Parameters
    ----------
    optical_path : array_like
        Difference of two paths times index of refraction, in metres, >= 0.
    """
    phase = 2.0 * np.pi * np.asarray(optical_path, dtype=np.float64)[..., None]
    waves = np.cos(np.asarray(FILM_CENTERS) * phase) * np.exp(-np.asarray(FILM_WIDTHS) * phase**2)
    blue = np.cos(FILM_BLUE_CENTER * phase[..., 0]) * np.exp(-FILM_BLUE_WIDTH * phase[..., 0] ** 2)
    waves[..., 0] = (1.0 - FILM_BLUE_SHARE) * waves[..., 0] + FILM_BLUE_SHARE * blue
    return np.asarray(waves @ FILM_TO_RGB.T)


@np.errstate(under="ignore")
def thin_film_reflectance(
    cos_incident: npt.ArrayLike, ior: npt.ArrayLike, film_ior: npt.ArrayLike, optical_thickness: npt.ArrayLike
) -> Array:
    """Unpolarized reflectance (0..1) of a smooth interface under a thin film; the rest is transmitted.

    The same from both sides. With an index of the film that equals that of either side, or without thickness, it is
    `optics.fresnel_dielectric`. Where light could only tunnel through the film all is reflected.

    Parameters
    ----------
    cos_incident : array_like
        Cosine of the angle of incidence, 0..1.
    ior, film_ior : array_like
        Indices of the other side and of the film, relative to the side that the ray comes from.
    optical_thickness : array_like
        Index of the film (itself, not relative) times its thickness in metres.
    """
    values = np.broadcast_arrays(cos_incident, ior, film_ior, optical_thickness)
    c, n, film, thick = (np.asarray(x, dtype=np.float64) for x in values)
    in_film = ((film - 1.0) * (film + 1.0) + c * c) / (film * film)
    beyond = ((n - 1.0) * (n + 1.0) + c * c) / (n * n)
    total = (np.minimum(in_film, beyond) <= 0.0) | (c <= 0.0)
    c, c_film, c_beyond = (np.where(total, 1.0, x) for x in (c, _root(in_film), _root(beyond)))
    path = 2.0 * thick * c_film
    waves = [film_interference(order * path) for order in range(1, FILM_ORDERS + 1)]
    # Perpendicular to the plane of incidence, and in it.
    passed = _film_transmittance(c, film * c_film, n * c_beyond, path, waves)
    passed = passed + _film_transmittance(film * c, c_film, c_beyond * film / n, path, waves)
    return np.where(total[..., None], 1.0, 1.0 - np.clip(0.5 * passed, 0.0, 1.0))


def _root(squared: Array) -> Array:
    return np.sqrt(np.maximum(squared, 0.0))


def _film_transmittance(first: Array, film: Array, last: Array, path: Array, waves: list[Array]) -> Array:
    """Transmittance (..., 3) between three admittances for one polarization."""
    near, far = (first - film) / (first + film), (film - last) / (film + last)
    passed = (4.0 * first * film / (first + film) ** 2 * (4.0 * film * last / (film + last) ** 2))[..., None]
    both = -(near * far)[..., None]
    orders = 1.0 + 2.0 * sum(both ** (order + 1) * wave for order, wave in enumerate(waves))
    colored = passed / ((1.0 - both) * (1.0 + both)) * orders
    together = passed / (1.0 - 2.0 * both * np.clip(waves[0], -1.0, 1.0) + both * both)
    fraction = np.clip((path - FILM_COHERENT[0]) / (FILM_COHERENT[1] - FILM_COHERENT[0]), 0.0, 1.0)[..., None]
    return np.asarray(together + fraction * fraction * (3.0 - 2.0 * fraction) * (colored - together))


@np.errstate(under="ignore")
def film_slab_transmittance(front: npt.ArrayLike, back: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """Transmittance (..., 3) of a thin wall with a film on one side: (1 - f)(1 - b) a / (1 - f b a^2), a = exp(-tau).

    Reflections are added up as for `interface.slab_transmittance`. It is the same from both sides.

    Parameters
    ----------
    front : array_like (..., 3)
        f, reflectance of the side that the film is on, 0..1.
    back : array_like (...)
        b, of the other one.
    optical_depth : array_like (..., 3)
        tau of one passage, along the refracted ray.
    """
    other = np.asarray(back, dtype=np.float64)[..., None]
    return np.asarray(_within(front, back, optical_depth) * (1.0 - other) * optics.transmittance(optical_depth))


@np.errstate(under="ignore")
def film_slab_reflectance(front: npt.ArrayLike, back: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """Reflectance (..., 3) of such a wall from the side of the film: f + (1 - f)^2 b a^2 / (1 - f b a^2)."""
    near, other = np.asarray(front, dtype=np.float64), np.asarray(back, dtype=np.float64)[..., None]
    again = optics.transmittance(optical_depth) ** 2 * other * _within(front, back, optical_depth)
    return np.asarray(near + (1.0 - near) * again)


def _within(front: npt.ArrayLike, back: npt.ArrayLike, optical_depth: npt.ArrayLike) -> Array:
    """(1 - f) / (1 - f b a^2), with the difference multiplied out."""
    near, other = np.asarray(front, dtype=np.float64), np.asarray(back, dtype=np.float64)[..., None]
    doubled = 2.0 * np.asarray(optical_depth, dtype=np.float64)
    kept = (1.0 - near) + near * ((1.0 - other) + other * optics.opacity(doubled))
    return np.where(near < 1.0, (1.0 - near) / np.where(kept > 0.0, kept, 1.0), 0.0)
