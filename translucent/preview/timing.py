"""Times of drawn steps, and which plans take about the same."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from translucent.gpu.strides import STRIDES
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan

Factor = TypeVar("Factor", int, float)

#: Budgets that a step of the largest stride but one may take: a whole picture of the largest takes twice as long, since
#: each step costs the window a frame.
OVERDRAWN = 1.5


#: Frames of which the quickest tells what the rest of a window takes; seconds of it that cost drawing nothing; and the
#: least share of its budget that drawing keeps.
RECENT, FREE, LEAST_SHARE = 16, 0.010, 1.0 / 3.0

#: Share of its budget after which a frame that makes what a picture needs leaves the drawing to the next one.
PREPARING = 0.5

#: Factors by which a picture is coarser while it moves; the largest where rays are traced or shadows drawn, and nobody
#: knows yet for how long.
FACTORS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0)

#: Largest such factor for traced interfaces: beyond it, those of the screen show more of what moves.
COARSEST_TRACED = 3.0


class FrameBudget:
    """Seconds that drawing may take of a frame: less of it where the rest of the window takes long, as large ones do.

    Parameters
    ----------
    clock : callable
        Seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._rests: deque[float] = deque(maxlen=RECENT)
        self._ended: float | None = None

    def begin(self, budget: float) -> float:
        """Begin to draw a frame, and return what is left of a budget."""
        if self._ended is not None:
            self._rests.append(self._clock() - self._ended)
        taken = min(self._rests, default=0.0) - FREE
        return budget - min(max(taken, 0.0), (1.0 - LEAST_SHARE) * budget)

    def end(self, *, more: bool) -> None:
        """End it. Where no other follows at once, the window may sleep."""
        self._ended = self._clock() if more else None


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

    def traces_longer(self, plan: RenderPlan | None, seconds: float) -> bool:
        """True if a whole picture in which interfaces are traced is known to take longer."""
        return plan is not None and plan.has(PassName.TRACED) and self.known(plan) > seconds

    def factor(self, plan: RenderPlan | None, factors: Sequence[Factor], budget: float) -> Factor:
        """Smallest factor of reduction at which a picture is expected to be drawn within so many seconds."""
        known = None if plan is None else self._seconds.get(kind(plan))
        if known is None:
            slow = plan is not None and (plan.has(PassName.SHADOW_MAPS) or plan.has(PassName.TRACED))
            return factors[0] if plan is None else factors[-1] if slow else factors[-2]
        return next((factor for factor in factors if known / factor**2 <= budget), factors[-1])

    def stride(self, plan: RenderPlan | None, budget: float) -> int:
        """Stride of a progressive picture whose steps are expected to take so many seconds; the largest if unknown."""
        *usual, largest = STRIDES
        if plan is not None and not self.known(plan):
            return largest
        slow = plan is not None and self.known(plan) / usual[-1] ** 2 > OVERDRAWN * budget
        return largest if slow else self.factor(plan, usual, budget)
