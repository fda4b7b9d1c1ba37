"""Environments on the GPU: as they are, and filtered for rough surfaces; uploaded once for each map."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from translucent.gpu.compile_budget import before_making
from translucent.scene.environment import Environment, filtered
from translucent.scene.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class LightMaps:
    """Filtered maps of an environment's light.

    Attributes
    ----------
    levels : moderngl.TextureArray
        For reflections of surfaces of roughness 1/n, 2/n .. 1.
    irradiance : moderngl.Texture
        By normal.
    """

    levels: moderngl.TextureArray
    irradiance: moderngl.Texture


class EnvironmentMaps:
    """Cache of textures of each environment map that has been drawn and is still alive."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._sharp: WeakKeyDictionary[EnvironmentMap, moderngl.Texture] = WeakKeyDictionary()
        self._filtered: WeakKeyDictionary[EnvironmentMap, LightMaps] = WeakKeyDictionary()

    def sharp(self, environment: Environment) -> moderngl.Texture:
        """Texture of the unfiltered environment."""
        source = environment.light_map
        if (texture := self._sharp.get(source)) is None:
            before_making(self._gl)
            texture = self._sharp[source] = self._texture(source.pixels)
        return texture

    def light(self, environment: Environment) -> LightMaps:
        """Maps for rough reflection and irradiance; filtered on first use."""
        source = environment.light_map
        if (maps := self._filtered.get(source)) is None:
            before_making(self._gl)
            found = filtered(environment)
            count, height, width = found.levels.shape[:3]
            levels = self._gl.texture_array((width, height, count), 3, found.levels.astype(np.float32), dtype="f4")
            levels.filter = moderngl.LINEAR, moderngl.LINEAR
            levels.repeat_x, levels.repeat_y = True, False
            maps = self._filtered[source] = LightMaps(levels, self._texture(found.irradiance))
        return maps

    def _texture(self, pixels: np.ndarray) -> moderngl.Texture:
        height, width = pixels.shape[:2]
        content = np.ascontiguousarray(pixels, dtype=np.float32)
        texture = self._gl.texture((width, height), 3, content, dtype="f4", alignment=4)
        texture.filter = moderngl.LINEAR, moderngl.LINEAR
        texture.repeat_x, texture.repeat_y = True, False
        return texture

    def release(self) -> None:
        """Free all textures."""
        for texture in self._sharp.values():
            texture.release()
        for maps in self._filtered.values():
            maps.levels.release()
            maps.irradiance.release()
        self._sharp.clear()
        self._filtered.clear()
