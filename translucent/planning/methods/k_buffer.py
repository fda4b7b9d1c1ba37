"""k-buffer: the k nearest surfaces of each pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.bodies import solids_of
from translucent.planning.methods.base import MAX_LIGHT_POINTS, Method, check_count
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Scene

#: Largest number of surfaces for each pixel, which must fit into the memory of a frame.
MAX_K = 256


@checked
@dataclass(frozen=True)
class KBuffer(Method):
    """Ordered intervals from one pass that keeps the k nearest surfaces (Bavoil et al. 2007). OpenGL 4.3.

    Parameters
    ----------
    k : int
        Surfaces that a ray may cross; pixels with more are marked invalid.
    light_points : int
        Where a medium scatters light: points at which each interval looks at each light.
    """

    name: ClassVar[str] = "k-buffer"
    cost: ClassVar[float] = 4.2
    ordered: ClassVar[bool] = True
    needs_storage: ClassVar[bool] = True
    samples_lights: ClassVar[bool] = True
    finds_exits: ClassVar[bool] = True

    k: int = 8
    light_points: int = 8

    def __post_init__(self) -> None:
        check_count("KBuffer k", self.k, MAX_K)
        check_count("KBuffer light_points", self.light_points, MAX_LIGHT_POINTS)

    @property
    def layer_limit(self) -> int:
        """Largest number of surfaces that a ray may cross."""
        return self.k

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes: one draw of all solids."""
        reason = f"{why}; one draw; each pixel keeps the {self.k} nearest surfaces"
        return (PassSpec(PassName.K_BUFFER, reason, solids_of(scene), 1, cost=self.cost),)
