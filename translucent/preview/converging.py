"""The still picture, path traced as long as nobody changes anything: the truth in place of the interactive method."""

from __future__ import annotations

from translucent.errors import InputError
from translucent.gpu.convergence import Convergence
from translucent.gpu.viewport import Viewport
from translucent.planning.methods import PathTraced
from translucent.planning.render_plan import RenderPlan
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

#: What the plan of such a picture is made for; how many paths there are is seen as it goes on.
PATHS = PathTraced(paths=2)


class Converging:
    """Path tracing of the scene on show.

    Attributes
    ----------
    told : str
        How many paths there are, and how noisy they are; or why there are none; or nothing.
    plan : RenderPlan, optional
        Of the paths, while they are followed.
    """

    def __init__(self) -> None:
        self.told = ""
        self.plan: RenderPlan | None = None
        self._scene: Scene | None = None
        self._held: Convergence | None = None

    def step(self, scene: Scene, renderer: Renderer, viewport: Viewport, seconds: float) -> tuple[bool, bool]:
        """Follow paths of a still picture for about so many seconds; whether more are to come, and it has changed."""
        try:
            if self._scene is not scene:
                self.stop()
                self._scene, self.plan = scene, renderer.plan(scene, PATHS)
            if self.plan is None:
                return False, False
            if self._held is None:
                self._held = Convergence(renderer.gpu, scene, viewport.size, self.plan)
                self.told = "converging: the first paths"
                return True, False
        except InputError as error:
            self.told = f"not converging: {error}"
            return False, False
        held = self._held
        if held.done:
            return False, False
        if changed := held.step(seconds):
            viewport.take(0, held.job)
            state = "converged" if held.done else "converging"
            self.told = f"{state}: {held.paths} paths, standard error {held.error:.2%}"
        return not held.done, changed

    def stop(self) -> bool:
        """End it; returns whether its picture was on show."""
        was = self._held is not None and self._held.paths > 0
        if self._held is not None:
            self._held.release()
        self._scene = self._held = self.plan = None
        self.told = ""
        return was
