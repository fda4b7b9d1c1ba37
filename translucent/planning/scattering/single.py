"""Light that media scatter once, and no more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.methods.base import MAX_LIGHT_POINTS, check_count
from translucent.planning.scattering.base import Scattering


@checked
@dataclass(frozen=True)
class SingleScattering(Scattering):
    """Light of lights that is scattered once into each ray; what is scattered again is lost.

    Exact for thin smoke and clear drinks. In wax or milk nearly all light is scattered more often: they come out dark.

    Parameters
    ----------
    points : int
        On each interval, at which each light is looked at; a method that is asked for has its own.
    """

    name: ClassVar[str] = "single"

    points: int = 8

    def __post_init__(self) -> None:
        check_count("SingleScattering points", self.points, MAX_LIGHT_POINTS)
