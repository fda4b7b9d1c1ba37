"""The system's file dialogs, without waiting for them, and files dropped on the window."""

from __future__ import annotations

import ctypes
import shutil
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import imgui_bundle
from imgui_bundle import hello_imgui, portable_file_dialogs

from translucent.preview.browser import Browser

MODELS = ["Models", "*.glb *.gltf *.obj *.stl *.ply *.off", "All files", "*"]
SESSIONS = ["Sessions", "*.toml", "All files", "*"]
PANORAMAS = ["Pictures of all directions", "*.hdr *.exr *.png *.jpg", "All files", "*"]

#: Kinds of dialogs: the title, the file that is proposed where one is written, and the kinds.
QUESTIONS: dict[str, tuple[str, str | None, list[str]]] = {
    "open": ("Open a model", None, MODELS),
    "open session": ("Open a session", None, SESSIONS),
    "save session": ("Save the session", "session.toml", SESSIONS),
    "environment": ("Light with a picture", None, PANORAMAS),
    "background": ("A picture behind the model", None, PANORAMAS),
    "png": ("Save the picture", "picture.png", ["PNG", "*.png"]),
    "exr": ("Save the picture and its quantities", "picture.exr", ["OpenEXR", "*.exr"]),
    "turntable": ("Save a turntable", "turntable.gif", ["Animations", "*.gif *.webp *.mp4"]),
    "save glb": ("Save the medium into a copy of the model", "model.glb", ["glTF", "*.glb *.gltf"]),
    "map": ("Save the thickness map", "thickness.exr", ["Maps", "*.exr *.png *.npy *.glb"]),
}


def open_dialog(kind: str) -> Any | None:
    """Open a dialog; None if the system has none."""
    if sys.platform.startswith("linux") and not any(map(shutil.which, ("zenity", "kdialog", "matedialog", "qarma"))):
        return None
    title, proposed, kinds = QUESTIONS[kind]
    if proposed is None:
        return portable_file_dialogs.open_file(title, "", kinds)
    return portable_file_dialogs.save_file(title, proposed, kinds)


def browser_for(kind: str, folder: Path) -> Browser:
    """Browser of our own for a kind of dialog."""
    title, proposed, kinds = QUESTIONS[kind]
    return Browser(kind, title, tuple(kinds[1].split()), proposed is not None, folder, proposed or "")


def answer(dialog: Any) -> str | None:
    """Path of the file that the user has chosen; empty if none, None while the dialog is open."""
    if not dialog.ready(0):
        return None
    result = dialog.result()
    return result if isinstance(result, str) else (result[0] if result else "")


_Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))


def accept_drops(take: Callable[[list[str]], None]) -> object:
    """Call `take` with the files that are dropped on the window; the returned object has to be kept alive. None: not
    possible.
    """
    if (library := _glfw()) is None:
        return None

    def dropped(_: int, count: int, paths: Any) -> None:
        take([paths[i].decode("utf-8", "surrogateescape") for i in range(count)])

    callback = _Callback(dropped)
    library.glfwSetDropCallback(_window(), callback)
    return callback


def move_pointer(x: float, y: float) -> None:
    """Move the system's pointer to a place of the window, where that is possible: a window in front follows it."""
    if (library := _glfw()) is not None:
        library.glfwSetCursorPos(_window(), ctypes.c_double(x), ctypes.c_double(y))


@cache
def _glfw() -> ctypes.CDLL | None:
    """The very library that the window uses, as another copy would know no windows; None if it is not there."""
    folder = Path(imgui_bundle.__file__).parent
    names = ("libglfw.so.3", "libglfw.3.dylib", "glfw3.dll")
    libraries = [folder / name for name in names if (folder / name).exists()]
    return ctypes.CDLL(str(libraries[0])) if libraries else None


def _window() -> ctypes.c_void_p:
    return ctypes.c_void_p(getattr(hello_imgui, "get_glfw_window_address")())  # noqa: B009 - its stubs do not know it
