"""OpenGL contexts: the one place that opens them, and records what it tried.

``python -m translucent.gpu.context --probe`` prints as JSON which backend works here.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Literal, get_args

import moderngl

from translucent.arguments import brief
from translucent.errors import InputError, RenderError
from translucent.files.reading import require_allowed
from translucent.gpu.drivers import avoid_full_cache
from translucent.gpu.osmesa import OSMesaContext
from translucent.gpu.signals import DeferredSignals

Backend = Literal["egl", "window", "osmesa"]

#: Version of moderngl. Looking it up takes a millisecond, and every frame records it.
MODERNGL = version("moderngl")

#: OpenGL version code that every raster path needs: 3.3 core.
REQUIRED = 330

#: Bytes that Mesa's software rasterizer takes with small frames, as measured: LLVM alone is half of it. Where it gets
#: no more it ends the process, or waits forever for threads that did not start.
_TAKEN = 1200 << 20


class _Entered(threading.local):
    """Contexts that `GpuContext.current` has made current in this thread, the innermost last."""

    def __init__(self) -> None:
        self.stack: list[GpuContext] = []


_entered = _Entered()

#: Id of the process that has opened OpenGL: no process forked from it can use it.
_opened_in: int | None = None


@dataclass(frozen=True)
class Attempt:
    """Attempt to open one backend, and the reason why it failed; None if it did not."""

    backend: str
    error: str | None


class NoContextError(RenderError):
    """Error for a machine without usable OpenGL; `attempts` says what was tried."""

    def __init__(self, attempts: tuple[Attempt, ...]) -> None:
        tried = "; ".join(f"{attempt.backend}: {attempt.error}" for attempt in attempts)
        super().__init__(
            "OpenGL 3.3 context",
            f"none; tried {tried}",
            "apt-get install libegl1 libgl1 libgl1-mesa-dri, or pip install --no-deps lavavu-osmesa (Linux x86-64); "
            "`translucent doctor` explains this machine",
        )
        self.attempts = attempts

    def __reduce__(self) -> tuple[type[NoContextError], tuple[tuple[Attempt, ...]]]:
        return NoContextError, (self.attempts,)


@dataclass(frozen=True, eq=False)
class GpuContext:
    """An OpenGL context with its origin.

    Attributes
    ----------
    gl : moderngl.Context
    backend : str
        ``egl``, ``window``, ``osmesa`` or ``adopted``.
    info : dict
        What the driver says of itself; moderngl reads it once and for all, so it is read while the context is current.
    attempts : tuple of Attempt
        What was tried before, ending with this one.
    """

    gl: moderngl.Context
    backend: str
    info: Mapping[str, Any]
    attempts: tuple[Attempt, ...] = ()

    @property
    def owned(self) -> bool:
        """True if the context was made here, and is released here."""
        return self.backend != "adopted"

    @property
    def renderer(self) -> str:
        """Name of the driver's device; a software rasterizer is named as such."""
        name = str(self.info["GL_RENDERER"])
        software = any(word in name.lower() for word in ("llvmpipe", "softpipe", "swrast"))
        return f"{name} (software rasterizer)" if software else name

    @property
    def provenance(self) -> dict[str, str]:
        """Backend, device, driver and versions, for the record."""
        return {
            "backend": self.backend,
            "renderer": self.renderer,
            "driver": str(self.info["GL_VERSION"]),
            "moderngl": MODERNGL,
        }

    def current(self) -> AbstractContextManager[moderngl.Context]:
        """Make the context current, and afterwards what was current before; may be nested.

        An adopted context is current already, by contract.
        """
        if not self.owned or _entered.stack[-1:] == [self]:
            return nullcontext(self.gl)
        return _Current(self)

    def forget(self) -> None:
        """Have this thread make the context current again when it is asked to, whatever was interrupted."""
        _entered.stack[:] = [context for context in _entered.stack if context is not self]

    def drain(self) -> None:
        """Free objects dropped since the last call; to be called at a safe moment, with the context current."""
        queue = self.gl.objects
        while queue:
            # moderngl's own gc() trips over objects that were released before they were dropped.
            if (release := getattr(queue.popleft(), "release", None)) is not None:
                release()


