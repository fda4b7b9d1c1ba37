"""Library of named media, built-in and user presets; and tables of colors at distances."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from translucent.arguments import checked
from translucent.errors import LEAST_PART, InputError, close_names, did_you_mean
from translucent.files.paths import (
    config_folder,
    csv_text,
    make_folder,
    require_output,
    write_atomically,
    write_text_atomically,
)
from translucent.files.reading import read_text
from translucent.media.conversion import CLAMP, clamp_colors, html_strip, summary
from translucent.media.medium import Medium
from translucent.media.preset import Preset, Row, check_cells, preset_text, read_good_presets, read_presets, read_table
from translucent.units import metres_per_unit

#: Group of own presets that name none.
OWN = "own"


def presets_folder() -> Path:
    """Folder of the user's own presets; it need not be there."""
    return config_folder() / "presets"


def read_own_presets(folder: Path | None = None) -> tuple[dict[str, Preset], list[InputError]]:
    """Presets in the .toml files of a folder, by name, and errors of unreadable ones, with file and line.

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
                wrong.append(
                    InputError(
                        what, f"the preset [{name}] is also defined in another file", "rename one of these presets"
                    )
                )
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
        raise InputError(
            f"preset {words!r}", "the name of a preset must begin with a letter", "choose a name such as green jade"
        )
    return name


def save_own_preset(one: Preset, folder: Path | None = None) -> Path:
    """Write a preset into a file with its name; an existing file is replaced.

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
    """Presets by group, built-in ones first; user presets without a group are in the group `OWN`."""
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
    if broken := [error for error in wrong if re.search(rf"\[{key}\]|[/\\]{key}\.toml'", str(error))]:
        raise InputError(f"preset {name!r}", "your own preset of this name cannot be read", str(broken[0]))
    speaking = [one.name for one in _all().values() if _speaks_of(one, key)]
    close = close_names(key, [*_all(), *own]) or close_names(key, known) or speaking
    number = len(_all())
    do = (
        f"{did_you_mean(close)} 'translucent presets' lists all {number} presets"
        if close
        else f"use one of {', '.join(_WELL_KNOWN)} and {number - len(_WELL_KNOWN)} more, see 'translucent presets'"
    )
    unread = f"; one of your own presets could not be read: {wrong[0]}" if wrong else ""
    raise InputError(f"preset {name!r}", "no preset has this name", f"{do}{unread}")


@cache
def _all() -> dict[str, Preset]:
    return read_presets(files("translucent").joinpath("media/presets.toml").read_text(encoding="utf-8"))


@cache
def _names() -> dict[str, Preset]:
    return {name: one for one in _all().values() for name in (one.name, *one.aliases)}


def _words(one: Preset) -> list[str]:
    parts = (one.name, *one.aliases, one.group, one.kind, one.note, one.source)
    return re.findall(r"\w+", " ".join(parts).lower().replace("_", " "))


def _speaks_of(one: Preset, word: str) -> bool:
    """True if the note contains the word, as that of merlot contains wine."""
    return len(word) >= LEAST_PART and word in re.findall(r"[a-z]+", one.note.lower())


#: Largest number of rows in a table of swatches.
MOST_SHOWN = 30

_TRIPLES = ("color", "extinction", "mean_free_path", "half_value_thickness", "condition_number", "extinction_per_unit")


@dataclass(frozen=True)
class Batch:
    """Result of converting a table.

    Attributes
    ----------
    records : list of dict
        Per good row its name, and what `conversion.summary` says.
    errors : list of str
        Per bad row its location and what is wrong.
    clamped : int
        Records whose color was clamped.
    """

    records: list[dict[str, Any]]
    errors: list[str]
    clamped: int = 0

    def write(self, path: Path) -> None:
        """Write the records to a ``.json`` or ``.csv`` file, which appears complete or not at all."""
        check_batch_output(path)
        text = self.to_csv() if path.suffix.lower() == ".csv" else self.to_json()

        def fill(temporary: Path) -> None:
            temporary.write_text(text, encoding="utf-8", newline="")

        write_atomically(path, fill)

    def _repr_html_(self) -> str:
        """Names, swatches and errors, for notebooks; of long tables the first rows."""
        parts = [
            f"<div>{escape(one['name'])}</div>{html_strip(one['extinction'], one['distance'])}"
            for one in self.records[:MOST_SHOWN]
        ]
        if (more := len(self.records) - MOST_SHOWN) > 0:
            parts.append(f"<div>and {more} more</div>")
        return "".join([*parts, *(f"<div>error: {escape(line)}</div>" for line in self.errors[:MOST_SHOWN])])

    def to_json(self) -> str:
        """The records as a JSON list, one record per line; null is infinity."""
        return "[\n" + ",\n".join(json.dumps(record) for record in self.records) + "\n]\n"

    def to_csv(self) -> str:
        """The records as CSV: triples in columns ``_r``, ``_g``, ``_b``, warnings joined by `` | ``."""
        columns = ["name", "distance", "unit", *(f"{name}_{c}" for name in _TRIPLES for c in "rgb"), "warnings"]
        rows = []
        for record in self.records:
            triples = {
                f"{name}_{c}": "inf" if value is None else repr(value)
                for name in _TRIPLES
                for c, value in zip("rgb", record[name], strict=True)
            }
            rows.append({**record, **triples, "warnings": " | ".join(record["warnings"])})
        return csv_text(columns, rows)


def convert_table(path: str | Path, unit: str = "m", unit_out: str = "m", clamp: bool = False) -> Batch:
    """Convert every row of a table.

    Parameters
    ----------
    path : str or Path
        CSV with the columns ``name``, ``color``, ``distance`` and, if lengths name none, ``unit``; or a JSON list of
        objects with these keys, in which a color may also be a linear triple.
    unit : str
        Of distances for which neither they nor their row name one.
    unit_out : str
        The records also hold the extinction per this unit.
    clamp : bool
        Whether channels of 0 become 1e-4; a record's warnings say where it happened.

    Raises
    ------
    InputError
        If the table as a whole cannot be used.
    """
    metres_per_unit(unit), metres_per_unit(unit_out)
    records: list[dict[str, Any]] = []
    errors: list[str] = []
    clamped = 0
    for row in read_table(path, needs=[("name",), ("color",), ("distance",)]):
        try:
            record, changed = _record(row, unit, unit_out, clamp)
        except InputError as error:
            errors.append(f"{row.location}: {error}")
        else:
            records.append(record)
            clamped += changed
    return Batch(records, errors, clamped)


def check_batch_output(path: Path) -> None:
    """Raise before any work is done if a table could not be written to `path`."""
    if path.suffix.lower() not in (".json", ".csv"):
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .json or .csv")
    require_output(path, f"output {str(path)!r}")


def _record(row: Row, unit: str, unit_out: str, clamp: bool) -> tuple[dict[str, Any], bool]:
    """The record of a row, and whether its color was clamped."""
    check_cells(row)
    name, color = str(row.need("name")), row.color()
    distance = row.length("distance", str(row.cells.get("unit", unit)))
    lighter, channels = clamp_colors(color)
    changed = clamp and bool(channels.any())
    kept = lighter if changed else color
    medium = Medium.from_color(kept, distance)
    found = summary(kept, distance, medium.extinction, unit_out)
    if changed:
        found["warnings"].insert(0, f"channels of the color below {CLAMP:g} were set to {CLAMP:g}")
    return {"name": name, **found}, changed
