"""Times of drawn steps, and which plans take about the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from translucent.gpu.strides import STRIDES
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan

Factor = TypeVar("Factor", int, float)

#: Budgets that a step of the largest stride but one may take: a whole picture of the largest takes twice as long, since
#: each step costs the window a frame.
OVERDRAWN = 1.5


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


class Pace:
    """Seconds that whole pictures of each kind of plan are known to take, and how coarse they must be to be quick."""

    def __init__(self) -> None:
        self._seconds: dict[tuple[str, ...], float] = {}

    def note(self, plan: RenderPlan, seconds: float) -> None:
        """Take down what a whole picture would have taken."""
        known = self._seconds.get(kind(plan))
        # The first of its kind compiles shaders.
        self._seconds[kind(plan)] = seconds if known is None or seconds < known else 0.8 * known + 0.2 * seconds

    def known(self, plan: RenderPlan) -> float:
        """Seconds of a whole picture; 0 if there was none."""
        return self._seconds.get(kind(plan), 0.0)

    def factor(self, plan: RenderPlan | None, factors: Sequence[Factor], budget: float) -> Factor:
        """Smallest factor of reduction at which a picture is expected to be drawn within so many seconds."""
        known = None if plan is None else self._seconds.get(kind(plan))
        if known is None:
            slow = plan is not None and (plan.has(PassName.SHADOW_MAPS) or plan.has(PassName.TRACED))
            return factors[0] if plan is None else factors[-1] if slow else factors[-2]
        return next((factor for factor in factors if known / factor**2 <= budget), factors[-1])

    def stride(self, plan: RenderPlan | None, budget: float) -> int:
        """Stride of a progressive picture whose steps are expected to take so many seconds."""
        *usual, largest = STRIDES
        slow = plan is not None and self.known(plan) / usual[-1] ** 2 > OVERDRAWN * budget
        return largest if slow else self.factor(plan, usual, budget)
