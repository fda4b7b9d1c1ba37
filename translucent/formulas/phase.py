"""Phase functions: distributions of scattered light over the scattering angle.

Functions have twins of the same name in ``shaders/lib/phase.glsl``; a phase function is four numbers there, its
`PhaseFunction.parameters`.

References
----------
Henyey & Greenstein 1941, "Diffuse radiation in the galaxy"; Witt 1977, "Multiple scattering in reflection nebulae", for
directions by chance; Draine 2003, "Scattering by interstellar dust grains"; Jendersie & d'Eon 2023, "An approximate Mie
scattering function for fog and cloud rendering"; Cornette & Shanks 1992 is Draine's with alpha = 1, and Rayleigh 1871
with g = 0 besides. Goudsmit & Saunderson 1940, "Multiple scattering of electrons", for what follows many events.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import astuple, dataclass, fields
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked
from translucent.arrays import Array
from translucent.errors import InputError

#: Steps of Newton's method, or halvings of its bracket, that `draine_cosine` takes.
DRAINE_STEPS = 24

#: Largest alpha of Draine's phase function: its lobes are then those of cos^2.
MAX_ALPHA = 1e4

#: Range of the droplets that `WaterDroplets` fits, in metres.
DROPLETS = 5e-6, 50e-6

#: Parameters of a phase function as tables and shaders have them: g of Henyey and Greenstein; g and alpha of Draine,
#: and the fraction of the light that the latter scatters.
Parameters = tuple[float, float, float, float]


def henyey_greenstein(cos_scatter: npt.ArrayLike, anisotropy: npt.ArrayLike) -> Array:
    """Henyey & Greenstein 1941 phase function in 1/sr: (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)).

    Parameters
    ----------
    cos_scatter : array_like
        Cosine between the directions of travel before and after the event: 1 is straight on.
    anisotropy : array_like
        g, the mean cosine, -1 < g < 1.
    """
    g = np.asarray(anisotropy, dtype=np.float64)
    a, c = np.abs(g), np.where(g < 0, -1.0, 1.0) * np.asarray(cos_scatter, dtype=np.float64)
    # Turned around for g < 0, (1 - a)^2 + 2 a (1 - c) is 1 + g^2 - 2 g cos without its cancellation.
    base = (1.0 - a) ** 2 + 2.0 * a * (1.0 - c)
    return (1.0 - a) * (1.0 + a) / (4.0 * np.pi * base * np.sqrt(base))


def henyey_greenstein_cosine(share: npt.ArrayLike, anisotropy: npt.ArrayLike) -> Array:
    """Cosine of the angle beyond which a fraction `share`, 0 to 1, of the light is scattered (Witt 1977).

    Rearranged so that nothing is divided by g, which may be 0.
    """
    g = np.asarray(anisotropy, dtype=np.float64)
    a = 2.0 * np.asarray(share, dtype=np.float64) - 1.0
    with np.errstate(under="ignore"):
        root = (1.0 - g) * (1.0 + g) / (1.0 + g * a)
        return np.clip(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0)


def draine(cos_scatter: npt.ArrayLike, anisotropy: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Phase function of Draine 2003 in 1/sr: Henyey and Greenstein's times 1 + alpha cos^2, normalised."""
    g, a = np.asarray(anisotropy, dtype=np.float64), np.asarray(alpha, dtype=np.float64)
    cosine = np.asarray(cos_scatter, dtype=np.float64)
    with np.errstate(under="ignore"):
        squares = (1.0 + 2.0 * g * g) / 3.0  # mean of cos^2 by Henyey and Greenstein
        return np.asarray(henyey_greenstein(cosine, g) * (1.0 + a * cosine * cosine) / (1.0 + a * squares))


