"""Interactive quality: what is drawn more coarsely or more simply so that the window stays quick."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache as kept
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from translucent.diffusion.keys import diffusion_key, place_of
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.strides import STRIDES
from translucent.planning.caustics import Caustics
from translucent.planning.interfaces import Interfaces, ScreenInterfaces
from translucent.planning.methods import Method
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.planning.scattering.choice import GivenBack, given_back, shown
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.compiling import Tracing
from translucent.preview.scenes import scattering_of
from translucent.preview.tasks import Report, Task
from translucent.preview.worker import Pool, Urgency
from translucent.preview.workspace import Workspace
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.diffusion.cache import FieldCache, Fields


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
class StepTiming:
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


class StepTimes:
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

    def __init__(self, pace: StepTimes) -> None:
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


#: Grid on which light is solved for in the frame while things move: in the bear, other lights take 25 ms of processor
#: time and another medium 45 ms, a sixth of what they take on the usual one. Pixels of milk, jade and wax in bear and
#: candle are 0.5 to 5.6 of 255 off those of the usual one, those of layers 1.2 to 19.
SMALL = Diffusion(12)

#: Seconds of a frame that it may take. Where it took longer, it waits until the scene rests.
LONGEST = 0.03

UNTIL = "light that is scattered many times {}, until its diffusion is solved for"
NEVER = "light that is scattered many times {}, since it could not be solved for"


@dataclass(frozen=True)
class _Solving:
    """Search for the light of a `diffusion_key`."""

    key: Hashable
    task: Task

    @property
    def failed(self) -> bool:
        """True if it ended without any, or nobody wants to wait for it."""
        return self.task.cancelled or self.task.error is not None


class Diffusing:
    """Search for the light that diffuses in the scene on show, one scene at a time.

    Attributes
    ----------
    told : str
        How such light is shown while it is not known, or nothing.
    solved : bool
        It has just been solved for on the small grid, in the frame.
    """

    def __init__(self) -> None:
        self.told, self.solved = "", False
        self._solving: _Solving | None = None
        self._insoluble: Hashable = None
        self._last: Hashable = None
        #: Bodies whose cells of the small grid are known, which take longest.
        self._cut: Hashable = None

    def scattering(
        self, workspace: Workspace, scene: Scene, asked: Scattering | None, back: GivenBack, cache: DiffusionCache
    ) -> Scattering | None:
        """Scattering to draw with: that asked for if its light is known, else a simpler one, while the search goes on.

        The search begins when the light is asked for again: while things move, that of every picture is another.

        Parameters
        ----------
        workspace : Workspace
            Whose lane and processes search.
        scene : Scene
        asked : Scattering or None
        back : GivenBack
            What the planner makes of that.
        cache : DiffusionCache
            Light that is known.
        """
        self.told, self.solved = "", False
        if not back.solved:
            return asked
        instead: Scattering = ScatteringLayer() if back.diffused else SingleScattering()
        simply = "as of flat layers" if back.diffused else "once alone"
        marked, diffusion = shown(scene, back).with_ambient_emitted, back.diffusion
        key = diffusion_key(marked, diffusion)
        moves, self._last = key != self._last, key
        if cache.has(key):
            return asked
        if self._solving is not None and self._solving.failed:
            self._insoluble, self._solving = self._solving.key, None
        if key == self._insoluble:
            self.told = NEVER.format(simply)
            return instead
        small = self._smaller(scene, asked, back)
        if (lane := workspace.lanes["diffuse"]).task is None and not moves:
            solve = partial(self._solve, workspace.pool, scene, small, back, cache)
            task = lane.start("diffusing light", solve, lambda _: None)
            self._solving = _Solving(key, task)
        if small is not None and self._known(scene, small, cache):
            simply, instead = f"on a small grid, {SMALL} for {diffusion}", SMALL
        self.told = UNTIL.format(simply)
        return instead

    def _smaller(self, scene: Scene, asked: Scattering | None, back: GivenBack) -> GivenBack | None:
        """The same bodies on the small grid; None where that does not take all of them, or is no smaller."""
        small = replace(back, diffusion=SMALL)
        if back.diffusion.resolution <= SMALL.resolution:
            return None
        if any(SMALL.refusal(scene.objects[i]) is not None for i in (*back.diffused, *back.volumes)):
            return None
        wanted = given_back(scene, SMALL, layers=True)
        return small if wanted == small else None

    def _known(self, scene: Scene, small: GivenBack, cache: DiffusionCache) -> bool:
        """True if the light on the small grid is known, which is solved for here if that is quick."""
        marked = shown(scene, small).with_ambient_emitted
        if cache.has(diffusion_key(marked, SMALL)):
            return True
        if self._cut != _bodies(scene, small):
            return False
        begun = time.perf_counter()
        cache.solve(marked, SMALL)
        self.solved = True
        if time.perf_counter() - begun > LONGEST:
            self._cut = None
        return True

    def _solve(
        self, pool: Pool, scene: Scene, small: GivenBack | None, back: GivenBack, cache: DiffusionCache, task: Task
    ) -> None:
        """Solve for light: on the small grid here if that is new to the bodies, on the one asked for in a process."""
        if small is not None and self._cut != (bodies := _bodies(scene, small)):
            cache.solve(shown(scene, small).with_ambient_emitted, SMALL)
            self._cut = bodies
        solve_aside(task, pool, cache, shown(scene, back).with_ambient_emitted, back.diffusion)


def solve_aside(
    task: Task, pool: Pool, cache: DiffusionCache, scene: Scene, diffusion: Diffusion, caustics: Caustics | None = None
) -> None:
    """Find the light of a scene whose media are marked in a worker process, for a cache.

    In a thread, it would share Python's lock with the window, whose frames would take twice as long.
    """
    found = pool.call(task, solved_light, scene, diffusion, caustics, urgency=Urgency.PICTURE)
    cache.keep(scene, diffusion, caustics, found)


def solved_light(report: Report, scene: Scene, diffusion: Diffusion, caustics: Caustics | None) -> Fields:
    """Light of a scene whose media are marked, by the solver of this process, which keeps what it knows of bodies."""
    report(None, "")
    return _solver().of(scene, diffusion, caustics)


@kept
def _solver() -> FieldCache:
    from translucent.diffusion.cache import FieldCache  # with SciPy, which the window does without as long as it can

    return FieldCache(warm_starts=True)


def _bodies(scene: Scene, back: GivenBack) -> Hashable:
    """Places of the bodies in which light is solved for, and of what shadows them."""
    return tuple(place_of(scene.objects[i]) for i in (*back.diffused, *back.volumes)), tuple(
        place_of(item) for item in scene.opaque
    )


#: Interfaces of a picture in which rays cannot be traced, or would take too long.
SCREEN = ScreenInterfaces()

#: Triangles of which a picture takes long to draw, and a map of shadows, too.
MANY = 1_000_000

#: Shadows of a picture that moves: those of a few directions of the environment; and of fewer for many triangles, and
#: while lights move, which takes new maps for every picture. Pictures of two would be further off than without any.
QUICK_SHADOWS, QUICKER_SHADOWS = ShadowMaps(directions=8), ShadowMaps(directions=4)


class InteractiveQuality:
    """Ways of showing the scene on show.

    Parameters
    ----------
    traced_at_once : bool
        Nobody else makes what rays need.

    Attributes
    ----------
    scattering : Scattering, optional
    interfaces : Interfaces, optional
        None, as the planner picks.
    """

    def __init__(self, traced_at_once: bool) -> None:
        self.scattering: Scattering | None = None
        self.interfaces: Interfaces | None = None
        self._lit: tuple[object, ...] = ()
        self._at_once = traced_at_once
        self._diffusing, self._tracing = Diffusing(), Tracing()

    @property
    def told(self) -> tuple[str, str]:
        """Remarks on what is shown more simply until something is known; empty if it is."""
        return self._tracing.told, self._diffusing.told

    @property
    def solved(self) -> bool:
        """True if the last choice took the time to solve for light."""
        return self._diffusing.solved

    def choose(self, workspace: Workspace, scene: Scene, method: Method | None, renderer: Renderer) -> None:
        """Choose the ways in which to draw now, and request what better ones need."""
        asked = scattering_of(workspace.document.display.scattering)
        back = renderer.plan(scene, method, scattering=asked).given_back
        self.scattering = self._diffusing.scattering(workspace, scene, asked, back, renderer.gpu.diffusion)
        self._tracing.told = ""
        traced = renderer.plan(scene, method, scattering=self.scattering).has(PassName.TRACED)
        self.interfaces = None if not traced or self.traceable(workspace, scene) else SCREEN

    def traceable(self, workspace: Workspace, scene: Scene) -> bool:
        """True if rays can be traced through the meshes of the scene without making the window wait."""
        return self._at_once or self._tracing.ready(scene, workspace.pool, workspace.lanes["trace"])

    def quick_shadows(self, scene: Scene) -> ShadowMaps | None:
        """Shadows of a picture that moves, for which those of the pictures before tell whether its lights do."""
        lit, self._lit = self._lit, (scene.environment, *scene.lights)
        if not scene.environment_shadows:
            return None
        still = lit in ((), self._lit) and sum(len(item.mesh.faces) for item in scene.objects) <= MANY
        return QUICK_SHADOWS if still else QUICKER_SHADOWS
