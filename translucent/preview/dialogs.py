"""File dialogs of the system, or the built-in file browser; and files dropped on the window."""

from __future__ import annotations

import ctypes
import fnmatch
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import imgui_bundle
from imgui_bundle import hello_imgui, portable_file_dialogs

#: Largest number of entries of a folder that are listed.
MOST_ENTRIES = 20_000


@dataclass(frozen=True)
class Entry:
    """File or folder in a list."""

    name: str
    is_folder: bool


@dataclass
class Browser:
    """File browser.

    Attributes
    ----------
    kind : str
        Which question it answers, one of `translucent.preview.dialogs.QUESTIONS`.
    title : str
    patterns : tuple of str
        Of names of files, such as ``*.glb``.
    saves : bool
        Whether a file is to be written.
    folder : Path
        Folder on show.
    text : str
        In the field: the name of a file, or a path.
    every : bool
        Whether files of all kinds are listed.
    problem : str
        Why the text was not accepted, or the folder cannot be listed.
    replaced : str
        File that is replaced if the user confirms it.
    """

    kind: str
    title: str
    patterns: tuple[str, ...]
    saves: bool
    folder: Path
    text: str = ""
    every: bool = False
    problem: str = ""
    replaced: str = ""
    _listed: tuple[object, list[Entry]] | None = field(default=None, repr=False)

    def entries(self) -> list[Entry]:
        """Folders and files of the folder on show, in the order of their names; listed again when it changes."""
        try:
            key = self.folder, self.every, self.folder.stat().st_mtime_ns
        except OSError as error:
            self.problem = f"{self.folder}: {error.strerror}"
            return []
        if self._listed is None or self._listed[0] != key:
            self._listed = key, self._list()
        return self._listed[1]

    def enter(self, folder: str | Path) -> None:
        """Show another folder; `problem` says if there is none."""
        found = Path(os.path.normpath(self.folder / Path(folder).expanduser()))
        if not found.is_dir():
            self.problem = f"{found}: this folder does not exist"
            return
        self.folder, self.problem, self.replaced = found, "", ""

    def accept(self) -> str | None:
        """Path of the file that the text names; None if there is none yet: it names a folder, or is to be confirmed."""
        self.problem = ""
        text = self.text.strip()
        if not text or "\0" in text:
            return None
        path = Path(os.path.normpath(self.folder / Path(text).expanduser()))
        if path.is_dir():
            self.enter(path)
            self.text = ""
            return None
        if not self.saves:
            if not path.is_file():
                self.problem = f"{path.name}: this file does not exist"
                return None
            return str(path)
        if not path.suffix and self.patterns and "." in self.patterns[0]:
            path = path.with_name(path.name + self.patterns[0].removeprefix("*"))
        if not path.parent.is_dir():
            self.problem = f"{path.parent}: this folder does not exist"
            return None
        if path.exists() and self.replaced != str(path):
            self.replaced = str(path)
            self.problem = f"{path.name} exists; press Replace to overwrite it"
            return None
        return str(path)

    @property
    def button(self) -> str:
        """Label of the button that accepts."""
        if self.replaced and self.replaced.startswith(str(self.folder / Path(self.text.strip() or "."))):
            return "Replace"
        return "Save" if self.saves else "Open"

    def _list(self) -> list[Entry]:
        found = []
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    if entry.name.startswith("."):
                        continue
                    is_folder, lower = os.path.isdir(entry.path), entry.name.lower()
                    fits = any(fnmatch.fnmatchcase(lower, pattern) for pattern in self.patterns)
                    if is_folder or self.every or fits:
                        found.append(Entry(entry.name, is_folder))
                    if len(found) >= MOST_ENTRIES:
                        break
        except OSError as error:
            self.problem = f"{self.folder}: {error.strerror}"
        return sorted(found, key=lambda one: (not one.is_folder, one.name.lower(), one.name))


MODELS = ["Models", "*.glb *.gltf *.obj *.stl *.ply *.off", "All files", "*"]
SESSIONS = ["Sessions", "*.toml", "All files", "*"]
PANORAMAS = ["Pictures of all directions", "*.hdr *.exr *.png *.jpg", "All files", "*"]

TEXTURES = ["Pictures", "*.png *.jpg *.jpeg", "All files", "*"]

#: Kinds of dialogs: the title, the file that is proposed where one is written, and the kinds.
QUESTIONS: dict[str, tuple[str, str | None, list[str]]] = {
    "open": ("Open a model", None, MODELS),
    "open session": ("Open a session", None, SESSIONS),
    "save session": ("Save the session", "session.toml", SESSIONS),
    "environment": ("Light with a picture", None, PANORAMAS),
    "background": ("A picture behind the model", None, PANORAMAS),
    "color texture": ("A picture that tints the surface", None, TEXTURES),
    "roughness texture": ("A picture that multiplies the roughness", None, TEXTURES),
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
    """Our own browser for a type of dialog."""
    title, proposed, kinds = QUESTIONS[kind]
    return Browser(kind, title, tuple(kinds[1].split()), proposed is not None, folder, proposed or "")


def chosen_path(dialog: Any) -> str | None:
    """Path of the file that the user has chosen; empty if none, None while the dialog is open."""
    if not dialog.ready(0):
        return None
    result = dialog.result()
    return result if isinstance(result, str) else (result[0] if result else "")


_Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))


def accept_drops(take: Callable[[list[str]], None]) -> object:
    """Call `take` with the files that are dropped on the window, where the system can do that.

    The returned object has to be kept alive as long as the window.
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
    """The library that the window itself uses, as another copy would know no windows; None if it is not there."""
    folder = Path(imgui_bundle.__file__).parent
    names = ("libglfw.so.3", "libglfw.3.dylib", "glfw3.dll")
    libraries = [folder / name for name in names if (folder / name).exists()]
    return ctypes.CDLL(str(libraries[0])) if libraries else None


def _window() -> ctypes.c_void_p:
    return ctypes.c_void_p(getattr(hello_imgui, "get_glfw_window_address")())  # noqa: B009 - its stubs do not know it
