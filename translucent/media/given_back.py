"""Media that give back light which they scatter many times, as the planner marks them for a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy.typing as npt

from translucent.media.medium import Medium


@dataclass(frozen=True, eq=False)
class LayeredMedium(Medium):
    """Medium that gives back light as a layer does; see `ScatteringLayer`."""

    gives_back: ClassVar[bool] = True

    @classmethod
    def of(cls, medium: Medium) -> Self:
        """The medium, marked."""
        return cls(medium.absorption, medium.scattering, medium.emission, medium.anisotropy, medium.ior, medium.phase)


@dataclass(frozen=True, eq=False)
class DiffusedVolume(Medium):
    """Medium into whose rays light is scattered that was scattered before; see `Diffusion`."""

    @classmethod
    def of(cls, medium: Medium) -> Self:
        """The medium, marked."""
        return cls(medium.absorption, medium.scattering, medium.emission, medium.anisotropy, medium.ior, medium.phase)


@dataclass(frozen=True, eq=False)
class DiffusedMedium(Medium):
    """Medium in which light diffuses; see `Diffusion`. Along rays its scattering only removes light, like absorption.

    Parameters
    ----------
    original : Medium
        What scatters.
    """

    gives_back: ClassVar[bool] = True

    original: Medium = field(default_factory=Medium)

    @classmethod
    def of(cls, medium: Medium, emission: npt.ArrayLike) -> Self:
        """The medium, marked; `emission` (3,) is what it emits along rays, with the ambient light that it scatters."""
        return cls(medium.extinction, 0.0, emission, 0.0, medium.ior, original=medium)
