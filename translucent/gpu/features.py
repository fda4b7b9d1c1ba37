"""Features of a frame: what its scene and plan ask of the passes, without OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.slots import Slot, medium_slots
from translucent.scene.scene import Object, Scene


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """Traits of a frame by which its passes choose their shaders and targets.

    Parameters
    ----------
    scene : Scene
    plan : RenderPlan
        Of that scene.
    """

    scene: Scene
    plan: RenderPlan

    @property
    def has_opaque(self) -> bool:
        """Whether rays may end on an opaque surface."""
        return self.plan.has(PassName.OPAQUE, PassName.BACKDROP)

    @property
    def has_surfaces(self) -> bool:
        """Whether light changes at the interface of a body."""
        return self.plan.has(PassName.SURFACES)

    @property
    def has_layers(self) -> bool:
        """Whether layers are painted over the picture, or interfaces glow."""
        return self.plan.has(PassName.LAYERS)

    @property
    def accumulates(self) -> bool:
        """Whether paths add up: those that the method finds without an order, or those through sheets."""
        return not self.plan.ordered or self.plan.has(PassName.THIN_LAYER)

    @property
    def has_fallback(self) -> bool:
        """Whether pixels that do not balance take their path from another target."""
        return self._fills("fallback")

    @property
    def has_unlit(self) -> bool:
        """Whether pixels are marked invalid where bodies are that scatter unseen light."""
        return self._fills("unlit")

    @property
    def scatters(self) -> bool:
        """Whether light from the lights is scattered into the rays."""
        return self.plan.has(PassName.LIGHT_VIEWS)

    @property
    def last_pass(self) -> str:
        """Name of the pass after which a sample's radiance is whole, and can be summed up."""
        return self.plan.passes[-1].name

    @property
    def one_interface(self) -> bool:
        """Whether rays bend at the interface where they enter a body, and not at the one where they leave it."""
        return self.plan.interfaces == "front"

    @property
    def finds_exits(self) -> bool:
        """Whether the intervals tell where each ray first leaves all bodies: interfaces need it where bodies touch."""
        return self.has_surfaces and self.plan.method.finds_exits

    @property
    def marches(self) -> bool:
        """Whether the method steps through the intervals."""
        return self.plan.method.marches

    @property
    def emits(self) -> bool:
        """Whether any medium emits light."""
        return any(body.medium is not None and body.medium.emits for body in self.scene.bodies)

    @cached_property
    def slots(self) -> tuple[Slot, ...]:
        """Bodies by the winding numbers that rays keep apart."""
        return medium_slots(self.scene)

    @cached_property
    def sheets(self) -> dict[int, float]:
        """Thickness in metres of the objects that are drawn as sheets, without an inside, by their numbers."""
        thin = self.plan.method.makes_sheets
        return {
            i: self.sheet_thickness(body)
            for i, body in enumerate(self.scene.objects)
            if body.medium is not None and (thin or body.sheet_thickness is not None)
        }

    def sheet_thickness(self, body: Object) -> float:
        """Metres through every face of a body, wherever a pass takes it for a sheet."""
        if body.sheet_thickness is not None:
            return body.sheet_thickness
        if (usual := self.plan.method.usual_thickness) is not None:
            return usual
        return FALLBACK_SHEET * float(np.linalg.norm(body.bounds[1] - body.bounds[0]))

    def _fills(self, target: str) -> bool:
        return any(step.target == target for step in self.plan.passes)
