"""Seconds that the GPU spends on each pass."""

from __future__ import annotations

from contextlib import suppress

import moderngl


class PassTimer:
    """OpenGL timer queries by name; read after the frame, or a sample later, so that drawing does not wait for them.

    moderngl reads 32 bits of nanoseconds: a single draw that takes more than 4.295 s counts as that.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._queries: dict[str, moderngl.Query] = {}
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

    def begin_frame(self) -> None:
        """Discard the previous frame's times."""
        self._seconds.clear()

    def measure(self, name: str) -> moderngl.Query:
        """Context manager that times the draws within; times of the same name in a frame add up."""
        if name not in self._queries:
            self._queries[name] = self._gl.query(time=True)
        query = self._queries[name]
        self._seconds[name] = self._seconds[name] + query.elapsed * 1e-9 if name in self._seconds else 0.0
        return query

    def stop(self) -> None:
        """End the running measurement, if there is one."""
        for query in self._queries.values():
            with suppress(moderngl.Error):  # it was not begun
                query.mglo.end()

    def seconds(self) -> dict[str, float]:
        """Seconds per name, in the order of the frame; waits for the GPU."""
        return {name: before + self._queries[name].elapsed * 1e-9 for name, before in self._seconds.items()}
