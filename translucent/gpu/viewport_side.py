"""Samples of one side of a viewport, kept by the pixels of a step."""

from __future__ import annotations

import moderngl

from translucent.errors import RenderError
from translucent.gpu.strides import STRIDES, phases

Size = tuple[int, int]


class Side:
    """Accumulated samples of one side of the comparison: radiance, optical depth and thickness, flags."""

    def __init__(self, gl: moderngl.Context, size: Size) -> None:
        self.size = size
        try:
            self.textures = [gl.texture(size, count, dtype="f4") for count in (4, 4, 1)]
            for texture in self.textures:
                texture.filter = moderngl.NEAREST, moderngl.NEAREST
            self.all = gl.framebuffer(self.textures)
            self.light = gl.framebuffer(self.textures[:1])
        except moderngl.Error as error:
            found = f"OpenGL has no room for it ({error})"
            raise RenderError(f"viewport of {size[0]}x{size[1]}", found, "make the window smaller") from error
        self.step, self.stride = 0, 1

    def known(self) -> list[tuple[int, ...]]:
        """Drawn phase, of the stride x stride ones, that stands in for each phase; 0 for the rest. In fours."""
        order = phases(self.stride)
        found = [0] * STRIDES[-1] ** 2
        for (x, y), block in order[: max(self.step, 1)]:
            for i in range(x, x + block):
                for j in range(y, y + block):
                    found[i + self.stride * j] = x + self.stride * y
        # Whole registers: of small ones, OpenGL 3.3 need not have room for those of two frames.
        return [tuple(found[i : i + 4]) for i in range(0, len(found), 4)]

    def kept(self, x: int, y: int) -> Size:
        """Position at which pixel (x, y) is kept, once all of them are drawn."""
        part = self.size[0] // self.stride, self.size[1] // self.stride
        return x % self.stride * part[0] + x // self.stride, y % self.stride * part[1] + y // self.stride

    def release(self) -> None:
        """Free the textures."""
        for resource in (self.all, self.light, *self.textures):
            resource.release()
