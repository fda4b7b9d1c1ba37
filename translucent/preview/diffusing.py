"""Light that is scattered many times, solved for in a thread while the picture shows it more simply."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from translucent.diffusion.keys import diffusion_key
from translucent.gpu.diffusion import DiffusionCache
from translucent.planning.scattering import Scattering, ScatteringLayer, SingleScattering
from translucent.planning.scattering.choice import GivenBack, shown
from translucent.preview.tasks import Lane, Task
from translucent.scene.scene import Scene

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
    """

    def __init__(self) -> None:
        self.told = ""
        self._solving: _Solving | None = None
        self._insoluble: Hashable = None

    def scattering(
        self, scene: Scene, asked: Scattering | None, back: GivenBack, cache: DiffusionCache, lane: Lane
    ) -> Scattering | None:
        """Scattering to draw with: that asked for if its light is known, else a simpler one, while the search goes on.

        Parameters
        ----------
        scene : Scene
        asked : Scattering or None
        back : GivenBack
            What the planner makes of that.
        cache : DiffusionCache
            Light that is known.
        lane : Lane
            For the search.
        """
        self.told = ""
        if not back.solved:
            return asked
        instead = ScatteringLayer() if back.diffused else SingleScattering()
        simply = "as of flat layers" if back.diffused else "once alone"
        marked, diffusion = shown(scene, back).with_ambient_emitted, back.diffusion
        if cache.has(key := diffusion_key(marked, diffusion)):
            return asked
        if self._solving is not None and self._solving.failed:
            self._insoluble, self._solving = self._solving.key, None
        if key == self._insoluble:
            self.told = NEVER.format(simply)
            return instead
        self.told = UNTIL.format(simply)
        if lane.task is None:
            task = lane.start(
                "diffusing light",
                lambda _: cache.solve(marked, diffusion),
                lambda _: None,
            )
            self._solving = _Solving(key, task)
        return instead
