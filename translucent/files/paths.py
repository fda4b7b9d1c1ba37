"""Files and folders to write to: checks before any work is done, atomic writing, and CSV text."""

from __future__ import annotations

import csv
import errno
import io
import os
import secrets
import stat
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO, Self

from translucent.errors import InputError, RenderError

if sys.platform != "win32":
    import fcntl

# os.path says False of a name that no file can have, where pathlib may raise.


def require_file(path: Path, requested: str) -> None:
    """Raise unless the path is a file that can be read.

    Parameters
    ----------
    path : Path
    requested : str
        What was requested, as errors state it.

    Raises
    ------
    InputError
        If nothing of that name is there, or a folder, a pipe or a device.
    """
    if os.path.isfile(path):
        return
    if os.path.isdir(path):
        raise InputError(requested, "the path is a folder", "give the path of a file")
    if os.path.exists(path):
        raise InputError(
            requested, "the path is a pipe or a device", "copy the content into a file, and give the path of this file"
        )
    raise InputError(requested, "no file has this path", "check the path")


def require_output(path: Path, requested: str) -> None:
    """Raise unless a file can be written to the path.

    Parameters
    ----------
    path : Path
    requested : str
        What was requested, as errors state it.

    Raises
    ------
    InputError
        If there is no folder for it, or a folder, a pipe, a device or a loop of links has the name.
    RenderError
        If no file can be made in that folder.
    """
    folder = path.parent
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise InputError(requested, f"{str(folder)!r} is not a folder", "choose another path")
    if not os.path.isdir(folder):
        raise InputError(requested, f"the folder {str(folder)!r} does not exist", "create the folder first")
    _require_replaceable(path, requested)
    _require_writable(path, requested)


def _require_replaceable(path: Path, requested: str) -> None:
    """Raise `InputError` if the output would replace something other than a regular file."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:  # nothing is there, or what makes a file says why it cannot be there
        if isinstance(error, OSError) and error.errno == errno.ELOOP:
            raise InputError(
                requested, "the symbolic links of this path point at each other", "choose another path"
            ) from error
        return
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
        raise InputError(requested, f"{what} of this name already exists", "choose another name")


def require_folder(path: Path, requested: str) -> None:
    """Raise unless the path is a folder, or can be created as one.

    Parameters
    ----------
    path : Path
    requested : str
        What was requested, as errors state it.

    Raises
    ------
    InputError
        If the name, or that of a folder above, is one of a file.
    RenderError
        If nothing can be made in it, or in the folder that it has to be made in.
    """
    there = next((folder for folder in (path, *path.parents) if os.path.lexists(folder)), None)
    if there is None:
        return
    if not os.path.isdir(there):
        raise InputError(requested, f"{str(there)!r} is not a folder", "choose another path")
    _require_writable(there / path.name, requested)


def _require_writable(path: Path, requested: str) -> None:
    """Raise `RenderError` unless a file can be made beside the path."""
    try:  # rights do not suffice: disks may be read-only, and full; and a name may be too long
        with suppress(FileNotFoundError):
            os.lstat(path)
        temporary, held = _temporary_file(Path(os.path.realpath(path)))
    except OSError as error:
        raise RenderError(
            requested, f"the file cannot be written ({error.strerror})", "check the permissions of the folder"
        ) from error
    held.close()
    temporary.unlink(missing_ok=True)


def same_file(one: Path, other: Path) -> bool:
    """True if both paths name one existing file: directly, or through links of either kind."""
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        return False


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it; on any failure `path` stays as it was.

    What a process that was killed while it wrote `path` has left beside it is removed.

    Raises
    ------
    InputError
        If the file would take the place of a folder, a pipe, a device or a loop of links.
    RenderError
        If the file cannot be written.
    """
    with OutputFiles() as files:
        files.write(path, write)


