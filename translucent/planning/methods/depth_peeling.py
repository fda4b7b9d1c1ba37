"""Depth peeling: a layer or two of surfaces with each pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.planning.bodies import solids_of
from translucent.planning.methods.base import Method, check_count
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Scene

#: Largest number of passes over the geometry.
MAX_LAYERS = 4096

#: Layers of a body that is not convex, for want of a better guess: cost estimates are made before anything is drawn.
_GUESSED_LAYERS = 8


@checked
@dataclass(frozen=True)
class DepthPeeling(Method):
    """Ordered intervals from a pass over the geometry for every layer or two (Everitt 2001), with OpenGL 3.3.

    Coplanar faces survive, since a layer differs from the next by distance, medium and side, and those alike are
    counted.

    Parameters
    ----------
    max_layers : int
        Surfaces that a ray may cross; pixels with more are marked invalid.
    order : {"both-ends", "front-to-back", "back-to-front"}
        In which layers are peeled and composited; ``both-ends`` takes two with each pass (dual depth peeling, Bavoil &
        Myers 2008). Pixels with too many layers lose the last of them, or those in the middle.
    """

    name: ClassVar[str] = "depth-peeling"
    cost: ClassVar[float] = 2.4  # of each draw
    ordered: ClassVar[bool] = True
    peels: ClassVar[bool] = True

    max_layers: int = 64
    order: Literal["both-ends", "front-to-back", "back-to-front"] = "both-ends"

    def __post_init__(self) -> None:
        check_count("DepthPeeling max_layers", self.max_layers, MAX_LAYERS)
        if self.order not in (orders := ("both-ends", "front-to-back", "back-to-front")):
            raise InputError(
                f"DepthPeeling order {self.order!r}", "no order has this name", f"use one of {', '.join(orders)}"
            )

    @property
    def layer_limit(self) -> int:
        """Largest number of surfaces that a ray may cross."""
        return self.max_layers

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """One pass, with as many draws of all solids as they are expected to have layers."""
        solids = solids_of(scene)
        bodies = [scene.objects[i] for i in solids]
        expected = sum(2 if body.mesh.diagnosis.convex else _GUESSED_LAYERS for body in bodies)
        layers = min(expected, self.max_layers)
        both_ends = self.order == "both-ends"
        reason = f"{why}; each draw finds {'two layers' if both_ends else 'one layer'}, until none is left"
        # Where some layers are left out, one more draw counts the faces of the last that is not.
        draws = (-(-layers // 2) if both_ends else layers) + (expected > layers)
        return (PassSpec(PassName.DEPTH_PEELING, reason, solids, draws, cost=draws * self.cost),)
