"""Interfaces in screen space: the first two on each ray, drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.interfaces.base import (
    DRAW_COST,
    LATER_REFRACTION,
    ONE_DRAWN,
    SHADE_COST,
    Interfaces,
)
from translucent.planning.interfaces.places import with_interfaces
from translucent.planning.interfaces.words import effects_of, owners
from translucent.planning.notes import Note
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Scene


@dataclass(frozen=True)
class ScreenInterfaces(Interfaces):
    """The interface where each ray enters a body and the one where it leaves, both drawn in screen space (Wyman 2005).

    What lies farther on is crossed straight, interfaces mirror the environment only, and refracted rays find opaque
    surfaces as far as the picture shows them.
    """

    name: ClassVar[str] = "screen"
    finds_exits: ClassVar[bool] = True

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: two draws of all bodies with interfaces, or one of sheets; and one over pixels."""
        objects, names = with_interfaces(scene), owners(scene)
        if straight:
            # What bends on entering a sheet bends back on leaving it: each has one interface, that towards the eye.
            return (
                PassSpec(
                    PassName.INTERFACES,
                    f"{names}: normal and place of the sheet that a ray meets first",
                    objects,
                    1,
                    cost=DRAW_COST * ONE_DRAWN,
                ),
                PassSpec(
                    PassName.SURFACES,
                    f"{effects_of(scene, bends=False)}; rays go straight through sheets",
                    cost=SHADE_COST,
                ),
            )
        found = f"{names}: normal and place of the interface where a ray enters, and of the one where it leaves"
        shaded = f"{effects_of(scene)}; the path through the first interval bends with it"
        return (
            PassSpec(PassName.INTERFACES, found, objects, 2, cost=DRAW_COST),
            PassSpec(PassName.SURFACES, shaded, cost=SHADE_COST),
        )

    def unmodelled(self) -> list[Note]:
        """Notes: what lies beyond the first interval."""
        return [LATER_REFRACTION]
