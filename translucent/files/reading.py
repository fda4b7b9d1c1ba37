"""Reading of untrusted files: which may be opened, and how much memory they may take.

Every reader of the toolkit begins here. Opened are regular files only, since a device may never end and a pipe may wait
forever; a linked file has to lie below the folder of its link, symlinks resolved. Nothing is allocated because
a header says so: `require_room` checks first. A file may unpack into `FREE` bytes, or into `RATIO` times its own
size: honest files stay far below, and a few bytes cannot fill the memory.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

from translucent.errors import InputError, RenderError
from translucent.files.paths import require_file

#: Bytes of the largest file: what the header of a .glb can state.
MAX_FILE = 2**32 - 1
#: Bytes of the largest text file: a material, a table, a session.
MAX_TEXT = 8 << 20
#: Bytes that any file may unpack into, and how many times its own size a larger one may.
FREE, RATIO = 1 << 29, 128
#: Largest depth of nested lists and objects.
MAX_DEPTH = 100
#: Characters of the longest TOML text: its parser takes up to 750 bytes for each.
MAX_TOML = 1 << 20
#: Largest number of digits of an integer within the range of float64.
MAX_DIGITS = 300

_SCHEME = re.compile(r"file:|[A-Za-z][A-Za-z0-9+.-]+://")

#: Strings and comments of TOML; what does not end reaches to the end of its line or of the text.
_TOML_TEXT = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"{3,5}|\Z)|"(?:\\.|[^"\\\n])*+"?|'''
    r"""'''.*?(?:'{3,5}|\Z)|'[^'\n]*+'?|#[^\n]*""",
    re.DOTALL,
)


def open_file(path: str | Path, requested: str, limit: int = MAX_FILE) -> BinaryIO:
    """Open a regular file for reading.

    Parameters
    ----------
    path : str or Path
    requested : str
        What was requested, as errors state it.
    limit : int
        Bytes that it may have.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, it is a folder, a pipe or a device, or it is larger.
    """
    require_file(Path(path), requested)
    try:
        stream = open(path, "rb", opener=_open_at_once)  # noqa: SIM115
    except OSError as error:
        raise InputError(
            requested, f"the file cannot be read ({error.strerror})", "check the permissions of the file"
        ) from None
    found = os.fstat(stream.fileno())
    if stat.S_ISREG(found.st_mode) and found.st_size <= limit:
        return stream
    stream.close()
    if not stat.S_ISREG(found.st_mode):
        raise InputError(requested, "the path is not a regular file", "give the path of a regular file")
    raise InputError(
        requested,
        f"the file has {size_text(found.st_size)}, more than the limit of {size_text(limit)}",
        "check the file, or split it into smaller files",
    )


def _open_at_once(path: str, flags: int) -> int:
    """Open a path without blocking if it has become a pipe since it was checked."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def read_bytes(path: str | Path, requested: str, limit: int = MAX_FILE) -> bytes:
    """Read the bytes of a file; raises `InputError` like `open_file`."""
    with open_file(path, requested, limit) as stream:
        try:
            return stream.read(os.fstat(stream.fileno()).st_size)
        except OSError as error:
            raise InputError(requested, f"the file cannot be read ({error.strerror})", "check the disk") from None


def read_text(path: str | Path, requested: str, limit: int = MAX_TEXT, do: str = "save the file as UTF-8 text") -> str:
    """Read a file of UTF-8 text; raises `InputError` like `open_file`, or if it is not UTF-8."""
    try:
        return read_bytes(path, requested, limit).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(requested, "not UTF-8 text", do) from None


def linked_file(folder: Path, link: str, requested: str, allow_outside: bool = False) -> Path:
    """Path of a file that another file in `folder` links to.

    Parameters
    ----------
    folder : Path
    link : str
        Relative, percent-encoded or not.
    requested : str
        What was requested, as errors state it.
    allow_outside : bool
        Whether the link may lead out of the folder: to where its user could not have meant.

    Raises
    ------
    InputError
        If it leads out of the folder, by its text or by a symbolic link, and may not; if it names no path.
    """
    name = unquote(link)
    if _SCHEME.match(name):
        raise InputError(
            requested,
            f"the link {link!r} is not a valid path",
            "keep all files of the model together, and link them by relative paths",
        )
    if "\0" in name:
        raise InputError(requested, f"the link {link!r} names no file", "export the model again")
    path = folder / name
    if not allow_outside and not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        do = "keep all files together, or add --allow-outside (Python: allow_outside=True)"
        raise InputError(requested, f"the link {link!r} leads outside the folder of the model", do)
    return path


def require_room(requested: str, found: str, size: int, stored: int, do: str = "use a smaller file") -> None:
    """Raise unless reading may take this much memory.

    Parameters
    ----------
    requested : str
        What was requested, as errors state it.
    found : str
        What takes it, such as ``"16384x16384 pixels"``.
    size : int
        Bytes that reading it takes at most, with all that is made in between.
    stored : int
        Bytes of the file that it is unpacked from.
    do : str
        What the user can do about it.

    Raises
    ------
    InputError
        If it is more than `FREE` bytes, and more than `RATIO` times what is stored.
    """
    if size > (allowed := max(FREE, RATIO * stored)):
        limit = f"the limit for a file of this size is {size_text(allowed)}"
        raise InputError(requested, f"{found} take {size_text(size)}; {limit}", do)


def size_text(size: int) -> str:
    """Text of a size in bytes."""
    for unit, scale in (("GiB", 1 << 30), ("MiB", 1 << 20), ("kiB", 1 << 10)):
        if size >= scale:
            return f"{size / scale:.3g} {unit}" if size < 1000 * scale else f"{size // scale} {unit}"
    return f"{size} bytes"


def json_value(text: str) -> Any:
    """Parse a JSON text, without infinities, oversized numbers and deep nesting.

    Raises
    ------
    ValueError
        If it is no such JSON; the message says why.
    """
    try:
        value = json.loads(text, parse_constant=_refuse, parse_float=_finite, parse_int=_whole)
    except RecursionError:
        raise ValueError(f"more than {MAX_DEPTH} levels") from None
    _require_shallow(value)
    return value


def toml_value(text: str) -> dict[str, Any]:
    """Parse a TOML text; raises `ValueError` like `json_value`, or if it is too long."""
    if len(text) > MAX_TOML:
        raise ValueError(f"more than {MAX_TOML} characters")
    # The parser keeps each beginning of a dotted key, which takes the square of its length.
    keys = re.split(r"[=,{}\[\]\n]", _TOML_TEXT.sub("", text))
    if max(key.count(".") for key in keys) >= MAX_DEPTH:
        raise ValueError(f"more than {MAX_DEPTH} levels")
    try:
        value = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"more than {MAX_DEPTH} levels") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # of int, which tomllib calls
        raise ValueError("a number is too long") from error
    _require_shallow(value)
    return value


def _refuse(word: str) -> None:
    raise ValueError(f"{word} is not a JSON number")


def _finite(text: str) -> float:
    if math.isinf(value := float(text)):
        raise ValueError(f"{text} is beyond the range of numbers")
    return value


def _whole(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise ValueError("a whole number is too long")
    return int(text)


def _require_shallow(value: Any) -> None:
    """Raise `ValueError` where lists and objects are nested too deeply, or a whole number is too long."""
    level: list[Any] = [[value]]
    for _ in range(MAX_DEPTH + 1):
        inner: list[Any] = []
        for holder in level:
            children: Iterable[Any] = holder.values() if isinstance(holder, dict) else holder
            inner += [child for child in children if isinstance(child, (dict, list, int))]
        if any(isinstance(child, int) and child.bit_length() > 1000 for child in inner):
            raise ValueError("a whole number is too long")
        level = [child for child in inner if not isinstance(child, int)]
        if not level:
            return
    raise ValueError(f"more than {MAX_DEPTH} levels")


def shown(error: BaseException) -> str:
    """Error message of a library as short text."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


#: Bytes that are never refused: whether they are free changes faster than they are taken.
SMALL = 1 << 28

_MACHINE, _GROUP = Path("/proc/meminfo"), Path("/sys/fs/cgroup")


def free_memory() -> int | None:
    """Free memory in bytes, of the machine or the container; None if it is unknown."""
    try:
        fields = dict(line.split(":", 1) for line in _MACHINE.read_text().splitlines())
        free = 1024 * int(fields["MemAvailable"].split()[0])
    except (OSError, ValueError, KeyError, IndexError):
        return None
    try:
        limit, held = (int((_GROUP / name).read_text()) for name in ("memory.max", "memory.current"))
        counts = dict(line.split() for line in (_GROUP / "memory.stat").read_text().splitlines())
        return max(0, min(free, limit - held + int(counts["inactive_file"])))
    except (OSError, ValueError, KeyError):  # no container, or one without a limit
        return free


def require_memory(requested: str, found: str, size: int, do: str) -> None:
    """Raise `InputError` if this much memory is not free.

    Parameters
    ----------
    requested : str
        What was requested, as errors state it.
    found : str
        What takes it, such as ``"50000000 triangles"``.
    size : int
        Bytes that it takes, about.
    do : str
        What the user can do about it.
    """
    if size <= SMALL or (free := free_memory()) is None or size <= free:
        return
    raise InputError(
        requested, (f"{found} need about {size_text(size)} of memory, but only {size_text(free)} are free"), do
    )


def require_allowed(requested: str, size: int) -> None:
    """Raise `RenderError` where the limit of the process (``ulimit -v``) leaves less memory than `requested` takes.

    Libraries that are written in C end the process where they get no more.
    """
    if sys.platform != "linux":
        return
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return
    free = max(limit - resource.getpagesize() * int(Path("/proc/self/statm").read_text().split()[0]), 0)
    if free < size:
        found = f"this needs {size_text(size)} of memory, but the limit of this process leaves only {size_text(free)}"
        raise RenderError(requested, found, "raise the limit (ulimit -v)")
