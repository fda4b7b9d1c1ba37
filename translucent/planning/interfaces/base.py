"""Base class of the ways of finding interfaces: a frozen configuration, its passes, and traits to choose by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassSpec
from translucent.scene.scene import Scene

#: Time of drawing the interfaces where rays enter and where they leave, in depth-only draws of the same geometry, as
#: measured on a software rasterizer.
DRAW_COST = 4.0

#: Time of shading both, likewise, beside 90,000 triangles.
SHADE_COST = 8.0

#: Time of drawing one interface of each body, as a share of that of two; measured likewise.
ONE_DRAWN = 0.4

#: Time of shading one interface, as a share of that of two; measured likewise.
ONE_SHADED = 0.45

#: Note of a plan in which rays meet interfaces as far as the first interval shows them.
LATER_REFRACTION = Note(
    NoteKind.LATER_REFRACTION,
    "refraction and reflection beyond the first interval of a ray: what lies farther on is crossed straight, "
    "and interfaces mirror the environment only",
)


@dataclass(frozen=True)
class Interfaces:
    """A way to find the interfaces at which light refracts and reflects; see its subclasses.

    Attributes
    ----------
    name : str
        On the command line.
    traced : bool
        Follows rays through the meshes, from interface to interface.
    one_interface : bool
        Bends rays where they enter a body, and not where they leave it.
    finds_exits : bool
        Draws the interface where rays leave a body, beside that where they enter.
    """

    name: ClassVar[str] = ""
    traced: ClassVar[bool] = False
    one_interface: ClassVar[bool] = False
    finds_exits: ClassVar[bool] = False

    @property
    def tree(self) -> tuple[int, int]:
        """Number of interfaces that a traced ray may meet, and of forks."""
        return 0, 0

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason why rays cannot bend so in a scene, and what to do; None if they can."""
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes that find and shade interfaces; `straight` if all of them are of sheets, which bend no ray."""
        raise NotImplementedError

    def unmodelled(self) -> list[Note]:
        """Notes on refracted and reflected light that is not rendered."""
        raise NotImplementedError
