"""Preferences that one window leaves to the next: recently opened files and used folders, and the stage."""

from __future__ import annotations

import os
from pathlib import Path

from translucent.files.user_folders import config_folder
from translucent.preview.document import AUTO, STAGE_WORDS


def _file(name: str) -> Path:
    return config_folder() / name


def _read(name: str) -> list[str]:
    try:
        return _file(name).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []  # a file that cannot be read is no reason not to start


def _write(name: str, lines: list[str]) -> None:
    try:
        _file(name).parent.mkdir(parents=True, exist_ok=True)
        _file(name).write_text("\n".join(lines), encoding="utf-8")
    except OSError:
        return  # nor is one that cannot be written a reason to fail at the end


def read_recent() -> list[str]:
    """Read recent paths, the latest first; those that are gone are left out. None where there is no such list."""
    return [line for line in _read("recent.txt") if os.path.exists(line)]


def write_recent(paths: list[str]) -> None:
    """Write the list, if possible."""
    _write("recent.txt", paths)


def read_folders() -> list[str]:
    """Read the folders in which files were used last; those that are gone are left out."""
    return [line for line in _read("folders.txt") if os.path.isdir(line)]


def write_folders(folders: list[str]) -> None:
    """Write the list, if possible."""
    _write("folders.txt", folders)


def read_environments() -> str:
    """Read the folder of environments; empty if there is none."""
    return next((line for line in _read("environments.txt") if os.path.isdir(line)), "")


def write_environments(folder: str) -> None:
    """Write it, if possible."""
    _write("environments.txt", [folder])


def read_stage() -> str:
    """Read the stage of the last window; at first, the one that ``translucent render`` would take."""
    lines = _read("stage.txt")
    return lines[0] if lines and lines[0] in STAGE_WORDS else AUTO


def write_stage(stage: str) -> None:
    """Write it, if possible."""
    _write("stage.txt", [stage])
