"""Files and folders that a user names: whether they are what they have to be, told before any work is done."""

from __future__ import annotations

import os
from pathlib import Path

from translucent.errors import InputError

# os.path says False of a name that no file can have, where pathlib may raise.


def require_file(path: Path, asked: str) -> None:
    """Raise unless there is a file to read.

    Parameters
    ----------
    path : Path
    asked : str
        What the error says was asked for.

    Raises
    ------
    InputError
        If nothing of that name is there, or a folder, a pipe or a device.
    """
    if os.path.isfile(path):
        return
    if os.path.isdir(path):
        raise InputError(asked, "it is a folder", "give a file in it")
    if os.path.exists(path):
        raise InputError(asked, "it is a pipe or a device", "copy its content into a file, and give that")
    raise InputError(asked, "no such file", "check the path")


def require_place(path: Path, asked: str) -> None:
    """Raise unless a file of this name can be written.

    Parameters
    ----------
    path : Path
    asked : str
        What the error says was asked for.

    Raises
    ------
    InputError
        If there is no folder for it, or a folder has the name.
    """
    folder = path.parent
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise InputError(asked, f"{str(folder)!r} is no folder", "choose another one")
    if not os.path.isdir(folder):
        raise InputError(asked, f"no folder {str(folder)!r}", "make the folder first")
    if os.path.isdir(path):
        raise InputError(asked, "a folder of that name is there", "choose another name")


def require_folder(path: Path, asked: str) -> None:
    """Raise unless this is a folder, or one of this name can be made, with those above it.

    Parameters
    ----------
    path : Path
    asked : str
        What the error says was asked for.

    Raises
    ------
    InputError
        If the name, or that of a folder above, is one of a file.
    """
    there = next((folder for folder in (path, *path.parents) if os.path.lexists(folder)), None)
    if there is not None and not os.path.isdir(there):
        raise InputError(asked, f"{str(there)!r} is no folder", "choose another one")