@np.errstate(under="ignore")
def draine_cosine(share: npt.ArrayLike, anisotropy: npt.ArrayLike, alpha: npt.ArrayLike) -> Array:
    """Cosine of the angle beyond which Draine's phase function scatters a fraction `share`, 0 to 1, of the light.

    With t, that fraction by Henyey and Greenstein, it is the integral of 1 + alpha cos^2 over t: in q = 1 - g + 2 g t,
    the integral of cos^2 is t (m^2 + t^2 (1 - g) (1 + g)^4 / (3 q^3)) with m = (t (1 + g^2) - (1 - g)) / q, in which
    nothing cancels. It rises with t, and is solved for by Newton's method in a bracket.
    """
    share, g, a = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (share, anisotropy, alpha)))
    target = share * (1.0 + a * (1.0 + 2.0 * g * g) / 3.0)
    low, high, t = np.zeros(share.shape), np.ones(share.shape), share
    for _ in range(DRAINE_STEPS):
        q = 1.0 - g + 2.0 * g * t
        middle = (t * (1.0 + g * g) - (1.0 - g)) / q
        squares = middle**2 + t * t * (1.0 - g) * (1.0 + g) ** 4 / (3.0 * q**3)
        beyond = t * (1.0 + a * squares) - target
        low, high = np.where(beyond > 0, low, t), np.where(beyond > 0, t, high)
        following = t - beyond / (1.0 + a * henyey_greenstein_cosine(t, g) ** 2)
        t = np.where((following >= low) & (following <= high), following, 0.5 * (low + high))
    return henyey_greenstein_cosine(t, g)


def phase_value(phase: npt.ArrayLike, cos_scatter: npt.ArrayLike) -> Array:
    """Phase function in 1/sr at the cosine (...,) of the scattering angle, of `parameters` (..., 4)."""
    g, draine_g, alpha, weight = np.moveaxis(np.asarray(phase, np.float64), -1, 0)
    parts = henyey_greenstein(cos_scatter, g), draine(cos_scatter, draine_g, alpha)
    return np.asarray((1.0 - weight) * parts[0] + weight * parts[1])


def phase_cosine(phase: npt.ArrayLike, share: npt.ArrayLike) -> Array:
    """Random cosine (...,) of the scattering angle: `share` (...,) is a random number, 0 to 1."""
    g, draine_g, alpha, weight = np.moveaxis(np.asarray(phase, np.float64), -1, 0)
    share = np.asarray(share, np.float64)
    # Of the two of the mixture, one scatters the first numbers and the other the rest.
    first = np.minimum(share / np.where(weight > 0, weight, 1.0), 1.0)
    second = np.clip((share - weight) / np.where(weight < 1, 1.0 - weight, 1.0), 0.0, 1.0)
    draines = (weight > 0) & (share <= weight)
    return np.where(draines, draine_cosine(first, draine_g, alpha), henyey_greenstein_cosine(second, g))


#: Number of events up to which `phase_after_scattering` is a sum: later ones leave Legendre moments of order 3 and more
#: small, unless g is above 0.98.
AHEAD_EVENTS = 16

#: Mean cosine after several events below which their phase function has no moment of order 3 and more that is seen.
LEAST_POWER = 0.15


def phase_after_scattering(
    cos_scatter: npt.ArrayLike,
    anisotropy: npt.ArrayLike,
    straight: npt.ArrayLike,
    depth: npt.ArrayLike,
    lever: npt.ArrayLike = 1.0,
) -> Array:
    """Phase function in 1/sr of light that was scattered ahead before on its path.

    It is multiplied by the probability that it was. In a medium that scatters ahead, a beam at an optical depth of
    scattering has the Legendre moments exp(-(1 - g^l) depth), as long as it has turned little; the unscattered part of
    it exp(-depth) (Goudsmit & Saunderson 1940). So after one more event (2 l + 1) / 4 pi g^l times their difference is
    the moment of order l. It equals a sum over a Poisson number n of events before, after which the phase function is
    that of g^(n + 1): orders up to 2 are in closed form here, and only the others are this sum.

    Of light that comes from a point, and is scattered by a small angle at a fraction u of its way, a fraction u of the
    angle is seen at its end. By small angles g^l = exp(-l |log g|) is then g^(u l): before, g^u takes the place of g.

    Parameters
    ----------
    cos_scatter : array_like
        Cosine between the directions of travel from the light and after the event.
    anisotropy : array_like
        g, 0 to 1.
    straight : array_like
        Fraction of scattered light that counts as unscattered in what is found of orders 0 to 2 otherwise: these
        moments decay with 1 - straight here, not with 1 - g^l.
    depth : array_like
        Optical depth of scattering before, without absorption.
    lever : array_like
        Mean u over this depth; 1 for light from far away.
    """
    g, kept = np.asarray(anisotropy, np.float64), np.asarray(straight, np.float64)
    cosine, depth = np.asarray(cos_scatter, np.float64), np.asarray(depth, np.float64)
    before = g ** np.asarray(lever, np.float64)
    second = 1.5 * cosine * cosine - 0.5
    with np.errstate(under="ignore"):
        none = np.exp(-depth)
        total = (1.0 + g * (3.0 * cosine + 5.0 * g * second)) * (np.exp((kept - 1.0) * depth) - none)
        probability, power = none, g
        for n in range(1, AHEAD_EVENTS + 1):
            probability, power = probability * depth / n, power * before
            lower = 1.0 + power * (3.0 * cosine + 5.0 * power * second)
            beyond = 4.0 * np.pi * henyey_greenstein(cosine, power) - lower
            total = total + np.where(power < LEAST_POWER, 0.0, probability * beyond)
        return np.asarray(total / (4.0 * np.pi))


