"""Random directions after a scattering event."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array


def scattered_directions(directions: Array, anisotropy: Array, rng: np.random.Generator) -> Array:
    """Unit vectors (k, 3) distributed by the phase function of Henyey and Greenstein around `directions` (k, 3).

    Parameters
    ----------
    directions : (k, 3) float64
        Of travel before the event; unit vectors.
    anisotropy : (k,) float64
    rng : numpy.random.Generator
    """
    cosine = henyey_greenstein_cosine(rng.random(len(directions)), anisotropy)
    sine = np.sqrt(np.maximum((1.0 - cosine) * (1.0 + cosine), 0.0))
    angle = 2.0 * np.pi * rng.random(len(directions))
    across, up = _frame(directions)
    with np.errstate(under="ignore"):
        turned = across * np.cos(angle)[:, None] + up * np.sin(angle)[:, None]
        scattered = directions * cosine[:, None] + turned * sine[:, None]
    return np.asarray(scattered / np.linalg.norm(scattered, axis=1, keepdims=True))


def henyey_greenstein_cosine(u: npt.ArrayLike, anisotropy: npt.ArrayLike) -> Array:
    """Cosine between the directions before and after the event, from `u` in 0 to 1 (Witt 1977).

    Rearranged so that nothing is divided by g, which may be 0.
    """
    g = np.asarray(anisotropy, dtype=np.float64)
    a = 2.0 * np.asarray(u, dtype=np.float64) - 1.0
    with np.errstate(under="ignore"):
        root = (1.0 - g) * (1.0 + g) / (1.0 + g * a)
        return np.clip(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0)


@np.errstate(under="ignore")
def _frame(directions: Array) -> tuple[Array, Array]:
    """Two unit vectors (k, 3) each, at right angles to each other and to `directions` (Duff et al. 2017)."""
    x, y, z = directions.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1),
        np.stack([b, sign + y * y * a, -y], axis=-1),
    )
