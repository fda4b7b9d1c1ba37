"""Quality of the picture on show: simpler and coarser while things move, refined by paths or photons at rest."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar, cast

from translucent.arrays import Floats
from translucent.diffusion.keys import diffusion_key, media_lit_by_photons, place_of
from translucent.errors import InputError
from translucent.frames.denoising import denoised_radiance
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.refinement import Convergence, PhotonPicture
from translucent.gpu.viewport import STRIDES, Viewport
from translucent.planning.caustics import Caustics
from translucent.planning.interfaces import ScreenInterfaces, TracedInterfaces
from translucent.planning.methods import PathTraced
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import Treatment, treatment_of
from translucent.planning.request import RenderRequest
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering, choose_treatments
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.preparation import make_large_normals, untraceable
from translucent.preview.tasks import Task
from translucent.preview.worker import Pool, Urgency
from translucent.preview.workspace import Workspace
from translucent.renderer import Renderer
from translucent.scene.camera import Lens
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.diffusion.cache import FieldCache, Fields

Factor = TypeVar("Factor", int, float)

#: Recent frames, whose quickest measures the rest of a window; seconds of it that cost drawing nothing; and the least
#: fraction of its budget that drawing keeps.
RECENT, FREE, LEAST_SHARE = 16, 0.010, 1.0 / 3.0

#: Fraction of its budget after which a frame that makes what a picture needs leaves the drawing to the next one.
PREPARING = 0.5

#: Largest time in seconds of a step of a picture at rest: with the rest of the window, a frame takes up to 100 ms.
AT_REST = 0.085

#: Factors by which a picture is coarser while it moves; the largest where rays are traced or shadows drawn, and nobody
#: knows yet for how long.
FACTORS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0)

#: Largest such factor for traced interfaces: beyond it, those of the screen show more of what moves.
COARSEST_TRACED = 3.0

#: Samples of a pixel where steps are quick, or slow.
SAMPLES, SLOW_SAMPLES = 16, 4

#: Samples of a pixel through a lens, each through another point of it.
LENS_SAMPLES = 64

#: Paths of each pixel after which noise is first taken out of them, and the factor from one time to the next.
FIRST_DENOISED, DENOISED_AGAIN = 4, 4

#: Interfaces of a picture in which rays cannot be traced, or would take too long.
SCREEN = ScreenInterfaces()

#: Largest number of triangles of a mesh that Embree gets: it holds Python's lock while it builds, which is 75 ms.
MOST_EMBREE = 200_000

#: Number of triangles from which on pictures and shadow maps take long to draw.
MANY = 1_000_000

#: Shadows of a picture that moves: those of a few directions of the environment; and of fewer for many triangles, and
#: while lights move, which takes new maps for every picture. Pictures of two would be further off than without any.
QUICK_SHADOWS, QUICKER_SHADOWS = ShadowMaps(directions=8), ShadowMaps(directions=4)

#: Grid on which light is solved for in the frame while things move: in the bear, other lights take 25 ms of processor
#: time and another medium 45 ms, a sixth of what they take on the usual one. Pixels of milk, jade and wax in bear and
#: candle are 0.5 to 5.6 of 255 off those of the usual one, those of layers 1.2 to 19.
SMALL = Diffusion(12)

#: Seconds of a frame that it may take. Where it took longer, it waits until the scene rests.
LONGEST = 0.03


class FrameBudget:
    """Seconds that drawing may take of a frame: less where the rest of the window takes long, as large ones do.

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
        """Begin to draw a frame, and return the rest of a budget."""
        if self._ended is not None:
            self._rests.append(self._clock() - self._ended)
        taken = min(self._rests, default=0.0) - FREE
        return budget - min(max(taken, 0.0), (1.0 - LEAST_SHARE) * budget)

    def end(self, *, more: bool) -> None:
        """End the preparation. Where no other follows at once, the window may sleep."""
        self._ended = self._clock() if more else None


@dataclass
class StepTiming:
    """Seconds that the last step of a side took, by the clock and per pass on the GPU, and its part of all pixels."""

    wall: float = 0.0
    passes: dict[str, float] | None = None
    share: float = 1.0


