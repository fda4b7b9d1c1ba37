"""Software OpenGL without a window system, through Mesa's off-screen library and ctypes.

The library is the system's libOSMesa, or the one in the Python package that the extra ``osmesa`` installs.
"""

from __future__ import annotations

import ctypes
from importlib import metadata
from pathlib import Path

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
