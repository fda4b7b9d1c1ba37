"""Back-face depth: farthest back face minus nearest front face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.errors import InputError
from translucent.planning.bodies import sheets_of, solids_of
from translucent.planning.methods.base import Method
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.scene import Scene, object_names


@dataclass(frozen=True)
class BackFaceDepth(Method):
    """Farthest back face minus nearest front face. Exact for convex bodies; other pixels are marked invalid."""

    name: ClassVar[str] = "back-face-depth"
    cost: ClassVar[float] = 1.7
    tells_media_apart: ClassVar[bool] = False
    convex_only: ClassVar[bool] = True

    def check(self, scene: Scene) -> None:
        """Refuse sheets."""
        if sheets := [scene.objects[i] for i in sheets_of(scene)]:
            raise InputError(
                "BackFaceDepth",
                f"{object_names(sheets)}: this method cannot render thin-walled sheets",
                "use SignedDepth or ThinLayer",
            )

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Two draws of all bodies."""
        reason = f"{why}: nearest front face, then farthest back face"
        return (PassSpec(PassName.BACK_FACE_DEPTH, reason, solids_of(scene), 2, cost=self.cost),)

    def limits(self, scene: Scene) -> list[Note]:
        """Notes on pixels whose ray enters a body more than once, or more than one body."""
        limits = []
        if len(scene.bodies) > 1:
            text = "pixels whose rays cross more than one body are marked as invalid"
            limits.append(Note(NoteKind.SEVERAL_BODIES, text))
        if concave := [body for body in scene.bodies if not body.mesh.diagnosis.convex]:
            text = f"{object_names(concave)}: not convex, so pixels with more than one entry are marked as invalid"
            limits.append(Note(NoteKind.NOT_CONVEX, text))
        return limits
