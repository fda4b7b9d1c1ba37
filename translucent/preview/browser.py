"""File browser without a window: a folder's files of some kinds, and the path that is chosen."""

from __future__ import annotations

import fnmatch
import os
from dataclasses import dataclass, field
from pathlib import Path

#: Largest number of entries of a folder that are listed.
MOST_ENTRIES = 20_000


@dataclass(frozen=True)
class Entry:
    """File or folder in a list."""

    name: str
    is_folder: bool


@dataclass
class Browser:
    """File browser.

    Attributes
    ----------
    kind : str
        Which question it answers, one of `translucent.preview.dialogs.QUESTIONS`.
    title : str
    patterns : tuple of str
        Of names of files, such as ``*.glb``.
    saves : bool
        Whether a file is to be written.
    folder : Path
        Folder on show.
    text : str
        In the field: the name of a file, or a path.
    every : bool
        Whether files of all kinds are listed.
    problem : str
        Why the text was not accepted, or the folder cannot be listed.
    replaced : str
        File that is replaced if the user confirms it.
    """

    kind: str
    title: str
    patterns: tuple[str, ...]
    saves: bool
    folder: Path
    text: str = ""
    every: bool = False
    problem: str = ""
    replaced: str = ""
    _listed: tuple[object, list[Entry]] | None = field(default=None, repr=False)

    def entries(self) -> list[Entry]:
        """Folders and files of the folder on show, in the order of their names; listed again when it changes."""
        try:
            key = self.folder, self.every, self.folder.stat().st_mtime_ns
        except OSError as error:
            self.problem = f"{self.folder}: {error.strerror}"
            return []
        if self._listed is None or self._listed[0] != key:
            self._listed = key, self._list()
        return self._listed[1]

    def enter(self, folder: str | Path) -> None:
        """Show another folder; one that is none is told."""
        found = Path(os.path.normpath(self.folder / Path(folder).expanduser()))
        if not found.is_dir():
            self.problem = f"{found}: no such folder"
            return
        self.folder, self.problem, self.replaced = found, "", ""

    def accept(self) -> str | None:
        """Path of the file that the text names; None if there is none yet: it names a folder, or is to be confirmed."""
        self.problem = ""
        text = self.text.strip()
        if not text or "\0" in text:
            return None
        path = Path(os.path.normpath(self.folder / Path(text).expanduser()))
        if path.is_dir():
            self.enter(path)
            self.text = ""
            return None
        if not self.saves:
            if not path.is_file():
                self.problem = f"{path.name}: no such file"
                return None
            return str(path)
        if not path.suffix and self.patterns and "." in self.patterns[0]:
            path = path.with_name(path.name + self.patterns[0].removeprefix("*"))
        if not path.parent.is_dir():
            self.problem = f"{path.parent}: no such folder"
            return None
        if path.exists() and self.replaced != str(path):
            self.replaced = str(path)
            self.problem = f"{path.name} is there; press Replace to write over it"
            return None
        return str(path)

    @property
    def button(self) -> str:
        """Label of the button that accepts."""
        if self.replaced and self.replaced.startswith(str(self.folder / Path(self.text.strip() or "."))):
            return "Replace"
        return "Save" if self.saves else "Open"

    def _list(self) -> list[Entry]:
        found = []
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    if entry.name.startswith("."):
                        continue
                    is_folder = _is_folder(entry)
                    if is_folder or self.every or self._fits(entry.name):
                        found.append(Entry(entry.name, is_folder))
                    if len(found) >= MOST_ENTRIES:
                        break
        except OSError as error:
            self.problem = f"{self.folder}: {error.strerror}"
        return sorted(found, key=lambda one: (not one.is_folder, one.name.lower(), one.name))

    def _fits(self, name: str) -> bool:
        return any(fnmatch.fnmatchcase(name.lower(), pattern) for pattern in self.patterns)


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def with_recent(folders: list[str], path: str | Path, most: int = 8) -> list[str]:
    """Recent folders after a file has been used, the latest first."""
    folder = str(Path(os.path.realpath(path)).parent)
    return [folder, *(one for one in folders if one != folder)][:most]
