"""Signed depth: distances where a ray leaves, minus those where it enters, in any order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.bodies import count_of, media_differ, solids_of
from translucent.planning.methods.base import Method
from translucent.planning.passes import Note, NoteKind, PassName, PassSpec
from translucent.scene.scene import Scene


@checked
@dataclass(frozen=True)
class SignedDepth(Method):
    """One unsorted pass: the sum of exit distances minus the sum of entry distances. Exact for closed meshes.

    Baker & Boyd 2001 without a sort, in float32 and anchored: distances count from the body's own center, so that
    precision does not depend on how far away the body is.

    Parameters
    ----------
    anchored : bool
        False counts distances from the camera, as engines do: a counter-example for measurements.
    """

    name: ClassVar[str] = "signed-depth"
    cost: ClassVar[float] = 1.1
    spectral_cost: ClassVar[float] = 1.5

    anchored: bool = True

    @property
    def counts_from_camera(self) -> bool:
        """True if distances count from the camera, and lose digits with distance."""
        return not self.anchored

    @classmethod
    def cost_for(cls, *, spectral: bool) -> float:
        """Cost of its pass, higher where it adds up the optical depth of each channel."""
        return cls.spectral_cost if spectral else cls.cost

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes: one draw of all solids."""
        if not (solids := solids_of(scene)):
            return ()
        spectral = media_differ(scene)
        what = (
            "optical depth per channel, because media differ"
            if spectral
            else "thickness, because all bodies share one medium"
        )
        draws = f"{count_of(solids, 'body', 'bodies')} in one unsorted draw each"
        reason = f"{draws}: distances of exits minus distances of entries add up to {what}"
        return (PassSpec(PassName.SIGNED_DEPTH, reason, solids, 1, cost=self.cost_for(spectral=spectral)),)

    def limits(self, scene: Scene) -> list[Note]:
        """Notes on digits lost in distances from the camera."""
        if self.anchored:
            return []
        text = "distances are measured from the camera, so float32 loses digits far away"
        return [Note(NoteKind.DISTANCE_FROM_CAMERA, text)]
