"""Textures of the light that diffuses in bodies, made anew only where the light, a medium or a mesh changes."""

from __future__ import annotations

from collections.abc import Hashable

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.diffusion.cache import FieldCache
from translucent.diffusion.field import DiffusionField
from translucent.planning.scattering import Diffusion
from translucent.scene.scene import Scene


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
    """Textures of the diffused light of the last scene."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._fields = FieldCache()
        self._last: DiffusedLight | None = None

    def of(self, scene: Scene, diffusion: Diffusion) -> DiffusedLight | None:
        """Diffused light of a scene whose media are marked, None where there is none."""
        if not (fields := self._fields.of(scene, diffusion)):
            return None
        if self._last is None or self._last.fields is not fields:
            self._release_last()
            self._last = DiffusedLight(self._gl, fields)
        return self._last

    def has(self, key: Hashable) -> bool:
        """Whether the light of this `diffusion_key` is known."""
        return self._fields.has(key)

    def solve(self, scene: Scene, diffusion: Diffusion) -> None:
        """Find the light of a scene whose media are marked, to be drawn later. Needs no context: a thread may do it."""
        self._fields.of(scene, diffusion)

    def release(self) -> None:
        """Free the texture."""
        self._release_last()
        self._fields.clear()

    def _release_last(self) -> None:
        if self._last is not None:
            self._last.texture.release()
            self._last = None
