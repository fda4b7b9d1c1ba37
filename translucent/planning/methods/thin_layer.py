"""Thin layers: every face is a sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.geometry.mesh import MAX_COORDINATE
from translucent.planning.bodies import count_of, indices
from translucent.planning.methods.base import Method
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.scene import Scene, object_names


@checked
@dataclass(frozen=True)
class ThinLayer(Method):
    """Every face is a sheet of the given thickness: t / max(0.001, n.v) each (Drobot 2017), added up.

    With a medium of ior > 1 the cosine is that of the refracted ray.

    Parameters
    ----------
    thickness : float
        In metres.
    """

    name: ClassVar[str] = "thin-layer"
    cost: ClassVar[float] = 1.7
    makes_sheets: ClassVar[bool] = True

    thickness: float = 1e-3

    def __post_init__(self) -> None:
        if not 0 < self.thickness <= MAX_COORDINATE:
            raise InputError(
                f"ThinLayer thickness {self.thickness}",
                "the thickness must be above 0",
                "give the thickness in metres, for example 1e-3",
            )

    @property
    def usual_thickness(self) -> float:
        """Thickness in metres of faces that declare none."""
        return self.thickness

    def with_thickness(self, thickness: float) -> ThinLayer:
        """The method with that thickness, in metres, of faces that declare none."""
        return replace(self, thickness=thickness)

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes: one draw of all bodies."""
        bodies = indices(scene, lambda body: body.medium is not None)
        return (
            sheet_pass(bodies, f"every face of {count_of(bodies, 'mesh', 'meshes')} is a sheet: sum of their paths"),
        )

    def limits(self, scene: Scene) -> list[Note]:
        """Notes on closed bodies, whose volume sheets leave out."""
        solid = [body for body in scene.bodies if body.sheet_thickness is None and body.mesh.diagnosis.solid]
        if not solid:
            return []
        text = f"{object_names(solid)}: closed, but drawn as sheets, without the inside"
        return [Note(NoteKind.CLOSED_AS_SHEETS, text)]


def sheet_pass(objects: tuple[int, ...], reason: str) -> PassSpec:
    """The pass that draws objects as sheets."""
    reason = f"{reason}, t / max(0.001, n.v) each"
    return PassSpec(PassName.THIN_LAYER, reason, objects, 1, cost=ThinLayer.cost)
