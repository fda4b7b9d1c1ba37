"""Stock pyrender 0.1.45 on today's NumPy and Python: every fix that it needs, in one place.

- NumPy 2 removed `infty`, which every bounding box of pyrender asks for.
- From Python 3.12 on, ctypes references have another type name, which PyOpenGL 3.1.0 does not know: textures and
  depth-only pictures fail.
- `OffscreenRenderer.delete`, and its garbage collection, end the EGL display, which all contexts of the process share:
  other renderers die of it, some of them without an error.

PyOpenGL binds itself to one window system when it is first imported: that of the variable PYOPENGL_PLATFORM. It has to
be that of the context in use, ``egl`` without a window.
"""

from __future__ import annotations

import ctypes
import os
import sys
from types import ModuleType
from typing import Any

import numpy as np

from translucent.errors import RenderError

#: Private members of pyrender that are used, by class; another pyrender may lack them.
_PRIVATE = {
    "Renderer": ("_configure_forward_pass_viewport", "_read_main_framebuffer", "_configure_main_framebuffer"),
    "Primitive": ("_add_to_context", "_remove_from_context"),
    "Texture": ("_add_to_context", "_remove_from_context"),
}


def load_pyrender(backend: str | None = None) -> ModuleType:
    """Import pyrender and fix it.

    Parameters
    ----------
    backend : str, optional
        Of the renderer that it is to work with, which decides what PyOpenGL binds to, if nothing has decided before.

    Raises
    ------
    RenderError
        If pyrender or an OpenGL that it can load is missing, or it is a version of other private members.
    """
    if backend in ("egl", "osmesa") and "OpenGL" not in sys.modules:  # there is no window
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010 - type checkers know that NumPy 2 has none
    try:
        import pyrender
    except Exception as error:  # PyOpenGL raises its own kinds where a library is missing
        platform = os.environ.get("PYOPENGL_PLATFORM")
        bound = f"PYOPENGL_PLATFORM={platform}" if platform else "no PYOPENGL_PLATFORM set"
        raise RenderError(
            "drawing with pyrender",
            f"it cannot be imported with {bound} ({type(error).__name__}: {error})",
            "pip install pyrender==0.1.45; apt-get install libegl1 libgl1 libgl1-mesa-dri; without a window, set "
            "PYOPENGL_PLATFORM=egl before anything imports pyrender",
        ) from error
    missing = [f"{kind}.{name}" for kind, names in _PRIVATE.items() for name in names if _lacks(pyrender, kind, name)]
    if missing:
        raise RenderError(
            f"drawing with pyrender {pyrender.__version__}",
            f"it has no {', '.join(missing)}",
            "pip install pyrender==0.1.45",
        )
    _let_pyopengl_know_references()
    if os.environ.get("PYOPENGL_PLATFORM") == "egl":
        _keep_the_display()
    return pyrender  # type: ignore[no-any-return]


def _lacks(pyrender: Any, kind: str, name: str) -> bool:
    return not hasattr(getattr(pyrender, kind), name)


def _let_pyopengl_know_references() -> None:
    if sys.version_info >= (3, 12):
        from OpenGL.plugins import FormatHandler

        handler = "OpenGL.arrays.ctypesparameters.CtypesParameterHandler"
        if not any(plugin.name == "ctypesreference" for plugin in FormatHandler.all()):
            FormatHandler("ctypesreference", handler, ["_ctypes.CArgObject"])


def _keep_the_display() -> None:
    from pyrender.platforms.egl import EGLPlatform

    EGLPlatform.delete_context = _delete_context


def _delete_context(platform: Any) -> None:
    """End pyrender's context, and leave the display to the others."""
    from OpenGL.EGL import EGL_NO_CONTEXT, EGL_NO_SURFACE, eglDestroyContext, eglGetCurrentContext, eglMakeCurrent

    display, context = platform._egl_display, platform._egl_context
    if display is None or context is None:
        return
    platform._egl_display = platform._egl_context = None
    if _address(eglGetCurrentContext()) == _address(context):
        eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT)
    eglDestroyContext(display, context)


def _address(pointer: Any) -> int | None:
    return ctypes.cast(pointer, ctypes.c_void_p).value
