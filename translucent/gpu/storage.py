"""Buffers that shaders write to."""

from __future__ import annotations

from functools import cached_property

import moderngl

from translucent.errors import RenderError
from translucent.gpu.compile_budget import before_making

#: First OpenGL version in which shaders write to buffers.
SHADER_STORAGE = 430


class Storage:
    """Named buffers, made on first use, that only grow.

    Parameters
    ----------
    gl : moderngl.Context
    owner : str
        What errors call that which the buffers are for.
    """

    def __init__(self, gl: moderngl.Context, owner: str) -> None:
        self._gl, self._owner = gl, owner
        self._buffers: dict[str, moderngl.Buffer] = {}

    def get(self, name: str, size: int) -> moderngl.Buffer:
        """A buffer of at least `size` bytes; what it held is lost where it has to grow.

        Raises
        ------
        RenderError
            If a shader of this OpenGL cannot reach that many bytes, or there is no room for them.
        """
        buffer = self._buffers.get(name)
        if buffer is not None and buffer.size >= size:
            return buffer
        before_making(self._gl)
        if buffer is not None:
            buffer.release()
            del self._buffers[name]
        try:
            if size > self.largest:
                raise moderngl.Error(f"a shader reaches {self.largest / 1e6:.0f} MB")
            self._buffers[name] = self._gl.buffer(reserve=size)
        except moderngl.Error as error:
            raise RenderError(
                self._owner,
                f"OpenGL has no room for {size / 1e6:.0f} MB of surfaces ({error})",
                "use DepthPeeling, render in parts, or smaller",
            ) from error
        return self._buffers[name]

    @cached_property
    def largest(self) -> int:
        """Bytes of a buffer that a shader can write to."""
        return int(self._gl.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])

    @property
    def size(self) -> int:
        """Total size of the buffers in bytes."""
        return sum(buffer.size for buffer in self._buffers.values())

    def release(self) -> None:
        """Free all buffers."""
        for buffer in self._buffers.values():
            buffer.release()
        self._buffers.clear()
