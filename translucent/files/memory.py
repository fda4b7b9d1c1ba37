"""Memory that is free, asked before a large file takes it."""

from __future__ import annotations

from pathlib import Path

from translucent.errors import InputError
from translucent.files.reading import size_text

#: Bytes that are never refused: whether they are free changes faster than they are taken.
SMALL = 1 << 28

_MACHINE, _GROUP = Path("/proc/meminfo"), Path("/sys/fs/cgroup")


def free_memory() -> int | None:
    """Bytes that this process can take, of the machine and of the container that it runs in; None where nobody says."""
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


def require_memory(asked: str, found: str, size: int, do: str) -> None:
    """Raise `InputError` where as much memory is not free.

    Parameters
    ----------
    asked : str
        What the error says was asked for.
    found : str
        What takes it, such as ``"50000000 triangles"``.
    size : int
        Bytes that it takes, about.
    do : str
        What the user can do about it.
    """
    if size <= SMALL or (free := free_memory()) is None or size <= free:
        return
    raise InputError(asked, f"{found} take about {size_text(size)} of memory, and {size_text(free)} are free", do)
