"""Features of a frame: requirements of its scene and plan on the passes, worked out without OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.bodies import Slot, medium_slots
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import Treatment
from translucent.planning.shadow_maps import dims_interfaces
from translucent.scene.scene import Scene

#: Largest number of media whose paths are added up in textures of their own.
MOST_APART = 3


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """Traits of a frame by which its passes choose their shaders and targets.

    Parameters
    ----------
    plan : RenderPlan
    """

    plan: RenderPlan

    @property
    def scene(self) -> Scene:
        """Scene that the plan renders."""
        return self.plan.scene

    @property
    def has_opaque(self) -> bool:
        """True if rays may end on an opaque surface."""
        return self.plan.has(PassName.OPAQUE, PassName.BACKDROP)

    @property
    def has_shadow_maps(self) -> bool:
        """True if opaque objects need shadow maps."""
        return self.plan.has(PassName.SHADOW_MAPS)

    @property
    def shadows_backdrop(self) -> bool:
        """True if bodies throw shadows onto a picture that is drawn elsewhere."""
        return self.has_shadow_maps and self.plan.has(PassName.BACKDROP)

    @property
    def has_surfaces(self) -> bool:
        """True if any body has an interface that changes light."""
        return self.plan.has(PassName.SURFACES, PassName.TRACED)

    @property
    def has_layers(self) -> bool:
        """True if layers are drawn over the picture, or interfaces emit light."""
        return self.plan.has(PassName.LAYERS)

    @property
    def accumulates(self) -> bool:
        """True if path lengths are accumulated without order, by the method or through sheets."""
        return not self.plan.ordered or self.plan.has(PassName.THIN_LAYER)

    @property
    def has_fallback(self) -> bool:
        """True if pixels with unbalanced counts take their path length from another target."""
        return self._fills("fallback")

    @property
    def has_unlit(self) -> bool:
        """True if pixels of scattering bodies are marked invalid, because their light cannot be computed."""
        return self._fills("unlit")

    @property
    def scatters(self) -> bool:
        """True if light from the lights is scattered into the rays."""
        return self.plan.has(PassName.LIGHT_VIEWS)

    @property
    def varies(self) -> bool:
        """True if media, or the light in them, vary from place to place."""
        return self.scene.varies or self.scatters_again

    @cached_property
    def scatters_again(self) -> bool:
        """True if light that was scattered before is scattered into the rays."""
        return bool(self.plan.treated(Treatment.VOLUME))

    @property
    def stopping_slots(self) -> int:
        """Bit mask of the slots whose straight light is stopped, because photons carry it."""
        stops = self.plan.opaque_to_shadows if self.scatters_again else frozenset()
        return sum(1 << i for i, slot in enumerate(self.slots) if stops.intersection(slot.objects))

    @property
    def last_pass(self) -> str:
        """Name of the pass after which a sample's radiance is complete and can be summed."""
        return self.plan.passes[-1].name

    @property
    def can_be_compact(self) -> bool:
        """True if radiance, thickness, its validity and optical depth are all that the passes over pixels find."""
        return self.last_pass == PassName.TRANSMITTANCE and not self.has_unlit

    @cached_property
    def media_apart(self) -> npt.NDArray[np.intp] | None:
        """(objects,): number of each object's medium, of a few that absorb differently and have an accumulator each.

        None where there are more, or other passes than signed depth add up.
        """
        others = (PassName.THIN_LAYER, PassName.BACK_FACE_DEPTH, PassName.UNLIT)
        if not self.plan.spectral or self.plan.ordered or self.has_fallback or self.plan.has(*others):
            return None
        bodies = np.array([body.medium.extinction for body in self.scene.bodies if body.medium is not None])
        found, numbers = np.unique(bodies, axis=0, return_inverse=True)
        if not 2 <= len(found) <= MOST_APART:
            return None
        media = np.zeros(len(self.scene.objects), dtype=np.intp)
        media[self.scene.filled] = numbers.reshape(-1)
        return media

    @property
    def one_interface(self) -> bool:
        """True if only the first interface on each ray is drawn, and not the one where the ray leaves."""
        return self.plan.interfaces is not None and not self.plan.interfaces.finds_exits

    @property
    def traced(self) -> bool:
        """True if rays are traced from the first interface on."""
        return self.plan.has(PassName.TRACED)

    @property
    def dims_interfaces(self) -> bool:
        """True if shadow rays dim highlights and diffuse reflection on interfaces."""
        return (self.traced or self.path_traced) and dims_interfaces(self.scene)

    @property
    def path_traced(self) -> bool:
        """True if radiance is path traced."""
        return self.plan.has(PassName.PATH_TRACE)

    @property
    def textured(self) -> bool:
        """True if rays read textures of surfaces wherever they hit one."""
        return self.plan.textured

    @property
    def has_caustics(self) -> bool:
        """True if photons light opaque objects."""
        return self.plan.has(PassName.CAUSTICS)

    @property
    def finds_exits(self) -> bool:
        """True if the intervals give each ray's first exit from all bodies: touching interfaces need it."""
        return self.has_surfaces and self.plan.method.finds_exits

    @property
    def marches(self) -> bool:
        """True if the method steps through the intervals."""
        return self.plan.method.marches

    @property
    def straight_light(self) -> bool:
        """True if the light that media add is found along straight rays, where traced rays do not find it."""
        return self.scatters or self.marches

    @cached_property
    def emits(self) -> bool:
        """True if any medium emits light."""
        return any(body.medium is not None and body.medium.emits for body in self.scene.bodies)

    @cached_property
    def slots(self) -> tuple[Slot, ...]:
        """Slots: bodies grouped by the winding numbers that rays keep apart."""
        return medium_slots(self.scene)

    @cached_property
    def sheets(self) -> dict[int, float]:
        """Thickness in metres of the objects that are drawn as sheets, by object index."""
        thin = self.plan.method.makes_sheets
        return {
            i: float(self.sheet_thicknesses[i])
            for i, body in enumerate(self.scene.objects)
            if body.medium is not None and (thin or body.sheet_thickness is not None)
        }

    @cached_property
    def sheet_thicknesses(self) -> Array:
        """(objects,): thickness in metres of each face of an object, where a pass draws it as a sheet."""
        declared = np.array([item.sheet_thickness for item in self.scene.objects], dtype=np.float64)  # NaN: none
        usual = self.plan.method.usual_thickness
        boxes = self.scene.boxes
        others = FALLBACK_SHEET * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) if usual is None else usual
        return np.where(np.isnan(declared), others, declared)

    def _fills(self, target: str) -> bool:
        return any(step.target == target for step in self.plan.passes)
