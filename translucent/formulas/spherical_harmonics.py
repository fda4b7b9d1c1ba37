"""Light in nine real spherical harmonics, and the subsurface radiance of bodies in it, in float64.

Each function has a twin of the same name in ``shaders/lib/spherical_harmonics.glsl``. Coefficient i = l (l + 1) + m of
the bands l = 0, 1, 2; orthonormal over the sphere, without the sign (-1)^m of Condon and Shortley.

References
----------
Ramamoorthi & Hanrahan 2001, "An efficient representation for irradiance environment maps", equation 3; Sloan, Kautz &
Snyder 2002, "Precomputed radiance transfer for real-time rendering in dynamic, low-frequency lighting environments".
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas import optics

#: Number of coefficients.
COUNT = 9

#: Factors of the polynomials: of band 0, of band 1, and in band 2 of x y and of 3 z^2 - 1.
BAND_0, BAND_1 = 0.5 / math.sqrt(math.pi), math.sqrt(0.75 / math.pi)
BAND_2, BAND_2_ZONAL = 0.5 * math.sqrt(15.0 / math.pi), 0.25 * math.sqrt(5.0 / math.pi)


@np.errstate(under="ignore")
def real_harmonics(direction: npt.ArrayLike) -> Array:
    """Nine real spherical harmonics (..., 9) in unit directions (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    band_1 = [BAND_1 * y, BAND_1 * z, BAND_1 * x]
    band_2 = [
        BAND_2 * x * y,
        BAND_2 * y * z,
        BAND_2_ZONAL * (3.0 * z * z - 1.0),
        BAND_2 * x * z,
        0.5 * BAND_2 * (x * x - y * y),
    ]
    return np.stack([np.full_like(x, BAND_0), *band_1, *band_2], axis=-1)


@np.errstate(under="ignore")
def scattered_radiance(transfer: npt.ArrayLike, light: npt.ArrayLike) -> Array:
    """Mean subsurface radiance (..., 3) of a point of a body, sum_i T_i L_i; at least 0.

    Parameters
    ----------
    transfer : array_like (..., 9, 3)
        T: what is baked.
    light : array_like (..., 9, 3)
        L: coefficients of the radiance that arrives from each direction, in the frame of the object. An environment has
        `Environment.harmonics`; a distant light its irradiance times `real_harmonics` of the direction towards it.
    """
    found = (np.asarray(transfer, np.float64) * np.asarray(light, np.float64)).sum(axis=-2)
    return np.asarray(np.maximum(found, 0.0))


def exit_lobe(cosine: npt.ArrayLike, ior: npt.ArrayLike, entering: npt.ArrayLike) -> Array:
    """Subsurface radiance in a direction over its mean: (1 - F(mu)) / e.

    What leaves a lossless body in uniform light: alike in all directions inside, it passes the interface. The mean over
    directions outside, weighted by their cosines, is 1.

    Parameters
    ----------
    cosine : array_like
        mu: of the direction with the normal, outside, 0 to 1.
    ior : array_like
        Of the medium.
    entering : array_like
        e: fraction of diffuse light that the polished interface lets through, `DiffuseInterface.entering`.
    """
    return np.asarray((1.0 - optics.fresnel_dielectric(cosine, ior)) / np.asarray(entering, np.float64))
