"""Fragment lists: all surfaces of each pixel, sorted afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from translucent.arguments import checked
from translucent.planning.bodies import solids_of
from translucent.planning.methods.base import MAX_LIGHT_POINTS, Method, check_count
from translucent.planning.passes import PassName, PassSpec
from translucent.scene.scene import Scene


@checked
@dataclass(frozen=True)
class FragmentLists(Method):
    """Ordered intervals from one pass: every pixel keeps the list of its surfaces (Yang et al. 2010). OpenGL 4.3.

    Parameters
    ----------
    light_points : int
        Where a medium scatters light: points at which each interval looks at each light.
    """

    name: ClassVar[str] = "fragment-lists"
    cost: ClassVar[float] = 2.4
    ordered: ClassVar[bool] = True
    needs_storage: ClassVar[bool] = True
    samples_lights: ClassVar[bool] = True
    finds_exits: ClassVar[bool] = True

    light_points: int = 8

    def __post_init__(self) -> None:
        check_count("FragmentLists light_points", self.light_points, MAX_LIGHT_POINTS)

    def passes(self, scene: Scene, why: str) -> tuple[PassSpec, ...]:
        """Passes: one draw of all solids."""
        reason = f"{why}; one draw fills a list for each pixel, which is then sorted"
        return (PassSpec(PassName.FRAGMENT_LISTS, reason, solids_of(scene), 1, cost=self.cost),)
