"""Folders: for results, and where the system expects a user's settings and caches."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from translucent.errors import RenderError
from translucent.files.paths import require_folder


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Context manager that makes a folder and its parents; after an error, empty ones that it made are removed.

    Raises
    ------
    InputError
        If its name, or that of a folder above, is one of a file.
    RenderError
        If it cannot be made.
    """
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        make_folder(folder)
        yield
    except BaseException:
        with suppress(OSError):  # something is in it
            for made in missing:
                made.rmdir()
        raise


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless it is there.

    Raises
    ------
    InputError
        If its name, or that of a folder above, is one of a file.
    RenderError
        If it cannot be made.
    """
    require_folder(folder, f"folder {str(folder)!r}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RenderError(
            f"folder {str(folder)!r}", f"it cannot be made ({error.strerror})", "check the path"
        ) from error


#: Name of the toolkit's folder in each.
NAME = "translucent"


def config_folder() -> Path:
    """Folder of settings; it need not be there."""
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA", Path.home())) / NAME
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / NAME
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / NAME


def cache_folder() -> Path:
    """Folder of what can be made again at any time; it need not be there."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / NAME / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / NAME
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / NAME
