"""Choice of the way in which a scene's interfaces are found: as asked for, or by the planner."""

from __future__ import annotations

from dataclasses import replace

from translucent.arguments import brief
from translucent.errors import InputError
from translucent.planning.interfaces import FrontInterface, Interfaces, ScreenInterfaces, TracedInterfaces
from translucent.planning.interfaces.places import with_interfaces
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.scene.scene import Scene

#: Names that configurations had, and what to write instead.
_OLD_NAMES = {"both": ScreenInterfaces(), "front": FrontInterface()}

#: Interfaces that rays may meet if nobody asks for a number: wine in a glass needs them, and few rays go as far.
USUAL_DEPTH = 12


def _default_interfaces(*, solid: bool) -> Interfaces:
    """The way that the planner takes, if nobody asks for one: sheets, which bend no ray, need no tracing."""
    return TracedInterfaces(depth=USUAL_DEPTH) if solid else ScreenInterfaces()


def check_interfaces(interfaces: object) -> None:
    """Raise `InputError` for what is no choice of interfaces."""
    if interfaces is None or isinstance(interfaces, Interfaces):
        return
    known = [f"tl.{one}" for one in (TracedInterfaces(), ScreenInterfaces(), FrontInterface())]
    old = _OLD_NAMES.get(interfaces) if isinstance(interfaces, str) else None
    do = f"give {', '.join(known[:-1])} or {known[-1]}" if old is None else f"write interfaces=tl.{old}"
    raise InputError(f"interfaces {brief(interfaces)}", "not a choice of interfaces", do)


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


def with_fallback_told(chosen: RenderPlan, why: str) -> RenderPlan:
    """The plan, with the reason why its interfaces are drawn in screen space rather than as the planner prefers."""
    passes = tuple(
        replace(step, reason=f"{step.reason}; in screen space, since {why}") if step.name is PassName.SURFACES else step
        for step in chosen.passes
    )
    return replace(chosen, passes=passes)
