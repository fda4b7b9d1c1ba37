"""Seconds that the GPU spends on each pass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl


class PassTimer:
    """OpenGL timer queries by name; the results are read only after the frame, so that nothing waits for them."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._queries: dict[str, moderngl.Query] = {}
        self._used: list[str] = []
        # Mesa's software rasteriser measures the first query of a context from the beginning of time.
        texture = gl.texture((1, 1), 1)
        framebuffer = gl.framebuffer([texture])
        first = gl.query(time=True)
        with first:
            framebuffer.clear()
        _ = first.elapsed
        framebuffer.release()
        texture.release()

    def begin_frame(self) -> None:
        """Forget the previous frame's times."""
        self._used.clear()

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time what is drawn inside; once per name and frame."""
        if name not in self._queries:
            self._queries[name] = self._gl.query(time=True)
        with self._queries[name]:
            yield
        self._used.append(name)

    def seconds(self) -> dict[str, float]:
        """Seconds per name, in the order of the frame; waits for the GPU."""
        return {name: self._queries[name].elapsed * 1e-9 for name in self._used}
