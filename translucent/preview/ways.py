"""Ways of showing scattered light and interfaces: those asked for, or quicker ones until what they need is there."""

from __future__ import annotations

from translucent.planning.interfaces import Interfaces, ScreenInterfaces
from translucent.planning.methods import Method
from translucent.planning.passes import PassName
from translucent.planning.scattering import Scattering
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.diffusing import Diffusing
from translucent.preview.scenes import scattering_of
from translucent.preview.tracing import Tracing
from translucent.preview.workspace import Workspace
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

#: Interfaces of a picture in which rays cannot be traced, or would take too long.
SCREEN = ScreenInterfaces()

#: Triangles of which a picture takes long to draw, and a map of shadows, too.
MANY = 1_000_000

#: Shadows of a picture that moves: those of a few directions of the environment; and of fewer for many triangles, and
#: while lights move, which takes new maps for every picture. Pictures of two would be further off than without any.
QUICK_SHADOWS, QUICKER_SHADOWS = ShadowMaps(directions=8), ShadowMaps(directions=4)


class Ways:
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
