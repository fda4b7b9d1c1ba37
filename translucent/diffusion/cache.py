"""Light that is scattered many times in the last scenes, made anew only where the light, a medium or a mesh changes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import astuple, dataclass
from threading import Lock
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.diffusion.entering import opaque_surfaces
from translucent.diffusion.field import DiffusingBody, DiffusionField, LitBody, lit_body
from translucent.diffusion.volume import DiffusingVolume, VolumeField, VolumeGrid
from translucent.geometry.embree import EmbreeMesh
from translucent.media.given_back import DiffusedMedium, DiffusedVolume
from translucent.media.medium import Medium
from translucent.planning.scattering import Diffusion
from translucent.scene.scene import Object, Scene

#: Bodies, and lit scenes, that are kept.
KEPT_BODIES, KEPT_SCENES = 16, 4

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Fields:
    """Light of the bodies of a scene, by the number of the object.

    Attributes
    ----------
    surfaces : dict of int to DiffusionField
    volumes : dict of int to VolumeField
    """

    surfaces: dict[int, DiffusionField]
    volumes: dict[int, VolumeField]

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.surfaces or self.volumes)


NO_FIELDS = Fields({}, {})


class FieldCache:
    """Light of scenes whose media are marked (`DiffusedMedium`, `DiffusedVolume`). Threads may share it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._opaque: OrderedDict[Hashable, EmbreeMesh | None] = OrderedDict()
        self._bodies: OrderedDict[Hashable, LitBody] = OrderedDict()
        self._diffusing: OrderedDict[Hashable, DiffusingBody] = OrderedDict()
        self._grids: OrderedDict[Hashable, VolumeGrid] = OrderedDict()
        self._volumes: OrderedDict[Hashable, DiffusingVolume] = OrderedDict()
        self._scenes: OrderedDict[Hashable, Fields] = OrderedDict()

    def of(self, scene: Scene, diffusion: Diffusion) -> Fields:
        """Light of each such body by its number; the same object until something changes it."""
        if not _marked(scene):
            return NO_FIELDS

        def make() -> Fields:
            places = tuple(_place(item) for item in scene.opaque)
            opaque = _kept(self._opaque, places, lambda: opaque_surfaces(scene.opaque), 1)
            surfaces, volumes = {}, {}
            for i, body in enumerate(scene.objects):
                if isinstance(body.medium, DiffusedMedium):
                    medium = body.medium.original
                    surfaces[i] = self._body(body, medium, places, opaque, diffusion).field(scene, i)
                elif isinstance(body.medium, DiffusedVolume):
                    volumes[i] = self._volume(body, body.medium, diffusion).field(scene)
            return Fields(surfaces, volumes)

        with self._lock:
            return _kept(self._scenes, diffusion_key(scene, diffusion), make, KEPT_SCENES)

    def has(self, key: Hashable) -> bool:
        """Whether the light of this `diffusion_key` is known."""
        return key in self._scenes

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            for store in (
                self._opaque,
                self._bodies,
                self._diffusing,
                self._grids,
                self._volumes,
                self._scenes,
            ):
                store.clear()

    def _body(
        self, body: Object, medium: Medium, places: Hashable, opaque: EmbreeMesh | None, diffusion: Diffusion
    ) -> DiffusingBody:
        step, roughness = diffusion.cell_size(body), _roughness(body)
        place = _place(body), body.density, places, step
        lit = _kept(self._bodies, place, lambda: lit_body(body, opaque, step), KEPT_BODIES)
        key = (place, medium, roughness)
        return _kept(self._diffusing, key, lambda: DiffusingBody(lit, medium, roughness), KEPT_BODIES)

    def _volume(self, body: Object, medium: Medium, diffusion: Diffusion) -> DiffusingVolume:
        step = diffusion.cell_size(body)
        place = _place(body), body.density, step
        grid = _kept(self._grids, place, lambda: VolumeGrid(body, step), KEPT_BODIES)
        key = (place, _coefficients(medium))
        return _kept(self._volumes, key, lambda: DiffusingVolume(grid, medium), KEPT_BODIES)


def diffusion_key(scene: Scene, diffusion: Diffusion) -> Hashable:
    """Everything that the diffused light of a scene depends on; the camera is no part of it."""
    bodies = tuple(
        (
            i,
            type(scene.objects[i].medium),
            _place(body := scene.objects[i]),
            body.density,
            _coefficients(medium),
            _roughness(body),
        )
        for i, medium in _marked(scene).items()
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
    dimming = tuple(
        (i, _place(item), np.asarray(item.medium.extinction).tobytes())
        for i, item in enumerate(scene.objects if lights else ())
        if item.medium is not None
    )
    return (diffusion, bodies, opaque, lighting, lights, dimming)


def _bytes(value: npt.ArrayLike) -> bytes:
    return np.asarray(value, np.float64).tobytes()


def _marked(scene: Scene) -> dict[int, Medium]:
    return {
        i: body.medium.original if isinstance(body.medium, DiffusedMedium) else body.medium
        for i, body in enumerate(scene.objects)
        if isinstance(body.medium, DiffusedMedium | DiffusedVolume)
    }


def _coefficients(medium: Medium) -> Hashable:
    return tuple(map(_bytes, astuple(medium)))


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
