"""Caustics: photons from the lights, bent and mirrored by interfaces, where they land on opaque objects and media."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.methods.base import check_count

#: Largest number of photons of a frame: a software rasterizer follows so many in some minutes.
MAX_PHOTONS = 1 << 30

#: Photons in media, least and most: each of them lights all cells on its way.
LEAST_IN_MEDIA, MOST_IN_MEDIA = 1 << 16, 1 << 18


@checked
@dataclass(frozen=True)
class Caustics:
    """Light of lamps and directional lights that interfaces bend and mirror onto opaque objects and media, by photons.

    Photons (Jensen 1996) leave the lights towards the bodies, and are refracted or reflected there by chance, as
    Fresnel says; media absorb on the way. Those that have been bent or mirrored land on the first opaque surface, and
    are drawn as points into the picture of the opaque objects (McGuire & Luebke 2009), each divided by the area that
    its pixel covers there; where there are few, they are spread over some pixels. Surfaces reflect them diffusely. The
    energy is right whatever their number; the noise of a pixel falls with its square root. Of several samples of a
    pixel each follows its part of the photons.

    Others of them (`in_media`) are followed into bodies in which light diffuses, and light fog all along their ways.

    The straight light of lamps ends at solids that bend light (`RenderPlan.opaque_to_shadows`).

    Interfaces show caustics behind them wherever the picture shows the receiver without them.

    Parameters
    ----------
    photons : int
        Of a frame, 1 to 2^30.
    seed : int
        Of the random numbers, 0 to 2^32 - 1.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    photons: int = 1_000_000
    seed: int = 0

    #: Time of a million photons, in multiples of drawing the bodies into a depth buffer, as measured on a software
    #: rasterizer: 2,600 through a ball, 5,400 through a goblet with wine.
    cost_of_a_million: ClassVar[float] = 4000.0

    def __post_init__(self) -> None:
        check_count("Caustics photons", self.photons, MAX_PHOTONS, example=1_000_000)
        check_count("Caustics seed", self.seed, (1 << 32) - 1, least=0, example=0)

    @property
    def in_media(self) -> int:
        """Photons, of others than land on opaque objects, that light media: a quarter as many, within bounds."""
        return min(max(self.photons // 4, LEAST_IN_MEDIA), MOST_IN_MEDIA)

    def __str__(self) -> str:
        return f"Caustics(photons={self.photons}, seed={self.seed})"