class _Current:
    """Context manager that makes a context current.

    Ctrl-C may end any of this between two lines: a context may stay current, which harms nothing, or listed, until
    `GpuContext.forget`. A generator would be resumed when it is collected, and leave what is current then.
    """

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._depth = len(_entered.stack)

    def __enter__(self) -> moderngl.Context:
        self._context.gl.__enter__()
        # glcontext remembers one predecessor per context, which nesting would overwrite, so we keep the stack.
        _entered.stack.append(self._context)
        return self._context.gl

    def __exit__(self, *error: object) -> None:
        del _entered.stack[self._depth :]
        self._context.gl.__exit__(None, None, None)
        if _entered.stack:
            _entered.stack[-1].gl.__enter__()


def require_own_process() -> None:
    """Raise `RenderError` in a process that is forked from one that has opened OpenGL: it would wait forever.

    The driver's threads are not forked along.
    """
    if _opened_in not in (None, os.getpid()):
        raise RenderError(
            "OpenGL in a forked process",
            f"process {_opened_in} has opened it before the fork, which its driver does not survive",
            'start processes with multiprocessing.get_context("spawn")',
        )


def _note_process() -> None:
    global _opened_in
    require_own_process()
    _opened_in = os.getpid()


def open_context(backend: str | None = None) -> GpuContext:
    """Open an OpenGL context.

    Parameters
    ----------
    backend : {"egl", "window", "osmesa"}, optional
        None tries EGL, then OSMesa. ``window`` attaches to the context that is current in this thread.

    Raises
    ------
    InputError
        If the backend is not known.
    NoContextError
        If none of the backends works.
    RenderError
        In a process that is forked from one that has opened OpenGL, or that may take too little memory.
    """
    if backend is not None and backend not in get_args(Backend):
        raise InputError(f"backend {backend!r}", "not a known backend", f"use one of {', '.join(get_args(Backend))}")
    if _opened_in is None:  # what takes most is loaded once
        require_allowed("OpenGL", _TAKEN)
    _note_process()
    avoid_full_cache()
    attempts: list[Attempt] = []
    for name in (backend,) if backend else ("egl", "osmesa"):
        try:
            with DeferredSignals():
                gl = _OPENERS[name]()
        except Exception as error:  # noqa: BLE001 - glcontext raises bare Exception, and each platform its own kinds
            attempts.append(Attempt(name, str(error) or type(error).__name__))
            continue
        attempts.append(Attempt(name, None))
        gl.gc_mode = "context_gc"
        return GpuContext(gl, name, gl.info, tuple(attempts))
    raise NoContextError(tuple(attempts))


def adopt_context(gl: moderngl.Context) -> GpuContext:
    """Use a context that somebody else owns: it is never released, and must be current whenever something is drawn.

    Where it has no ``gc_mode`` it gets ``"context_gc"``, or what we drop would stay in its memory.
    """
    _note_process()
    if not isinstance(gl, moderngl.Context):
        raise InputError(f"context {brief(gl)}", f"of type {type(gl).__name__}", "give a moderngl.Context")
    if gl.gc_mode is None:
        gl.gc_mode = "context_gc"
    return GpuContext(gl, "adopted", gl.info)


def _open_egl() -> moderngl.Context:
    # Without explicit names glcontext looks for development symlinks that a runtime installation lacks.
    names = {
        "libgl": os.environ.get("GLCONTEXT_LINUX_LIBGL", "libGL.so.1"),
        "libegl": os.environ.get("GLCONTEXT_LINUX_LIBEGL", "libEGL.so.1"),
    }
    settings: dict[str, Any] = names if sys.platform.startswith("linux") else {}
    return moderngl.create_context(require=REQUIRED, standalone=True, backend="egl", **settings)


def _open_window() -> moderngl.Context:
    return moderngl.create_context(require=REQUIRED)


def _open_osmesa() -> moderngl.Context:
    return moderngl.create_context(require=REQUIRED, context=OSMesaContext())


_OPENERS: dict[str, Callable[[], moderngl.Context]] = {"egl": _open_egl, "window": _open_window, "osmesa": _open_osmesa}


def _probe() -> int:
    try:
        context = open_context()
    except NoContextError as error:
        attempts = [vars(attempt) for attempt in error.attempts]
        print(json.dumps({"backend": None, "renderer": None, "attempts": attempts, "message": str(error)}))
        return 1
    attempts = [vars(attempt) for attempt in context.attempts]
    print(json.dumps({"backend": context.backend, "renderer": context.renderer, "attempts": attempts}))
    context.gl.release()
    return 0


if __name__ == "__main__":
    if sys.argv[1:] != ["--probe"]:
        sys.exit("usage: python -m translucent.gpu.context --probe")
    sys.exit(_probe())
