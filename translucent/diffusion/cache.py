"""Diffused light of the last scenes, made anew only where the light, a medium or a mesh changes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import astuple
from threading import Lock
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.diffusion.entering import opaque_surfaces
from translucent.diffusion.field import DiffusingBody, DiffusionField, LitBody, lit_body
from translucent.geometry.embree import EmbreeMesh
from translucent.media.given_back import DiffusedMedium
from translucent.media.medium import Medium
from translucent.planning.scattering import Diffusion
from translucent.scene.scene import Object, Scene

#: Bodies, and lit scenes, that are kept.
KEPT_BODIES, KEPT_SCENES = 16, 4

_T = TypeVar("_T")


class FieldCache:
    """Diffused light of scenes whose media are marked (`DiffusedMedium`). Threads may share it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._opaque: OrderedDict[Hashable, EmbreeMesh | None] = OrderedDict()
        self._bodies: OrderedDict[Hashable, LitBody] = OrderedDict()
        self._diffusing: OrderedDict[Hashable, DiffusingBody] = OrderedDict()
        self._scenes: OrderedDict[Hashable, dict[int, DiffusionField]] = OrderedDict()

    def of(self, scene: Scene, diffusion: Diffusion) -> dict[int, DiffusionField]:
        """Light of each such body by its number; the same object until something changes it."""
        if not (media := _diffused(scene)):
            return {}

        def make() -> dict[int, DiffusionField]:
            places = tuple(_place(item) for item in scene.opaque)
            opaque = _kept(self._opaque, places, lambda: opaque_surfaces(scene.opaque), 1)
            return {
                i: self._body(scene.objects[i], medium.original, places, opaque, diffusion).field(scene)
                for i, medium in media.items()
            }

        with self._lock:
            return _kept(self._scenes, diffusion_key(scene, diffusion), make, KEPT_SCENES)

    def has(self, key: Hashable) -> bool:
        """Whether the light of this `diffusion_key` is known."""
        return key in self._scenes

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            for store in (self._opaque, self._bodies, self._diffusing, self._scenes):
                store.clear()

    def _body(
        self, body: Object, medium: Medium, places: Hashable, opaque: EmbreeMesh | None, diffusion: Diffusion
    ) -> DiffusingBody:
        step, roughness = diffusion.cell_size(body), _roughness(body)
        place = _place(body), places, step
        lit = _kept(self._bodies, place, lambda: lit_body(body, opaque, step), KEPT_BODIES)
        key = (place, medium, roughness)
        return _kept(self._diffusing, key, lambda: DiffusingBody(lit, medium, roughness), KEPT_BODIES)


def diffusion_key(scene: Scene, diffusion: Diffusion) -> Hashable:
    """Everything that the diffused light of a scene depends on; the camera is no part of it."""
    bodies = tuple(
        (i, _place(body := scene.objects[i]), medium.original, _roughness(body))
        for i, medium in _diffused(scene).items()
    )
    opaque = tuple(_place(item) for item in scene.opaque)
    around = scene.environment  # what is seen behind everything lights nothing
    lighting = (
        around.kind,
        around.first.tobytes(),
        around.second.tobytes(),
        around.map,
        around.rotation,
        around.exposure,
    )
    lights = tuple((type(light), *map(_bytes, astuple(light))) for light in scene.lights)
    return (diffusion, bodies, opaque, lighting, lights)


def _bytes(value: npt.ArrayLike) -> bytes:
    return np.asarray(value, np.float64).tobytes()


def _diffused(scene: Scene) -> dict[int, DiffusedMedium]:
    return {i: body.medium for i, body in enumerate(scene.objects) if isinstance(body.medium, DiffusedMedium)}


def _kept(store: OrderedDict[Hashable, _T], key: Hashable, make: Callable[[], _T], most: int) -> _T:
    """Entry of a store, made if it is missing; beyond `most`, that which was used longest ago is dropped."""
    if key not in store:
        store[key] = make()
        if len(store) > most:
            store.popitem(last=False)
    store.move_to_end(key)
    return store[key]


def _place(item: Object) -> tuple[object, bytes]:
    return item.mesh, item.matrix.tobytes()


def _roughness(item: Object) -> float:
    return 0.0 if item.surface is None else item.surface.roughness
