"""Refinement of a still picture, as long as nobody changes anything: path tracing, or the light of photons."""

from __future__ import annotations

import time
from dataclasses import replace

from translucent.diffusion.keys import diffusion_key, media_lit_by_photons
from translucent.errors import InputError
from translucent.gpu.refinement import Convergence, PhotonLight
from translucent.gpu.viewport import Viewport
from translucent.planning.caustics import Caustics
from translucent.planning.methods import PathTraced
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.request import RenderRequest
from translucent.preview.quality import solve_aside
from translucent.preview.workspace import Workspace
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

#: Method of a path traced picture; how many paths there are is seen as it goes on.
PATHS = PathTraced(paths=2)

#: Photons of a round, rounds after which they are first shown, and photons after which a picture is done.
ROUND, FIRST_ROUNDS, MOST_PHOTONS = 1 << 14, 4, 1 << 26

#: Seconds of following photons for each second of drawing, at least.
SHARE = 0.1

#: Noise of the picture, as a fraction of its mean radiance, at which it is done, too.
QUIET = 1e-3


class PathRefinement:
    """Path tracing of the scene on show, in place of the interactive method.

    Attributes
    ----------
    note : str
        How many paths there are, and how noisy they are; or why there are none; or nothing.
    plan : RenderPlan, optional
        Plan of the paths, while they are followed.
    """

    def __init__(self) -> None:
        self.note = ""
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
                self._held = Convergence(renderer.gpu, self.plan, viewport.size)
                self.note = "converging: the first paths"
                return True, False
        except InputError as error:
            self.note = f"not converging: {error}"
            return False, False
        held = self._held
        if held.done:
            return False, False
        if changed := held.step(seconds):
            viewport.take(0, held.job)
            state = "converged" if held.done else "converging"
            self.note = f"{state}: {held.paths} paths, standard error {held.error:.2%}"
        return not held.done, changed

    def stop(self) -> bool:
        """End it; returns whether its picture was on show."""
        was = self._held is not None and self._held.paths > 0
        if self._held is not None:
            self._held.release()
        self._scene = self._held = self.plan = None
        self.note = ""
        return was


