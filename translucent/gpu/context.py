"""Creation of OpenGL contexts, and a record of the platforms that were tried.

Without a window system that is Mesa's off-screen library, through ctypes: the system's libOSMesa, or the one in the
Python package that the extra ``osmesa`` installs.

``python -m translucent.gpu.context --probe`` prints as JSON which backend works here.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import moderngl

from translucent.arguments import brief
from translucent.errors import InputError, RenderError, TranslucentWarning
from translucent.files.reading import require_allowed
from translucent.threads import DeferredSignals

WHEEL = "lavavu-osmesa"

_GL_RGBA, _GL_UNSIGNED_BYTE = 0x1908, 0x1401
_FORMAT, _DEPTH_BITS, _PROFILE, _CORE_PROFILE, _MAJOR, _MINOR = 0x22, 0x30, 0x33, 0x34, 0x36, 0x37


class OSMesaContext:
    """A current OSMesa context of at least OpenGL 3.3 core, in the shape that moderngl takes as ``context=``.

    Raises
    ------
    OSError
        If there is no OSMesa library, or it cannot make the context.
    """

    def __init__(self) -> None:
        self._library = _load()
        attributes = (_FORMAT, _GL_RGBA, _DEPTH_BITS, 24, _PROFILE, _CORE_PROFILE, _MAJOR, 3, _MINOR, 3, 0)
        self._handle = self._library.OSMesaCreateContextAttribs((ctypes.c_int * len(attributes))(*attributes), None)
        if not self._handle:
            raise OSError("libOSMesa cannot make an OpenGL 3.3 core context")
        # The default framebuffer; nobody draws to it, but it must live as long as the context.
        self._pixels = (ctypes.c_ubyte * 4)()
        self.__enter__()

    def load_opengl_function(self, name: str) -> int:
        """Address of an OpenGL function, 0 where there is none."""
        return int(self._library.OSMesaGetProcAddress(name.encode()) or 0)

    def __enter__(self) -> OSMesaContext:
        if not self._library.OSMesaMakeCurrent(self._handle, self._pixels, _GL_UNSIGNED_BYTE, 1, 1):
            raise OSError("OSMesaMakeCurrent failed")
        return self

    def __exit__(self, *_: object) -> None:  # moderngl calls it without arguments
        """Leave the context current: there is no other to go back to."""

    def release(self) -> None:
        """Destroy the context."""
        if self._handle:
            self._library.OSMesaMakeCurrent(None, None, 0, 0, 0)
            self._library.OSMesaDestroyContext(self._handle)
            self._handle = None


def _load() -> ctypes.CDLL:
    library = _load_from_wheel() or _load_from_system()
    create, make_current = library.OSMesaCreateContextAttribs, library.OSMesaMakeCurrent
    create.restype, create.argtypes = ctypes.c_void_p, [ctypes.POINTER(ctypes.c_int), ctypes.c_void_p]
    make_current.restype = ctypes.c_ubyte
    make_current.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
    library.OSMesaGetProcAddress.restype, library.OSMesaGetProcAddress.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    library.OSMesaDestroyContext.restype, library.OSMesaDestroyContext.argtypes = None, [ctypes.c_void_p]
    return library


def _load_from_system() -> ctypes.CDLL:
    try:
        return ctypes.CDLL("libOSMesa.so.8")
    except OSError:
        raise OSError(f"neither the package {WHEEL} nor libOSMesa.so.8 is installed") from None


def _load_from_wheel() -> ctypes.CDLL | None:
    """OSMesa of the Python package, or None where it is not installed.

    The wheel carries the libraries that it needs under names that the loader finds only among those already loaded,
    so they are loaded over and over until none is left that could not be.
    """
    from importlib import metadata  # late: it takes milliseconds, and most contexts are others

    try:
        files = metadata.distribution(WHEEL).files or []
    except metadata.PackageNotFoundError:
        return None
    waiting = sorted(Path(str(f.locate())).resolve() for f in files if ".libs/" in f.as_posix() and ".so" in f.name)
    found: ctypes.CDLL | None = None
    progress = True
    while waiting and progress:
        failed = []
        for path in waiting:
            try:
                library = ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
            except OSError:
                failed.append(path)
                continue
            if path.name.startswith("libOSMesa"):
                found = library
        progress, waiting = len(failed) < len(waiting), failed
    return found


class DriverFaultError(RenderError):
    """Error for a request that would crash the process through a fault of the driver."""


def require_interfaces(info: Mapping[str, Any]) -> None:
    """Raise `DriverFaultError` where the driver crashes on the shading of interfaces, and of lit opaque surfaces.

    Lavapipe 22 reads before the first of its constant buffers where it inlines uniforms into that shader.
    """
    if str(info["GL_RENDERER"]).startswith("zink (llvmpipe") and "Mesa 22." in str(info["GL_VERSION"]):
        raise DriverFaultError(
            "interfaces, or lit opaque surfaces, with the driver zink over lavapipe",
            f"this driver, {info['GL_VERSION']}, crashes on them",
            "use another driver, a newer Mesa, or objects without ior and surface",
        )


#: Mesa's variable that leaves out what makes the code of its software rasterizer faster (docs.mesa3d.org/envvars.html).
_QUICK = "GALLIVM_PERF", "nopt"


@contextmanager
def quick_compiles(quick: bool) -> Iterator[None]:
    """Let OpenGL contexts opened within compile shaders faster, with slower drawing and equal results.

    Mesa's software rasterizer does, where it is the first of its process, and the variable is not set otherwise.
    """
    name, value = _QUICK
    if not quick or name in os.environ:
        yield
        return
    os.environ[name] = value
    try:
        yield
    finally:
        del os.environ[name]


#: Bytes of the index that Mesa's cache of compiled shaders maps into memory (``disk_cache_os.c``), and of room for it
#: and for the shaders of a session, where there is none yet.
_INDEX, _ROOM = 8 + (20 << 16), 1 << 24


def avoid_full_cache() -> None:
    """Disable Mesa's shader cache in this process, with a warning, if its disk is full.

    To be called before OpenGL is opened. Some builds of Mesa map an index that has no blocks on the disk yet, and
    a write to it ends the process by SIGBUS where the disk, or the user's quota, is full.
    """
    off = "MESA_SHADER_CACHE_DISABLE"
    if not sys.platform.startswith("linux") or os.environ.get(off, "").lower() in ("1", "true", "yes", "y", "t"):
        return
    for folder in _cache_folders():
        try:
            _allocate_cache(folder)
        except OSError as error:
            # Where Mesa may not write at all it leaves the cache out by itself.
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                continue
            os.environ[off] = "true"
            found = f"the disk of {str(folder)!r} is full ({error.strerror})"
            do = "free some space, or set MESA_SHADER_CACHE_DIR; until then, each process compiles all shaders anew"
            warnings.warn(f"Mesa's shader cache is not used; {found}; {do}", TranslucentWarning, stacklevel=2)
            return


def _cache_folders() -> list[Path]:
    """Folders in which Mesa may keep its cache: the one that is set, or that of the user, which versions take from
    ``HOME`` or from the system's list of users.
    """
    for name in ("MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME"):
        if name in os.environ:
            return [Path(os.environ[name])]
    found = {os.environ.get("HOME", "")}
    with suppress(KeyError):  # a user whom the system does not list
        import pwd

        found.add(pwd.getpwuid(os.getuid()).pw_dir)
    return [Path(home, ".cache") for home in sorted(found) if home]


def _allocate_cache(folder: Path) -> None:
    """Allocate all disk blocks of a cache's index file; if the file is missing, only test whether this is possible."""
    if sys.platform == "linux":  # for checkers of types: other systems lack posix_fallocate
        indices = list(folder.glob("mesa_shader_cache*/index"))
        for index in indices:
            with index.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, _INDEX)
        if not indices:
            there = next(path for path in (folder, *folder.absolute().parents) if path.is_dir())
            with tempfile.TemporaryFile(dir=there) as file:
                os.posix_fallocate(file.fileno(), 0, _ROOM)


