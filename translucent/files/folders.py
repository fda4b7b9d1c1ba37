"""Folders for results."""

from __future__ import annotations

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
