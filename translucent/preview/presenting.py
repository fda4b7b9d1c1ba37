"""Presentation of the samples of a viewport as the document asks for it, with the reference beside them."""

from __future__ import annotations

from translucent.gpu.viewport import Shown, Viewport
from translucent.preview.measuring import Truth
from translucent.preview.scales import thickest, worst
from translucent.preview.scenes import method_of
from translucent.preview.staging import tone_of
from translucent.preview.workspace import Workspace
from translucent.scene.scene import Scene


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

    def present(
        self, workspace: Workspace, scene: Scene, viewport: Viewport, key: tuple[object, ...], *, changed: bool
    ) -> None:
        """Show the samples so far, unless they are on show: those of a picture with a key."""
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
                self.truth, changed = truth, True
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
        wanted = (shown, key)
        if changed or wanted != self.shown:
            viewport.present(shown)
            self.shown = wanted
