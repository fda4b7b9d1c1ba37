"""Seconds that the GPU spends on each pass."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from contextlib import suppress

import moderngl

_TIME_ELAPSED, _CURRENT_QUERY, _QUERY_RESULT = 0x88BF, 0x8865, 0x8866

#: What moderngl reads, 32 bits of nanoseconds, of whatever takes 4.295 s or more.
_SATURATED = (1 << 32) - 1


class PassTimer:
    """OpenGL timer queries by name; read after the frame, or a sample later, so that drawing does not wait for them."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._queries: dict[str, moderngl.Query] = {}
        self._numbers: dict[str, int] = {}  # of the queries, as OpenGL counts them
        self._seconds: dict[str, float] = {}  # of what was drawn in the frame before what the query has measured last
        # Mesa's software rasterizer measures the first query of a context from the beginning of time.
        texture = gl.texture((1, 1), 1)
        framebuffer = gl.framebuffer([texture])
        first = gl.query(time=True)
        with first:
            framebuffer.clear()
        _ = first.elapsed
        framebuffer.release()
        texture.release()
        self._get_query = self._function("glGetQueryiv", ctypes.c_uint, ctypes.c_uint)
        self._get_result = self._function("glGetQueryObjectui64v", ctypes.c_uint, ctypes.c_uint)

    def begin_frame(self) -> None:
        """Discard the previous frame's times."""
        self._seconds.clear()

    def measure(self, name: str) -> moderngl.Query:
        """Context manager that times the draws within; times of the same name in a frame add up."""
        if name not in self._queries:
            self._queries[name] = query = self._gl.query(time=True)
            self._numbers[name] = self._number(query)
        if name in self._seconds:
            self._seconds[name] += self._elapsed(name)
        else:
            self._seconds[name] = 0.0
        return self._queries[name]

    def stop(self) -> None:
        """End the running measurement, if there is one."""
        for query in self._queries.values():
            with suppress(moderngl.Error):  # it was not begun
                query.mglo.end()

    def seconds(self) -> dict[str, float]:
        """Seconds per name, in the order of the frame; waits for the GPU."""
        return {name: before + self._elapsed(name) for name, before in self._seconds.items()}

    def _elapsed(self, name: str) -> float:
        """Seconds that a query has measured last: as moderngl reads them, or all 64 bits where that is too few."""
        nanoseconds = self._queries[name].elapsed
        return 1e-9 * (nanoseconds if nanoseconds < _SATURATED else self._all_bits(name))

    def _all_bits(self, name: str) -> int:
        result = ctypes.c_uint64()
        self._get_result(self._numbers[name], _QUERY_RESULT, ctypes.byref(result))
        return result.value

    def _number(self, query: moderngl.Query) -> int:
        """Number of a query, which moderngl keeps to itself, and OpenGL tells of the one that runs."""
        number = ctypes.c_int()
        query.mglo.begin()
        self._get_query(_TIME_ELAPSED, _CURRENT_QUERY, ctypes.byref(number))
        query.mglo.end()
        return number.value

    def _function(self, name: str, *arguments: type) -> Callable[..., None]:
        """OpenGL function that writes its result to where its last argument points."""
        if sys.platform == "win32":
            prototype = ctypes.WINFUNCTYPE
        else:
            prototype = ctypes.CFUNCTYPE
        return prototype(None, *arguments, ctypes.c_void_p)(self._gl.mglo._context.load_opengl_function(name))