class OutputFiles:
    """Files that belong together: each is filled beside its place, and at the end of the context all are renamed.

    On any failure they stay as they were. Between renames a process is hardly ever killed: what takes long is before.
    """

    def __init__(self) -> None:
        self._filled: list[tuple[Path, Path, BinaryIO]] = []
        self._cleanup = ExitStack()

    def __enter__(self) -> Self:
        return self

    def write(self, path: Path, write: Callable[[Path], object]) -> Path:
        """Let `write` fill a temporary file beside `path`, as `write_atomically`; returns its path."""
        _require_replaceable(path, f"output {str(path)!r}")
        path = Path(os.path.realpath(path))  # a link stays a link, and what it points to is replaced
        try:
            remove_partial(path)
            temporary, held = _temporary_file(path)
        except OSError as error:
            raise _unwritable(path, error, "check the folder") from error
        self._cleanup.callback(temporary.unlink, missing_ok=True)
        self._cleanup.callback(held.close)
        try:
            write(temporary)
        except OSError as error:
            raise _unwritable(path, error, "check the disk") from error
        self._filled.append((temporary, path, held))
        return temporary

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._cleanup:
            if kind is not None:
                return
            for temporary, path, held in self._filled:
                if sys.platform == "win32":  # where nothing that is open can be renamed
                    held.close()
                try:
                    temporary.replace(path)
                except OSError as error:
                    raise _unwritable(path, error, "check the disk") from error


def _unwritable(path: Path, error: OSError, do: str) -> RenderError:
    return RenderError(f"output {str(path)!r}", f"the file cannot be written ({error.strerror or error})", do)


def remove_partial(path: Path) -> None:
    """Remove temporary files of processes that were killed while they wrote `path`; not those in use."""
    path = Path(os.path.realpath(path))
    for left in path.parent.glob(f"{_partial(path)}*"):
        # It may be gone meanwhile, not be ours, or be where there are no locks.
        with suppress(OSError), left.open("r+b") as file:
            if _lock(file):
                left.unlink()


def write_text_atomically(path: Path, text: str) -> None:
    """Write a text in UTF-8, as `write_atomically` does."""
    write_atomically(path, partial(fill_text, text=text))


def fill_text(path: Path, text: str) -> None:
    """Write a text in UTF-8 into a file."""
    path.write_text(text, encoding="utf-8")


def _temporary_file(path: Path) -> tuple[Path, BinaryIO]:
    """New temporary file beside `path`, locked while it is open: the lock ends with the process."""
    while True:
        temporary = path.with_name(f"{_partial(path)}{secrets.token_hex(4)}{path.suffix}")
        try:
            # Made as any other file is, it has the permissions of any other new file, too.
            file = temporary.open("x+b")
        except FileExistsError:
            continue
        try:
            locked = _lock(file)
        except OSError:  # a file system without locks, on which nothing is removed, either
            return temporary, file
        # Between being made and being locked it looks like one that was left, and may have been removed.
        if locked and os.fstat(file.fileno()).st_nlink:
            return temporary, file
        file.close()
        temporary.unlink(missing_ok=True)


def _lock(file: BinaryIO) -> bool:
    """Try to lock a file until it is closed or this process ends; false if another process holds it."""
    if sys.platform == "win32":
        return True  # no file that somebody has open can be removed there
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _partial(path: Path) -> str:
    """Prefix of the names of temporary files for `path`."""
    return f".partial-{zlib.crc32(os.fsencode(path.name)):08x}-"


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
    """Create a folder and its parents, unless it exists.

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
            f"folder {str(folder)!r}", f"the folder cannot be created ({error.strerror})", "check the path"
        ) from error


#: Name of the toolkit's folder in each.
NAME = "translucent"


def config_folder() -> Path:
    """Folder of settings, which may not exist yet."""
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA", Path.home())) / NAME
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / NAME
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / NAME


def cache_folder() -> Path:
    """Folder of caches, which may not exist yet."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / NAME / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / NAME
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / NAME


#: Beginnings of cells that spreadsheets run as formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\n")


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> str:
    """Write rows as CSV, below the names of their columns; other keys of a row are left out.

    A text that a spreadsheet would run as a formula gets an apostrophe before it, and all its line ends are ``\\n``, as
    the module csv leaves others without quotes. Numbers stay as they are.
    """
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _harmless(cell) for name, cell in row.items()} for row in rows)
    return stream.getvalue()


def _harmless(cell: object) -> object:
    if not isinstance(cell, str):
        return cell
    text = cell.replace("\r\n", "\n").replace("\r", "\n")
    if not text.startswith(_FORMULAS):
        return text
    try:
        list(map(float, text.split()))
    except ValueError:
        return f"'{text}"
    return text
