"""Textures of the light that diffuses in bodies, made anew only where the light, a medium or a mesh changes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.diffusion.field import DiffusionField, LitBody, diffusion_field, lit_body
from translucent.media.given_back import DiffusedMedium
from translucent.planning.scattering import Diffusion
from translucent.scene.scene import Object, Scene

#: Geometries of bodies, and lit scenes, that are kept.
KEPT_BODIES, KEPT_SCENES = 16, 4


class DiffusedLight:
    """Diffused light of the bodies of a scene.

    Attributes
    ----------
    texture : moderngl.Texture3D
        See ``shaders/shade/diffused_light.glsl``.
    fields : dict of int to DiffusionField
        By the number of the object.
    first_layers : dict of int to int
        Of each in the texture.
    """

    def __init__(self, gl: moderngl.Context, fields: dict[int, DiffusionField]) -> None:
        self.fields = fields
        self.first_layers: dict[int, int] = {}
        width, height = (max(field.fluence.shape[axis] for field in fields.values()) for axis in (0, 1))
        layers = sum(2 * field.fluence.shape[2] for field in fields.values())
        texels = np.zeros((layers, height, width, 4), np.float32)
        first = 0
        for number, field in fields.items():
            self.first_layers[number] = first
            for values in (field.fluence, field.entering):
                across, up, deep = values.shape[:3]
                texels[first : first + deep, :up, :across, :3] = values.transpose(2, 1, 0, 3)
                first += deep
        self.texture = gl.texture3d((width, height, layers), 4, texels, dtype="f4")
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False

    def rows(self, center: Array) -> dict[int, dict[str, npt.ArrayLike]]:
        """Fields of a `SURFACE_ROW` of each object, for positions that count from `center`."""
        return {
            number: {
                "diffuses": 1.0,
                "grid_low": field.low - center,
                "cells_per_metre": 1.0 / field.step,
                "grid_size": field.fluence.shape[:3],
                "first_layer": self.first_layers[number],
                "albedo": field.albedo,
                "conductance": field.conductance,
                "emergent_fluxes": field.fluxes,
                "exit_share": field.exit_share,
                "mean_cosine": field.mean_cosine,
            }
            for number, field in self.fields.items()
        }


class DiffusionCache:
    """Diffused light of the last scenes."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._lock = Lock()  # of the bodies
        self._bodies: OrderedDict[Hashable, LitBody] = OrderedDict()
        self._scenes: OrderedDict[Hashable, DiffusedLight] = OrderedDict()

    def of(self, scene: Scene, diffusion: Diffusion) -> DiffusedLight | None:
        """Diffused light of a scene whose media are marked, None where there is none."""
        if not _diffused(scene):
            return None
        if (key := diffusion_key(scene, diffusion)) not in self._scenes:
            self.keep(key, self.solved(scene, diffusion))
        self._scenes.move_to_end(key)
        return self._scenes[key]

    def has(self, key: Hashable) -> bool:
        """Whether the light of this `diffusion_key` is there."""
        return key in self._scenes

    def solved(self, scene: Scene, diffusion: Diffusion) -> dict[int, DiffusionField]:
        """Light in the bodies of a scene whose media are marked. Needs no context: a thread may wait for it."""
        opaque = tuple(scene.opaque)
        fields = {}
        with self._lock:
            for i, medium in _diffused(scene).items():
                body = scene.objects[i]
                lit = self._lit(body, opaque, diffusion.cell_size(body))
                fields[i] = diffusion_field(lit, medium.original, _roughness(body), scene)
        return fields

    def keep(self, key: Hashable, fields: dict[int, DiffusionField]) -> None:
        """Keep what `solved` found, as a texture."""
        if key in self._scenes:
            return
        self._scenes[key] = DiffusedLight(self._gl, fields)
        if len(self._scenes) > KEPT_SCENES:
            self._scenes.popitem(last=False)[1].texture.release()

    def _lit(self, body: Object, opaque: tuple[Object, ...], step: float) -> LitBody:
        key = (_place(body), tuple(_place(item) for item in opaque), step)
        if key not in self._bodies:
            self._bodies[key] = lit_body(body, opaque, step)
            if len(self._bodies) > KEPT_BODIES:
                self._bodies.popitem(last=False)
        self._bodies.move_to_end(key)
        return self._bodies[key]

    def release(self) -> None:
        """Free all textures."""
        for light in self._scenes.values():
            light.texture.release()
        self._scenes.clear()
        with self._lock:
            self._bodies.clear()


def diffusion_key(scene: Scene, diffusion: Diffusion) -> Hashable:
    """Everything that the diffused light of a scene depends on; the camera is no part of it."""
    bodies = tuple(
        (_place(body := scene.objects[i]), m.original, _roughness(body)) for i, m in _diffused(scene).items()
    )
    opaque = tuple(_place(item) for item in scene.opaque)
    return (diffusion, bodies, opaque, scene.environment, tuple(scene.lights))


def _diffused(scene: Scene) -> dict[int, DiffusedMedium]:
    return {i: body.medium for i, body in enumerate(scene.objects) if isinstance(body.medium, DiffusedMedium)}


def _place(item: Object) -> tuple[object, bytes]:
    return item.mesh, item.matrix.tobytes()


def _roughness(item: Object) -> float:
    return 0.0 if item.surface is None else item.surface.roughness
