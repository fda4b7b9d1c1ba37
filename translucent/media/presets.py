"""The library of named media: those of the toolkit, and files of the user's own."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from translucent.arguments import checked
from translucent.errors import LEAST_PART, InputError, close_names, did_you_mean
from translucent.files.paths import config_folder, make_folder, write_text_atomically
from translucent.files.reading import read_text
from translucent.media.preset import Preset, preset_text, read_good_presets, read_presets

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
    """Name of a preset in lower_snake_case, from free text.

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


_WELL_KNOWN = ("marble", "skim_milk", "merlot", "honey", "jade")


def presets() -> dict[str, Preset]:
    """All presets by name, without their aliases."""
    return dict(_all())


def grouped(found: Mapping[str, Preset]) -> dict[str, list[Preset]]:
    """Presets by their groups, those of the toolkit first; what has no group is among the user's own."""
    order = dict.fromkeys(one.group for one in _all().values())
    groups: dict[str, list[Preset]] = {group: [] for group in sorted(order)}
    for one in found.values():
        groups.setdefault(one.group or OWN, []).append(one)
    return {group: members for group, members in groups.items() if members}


def matching(found: Mapping[str, Preset], words: str) -> dict[str, Preset]:
    """Presets whose names, aliases, groups, types, notes or sources have all of these words, or words that begin so.

    Those of that name come first, then names that have the words, then aliases, notes, and all others.
    """
    searched = re.findall(r"\w+", words.lower().replace("_", " "))

    def have(texts: Iterable[str]) -> bool:
        begun = re.findall(r"\w+", " ".join(texts).lower().replace("_", " "))
        return all(any(word.startswith(one) for word in begun) for one in searched)

    def rank(one: Preset) -> int:
        key = "_".join(searched)
        named = key == one.name, key in one.aliases
        where = (*named, *map(have, ([one.name], one.aliases, [one.note])))
        return next((i for i, so in enumerate(where) if so), len(where))

    matched = [one for one in found.values() if have([*_words(one)])]
    return {one.name: one for one in sorted(matched, key=rank)}


@checked
def preset(name: str) -> Preset:
    """Preset of this name or alias, in any case and with any separators, or the user's own one of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    known = _names()
    key = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if key in known:
        return known[key]
    own, wrong = read_own_presets()
    if key in own:
        return own[key]
    if broken := [error for error in wrong if _is_about(error, key)]:
        raise InputError(f"preset {name!r}", "yours cannot be read", str(broken[0]))
    speaking = [one.name for one in _all().values() if _speaks_of(one, key)]
    close = close_names(key, [*_all(), *own]) or close_names(key, known) or speaking
    number = len(_all())
    do = (
        f"{did_you_mean(close)} 'translucent presets' lists all {number}"
        if close
        else f"use one of {', '.join(_WELL_KNOWN)} and {number - len(_WELL_KNOWN)} more, see 'translucent presets'"
    )
    unread = f"; your own are not all read: {wrong[0]}" if wrong else ""
    raise InputError(f"preset {name!r}", "not a known preset", f"{do}{unread}")


@cache
def _all() -> dict[str, Preset]:
    return read_presets(files("translucent").joinpath("media/presets.toml").read_text(encoding="utf-8"))


@cache
def _names() -> dict[str, Preset]:
    return {name: one for one in _all().values() for name in (one.name, *one.aliases)}


def _words(one: Preset) -> list[str]:
    parts = (one.name, *one.aliases, one.group, one.kind, one.note, one.source)
    return re.findall(r"\w+", " ".join(parts).lower().replace("_", " "))


def _is_about(error: InputError, key: str) -> bool:
    """True where an own preset of this name is wrong: an entry, or the file called so."""
    return re.search(rf"\[{key}\]|[/\\]{key}\.toml'", str(error)) is not None


def _speaks_of(one: Preset, word: str) -> bool:
    """True if the note contains the word, as that of merlot contains wine."""
    return len(word) >= LEAST_PART and word in re.findall(r"[a-z]+", one.note.lower())
