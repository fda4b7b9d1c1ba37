"""Times of drawn steps, and which plans take about the same."""

from __future__ import annotations

from dataclasses import dataclass

from translucent.planning.render_plan import RenderPlan


@dataclass
class Timing:
    """Timing of the last step of a side: seconds, by the clock and per pass on the GPU; and its share of the pixels."""

    wall: float = 0.0
    passes: dict[str, float] | None = None
    share: float = 1.0

    @property
    def gpu(self) -> float:
        """Sum over the passes."""
        return sum((self.passes or {}).values())


def kind(plan: RenderPlan) -> tuple[str, ...]:
    """Key of plans that take about the same time."""
    return (str(plan.method), str(plan.shadows.directions), *(step.name for step in plan.passes))
