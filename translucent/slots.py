"""What the intervals of a ray tell apart: bodies grouped into slots, one winding number for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.errors import InputError
from translucent.medium import Medium
from translucent.scene import Object, Scene

#: Winding numbers that a ray keeps apart.
MAX_SLOTS = 16


@dataclass(frozen=True, eq=False)
class Slot:
    """Bodies whose intervals need not be told apart.

    Attributes
    ----------
    objects : tuple of int
        Indices into `Scene.objects`.
    medium : Medium
    priority : int
    """

    objects: tuple[int, ...]
    medium: Medium
    priority: int


def medium_slots(scene: Scene) -> tuple[Slot, ...]:
    """The slots of a scene, of the highest priority first.

    Closed bodies of one medium share a slot: their winding numbers are never negative, so the sum of them says how
    often, and whether at all, the medium fills a place. An open body keeps a slot of its own, lest its holes cancel
    those of another, and so does one whose density varies. With ``overlap="priority"`` only bodies of equal priority
    share one.
    """
    groups: list[list[int]] = []
    for i, body in enumerate(scene.objects):
        if body.medium is None or body.sheet_thickness is not None:
            continue
        home = next((group for group in groups if _share(scene, scene.objects[group[0]], body)), None)
        if home is None:
            groups.append([i])
        else:
            home.append(i)
    groups.sort(key=lambda group: -scene.objects[group[0]].priority)
    slots = []
    for group in groups:
        first = scene.objects[group[0]]
        assert first.medium is not None
        slots.append(Slot(tuple(group), first.medium, first.priority))
    return tuple(slots)


def require_clear_priorities(scene: Scene) -> None:
    """Raise where two bodies of different media and equal priority may claim the same place."""
    bodies = [
        (i, body) for i, body in enumerate(scene.objects) if body.medium is not None and body.sheet_thickness is None
    ]
    for place, (j, later) in enumerate(bodies):
        for i, earlier in bodies[:place]:
            if later.priority != earlier.priority or _fill_alike(scene, later, earlier):
                continue
            if may_overlap(later, earlier):
                raise InputError(
                    'overlap="priority"',
                    f"objects {i} ({earlier.mesh.name!r}) and {j} ({later.mesh.name!r}) may overlap with different "
                    f"media, and both have priority {later.priority}",
                    "give the one that displaces the other a higher priority",
                )


def same_medium(a: Object, b: Object) -> bool:
    """Whether two bodies are filled alike, as far as thickness, absorption and emission go."""
    if a.medium is None or b.medium is None:
        return a.medium is b.medium
    return np.array_equal(a.medium.extinction, b.medium.extinction) and np.array_equal(
        a.medium.emission, b.medium.emission
    )


def may_overlap(a: Object, b: Object) -> bool:
    """Whether the bounds of two bodies share more than their border; bodies that touch there share no volume."""
    return bool((a.bounds[0] < b.bounds[1]).all() and (a.bounds[1] > b.bounds[0]).all())


def _share(scene: Scene, a: Object, b: Object) -> bool:
    if not (_never_negative(a) and _never_negative(b) and _fill_alike(scene, a, b)):
        return False
    return scene.overlap != "priority" or a.priority == b.priority


def _never_negative(body: Object) -> bool:
    return body.mesh.diagnosis.sound


def _fill_alike(scene: Scene, a: Object, b: Object) -> bool:
    """Whether it makes no difference which of two bodies fills a place."""
    if a.medium is None or b.medium is None or not same_medium(a, b):
        return False
    if a.density is not None or b.density is not None:
        return False
    if not scene.lights:
        return True
    same = np.array_equal(a.medium.scattering, b.medium.scattering)
    return same and a.medium.anisotropy == b.medium.anisotropy