class StepTimes:
    """Seconds that steps take, by the method and passes of their plans, and how coarse quick ones must be.

    A step takes some time however few pixels it has, and more in proportion to their number. Two sizes tell both; until
    then, most of a step's time counts as fixed, so that another size is tried. None is tried that is more than twice as
    fine as one that was timed.
    """

    def __init__(self) -> None:
        self._last: dict[tuple[str, ...], tuple[float, float]] = {}  # factor and seconds
        self._least: dict[tuple[str, ...], dict[float, float]] = {}  # seconds of the quickest step, by its factor

    def note(self, plan: RenderPlan, seconds: float, factor: float = 1.0) -> None:
        """Record the time of a step that is coarser by a factor."""
        key, before = _cost_key(plan), self.known(plan, factor)
        least = self._least.setdefault(key, {})
        least[factor] = min(seconds, least.get(factor, seconds))
        # The first of its type compiles shaders.
        self._last[key] = factor, seconds if not before or seconds < before else 0.8 * before + 0.2 * seconds

    def known(self, plan: RenderPlan, factor: float = 1.0) -> float:
        """Seconds that a step is expected to take; 0 if there was none."""
        if (key := _cost_key(plan)) not in self._last:
            return 0.0
        last, seconds = self._last[key]
        fixed = min(self._fixed(plan), 0.9 * seconds)
        return fixed + (seconds - fixed) * (last / factor) ** 2

    def _fixed(self, plan: RenderPlan) -> float:
        """Seconds of a step without pixels, by the finest and the coarsest that were timed."""
        least = self._least[_cost_key(plan)]
        fine, coarse = min(least), max(least)
        if fine == coarse:
            return least[fine]
        return max((coarse**2 * least[coarse] - fine**2 * least[fine]) / (coarse**2 - fine**2), 0.0)

    def factor(self, plan: RenderPlan, factors: Sequence[float], budget: float) -> float:
        """Smallest factor of reduction at which a picture is expected to be drawn within so many seconds."""
        if not self.known(plan):
            return factors[-1 if plan.has(PassName.SHADOW_MAPS) or plan.has(PassName.TRACED) else -2]
        tried = self._tried(plan, factors)
        return next((factor for factor in tried if self.known(plan, factor) <= budget), factors[-1])

    def stride(self, plan: RenderPlan | None, budget: float) -> int:
        """Stride of a picture at rest whose steps are expected to take so many seconds; the largest if unknown.

        They may take longer by the factor by which the whole picture is there sooner than by the next larger stride, up
        to `AT_REST`: each step draws all triangles, and costs the window a frame.
        """
        if plan is None:
            return STRIDES[0]
        chosen = STRIDES[-1]
        for finer in self._tried(plan, STRIDES[:-1])[::-1]:
            before, after = (stride**2 * (self.known(plan, stride) + FREE) for stride in (chosen, finer))
            if self.known(plan, finer) > max(budget, min(budget * before / after, AT_REST)):
                break
            chosen = finer
        return chosen

    def _tried(self, plan: RenderPlan, factors: Sequence[Factor]) -> Sequence[Factor]:
        """Factors that may be tried, of a list from fine to coarse."""
        finest = min(self._least.get(_cost_key(plan), ()), default=math.inf)
        return [factor for factor in factors if 2 * factor >= finest]


def _cost_key(plan: RenderPlan) -> tuple[str, ...]:
    """Key of plans that take about the same time."""
    return (str(plan.method), str(plan.shadows.directions), *(step.name for step in plan.passes))


def samples_of(stride: int, antialias: bool) -> int:
    """Number of samples of a pixel, after the first one, that make edges smooth."""
    return (SAMPLES if stride == 1 else SLOW_SAMPLES) if antialias else 0


