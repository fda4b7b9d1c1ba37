"""Comparison of a view with the float64 reference, once it is still and its picture has all that it needs."""

from __future__ import annotations

import time
from dataclasses import dataclass

from translucent.preview.measuring import Measured, measurable
from translucent.preview.preparations import prepares
from translucent.preview.scenes import method_of
from translucent.preview.workspace import Workspace
from translucent.scene.scene import Scene

#: Seconds after which a view is still.
STILL = 0.25


@dataclass
class Comparing:
    """Comparer of the views of a workspace, one after the other."""

    work: Workspace
    _view: object = None
    _since: float = 0.0
    _begun: bool = False

    def step(self, size: tuple[int, int]) -> bool:
        """Begin, if it is time; returns whether a view is still to be compared.

        Parameters
        ----------
        size : (width, height)
            Of the viewport, in pixels.
        """
        scene, display = self.work.scene(), self.work.document.display
        measured = scene is not None and (display.inset or measurable(scene))
        view = scene, display.method, display.compare, measured
        if view != self._view:
            self._view, self._since, self._begun = view, time.monotonic(), False
            if (last := self.work.lanes["draw"].task) is not None:
                last.cancel()
        if scene is None or self._begun:
            return False
        if time.monotonic() - self._since <= STILL or prepares(self.work):
            return True
        self._begun = True
        if self.work.shown_bake is None:
            self._begin(scene, size, measured=measured)
        return False

    def _begin(self, scene: Scene, size: tuple[int, int], *, measured: bool) -> None:
        display = self.work.document.display
        method = method_of(display.method, self.work.document.material)
        if measured:
            self.work.measure(scene, method, size, self._take)
        if display.compare in ("reference", "error"):
            levels = (1,) if display.compare == "error" else None
            self.work.draw_truth(scene, method, size, levels)

    def _take(self, measured: Measured) -> None:
        self.work.measured = measured
