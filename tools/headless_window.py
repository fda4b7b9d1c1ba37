"""``translucent`` with a window that no display shows: ``python tools/headless_window.py preview goblet``.

GLFW's null platform has windows, and OpenGL by EGL, but neither a screen nor a pointer. All else is as in a real one:
the loop of the window, its worker processes, and how it ends. `open_nowhere` does the same for other tools.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

from translucent import __main__

#: Of glfw3.h: GLFW_PLATFORM, GLFW_PLATFORM_NULL, GLFW_CONTEXT_CREATION_API, GLFW_EGL_CONTEXT_API.
_PLATFORM, _NULL, _CREATION, _EGL = 0x00050003, 0x00060005, 0x0002200B, 0x00036002


def open_nowhere() -> None:
    """Have the next window of this process open on no display."""
    import imgui_bundle

    glfw = ctypes.CDLL(str(Path(imgui_bundle.__file__).parent / "libglfw.so.3"))
    glfw.glfwInitHint(_PLATFORM, _NULL)
    if not glfw.glfwInit() or glfw.glfwGetPlatform() != _NULL:
        raise SystemExit("this GLFW has no null platform")
    glfw.glfwWindowHint(_CREATION, _EGL)
    os.environ.setdefault("DISPLAY", "none")


if __name__ == "__main__":
    heeded = signal.signal(signal.SIGINT, lambda *_: os._exit(130))  # as in __main__: nothing has begun
    open_nowhere()
    signal.signal(signal.SIGINT, heeded)
    sys.exit(__main__.main())
