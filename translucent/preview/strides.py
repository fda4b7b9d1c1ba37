"""Steps in which the two sides of a picture at rest are drawn: how many, and with how many samples of a pixel."""

from __future__ import annotations

from collections.abc import Sequence

from translucent.planning.render_plan import RenderPlan
from translucent.preview.timing import Pace

#: Samples of a pixel where steps are quick, or slow.
SAMPLES, SLOW_SAMPLES = 16, 4


def samples_of(stride: int, antialias: bool) -> int:
    """Number of samples of a pixel, after the first one, that make edges smooth."""
    return (SAMPLES if stride == 1 else SLOW_SAMPLES) if antialias else 0


class Strides:
    """Strides of the steps of both sides.

    Attributes
    ----------
    of : list of int
    """

    def __init__(self, pace: Pace) -> None:
        self._pace = pace
        self.of, self._coarsened = [4, 4], [False, False]

    def begin(self, plans: Sequence[RenderPlan | None], budget: float) -> None:
        """Choose strides whose steps are expected to take so many seconds."""
        self.of, self._coarsened = [self._pace.stride(plan, budget) for plan in plans], [False, False]

    def corrected(self, side: int, plan: RenderPlan, drawn: int, budget: float) -> bool:
        """True if another stride was chosen, so that the side begins anew, by what its first steps tell, of which the
        very first compiles: a smaller one at 2, 4, 8 ... steps while less than a quarter of them would be lost, a
        larger one once.
        """
        now = self.of[side]
        if drawn < 2 or drawn & (drawn - 1) or 4 * drawn > now * now:
            return False
        stride = self._pace.stride(plan, budget)
        if stride == now or (stride > now and self._coarsened[side]):
            return False
        self._coarsened[side] |= stride > now
        self.of[side] = stride
        return True
