"""Environments to choose from: the built-in ones, and the pictures of all directions in a folder."""

from __future__ import annotations

import os
from pathlib import Path

from translucent.scene.environment_files import READERS

#: Names of built-in environments, colors among them; empty: the stage's, or the model's own.
BUILT_IN = ("", "light-table", "studio", "checkerboard", "#ffffff", "#404040")

#: Suffixes of files that are listed: those of pictures that hold light. Others can be opened.
SUFFIXES = (".hdr", ".exr", ".pic")

#: Largest number of files that are listed.
MOST_FILES = 5000


class EnvironmentFolder:
    """Folder with environments.

    Attributes
    ----------
    path : str
        Of the folder, or nothing.
    problem : str
        Why nothing is listed, or nothing.
    """

    def __init__(self) -> None:
        self.path = self.problem = ""
        self._listed: tuple[object, list[str]] | None = None

    def take(self, path: str) -> None:
        """Show the environments beside a file, or in a folder."""
        if Path(path).suffix.lower() in READERS or os.path.isfile(path):
            path = str(Path(path).parent)
        self.path, self._listed = path, None

    def files(self) -> list[str]:
        """Paths of the files, by name; listed again when the folder changes."""
        if not self.path:
            return []
        try:
            key = os.stat(self.path).st_mtime_ns
            if self._listed is None or self._listed[0] != key:
                names = sorted(name for name in os.listdir(self.path) if name.lower().endswith(SUFFIXES))
                self._listed = key, [os.path.join(self.path, name) for name in names[:MOST_FILES]]
                self.problem = "" if names else f"{self.path}: no {', '.join(SUFFIXES)} is here"
        except OSError as error:
            self.problem = f"{self.path}: {error.strerror}"
            return []
        return self._listed[1]


def title(name: str) -> str:
    """Name that a user reads."""
    return Path(name).stem if Path(name).suffix.lower() in READERS else name or "own"
