"""Depth peeling: a layer or two of surfaces with each pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from translucent.errors import InputError
from translucent.planning.methods.base import Method, check_count

#: Passes over the geometry that anybody would wait for.
MAX_LAYERS = 4096


@dataclass(frozen=True)
class DepthPeeling(Method):
    """Ordered intervals from a pass over the geometry for every layer or two (Everitt 2001), with OpenGL 3.3.

    Coplanar faces survive, since a layer is told from the next by distance, medium and side, and those alike are
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
    ordered: ClassVar[bool] = True

    max_layers: int = 64
    order: Literal["both-ends", "front-to-back", "back-to-front"] = "both-ends"

    def __post_init__(self) -> None:
        check_count("DepthPeeling max_layers", self.max_layers, MAX_LAYERS)
        if self.order not in (orders := ("both-ends", "front-to-back", "back-to-front")):
            raise InputError(f"DepthPeeling order {self.order!r}", "not known", f"use one of {', '.join(orders)}")

    @property
    def layer_limit(self) -> int:
        """Surfaces that a ray may cross."""
        return self.max_layers
