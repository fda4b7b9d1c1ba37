"""Traced interfaces: the first on each ray drawn, all others found by rays through the meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.interfaces.base import DRAW_COST, ONE_DRAWN, Interfaces
from translucent.planning.interfaces.places import picture_cuts, with_interfaces
from translucent.planning.interfaces.words import effects_of, owners
from translucent.planning.methods.base import check_count
from translucent.planning.mirrors import mirror_of
from translucent.planning.notes import Note, NoteKind
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.shadow_maps import dims_interfaces
from translucent.scene.scene import Scene, object_names

#: Largest number of interfaces that a ray may meet: each takes a walk through the meshes.
MAX_DEPTH = 64

#: Bodies that a traced ray can be in at once.
INTERIOR_SIZE = 8

#: Largest number of forks: rays multiply with each.
MAX_FORKS = 4

#: Time of tracing, in depth-only draws of the same geometry, on a software rasterizer: on polished bodies 45 to 185 in
#: the published report, beside 8,000 to 41,000 triangles at 256 x 256; beside 90,000 at 512 x 512 that is about this.
TRACE_COST = 50.0


@checked
@dataclass(frozen=True)
class TracedInterfaces(Interfaces):
    """All interfaces that a ray meets, found by rays through the meshes: a tree of reflected and refracted ones.

    The tree of Whitted 1980: at an interface the reflected ray takes Fresnel's share, the refracted one the rest (Born
    & Wolf 1999, section 1.5). Bodies see themselves, each other and opaque objects, and may touch or hold the eye.

    Parameters
    ----------
    depth : int
        Interfaces that a ray may meet, from 1; behind the last one it sees the environment, as if nothing was ahead.
    forks : int
        How often a ray may go on as the weaker of the two, reflected or refracted, from 0; the mirror image at the
        first interface is free. The stronger one is always followed; a weaker one beyond that sees the environment.
    """

    name: ClassVar[str] = "traced"
    traced: ClassVar[bool] = True

    depth: int = 8
    forks: int = 2

    def __post_init__(self) -> None:
        check_count("TracedInterfaces depth", self.depth, MAX_DEPTH)
        check_count("TracedInterfaces forks", self.forks, MAX_FORKS, least=0, example=2)

    @property
    def tree(self) -> tuple[int, int]:
        """`depth` and `forks`."""
        return self.depth, self.forks

    def refusal(self, scene: Scene) -> tuple[str, str] | None:
        """Reason: rays of one picture start in different media, or media vary along a ray."""
        solids = [body for body in scene.bodies if body.sheet_thickness is None]
        if cut := [body for body in solids if picture_cuts(scene, body)]:
            return (
                f"the orthographic picture's plane, where rays start, cuts {object_names(cut)}",
                "use ScreenInterfaces(), or move the camera outside",
            )
        if varying := [body for body in solids if body.density is not None]:
            return (
                f"{object_names(varying)}: the density varies, and rays cross media in one step",
                "use ScreenInterfaces()",
            )
        return None

    def passes(self, scene: Scene, *, straight: bool) -> tuple[PassSpec, PassSpec]:
        """Passes: one draw of all bodies with interfaces, and one over pixels that traces."""
        found = f"{owners(scene)}: normal and place of the first interface on each ray"
        effects = effects_of(scene, bends=not straight, mirrored="what is around them")
        traced = f"{effects}; rays are traced from there on, through at most {self._count}"
        if self.forks:
            traced += f", {self._times} as the weaker of reflected and refracted light"
        if (mirror := mirror_of(scene)) is not None:
            traced += f"; {mirror.ground.mesh.name!r} mirrors what stands on it, once"
        if dims_interfaces(scene):
            traced += "; rays straight on to the lights tell what bodies keep of highlights, and of the light on paint"
        return (
            PassSpec(PassName.INTERFACES, found, with_interfaces(scene), 1, cost=DRAW_COST * ONE_DRAWN),
            PassSpec(PassName.TRACED, traced, cost=TRACE_COST),
        )

    def unmodelled(self) -> list[Note]:
        """Notes: what the tree leaves out."""
        often = f" more often than {self._times}" if self.forks else ""
        text = (
            f"light that meets more than {self._count}, or is the weaker of reflected and refracted light{often}: "
            "looked up in the environment, as if nothing was ahead"
        )
        return [Note(NoteKind.CUT_OFF_PATHS, text)]

    @property
    def _times(self) -> str:
        return {1: "once", 2: "twice"}.get(self.forks, f"{self.forks} times")

    @property
    def _count(self) -> str:
        return "1 interface" if self.depth == 1 else f"{self.depth} interfaces"