class Strides:
    """Strides of the steps in which both sides of a picture at rest are drawn.

    Attributes
    ----------
    of : list of int
    """

    def __init__(self, times: StepTimes) -> None:
        self._times = times
        self.of, self._coarsened = [4, 4], [False, False]

    def begin(self, plans: Sequence[RenderPlan | None], budget: float) -> None:
        """Choose strides whose steps are expected to take so many seconds."""
        self.of, self._coarsened = [self._times.stride(plan, budget) for plan in plans], [False, False]

    def corrected(self, side: int, plan: RenderPlan, drawn: int, budget: float) -> bool:
        """Choose another stride if the first steps were slower or quicker than expected; the side then begins anew.

        A smaller one at 2, 4, 8 ... steps while less than a quarter of them would be lost, a larger one once. The very
        first step compiles.
        """
        now = self.of[side]
        if drawn < 2 or drawn & (drawn - 1) or 4 * drawn > now * now:
            return False
        stride = self._times.stride(plan, budget)
        if stride == now or (stride > now and self._coarsened[side]):
            return False
        self._coarsened[side] |= stride > now
        self.of[side] = stride
        return True


class InteractiveQuality:
    """Scattering and interfaces of the picture on show: those requested, or quicker ones until these can be drawn.

    Parameters
    ----------
    traced_at_once : bool
        Hierarchies of meshes are built in the frame, by no other process.

    Attributes
    ----------
    request : RenderRequest
        With the interfaces and the scattering to draw with now.
    notes : list of str
        Reasons why interfaces, and scattering, are simpler than requested; empty where they are not.
    solved : bool
        The last choice took the time to solve for diffusion.
    """

    def __init__(self, traced_at_once: bool) -> None:
        self.request = RenderRequest()
        self.notes, self.solved = ["", ""], False
        self._at_once, self._embree = traced_at_once, False
        self._lights: tuple[object, ...] = ()
        self._last: Hashable = None
        #: Bodies whose cells of the small grid are known, which take longest.
        self._cells_of: Hashable = None

    def choose(self, workspace: Workspace, scene: Scene, requested: RenderRequest, renderer: Renderer) -> None:
        """Choose scattering and interfaces to draw with now, and request what better ones need."""
        self.notes, self.solved = ["", ""], False
        plan = renderer.plan_requested(scene, requested)
        request = replace(requested, scattering=self._choose_scattering(workspace, scene, plan, renderer.gpu.diffusion))
        plan = renderer.plan_requested(scene, request)
        self._embree = plan.hits == "embree"
        if (
            self._embree
            and plan.interfaces is not None
            and max(len(item.mesh.faces) for item in scene.objects) > MOST_EMBREE
        ):
            self._embree = False
            request = replace(request, interfaces=replace(cast(TracedInterfaces, plan.interfaces), hits="gl"))
        if plan.has(PassName.TRACED) and not self.traceable(workspace, scene):
            request = replace(request, interfaces=SCREEN)
        self.request = request

    def traceable(self, workspace: Workspace, scene: Scene) -> bool:
        """True if rays can be traced through the meshes of the scene without making the window wait."""
        self.notes[0] = (
            "" if self._at_once else untraceable(scene, workspace.pool, workspace.lanes["trace"], embree=self._embree)
        )
        return not self.notes[0]

    def quick_shadows(self, scene: Scene) -> ShadowMaps | None:
        """Shadows of the environment while the picture moves: fewer if its lights move, too."""
        before, self._lights = self._lights, (scene.environment, *scene.lights)
        if not scene.environment_shadows:
            return None
        still = before in ((), self._lights) and sum(len(item.mesh.faces) for item in scene.objects) <= MANY
        return QUICK_SHADOWS if still else QUICKER_SHADOWS

    def _choose_scattering(
        self, workspace: Workspace, scene: Scene, plan: RenderPlan, cache: DiffusionCache
    ) -> Scattering | None:
        """Scattering as requested if its light is known, else a simpler one while a worker process solves for it.

        That begins when the same light is needed twice: while things move, that of every picture is another. Light on
        opaque objects in clear bodies is solved for, too; until then, it comes straight.
        """
        if not plan.solves:
            return plan.request.scattering
        at_surfaces = bool(plan.treated(Treatment.DIFFUSION))
        instead: Scattering = ScatteringLayer() if at_surfaces else SingleScattering()
        where = f"Softening light in the {workspace.document.material.preset.replace('_', ' ') or 'model'}"
        roughly = "first guess" if at_surfaces else "only light that is scattered once"
        if not plan.diffuses:
            where, roughly = "Light on objects in glass", "first guess"
        key, lane = diffusion_key(plan), workspace.lanes["diffuse"]
        moves, self._last = key != self._last, key
        if cache.has(key):
            return plan.request.scattering
        if lane.failed(key):
            self.notes[1] = f"{where} has failed: {roughly}"
            return instead
        small = _on_small_grid(scene, plan)
        bodies = None if small is None else _bodies(small)

        def solve(task: Task) -> None:
            if small is not None and self._cells_of != bodies:
                make_large_normals(task, workspace.pool, [item.mesh for item in scene.objects])  # cells need them here
                cache.solve(small)
                self._cells_of = bodies
            solve_aside(task, workspace.pool, cache, plan)

        if not moves:
            lane.request(key, "softening light" if plan.diffuses else "light in glass", solve)
        if small is not None and self._knows(small, bodies, cache):
            roughly, instead = "rough preview", SMALL
        self.notes[1] = f"{where}: {roughly}"
        return instead

    def _knows(self, small: RenderPlan, bodies: Hashable, cache: DiffusionCache) -> bool:
        """True if the light on the small grid is known, which is solved for here if that is quick."""
        if cache.has(diffusion_key(small)):
            return True
        if self._cells_of != bodies:
            return False
        begun = time.perf_counter()
        cache.solve(small)
        self.solved = True
        if time.perf_counter() - begun > LONGEST:
            self._cells_of = None
        return True


