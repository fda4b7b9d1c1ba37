"""Classification of the bodies of a scene for planning: solids, sheets, and those that are not closed."""

from __future__ import annotations

from collections.abc import Callable

from translucent.planning.slots import same_medium
from translucent.scene.scene import Object, Scene


def indices(scene: Scene, keep: Callable[[Object], bool]) -> tuple[int, ...]:
    """Indices of the objects that satisfy a condition."""
    return tuple(i for i, item in enumerate(scene.objects) if keep(item))


def solids_of(scene: Scene) -> tuple[int, ...]:
    """Indices of bodies that have an inside."""
    return indices(scene, lambda body: body.medium is not None and body.sheet_thickness is None)


def sheets_of(scene: Scene) -> tuple[int, ...]:
    """Indices of bodies that are declared sheets."""
    return indices(scene, lambda body: body.medium is not None and body.sheet_thickness is not None)


def open_bodies(scene: Scene) -> tuple[int, ...]:
    """Indices of objects that are declared solid and are not closed."""
    return tuple(i for i in solids_of(scene) if not scene.objects[i].mesh.diagnosis.solid)


def media_differ(scene: Scene) -> bool:
    """True if any two bodies have different media."""
    return any(not same_medium(scene.bodies[0], body) for body in scene.bodies[1:])


def scatters(scene: Scene) -> bool:
    """True if any solid scatters, and the scene has lights."""
    media = (scene.objects[i].medium for i in solids_of(scene))
    return bool(scene.lights) and any(medium is not None and medium.scatters for medium in media)


def count_of(items: tuple[int, ...], one: str, many: str) -> str:
    """Count with its noun, in words."""
    return f"{len(items)} {one if len(items) == 1 else many}"
