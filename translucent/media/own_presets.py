"""Presets of the user: files in a folder, in the format of ``presets.toml``, to be saved and shared."""

from __future__ import annotations

import os
import re
from pathlib import Path

from translucent.errors import InputError
from translucent.files.folders import make_folder
from translucent.files.paths import write_text_atomically
from translucent.files.reading import read_text
from translucent.files.user_folders import config_folder
from translucent.media.preset import Preset
from translucent.media.preset_file import preset_text, read_good_presets

#: Group of own presets that name none.
OWN = "own"


def presets_folder() -> Path:
    """Folder of the user's own presets; it need not be there."""
    return config_folder() / "presets"


def read_own_presets(folder: Path | None = None) -> tuple[dict[str, Preset], list[InputError]]:
    """Presets in the .toml files of a folder, by name, and what is wrong with others: with its file and line.

    Parameters
    ----------
    folder : Path, optional
        Default: `presets_folder`. None are in a folder that is not there.

    Returns
    -------
    found : dict of Preset
        Of two with one name, the first is taken, in the order of the files' names.
    wrong : list of InputError
    """
    found: dict[str, Preset] = {}
    wrong: list[InputError] = []
    folder = folder or presets_folder()
    try:
        files = sorted(entry.path for entry in os.scandir(folder) if entry.name.lower().endswith(".toml"))
    except OSError:
        return {}, []
    for path in files:
        what = f"presets {path!r}"
        try:
            good, bad = read_good_presets(read_text(path, what), what)
        except InputError as error:
            wrong.append(error)
            continue
        wrong += bad
        for name, one in good.items():
            if name in found:
                wrong.append(InputError(what, f"[{name}] is in another file, too", "rename one of them"))
            found.setdefault(name, one)
    return found, wrong


def preset_name(words: str) -> str:
    """Name in lower_snake_case of what somebody calls a preset.

    Raises
    ------
    InputError
        If nothing is left, or it begins with a digit.
    """
    name = re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")
    if not re.match(r"[a-z]", name):
        raise InputError(f"preset {words!r}", "its name does not begin with a letter", "call it for example green jade")
    return name


def save_own_preset(one: Preset, folder: Path | None = None) -> Path:
    """Write a preset into a file of its name; one that is there is replaced.

    Raises
    ------
    InputError
        If the folder is none.
    RenderError
        If it cannot be written.
    """
    path = (folder or presets_folder()) / f"{one.name}.toml"
    make_folder(path.parent)
    write_text_atomically(path, preset_text(one))
    return path
