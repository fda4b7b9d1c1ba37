"""Bodies that touch: which of two has the space that both claim, as a drink and its glass do."""

from __future__ import annotations

import dataclasses
from graphlib import CycleError, TopologicalSorter
from pathlib import PurePath
from typing import TypeVar

import numpy as np

from translucent.arrays import Array
from translucent.scene.scene import Object, Scene

AnyScene = TypeVar("AnyScene", bound=Scene)

#: Vertices of a body that are looked at to see whether it is in another one, and the part of them that must be.
SAMPLES, MOSTLY = 48, 0.5

#: Winding numbers from which on a vertex touches a body, and is inside it; on a surface it is about a half.
TOUCHING, INSIDE = 0.25, 0.75


def with_priorities(scene: AnyScene) -> tuple[AnyScene, tuple[str, ...]]:
    """Scene whose bodies have priorities where they may claim the same space, and a sentence for each choice.

    A body that is mostly in another displaces it, as ice does a drink; else the one of the higher index of refraction,
    as a glass does wine; else the one that comes first. Nested dielectrics need such an order (Schmidt and Budge 2002).
    A scene with an overlap or priorities of its own, or without two such bodies, stays as it is.
    """
    if scene.overlap != "add" or any(body.priority for body in scene.bodies):
        return scene, ()
    solids = [i for i, item in enumerate(scene.objects) if item.medium is not None and item.sheet_thickness is None]
    above: dict[int, set[int]] = {i: set() for i in solids}
    said: dict[str, None] = {}
    overlapping = False
    for i, j in _overlapping_boxes(scene, solids):
        one, other = scene.objects[i], scene.objects[j]
        if _alike(one, other):
            continue
        overlapping = True
        of_one, of_other = _winding_numbers(one, other), _winding_numbers(other, one)
        if max(of_one.max(), of_other.max()) < TOUCHING:
            continue
        first, second = (i, j) if _displaces(one, other, of_one, of_other) else (j, i)
        above[second].add(first)
        said[f"{_name(scene.objects[first])} displaces {_name(scene.objects[second])}"] = None
    if not overlapping:
        return scene, ()
    try:
        order = list(TopologicalSorter(above).static_order())
    except CycleError:
        order = solids
    objects = list(scene.objects)
    for priority, i in enumerate(reversed(order)):
        objects[i] = dataclasses.replace(objects[i], priority=priority)
    made = dataclasses.replace(scene, objects=objects, overlap="priority")
    remark = f"where bodies overlap, {', '.join(said)}; to change this, write priorities in a .toml scene"
    return made, ((remark,) if said else ())


def _alike(one: Object, other: Object) -> bool:
    if one.medium is None or other.medium is None:
        return False
    return one.medium.ior == other.medium.ior and np.array_equal(one.medium.extinction, other.medium.extinction)


def _name(item: Object) -> str:
    return PurePath(item.mesh.name).stem


def _overlapping_boxes(scene: Scene, solids: list[int]) -> list[tuple[int, int]]:
    """Pairs of these objects whose boxes overlap."""
    if len(solids) < 2:
        return []
    low, high = np.stack([scene.objects[i].bounds for i in solids]).transpose(1, 0, 2)
    below = (low[:, None] < high[None]).all(axis=2)
    pairs = np.argwhere(np.triu(below & below.T, 1)).tolist()
    return [(solids[first], solids[second]) for first, second in pairs]


def _displaces(one: Object, other: Object, of_one: Array, of_other: Array) -> bool:
    inside = [float(np.mean(numbers > INSIDE)) > MOSTLY for numbers in (of_one, of_other)]
    if inside[0] != inside[1]:
        return inside[0]
    first, second = (1.0 if item.medium is None else item.medium.ior for item in (one, other))
    return first >= second


def _winding_numbers(one: Object, other: Object) -> Array:
    """(n,): winding numbers of another body around some vertices of one."""
    vertices = one.mesh.vertices
    chosen = vertices[np.linspace(0, len(vertices) - 1, min(SAMPLES, len(vertices))).astype(int)]
    points = chosen @ one.matrix[:3, :3].T + one.matrix[:3, 3]
    return np.array([other.winding_number(point) for point in points])
