"""Library of materials and environments to choose from."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from translucent.errors import InputError
from translucent.media.preset import Preset
from translucent.media.presets import (
    OWN,
    grouped,
    matching,
    preset_name,
    presets,
    presets_folder,
    read_own_presets,
    save_own_preset,
)
from translucent.preview.document import Material
from translucent.preview.scenes import medium_of
from translucent.scene.environment_files import READERS

#: Seconds between checks whether files of own presets have changed.
WATCH = 1.0

#: Source of presets that are saved here.
SAVED = "saved in the previewer"


class Library:
    """Library of materials.

    Parameters
    ----------
    refuse : callable
        Is told what is wrong with files of own presets, once.
    folder : Path, optional
        Of own presets. Default: `presets_folder`.

    Attributes
    ----------
    search : str
        Words that presets on show have.
    """

    def __init__(self, refuse: Callable[[Exception], None], folder: Path | None = None) -> None:
        self.search = ""
        self.folder = folder or presets_folder()
        self._refuse = refuse
        self._own: dict[str, Preset] = {}
        self._found: dict[str, list[Preset]] = {}
        self._searched: str | None = None
        self._checked = -WATCH
        self._files: object = None

    def groups(self) -> dict[str, list[Preset]]:
        """Presets with the words of the search, by their groups; own ones are read again when their files change."""
        self._refresh()
        if self._searched != self.search:
            self._found, self._searched = grouped(matching(self._own | presets(), self.search)), self.search
        return self._found

    def find(self, name: str) -> Preset | None:
        """Preset of a name; None if it is gone."""
        self._refresh()
        return presets().get(name) or self._own.get(name)

    def save(self, words: str, material: Material) -> tuple[Path, list[str]]:
        """Save a material as an own preset, and return its file and what no preset keeps.

        Raises
        ------
        InputError
            If there is no name, or one of the toolkit's presets has it.
        RenderError
            If it cannot be written.
        """
        name = preset_name(words)
        if name in presets():
            raise InputError(f"preset {name!r}", "one of the toolkit's has that name", "choose another")
        medium = medium_of(material)
        g = float(medium.anisotropy)
        source = f"{SAVED}, after {material.preset}" if material.preset else SAVED
        one = Preset(name, medium, "estimated", source, "", (), (g, g, g), False, material.roughness, OWN)
        path = save_own_preset(one, self.folder)
        self._checked = -WATCH
        return path, material.unsaid

    def _refresh(self) -> None:
        if time.monotonic() - self._checked < WATCH:
            return
        self._checked = time.monotonic()
        if (files := _files(self.folder)) == self._files:
            return
        self._files, self._searched = files, None
        self._own, wrong = read_own_presets(self.folder)
        for error in wrong:
            self._refuse(error)


def _files(folder: Path) -> list[tuple[str, int, int]]:
    try:
        with os.scandir(folder) as entries:
            return sorted((e.name, e.stat().st_mtime_ns, e.stat().st_size) for e in entries if e.is_file())
    except OSError:
        return []


#: Names of built-in environments, colors among them; empty: the stage's, or the model's own.
BUILT_IN = ("", "light-table", "studio", "checkerboard", "#ffffff", "#404040")

#: Suffixes of files that are listed: those of pictures that hold light. Others can be opened.
ENVIRONMENT_SUFFIXES = (".hdr", ".exr", ".pic")

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
                names = sorted(name for name in os.listdir(self.path) if name.lower().endswith(ENVIRONMENT_SUFFIXES))
                self._listed = key, [os.path.join(self.path, name) for name in names[:MOST_FILES]]
                self.problem = "" if names else f"{self.path}: no {', '.join(ENVIRONMENT_SUFFIXES)} is here"
        except OSError as error:
            self.problem = f"{self.path}: {error.strerror}"
            return []
        return self._listed[1]


def title(name: str) -> str:
    """Name that a user reads."""
    return Path(name).stem if Path(name).suffix.lower() in READERS else name or "own"
