"""Folders of the user, where the system expects settings and what can be made again."""

from __future__ import annotations

import os
import sys
from pathlib import Path

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
