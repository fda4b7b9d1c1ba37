"""Choice of the way in which a scene's interfaces are found: as asked for, or by the planner."""

from __future__ import annotations

from translucent.errors import InputError
from translucent.planning.interfaces import Interfaces, ScreenInterfaces, TracedInterfaces
from translucent.planning.interfaces.places import with_interfaces
from translucent.scene.scene import Scene

#: Interfaces that rays may meet if nobody asks for a number: wine in a glass needs them, and few rays go as far.
USUAL_DEPTH = 12


def _default_interfaces(*, solid: bool) -> Interfaces:
    """The way that the planner takes, if nobody asks for one: sheets, which bend no ray, need no tracing."""
    return TracedInterfaces(depth=USUAL_DEPTH) if solid else ScreenInterfaces()


def chosen_interfaces(scene: Scene, asked: Interfaces | None, *, sheets: bool) -> tuple[Interfaces, str]:
    """The way in which interfaces are found, and why it is not the one that the planner would rather take.

    Parameters
    ----------
    scene : Scene
    asked : Interfaces, optional
    sheets : bool
        All bodies are drawn as sheets.

    Raises
    ------
    InputError
        If what is asked for cannot be done in the scene.
    """
    solid = not sheets and any(scene.objects[i].sheet_thickness is None for i in with_interfaces(scene))
    wanted = _default_interfaces(solid=solid) if asked is None else asked
    if wanted.one_interface and not solid:
        return ScreenInterfaces(), ""  # sheets have one interface, whatever is asked for
    if sheets or not with_interfaces(scene) or (refusal := wanted.refusal(scene)) is None:
        return wanted, ""
    found, do = refusal
    if asked is not None:
        raise InputError(str(asked), found, do)
    return ScreenInterfaces(), found
