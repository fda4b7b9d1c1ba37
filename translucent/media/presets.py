"""Named media, from ``presets.toml``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from translucent.errors import InputError
from translucent.media.own_presets import OWN, read_own_presets
from translucent.media.preset import Preset
from translucent.media.preset_file import read_presets
from translucent.suggestions import LEAST_PART, close_names, did_you_mean

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
    """Presets of which names, aliases, groups, kinds, notes and sources have all of these words, or begin with them."""
    wanted = re.findall(r"\w+", words.lower().replace("_", " "))
    return {name: one for name, one in found.items() if all(any(w.startswith(x) for w in _words(one)) for x in wanted)}


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
