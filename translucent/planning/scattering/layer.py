"""Bodies that give back light as a flat layer does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.scattering.base import Scattering
from translucent.scene.scene import Object


@dataclass(frozen=True)
class ScatteringLayer(Scattering):
    """Light scattered many times as from a flat layer as thick as the body along the ray, between two interfaces.

    The layer of Kubelka and Munk (1931) with the inner mirrors of its interfaces (Saunderson 1942): exact for a wide
    flat slab in diffuse light. Light does not spread sideways, and nothing shadows it.
    """

    name: ClassVar[str] = "layer"
    gives_back: ClassVar[bool] = True

    def refusal(self, body: Object) -> str | None:
        """Reason: the density varies."""
        return None if body.density is None else "its density varies"
