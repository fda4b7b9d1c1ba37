"""Presentation of the samples of a viewport as the document asks for it, with the reference beside them."""

from __future__ import annotations

import time

from translucent.gpu.viewport import Shown, Viewport
from translucent.preview.measuring import Truth
from translucent.preview.scales import thickest, worst
from translucent.preview.scenes import method_of
from translucent.preview.staging import tone_of
from translucent.preview.workspace import Workspace
from translucent.scene.scene import Scene

#: Seconds up to which a presentation is quick: whatever changes is shown at once. Others are as many seconds apart, and
#: have frames of their own, as the first of each kind has, which is compiled.
QUICK, APART = 0.006, 0.25


class Presenting:
    """Presentation of a viewport.

    Attributes
    ----------
    truth : Truth, optional
        The reference right of the split.
    shown : tuple
        Key of what is on show; empty: nothing of the samples.
    """

    def __init__(self) -> None:
        self.truth: Truth | None = None
        self.shown: tuple[object, ...] = ()
        self._wanted: tuple[Shown, tuple[object, ...]] | None = None
        self._pending = self._alone = False
        self._seconds = self._when = 0.0

    def begin(self, workspace: Workspace, scene: Scene, viewport: Viewport, key: tuple[object, ...]) -> bool:
        """Begin a frame that shows samples of a picture with a key; returns whether it is to do nothing else."""
        display, look = workspace.document.display, workspace.document.look
        wanted_method = method_of(display.method, workspace.document.material)
        if display.compare in ("reference", "error"):
            truth = workspace.truth
            straight = display.compare == "error"
            if self.truth is not None and straight and not self.truth.straight:
                self.truth = None
            fits = truth is not None and truth.scene is scene and truth.method == wanted_method
            if fits and truth is not None and truth is not self.truth and truth.straight >= straight:
                viewport.put(truth.frame)
                self.truth, self._pending = truth, True
        right = {"off": "same", "method": "second", "reference": "second", "error": "difference"}[display.compare]
        if display.compare in ("reference", "error") and self.truth is None:
            right = "same"
        shown = Shown(
            display.mode,
            right,
            display.split,
            thickest(workspace),
            worst(workspace),
            look.exposure,
            tone_of(look, scene),
        )
        self._wanted = shown, key
        waits = self._wanted != self.shown or (self._pending and time.perf_counter() - self._when > APART)
        first = self._is_first(viewport)
        self._alone = (first or (waits and self._seconds > QUICK)) and viewport.steps(0) > 0
        return self._alone

    def present(self, viewport: Viewport, *, changed: bool, last: bool) -> bool:
        """Show the samples so far, unless they are on show, or can be shown later; returns whether they have to be.

        Parameters
        ----------
        viewport : Viewport
        changed : bool
            There are others than before.
        last : bool
            No others are to come.
        """
        assert self._wanted is not None
        self._pending = self._pending or changed
        now = self._alone or last or self._seconds <= QUICK
        if self._wanted == self.shown and not (self._pending and now):
            return False
        if not self._alone and self._is_first(viewport):
            return True
        begun = time.perf_counter()
        viewport.present(self._wanted[0])
        viewport.engine.context.gl.finish()
        self.shown, self._pending, self._when = self._wanted, False, time.perf_counter()
        self._seconds = self._when - begun
        return False

    def _is_first(self, viewport: Viewport) -> bool:
        """True if nothing has been shown so before."""
        return self._wanted is not None and not viewport.presents_at_once(self._wanted[0])
