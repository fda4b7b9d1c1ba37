"""Phase functions of the reference: their values, and random directions after a scattering event."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.formulas.phase import Draine, HenyeyGreenstein, PhaseFunction, WaterDroplets


def phase_value(phase: PhaseFunction, cosine: Array) -> Array:
    """Phase function in 1/sr at cosines between the directions of travel before and after the event."""
    match phase:
        case HenyeyGreenstein(g):
            return _henyey_greenstein(cosine, g)
        case Draine(g, alpha):
            # Its norm: half the integral of cos^2 times Henyey and Greenstein's is (1 + 2 g^2) / 3.
            return _henyey_greenstein(cosine, g) * (1 + alpha * cosine**2) / (1 + alpha * (1 + 2 * g**2) / 3)
        case WaterDroplets(diameter):
            parts, weight = _droplets(diameter)
            return (1 - weight) * phase_value(parts[0], cosine) + weight * phase_value(parts[1], cosine)
    raise NotImplementedError(f"the reference has no {phase.name}")


def scattered_directions(
    directions: Array, phases: Sequence[PhaseFunction], chosen: Integers, rng: np.random.Generator
) -> Array:
    """Unit vectors (k, 3) distributed by phase functions around `directions` (k, 3).

    Parameters
    ----------
    directions : (k, 3) float64
        Of travel before the event; unit vectors.
    phases : sequence of PhaseFunction
    chosen : (k,) int
        Number of that of each event.
    rng : numpy.random.Generator
    """
    u = rng.random(len(directions))
    cosine = np.empty(len(directions))
    angle = 2.0 * np.pi * rng.random(len(directions))
    for number, phase in enumerate(phases):
        own = chosen == number
        cosine[own] = _cosines(phase, u[own], rng)
    return turned(directions, cosine, angle)


def turned(directions: Array, cosine: Array, angle: Array) -> Array:
    """Unit vectors (k, 3) at the cosines (k,) to unit vectors (k, 3), at angles (k,) around them."""
    sine = np.sqrt(np.maximum((1.0 - cosine) * (1.0 + cosine), 0.0))
    across, up = _frame(directions)
    with np.errstate(under="ignore"):
        aside = across * np.cos(angle)[:, None] + up * np.sin(angle)[:, None]
        found = directions * cosine[:, None] + aside * sine[:, None]
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _cosines(phase: PhaseFunction, u: Array, rng: np.random.Generator) -> Array:
    """Cosines distributed by a phase function, for numbers `u` (k,) evenly distributed over 0 to 1, and others."""
    match phase:
        case HenyeyGreenstein(g):
            return henyey_greenstein_cosine(u, g)
        case Draine(g, alpha):
            # By rejection: Henyey and Greenstein's, each kept by the chance (1 + alpha cos^2) / (1 + alpha).
            cosine = henyey_greenstein_cosine(u, g)
            left = np.arange(len(u))
            while len(left := left[rng.random(len(left)) * (1 + alpha) > 1 + alpha * cosine[left] ** 2]):
                cosine[left] = henyey_greenstein_cosine(rng.random(len(left)), g)
            return cosine
        case WaterDroplets(diameter):
            parts, weight = _droplets(diameter)
            second = rng.random(len(u)) < weight
            return np.where(second, _cosines(parts[1], u, rng), _cosines(parts[0], u, rng))
    raise NotImplementedError(f"the reference has no {phase.name}")


def _henyey_greenstein(cosine: Array, g: float) -> Array:
    """Henyey and Greenstein 1941: (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))."""
    ahead = 1.0 - cosine if g >= 0 else 1.0 + cosine
    base = (1.0 - abs(g)) ** 2 + 2.0 * abs(g) * ahead
    return np.asarray((1.0 - g) * (1.0 + g) / (4.0 * np.pi * base * np.sqrt(base)))


def _droplets(diameter: float) -> tuple[tuple[HenyeyGreenstein, Draine], float]:
    """The two parts of light that water droplets scatter, and the fraction of the second: Jendersie and d'Eon 2023."""
    um = diameter / 1e-6
    g_hg, g_d = np.exp(-0.0990567 / (um - 1.67154)), np.exp(-2.20679 / (um + 3.91029) - 0.428934)
    alpha, w_d = np.exp(3.62489 - 8.29288 / (um + 5.52825)), np.exp(-0.599085 / (um - 0.641583) - 0.665888)
    return (HenyeyGreenstein(float(g_hg)), Draine(float(g_d), float(alpha))), float(w_d)


def henyey_greenstein_cosine(u: npt.ArrayLike, g: float) -> Array:
    """Cosine between the directions before and after the event, from `u` in 0 to 1 (Witt 1977).

    Rearranged so that nothing is divided by g, which may be 0.
    """
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