class PhotonRefinement:
    """Photons of the scene on show, and pictures with their light: the next is drawn aside, and then takes over.

    Each picture has twice the photons of the one before at least, and more where drawing it takes long.

    Attributes
    ----------
    note : str
        How many photons there are, and how noisy their light is; or why there are none; or nothing.
    plan : RenderPlan, optional
        Plan with caustics, while photons are followed.
    light : PhotonLight, optional
    drawing : bool
        A picture is to be drawn with the light as it is.
    side : int
        Side of the viewport with that picture: 1 until it has taken over.
    in_media : bool
        The light of photons in media is known.
    """

    def __init__(self) -> None:
        self._reset()

    def _reset(self) -> None:
        self.note = ""
        self.plan: RenderPlan | None = None
        self.light: PhotonLight | None = None
        self.drawing, self.side, self._on_show, self.in_media = False, 1, False, False
        self._in_texture = self._in_picture = 0  # photons
        self._scene: Scene | None = None
        self._noise, self._next = float("inf"), FIRST_ROUNDS
        self._following = self._drawing = self._begun = 0.0  # seconds spent, and when drawing began

    def ready(
        self,
        workspace: Workspace,
        scene: Scene,
        renderer: Renderer,
        viewport: Viewport,
        request: RenderRequest,
        seconds: float,
        drawing: float,
    ) -> bool:
        """Follow photons for about so many seconds, unless a picture is being drawn; whether any are to be followed.

        Photons that light media are followed first, all at once, in a worker process.

        Parameters
        ----------
        workspace : Workspace
        scene : Scene
        renderer : Renderer
        viewport : Viewport
        request : RenderRequest
            Of the picture without photons.
        seconds : float
        drawing : float
            Seconds that a picture is expected to take.
        """
        try:
            if self._scene is not scene:
                self.stop(viewport)
                self._scene = scene
                self.plan = renderer.plan_requested(scene, replace(request, caustics=Caustics(ROUND)))
            if self.plan is None or self.done or not self._media_known(workspace, renderer):
                return False
            if not self.plan.has(PassName.CAUSTICS):
                return False  # nothing opaque that more could land on
            if self.light is None:
                self.light = PhotonLight(renderer.gpu, self.plan, viewport.size)
                self.note = "caustics: the first photons"
                return True
        except InputError as error:
            self.note = f"no {error}" if str(error).startswith("caustics") else f"no caustics: {error}"
            return False
        if not self.drawing:
            begun = time.perf_counter()
            self.light.step(seconds)
            self._following += time.perf_counter() - begun
            due = self.light.rounds >= self._next and self._following >= SHARE * max(self._drawing, drawing)
            if due or self.light.photons >= MOST_PHOTONS:
                self.light.show()
                self._in_texture = self.light.photons
                viewport.restart(1)
                self.drawing, self.side, self._begun = True, 1, time.perf_counter()
            self._count()
        return True

    def _media_known(self, workspace: Workspace, renderer: Renderer) -> bool:
        """True if the light of photons in media is known, if there is any; else it is solved for."""
        assert self.plan is not None
        plan, caustics, cache = self.plan, self.plan.caustics, renderer.gpu.diffusion
        if not media_lit_by_photons(plan.scene):
            return True
        assert caustics is not None
        key, lane = diffusion_key(plan), workspace.lanes["diffuse"]
        if cache.has(key):
            self.in_media = True
            if not self.plan.has(PassName.CAUSTICS):
                self.note = f"caustics: {caustics.in_media:,} photons in media"
            return True
        if lane.failed(key):
            self.note = "no caustics: what photons light in media could not be solved for"
        elif lane.task is None:
            self.note = "caustics: photons in media first"
            given = workspace.pool, cache, plan
            lane.request(key, "photons in media", lambda task: solve_aside(task, *given))
        return False

    def show_media(self, viewport: Viewport) -> RenderPlan | None:
        """Begin the picture anew with photons in media, where none land on anything; its plan, None if it has begun."""
        if not self.in_media or self._on_show or self.plan is None or self.plan.has(PassName.CAUSTICS):
            return None
        viewport.restart()
        self._on_show = True
        return self.plan

    @property
    def done(self) -> bool:
        """True if more photons would change nothing to be seen."""
        return not self.drawing and (self._in_picture >= MOST_PHOTONS or self._noise < QUIET)

    def take_over(self, viewport: Viewport, stride: int, samples: int) -> bool:
        """Put the picture that is drawn aside on show once it is whole; returns whether it was put there.

        Where pictures take long, the first whole one takes over, and edges become smooth after that. When it is as good
        as it gets with these photons, more are followed.
        """
        assert self.light is not None
        drawn, whole, last = viewport.steps(self.side), stride * stride, stride * stride * (1 + samples)
        if over := self.side == 1 and drawn == (whole if stride > 1 else last):
            viewport.swap()
            self.side, self._on_show = 0, True
            self._in_picture = self._in_texture
            mean = viewport.mean_radiance()
            self._noise = self.light.error / mean if mean > 0 else 0.0
        if drawn >= last:
            self.drawing, self._next = False, 2 * self.light.rounds
            self._drawing, self._following = time.perf_counter() - self._begun, 0.0
        self._count()
        return over

    def _count(self) -> None:
        assert self.light is not None
        noise = f", standard error {self._noise:.2%}" if self._noise < 1e3 else ""
        seen = f"{self._in_picture:,} photons in the picture{noise}" if self._in_picture else "not in the picture yet"
        self.note = f"caustics: {seen}" if self.done else f"caustics: {seen}; {self.light.photons:,} so far"

    def stop(self, viewport: Viewport) -> bool:
        """End it; returns whether its picture was on show."""
        was = self._on_show
        if self.light is not None:
            self.light.release()
            viewport.restart(1)
        self._reset()
        return was
