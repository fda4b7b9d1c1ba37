"""Phase functions: how a medium spreads the light that it scatters over the angles that light turns by.

Functions have twins of the same name in ``shaders/lib/phase.glsl``; a phase function is four numbers there, its
`PhaseFunction.parameters`.

References
----------
Henyey & Greenstein 1941, "Diffuse radiation in the galaxy"; Witt 1977, "Multiple scattering in reflection nebulae", for
directions by chance.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import astuple, dataclass, fields
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError

#: Parameters of a phase function as tables and shaders have them.
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
    """Cosine of which a share, 0 to 1, of the scattered light turns further (Witt 1977).

    Rearranged so that nothing is divided by g, which may be 0.
    """
    g = np.asarray(anisotropy, dtype=np.float64)
    a = 2.0 * np.asarray(share, dtype=np.float64) - 1.0
    with np.errstate(under="ignore"):
        root = (1.0 - g) * (1.0 + g) / (1.0 + g * a)
        return np.clip(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0)


def phase_value(phase: npt.ArrayLike, cos_scatter: npt.ArrayLike) -> Array:
    """Phase function in 1/sr at the cosine (...,) of the angle that light turns by, of `parameters` (..., 4)."""
    return henyey_greenstein(cos_scatter, np.asarray(phase, np.float64)[..., 0])


def phase_cosine(phase: npt.ArrayLike, share: npt.ArrayLike) -> Array:
    """Cosine (...,) of the angle that light turns by, at random: `share` (...,) is a random number, 0 to 1."""
    return henyey_greenstein_cosine(share, np.asarray(phase, np.float64)[..., 0])


class PhaseFunction(ABC):
    """A phase function, normalised to 1 over the sphere of directions. It is written as its name and its numbers."""

    name: ClassVar[str]

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """Parameters that `phase_value` and ``shaders/lib/phase.glsl`` take."""

    @property
    def mean_cosine(self) -> float:
        """Mean cosine g of the angle that light turns by: 0 where as much goes on as turns back."""
        return float(self.moments(2)[1])

    @abstractmethod
    def moments(self, count: int) -> Array:
        """(count,): mean Legendre polynomials of the cosine, from order 0, which is 1, upwards."""

    def value(self, cos_scatter: npt.ArrayLike) -> Array:
        """Phase function in 1/sr at the cosine of the angle that light turns by: 1 is straight on."""
        return phase_value(self.parameters, cos_scatter)

    def __str__(self) -> str:
        return " ".join([self.name, *map(repr, astuple(self))])  # type: ignore[call-overload]


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
            raise InputError(f"anisotropy {self.anisotropy}", "not between -1 and 1", "give for example 0.8")

    @property
    def parameters(self) -> Parameters:
        """(g, 0, 0, 0)."""
        return self.anisotropy, 0.0, 0.0, 0.0

    def moments(self, count: int) -> Array:
        """Powers of g."""
        with np.errstate(under="ignore"):
            return np.asarray(self.anisotropy ** np.arange(count), dtype=np.float64)


#: Phase function of light that turns everywhere alike.
ISOTROPIC = HenyeyGreenstein()

#: Phase functions by their names.
PHASE_FUNCTIONS: dict[str, type[PhaseFunction]] = {one.name: one for one in (HenyeyGreenstein,)}


def parse_phase(text: str) -> PhaseFunction:
    """Phase function of a text such as ``henyey_greenstein 0.8``: its name, then its numbers.

    Raises
    ------
    InputError
        If there is none of that name, or its numbers are not what it takes.
    """
    name, *words = text.split() or [""]
    if name not in PHASE_FUNCTIONS:
        raise InputError(f"phase function {name!r}", "there is none of that name", f"use {', '.join(PHASE_FUNCTIONS)}")
    of = PHASE_FUNCTIONS[name]
    names = [field.name for field in fields(of)]  # type: ignore[arg-type]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != len(names):
        raise InputError(f"phase function {text!r}", f"not {len(names)} numbers", f"give {name} {' '.join(names)}")
    return of(*numbers)
