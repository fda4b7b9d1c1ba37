"""Textures on the GPU: uploaded once, shared by all passes, freed with the texture."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from translucent.errors import RenderError
from translucent.formulas.brdf_table import brdf_table
from translucent.gpu.compile_budget import before_drawing_with, before_making
from translucent.gpu.shaders import set_uniform
from translucent.scene.surface import TEXTURE_FIELDS, Surface
from translucent.scene.texture import Texture

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
    """Number of the kind of a texture: drivers compile other code for those of another kind.

    Of sides that are powers of two or 1, and of what repeats (llvmpipe's ``lp_static_texture_state``).
    """
    found = 0
    for side, wrap in zip(texture.pixels.shape[1::-1], texture.wrap, strict=True):
        found = 6 * found + 3 * (wrap == "repeat") + (2 if side == 1 else side & (side - 1) == 0)
    return found


def texture_units(first: int) -> dict[str, int]:
    """Units of a surface's textures by the names of their samplers, as in ``shaders/shade/surface_textures.glsl``."""
    return {name: unit for unit, name in enumerate(TEXTURE_FIELDS, first)}


def reflectance_table(gl: moderngl.Context) -> moderngl.Texture:
    """`brdf_table` on the GPU."""
    table = brdf_table()
    texture = gl.texture(table.shape[1::-1], 2, table, dtype="f4")
    texture.filter = moderngl.LINEAR, moderngl.LINEAR
    texture.repeat_x = texture.repeat_y = False
    return texture


class TextureCache:
    """Cache of each texture that has been drawn and is still alive, with mipmaps.

    Half floats hold 11 bits, more than pictures have, in half the room.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._textures: WeakKeyDictionary[Texture, moderngl.Texture] = WeakKeyDictionary()

    def bind(self, surface: Surface, program: moderngl.Program, first_unit: int) -> None:
        """Bind a surface's textures for a program that includes ``shade/surface_textures.glsl``."""
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
                raise RenderError(f"{texture!r}", f"this OpenGL ends at {limit}", "give a smaller picture")
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
