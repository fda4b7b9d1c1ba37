"""Places of interfaces: bodies that have any, that hold the eye, that a picture cuts, or that touch."""

from __future__ import annotations

import numpy as np

from translucent.planning.bodies import indices
from translucent.planning.slots import overlapping_pair
from translucent.scene.scene import Object, Scene


def with_interfaces(scene: Scene) -> tuple[int, ...]:
    """Indices of the objects whose interfaces change light."""
    return indices(scene, lambda item: item.has_interface)


def starts_inside(scene: Scene, body: Object) -> bool:
    """True if rays of the camera may start inside a body."""
    if scene.camera.fov_y is None:
        return picture_cuts(scene, body)
    low, high = body.bounds - scene.camera.eye
    around = bool((low <= 0).all() and (high >= 0).all())
    # On a surface the winding number is the mean of both sides.
    return around and round(abs(body.winding_number(scene.camera.eye)), 6) >= 0.5


def picture_cuts(scene: Scene, body: Object) -> bool:
    """True if an orthographic picture's plane, where its rays start, cuts the bounds of a body."""
    if scene.camera.fov_y is not None:
        return False
    low, high = body.bounds - scene.camera.eye
    forward = scene.camera.forward
    return bool(np.where(forward > 0, low, high) @ forward < 0 < np.where(forward > 0, high, low) @ forward)


def touching_interfaces(scene: Scene) -> str | None:
    """Reason why touching bodies with interfaces need ordered surfaces; None if none may touch."""
    solids = [body for body in scene.bodies if body.sheet_thickness is None]
    bends = np.array([body.has_interface for body in solids])
    if not bends.any() or (found := overlapping_pair(solids, lambda one, other: bends[one] | bends[other])) is None:
        return None
    earlier, later = (solids[index] for index in found)
    names = f"{earlier.mesh.name!r} and {later.mesh.name!r}"
    return f"interfaces of {names} may touch: the order tells where a ray leaves both"
