"""The front interface: where each ray enters a body, drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.interfaces.base import (
    DRAW_COST,
    LATER_REFRACTION,
    ONE_DRAWN,
    ONE_SHADED,
    SHADE_COST,
    Interfaces,
)
from translucent.planning.interfaces.places import starts_inside, with_interfaces
from translucent.planning.interfaces.words import effects_of, owners
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Scene

#: Note of a plan in which rays refract at the front interface alone.
ONE_INTERFACE = Note(
    NoteKind.ONE_INTERFACE,
    "FrontInterface: bends once, where a ray enters; leaves without bending: rays leave curved bodies in wrong "
    "directions",
)


@dataclass(frozen=True)
class FrontInterface(Interfaces):
    """The interface where each ray enters a body, and none where it leaves, as viewers of glTF have it.

    In one draw less than `ScreenInterfaces`; right for thin bodies, wrong for curved ones (KHR_materials_volume,
    Khronos 2021, leaves what happens inside to the viewer). Absorption is that of the straight ray.
    """

    name: ClassVar[str] = "front"
    one_interface: ClassVar[bool] = True

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason: rays start inside a body, and have no front interface there."""
        for body in scene.bodies:
            if body.has_interface and body.sheet_thickness is None and starts_inside(scene, body):
                return (
                    f"rays start inside {body.mesh.name!r}, and meet no interface where they would enter it",
                    "use ScreenInterfaces(), or move the camera outside",
                )
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: one draw of all bodies with interfaces, and one over pixels."""
        found = f"{owners(scene)}: normal and place of the interface where a ray enters"
        shaded = f"{effects_of(scene)}; rays bend where they enter and go straight on"
        return (
            PassSpec(PassName.INTERFACES, found, with_interfaces(scene), 1, cost=DRAW_COST * ONE_DRAWN),
            PassSpec(PassName.SURFACES, shaded, cost=SHADE_COST * ONE_SHADED),
        )

    def unmodelled(self) -> list[Note]:
        """Notes: what lies beyond the first interval, and the bend where rays leave."""
        return [LATER_REFRACTION, ONE_INTERFACE]