#: Largest number of moments of a phase function.
MOST_MOMENTS = 1 << 16


class PhaseFunction(ABC):
    """A phase function, normalised to 1 over the sphere of directions. It is written as its name and its numbers."""

    name: ClassVar[str]

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """Parameters that `phase_value` and ``shaders/lib/phase.glsl`` take."""

    @property
    def mean_cosine(self) -> float:
        """Mean cosine g of the scattering angle."""
        return float(self.moments(2)[1])

    @abstractmethod
    def moments(self, count: int) -> Array:
        """(count,): mean Legendre polynomials of the cosine, from order 0, which is 1, upwards."""

    @checked
    def value(self, cos_scatter: npt.ArrayLike) -> Array:
        """Phase function in 1/sr at the cosine of the scattering angle: 1 is straight on."""
        cosine = np.asarray(cos_scatter, dtype=np.float64)
        if not (np.abs(cosine) <= 1 + 1e-6).all():  # what rounding makes of 1
            raise InputError(
                "cosine of a scattering angle",
                "the cosine must lie in -1 to 1",
                "give cosines, where 1 means straight ahead",
            )
        return phase_value(self.parameters, cosine)

    def __str__(self) -> str:
        return " ".join([self.name, *map(repr, astuple(self))])  # type: ignore[call-overload]


@checked
@dataclass(frozen=True)
class HenyeyGreenstein(PhaseFunction):
    """Phase function of Henyey and Greenstein.

    Parameters
    ----------
    anisotropy : float
        g, the mean cosine, -1 < g < 1.
    """

    name: ClassVar[str] = "henyey_greenstein"

    anisotropy: float = 0.0

    def __post_init__(self) -> None:
        if not -1 < self.anisotropy < 1:
            raise InputError(
                f"anisotropy {self.anisotropy}", "the anisotropy must lie between -1 and 1", "use a value such as 0.8"
            )

    @property
    def parameters(self) -> Parameters:
        """(g, 0, 0, 0)."""
        return self.anisotropy, 0.0, 0.0, 0.0

    @checked
    def moments(self, count: int) -> Array:
        """Powers of g."""
        with np.errstate(under="ignore"):
            return np.asarray(self.anisotropy ** np.arange(_moments(count)), dtype=np.float64)


