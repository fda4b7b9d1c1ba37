"""Need for ordered surfaces: scenes in which a sum over each ray does not determine the picture."""

from __future__ import annotations

from translucent.planning.bodies import media_differ
from translucent.planning.interfaces import Interfaces
from translucent.planning.interfaces.places import touching_interfaces
from translucent.planning.methods import Method
from translucent.planning.slots import MAX_SLOTS, medium_slots, overlapping_pair
from translucent.scene.scene import Scene


def why_order_matters(scene: Scene, method: Method | None, interfaces: Interfaces) -> str | None:
    """Reason why this scene needs ordered surfaces rather than a sum over each ray; None if a sum suffices."""
    bodies = scene.bodies
    if media_differ(scene) and any(body.medium is not None and body.medium.emits for body in bodies):
        return "emission among several media: what is in front dims what is behind"
    if method is None and interfaces.finds_exits and (touching := touching_interfaces(scene)) is not None:
        return touching
    if method is None and (why := _inside_out(scene)) is not None:
        return why
    if scene.overlap == "add":
        return None
    # Sheets have no inside to overlap, and pixels that enter more than once may be marked.
    if method is not None and (method.makes_sheets or method.convex_only):
        return None
    solids = [body for body in bodies if body.sheet_thickness is None]
    if (found := overlapping_pair(solids)) is not None:
        earlier, later = (solids[index] for index in found)
        return (
            f'overlap="{scene.overlap}": {earlier.mesh.name!r} and {later.mesh.name!r} may overlap, and a sum '
            "would count both"
        )
    for body in solids:
        if not body.mesh.diagnosis.convex:
            return f'overlap="{scene.overlap}": {body.mesh.name!r} may overlap itself, and a sum would count it twice'
    return None


def _inside_out(scene: Scene) -> str | None:
    """Reason that a body is inside out in places, so that a sum cannot tell its pixels apart; None where intervals
    cannot.
    """
    broken = [body for body in scene.bodies if body.sheet_thickness is None and body.mesh.diagnosis.inside_out]
    if not broken or len(medium_slots(scene)) > MAX_SLOTS:
        return None
    return f"{broken[0].mesh.name!r} is inside out in places, and a sum does not tell which pixels show one"
