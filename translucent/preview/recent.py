"""Recently opened files, kept from one window to the next."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def _file() -> Path:
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA", Path.home()))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    else:
        base = Path(os.environ.get("XDG_CONFIG_HOME", Path.home() / ".config"))
    return base / "translucent" / "recent.txt"


def read_recent() -> list[str]:
    """Read recent paths, the latest first; those that are gone are left out. None where there is no such list."""
    try:
        lines = _file().read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []  # a list that cannot be read is no reason not to start
    return [line for line in lines if os.path.exists(line)]


def write_recent(paths: list[str]) -> None:
    """Write the list, if possible."""
    try:
        _file().parent.mkdir(parents=True, exist_ok=True)
        _file().write_text("\n".join(paths), encoding="utf-8")
    except OSError:
        return  # nor is one that cannot be written a reason to fail at the end