@checked
@dataclass(frozen=True)
class Draine(PhaseFunction):
    """Phase function of Draine 2003, for dust and small grains: it sends more light back.

    Parameters
    ----------
    g : float
        Of Henyey and Greenstein's part, -1 < g < 1; the mean cosine is larger.
    alpha : float
        0 and above: Henyey and Greenstein's, 1: Cornette and Shanks', and with g = 0 Rayleigh's.
    """

    name: ClassVar[str] = "draine"

    g: float
    alpha: float

    def __post_init__(self) -> None:
        if not -1 < self.g < 1:
            raise InputError(
                f"Draine's g {self.g}", "the parameter must lie between -1 and 1", "use a value such as 0.6"
            )
        if not 0 <= self.alpha <= MAX_ALPHA:
            raise InputError(
                f"Draine's alpha {self.alpha}", f"the parameter must lie in 0 to {MAX_ALPHA:g}", "use a value such as 1"
            )

    @property
    def parameters(self) -> Parameters:
        """(0, g, alpha, 1)."""
        return 0.0, self.g, self.alpha, 1.0

    @checked
    def moments(self, count: int) -> Array:
        """Moments of Henyey and Greenstein's g^n, with cos^2 P_n as a sum of P_(n-2), P_n and P_(n+2)."""
        # cos P_n = (1 - d_n) P_(n+1) + d_n P_(n-1)
        n = np.arange(-1, _moments(count) + 1)
        down = n / (2 * n + 1)
        before, own, after = down[:-2], down[1:-1], down[2:]
        powers = HenyeyGreenstein(self.g).moments(count + 2)
        squares = (1 - own) * (1 - after) * powers[2:] + ((1 - own) * after + own * (1 - before)) * powers[:-2]
        squares[2:] += (own * before)[2:] * powers[:-4]
        return np.asarray((powers[:-2] + self.alpha * squares) / (1.0 + self.alpha * squares[0]))


@checked
@dataclass(frozen=True)
class WaterDroplets(PhaseFunction):
    """Phase function of the droplets of fog and clouds: the fit of Jendersie and d'Eon 2023 to Mie's theory.

    Parameters
    ----------
    diameter : float
        In metres, 5e-6 to 5e-5: 1e-5 in fog, 2e-5 in clouds.
    """

    name: ClassVar[str] = "water_droplets"

    diameter: float

    def __post_init__(self) -> None:
        if not DROPLETS[0] <= self.diameter <= DROPLETS[1]:
            raise InputError(
                f"water droplets of {self.diameter:g} m",
                "the droplet diameter must lie in 5e-6 to 5e-5 m",
                "use a value such as 2e-5 for a cloud",
            )

    @property
    def parameters(self) -> Parameters:
        """Equations 4 to 7 of the paper."""
        d = 1e6 * self.diameter
        g = np.exp(-0.0990567 / (d - 1.67154))
        draine_g = np.exp(-2.20679 / (d + 3.91029) - 0.428934)
        alpha = np.exp(3.62489 - 8.29288 / (d + 5.52825))
        weight = np.exp(-0.599085 / (d - 0.641583) - 0.665888)
        return float(g), float(draine_g), float(alpha), float(weight)

    @checked
    def moments(self, count: int) -> Array:
        """Moments of both parts, by their weights."""
        g, draine_g, alpha, weight = self.parameters
        parts = HenyeyGreenstein(g).moments(count), Draine(draine_g, alpha).moments(count)
        return (1.0 - weight) * parts[0] + weight * parts[1]


def _moments(count: int) -> int:
    if not 0 <= count <= MOST_MOMENTS:
        raise InputError(
            f"moments {brief(count)}", f"the number of moments must lie in 0 to {MOST_MOMENTS}", "use a value such as 3"
        )
    return count


#: Phase function of isotropic scattering.
ISOTROPIC = HenyeyGreenstein()

#: Phase functions by their names.
PHASE_FUNCTIONS: dict[str, type[PhaseFunction]] = {one.name: one for one in (HenyeyGreenstein, Draine, WaterDroplets)}


def parse_phase(text: str) -> PhaseFunction:
    """Phase function of a text such as ``henyey_greenstein 0.8``: its name, then its numbers.

    Raises
    ------
    InputError
        If there is none of that name, or its numbers are not what it takes.
    """
    name, *words = text.split() or [""]
    if name not in PHASE_FUNCTIONS:
        raise InputError(
            f"phase function {name!r}", "no phase function has this name", f"use one of {', '.join(PHASE_FUNCTIONS)}"
        )
    of = PHASE_FUNCTIONS[name]
    names = [field.name for field in fields(of)]  # type: ignore[arg-type]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != len(names):
        raise InputError(
            f"phase function {text!r}",
            f"this phase function needs {len(names)} numbers",
            f"write {name} {' '.join(names)}",
        )
    return of(*numbers)