def _on_small_grid(scene: Scene, plan: RenderPlan) -> RenderPlan | None:
    """The plan on the small grid; None where that does not take all of its bodies, or is no smaller."""
    if not plan.diffuses or plan.diffusion.resolution <= SMALL.resolution:
        return None
    if any(SMALL.refusal(scene.objects[i]) is not None for i in plan.treated(Treatment.DIFFUSION, Treatment.VOLUME)):
        return None
    treatments = ((i, treatment_of(item)) for i, item in enumerate(plan.scene.objects))
    own = {i: treatment for i, treatment in treatments if treatment is not Treatment.SINGLE}
    return (
        replace(plan, diffusion=SMALL, exchanging=(), glowing=()) if choose_treatments(scene, SMALL).of == own else None
    )


def _bodies(plan: RenderPlan) -> Hashable:
    """Places of the bodies in which light is solved for, and of the objects that shadow them."""
    solved = plan.treated(Treatment.DIFFUSION, Treatment.VOLUME)
    return tuple(place_of(plan.scene.objects[i]) for i in solved), tuple(map(place_of, plan.scene.opaque))


def solve_aside(task: Task, pool: Pool, cache: DiffusionCache, plan: RenderPlan) -> None:
    """Solve for the light of the bodies of a plan in a worker process, for a cache.

    In a thread, it would share Python's lock with the window, whose frames would take twice as long.
    """
    cache.keep(plan, pool.call(task, solved_light, plan, urgency=Urgency.PICTURE))


def solved_light(plan: RenderPlan) -> Fields:
    """Light of the bodies of a plan, by the solver of this process, which keeps what it knows of bodies."""
    return _solver().of(plan)


@lru_cache(maxsize=1)
def _solver() -> FieldCache:
    from translucent.diffusion.cache import FieldCache  # with SciPy, which the window does without as long as it can

    return FieldCache(warm_starts=True)


