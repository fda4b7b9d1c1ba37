"""Textures of surfaces and environments, uploaded once, and freed together with their images."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from translucent.errors import RenderError
from translucent.formulas.bsdf import brdf_table
from translucent.gpu.shaders import before_drawing_with, before_making, set_uniform
from translucent.scene.environment import Environment, filtered
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.surface import TEXTURE_FIELDS, Surface
from translucent.scene.texture import Texture

#: Textures that a sampler reads.
AnyTexture: TypeAlias = moderngl.Texture | moderngl.TextureArray | moderngl.Texture3D

#: Neutral texels in place of a missing texture: factors of 1, and an unperturbed normal.
_WHITE = Texture(np.ones((1, 1, 3), dtype=np.float32))
_STRAIGHT = Texture(np.full((1, 1, 3), (0.5, 0.5, 1.0), dtype=np.float32))


def unlike_powers(side: int) -> int:
    """Smallest side of a texture of data from this one on that is no power of two.

    Drivers compile other code for textures whose sides are, so that what another process has compiled for a small scene
    would be of no use to a large one.
    """
    while side & (side - 1) == 0:
        side += 1
    return side


def kind_of(texture: Texture) -> int:
    """Number of the sampler type of a texture, because drivers compile other code for each type.

    Of sides that are powers of two or 1, and of what repeats (llvmpipe's ``lp_static_texture_state``).
    """
    found = 0
    for side, wrap in zip(texture.pixels.shape[1::-1], texture.wrap, strict=True):
        found = 6 * found + 3 * (wrap == "repeat") + (2 if side == 1 else side & (side - 1) == 0)
    return found


def has_textures(surface: Surface | None) -> bool:
    """True if a surface has textures: others have programs that read none."""
    return surface is not None and any(texture is not None for texture in surface.textures)


class TextureCache:
    """Cache of each texture that has been drawn and is still alive, with mipmaps.

    Half floats hold 11 bits, more than pictures have, in half the room.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._textures: WeakKeyDictionary[Texture, moderngl.Texture] = WeakKeyDictionary()

    @cached_property
    def reflectance(self) -> moderngl.Texture:
        """`brdf_table`, which is the same for all scenes and kept as long as the context."""
        table = brdf_table()
        texture = self._gl.texture(table.shape[1::-1], 2, table, dtype="f4")
        texture.filter = moderngl.LINEAR, moderngl.LINEAR
        texture.repeat_x = texture.repeat_y = False
        return texture

    def bind(self, surface: Surface, program: moderngl.Program, first_unit: int) -> None:
        """Bind a surface's textures, if it has some, for a program that includes ``shade/surface_textures.glsl``."""
        if not has_textures(surface):
            return
        rows = []
        chosen = {
            name: getattr(surface, name) or (_STRAIGHT if name == "normal_texture" else _WHITE)
            for name in TEXTURE_FIELDS
        }
        before_drawing_with(self._gl, program, tuple((name, kind_of(texture)) for name, texture in chosen.items()))
        for unit, texture in enumerate(chosen.values(), first_unit):
            self[texture].use(unit)
            rows += [tuple(row) for row in texture.rows]
        # Compilers cut an array off behind the last element that a program uses.
        set_uniform(program, "texture_rows", rows[: program["texture_rows"].array_length])

    def bind_holes(self, surface: Surface, program: moderngl.Program, unit: int) -> None:
        """Bind the textures of a sheet's holes for a program that includes ``thickness/holes.glsl``."""
        texture = surface.color_texture or _WHITE
        self[texture].use(unit)
        set_uniform(program, "color_rows", [tuple(row) for row in texture.rows])

    def __getitem__(self, texture: Texture) -> moderngl.Texture:
        if (found := self._textures.get(texture)) is None:
            height, width, channels = texture.pixels.shape
            if max(width, height) > (limit := int(self._gl.info["GL_MAX_TEXTURE_SIZE"])):
                raise RenderError(
                    f"{texture!r}", f"this OpenGL allows at most {limit} texels along a side", "use a smaller picture"
                )
            before_making(self._gl)
            content = np.ones((height, width, 4), dtype=np.float16)
            with np.errstate(under="ignore"):
                content[..., :channels] = texture.pixels
            found = self._gl.texture((width, height), 4, content, dtype="f2")
            found.build_mipmaps()
            found.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
            found.repeat_x, found.repeat_y = (wrap == "repeat" for wrap in texture.wrap)
            self._textures[texture] = found
        return found

    def release(self) -> None:
        """Free all textures."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()


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
