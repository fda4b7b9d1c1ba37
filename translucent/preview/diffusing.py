"""Light that is scattered many times: on a small grid while things move, and solved for in a worker process at rest."""

from __future__ import annotations

import time
from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cache as kept
from functools import partial
from typing import TYPE_CHECKING

from translucent.diffusion.keys import diffusion_key, place_of
from translucent.gpu.diffusion import DiffusionCache
from translucent.planning.caustics import Caustics
from translucent.planning.scattering import Diffusion, Scattering, ScatteringLayer, SingleScattering
from translucent.planning.scattering.choice import GivenBack, given_back, shown
from translucent.preview.tasks import Report, Task
from translucent.preview.worker import Pool, Urgency
from translucent.preview.workspace import Workspace
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from translucent.diffusion.cache import FieldCache, Fields

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

    return FieldCache()


def _bodies(scene: Scene, back: GivenBack) -> Hashable:
    """Places of the bodies in which light is solved for, and of what shadows them."""
    return tuple(place_of(scene.objects[i]) for i in (*back.diffused, *back.volumes)), tuple(
        place_of(item) for item in scene.opaque
    )