#: Method of a path traced picture; how many paths there are is seen as it goes on.
PATHS = PathTraced(paths=2, hits="gl")

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
        self._denoised = 0  # paths of the denoised picture on show
        self._made: tuple[int, Floats] | None = None  # paths and radiance of the next one

    def step(
        self,
        scene: Scene,
        renderer: Renderer,
        viewport: Viewport,
        seconds: float,
        workspace: Workspace,
        lens: Lens | None,
    ) -> tuple[bool, bool]:
        """Follow paths of a still picture for about so many seconds; whether more are to come, and it has changed.

        Where the document asks for it, noise is taken out of them now and then, in another process. Such a picture
        stays on show until the next one.
        """
        try:
            if self._scene is not scene:
                self.stop()
                self._scene, self.plan = scene, renderer.plan(scene, PATHS)
            if self.plan is None:
                return False, False
            if self._held is None:
                self._held = Convergence(renderer.gpu, self.plan, viewport.size, lens)
                self.note = "tracing the first paths"
                return True, False
        except InputError as error:
            self.note = f"not converging: {error}"
            return False, False
        held, wanted = self._held, workspace.document.display.denoise
        if self._denoised and not wanted:
            self._denoised = 0
            viewport.take(0, held.job)
            self._count(held)
            return True, True
        fresh = self._made is not None and wanted
        if self._made is not None and wanted:
            self._denoised, radiance = self._made
            viewport.put_radiance(0, radiance)
            self._count(held)
        self._made = None
        if held.done:
            return wanted and self._denoise(held, scene, viewport, workspace), fresh
        if (stepped := held.step(seconds)) and not self._denoised:
            viewport.take(0, held.job)
        if stepped:
            self._count(held)
        if wanted:
            self._denoise(held, scene, viewport, workspace)
        return wanted or not held.done, fresh or (stepped and not self._denoised)

    def _count(self, held: Convergence) -> None:
        state = "converged" if held.done else "converging"
        self.note = f"{state}: {held.paths} paths, standard error {held.error:.2%}"
        if self._denoised:
            self.note = (
                f"{state}: denoised after {self._denoised} paths, with an unknown error; {held.paths} paths so far"
            )

    def _denoise(self, held: Convergence, scene: Scene, viewport: Viewport, workspace: Workspace) -> bool:
        """Start denoising the picture, if it is time; returns whether a picture will follow."""
        lane, paths = workspace.lanes["denoise"], held.paths
        key = scene, paths
        if lane.task is not None:
            return True
        due = paths >= max(FIRST_DENOISED, self._denoised * DENOISED_AGAIN) or (held.done and paths > self._denoised)
        if not due or lane.failed(key):
            return False
        viewport.take(0, held.job)
        radiance = viewport.radiance(0)

        def work(task: Task) -> Floats:
            return workspace.pool.call(task, denoised_radiance, radiance, scene)

        def take(found: Floats) -> None:
            if self._held is held:
                self._made = paths, found

        lane.start("denoising", work, take).key = key
        return True

    def stop(self) -> bool:
        """End the refinement; returns whether its picture was visible."""
        was = self._held is not None and self._held.paths > 0
        if self._held is not None:
            self._held.release()
        self._scene = self._held = self.plan = None
        self.note, self._denoised, self._made = "", 0, None
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
    light : PhotonPicture, optional
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
        self.light: PhotonPicture | None = None
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
                self.light = PhotonPicture(renderer.gpu, self.plan, viewport.size)
                self.note = "caustics: tracing the first photons"
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
        if not media_lit_by_photons(plan.scene) and not plan.exchanging:
            return True
        assert caustics is not None
        key, lane = diffusion_key(plan), workspace.lanes["diffuse"]
        if cache.has(key):
            self.in_media = True
            if not self.plan.has(PassName.CAUSTICS):
                self.note = f"caustics: {caustics.in_media:,} photons in media"
            return True
        if lane.failed(key):
            self.note = "no caustics: the light of photons in media could not be computed"
        elif lane.task is None:
            self.note = "caustics: tracing photons in media"
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

    def take_over(self, viewport: Viewport, stride: int, samples: int, *, through_lens: bool) -> bool:
        """Replace the visible picture by the one drawn in the background, once it is complete; returns whether it did.

        Where pictures take long, the first whole one takes over, and edges become smooth after that. When it is as good
        as it gets with these photons, more are followed; not through a lens, whose points have photons of their own.
        """
        assert self.light is not None
        drawn, whole, last = viewport.steps(self.side), stride * stride, stride * stride * (1 + samples)
        if over := self.side == 1 and drawn == (whole if stride > 1 else last):
            viewport.swap()
            self.side, self._on_show = 0, True
            self._in_picture = MOST_PHOTONS if through_lens else self._in_texture
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
        count = f"{self._in_picture:,} photons in the picture{noise}" if self._in_picture else "not in the picture yet"
        self.note = f"caustics: {count}" if self.done else f"caustics: {count}; {self.light.photons:,} so far"

    def stop(self, viewport: Viewport) -> bool:
        """End the refinement; returns whether its picture was visible."""
        was = self._on_show
        if self.light is not None:
            self.light.release()
            viewport.restart(1)
        self._reset()
        return was