Backend = Literal["egl", "window", "osmesa"]

#: OpenGL version code that every raster path needs: 3.3 core.
REQUIRED = 330

#: Bytes that Mesa's software rasterizer takes with small frames, as measured: LLVM alone is half of it. Where it gets
#: no more it ends the process, or blocks forever on threads that did not start.
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
            f"no context could be created (tried {tried})",
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
            "moderngl": moderngl.__version__,
        }

    def current(self) -> AbstractContextManager[moderngl.Context]:
        """Make the context current, and afterwards what was current before; may be nested.

        An adopted context is current already, by contract.
        """
        if not self.owned or _entered.stack[-1:] == [self]:
            return nullcontext(self.gl)
        return _Current(self)

    def forget(self) -> None:
        """Have this thread make the context current again when it is needed, whatever was interrupted."""
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
            f"process {_opened_in} opened OpenGL before the fork, and the driver does not work after a fork",
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
        raise InputError(
            f"backend {backend!r}", "no backend has this name", f"use one of {', '.join(get_args(Backend))}"
        )
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
        raise InputError(
            f"context {brief(gl)}", f"of type {type(gl).__name__}", "give an object of type moderngl.Context"
        )
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


_OPENERS: dict[str, Callable[[], moderngl.Context]] = {
    "egl": _open_egl,
    "window": lambda: moderngl.create_context(require=REQUIRED),
    "osmesa": lambda: moderngl.create_context(require=REQUIRED, context=OSMesaContext()),
}


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
