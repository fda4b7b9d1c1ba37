"""Files that the previewer keeps: sessions as TOML, and what one window leaves to the next."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from translucent.errors import InputError
from translucent.extras import require_package
from translucent.files.paths import config_folder, write_atomically
from translucent.files.reading import read_text, toml_value
from translucent.planning.flags import Flags
from translucent.preview.document import (
    AUTO,
    SECTIONS,
    STAGE_WORDS,
    Assigned,
    Document,
    Export,
    Material,
    Orbit,
    Placed,
    Snapshot,
    checked,
)

#: Version of the format, raised by changes that older readers cannot read.
VERSION = 1

#: Largest numbers of files and of folders that are remembered.
MAX_RECENT = 8

#: Keys of older sessions without a meaning now: ``display.scattering`` replaces a switch of the material.
_FORMER = {"material": ("multiple_scattering",)}

_SECTIONS = ("model", "material", "look", "display", "flags", "orbit", "export")

#: Names of the fields in lists.
_LISTS = {"placed": "placed", "lights": "light"}


def to_table(document: Document) -> dict[str, Any]:
    """Document as values that TOML can hold."""
    table: dict[str, Any] = {"version": VERSION}
    for section in _SECTIONS:
        value = getattr(document, section)
        if value is not None and value not in (Flags(), Export()):
            table[section] = {k: v for k, v in dataclasses.asdict(value).items() if v is not None}
    if document.assigned:
        table["assigned"] = [dataclasses.asdict(one) for one in document.assigned]
    if document.hidden:
        table["hidden"] = list(document.hidden)
    for name in _LISTS:
        if entries := getattr(document, name):
            table[name] = [dataclasses.asdict(one) for one in entries]
    if document.snapshots:
        table["snapshots"] = [{"name": one.name, **to_table(one.document)} for one in document.snapshots]
    return table


def from_table(table: dict[str, Any], where: str) -> Document:
    """Document of a session's TOML table; absent fields have their defaults, and fields of older versions are ignored.

    Raises
    ------
    InputError
        If something in it is unknown, or out of its range.
    """
    if table.get("version") != VERSION:
        raise InputError(
            where, f"the session has version {table.get('version')!r}", f"use a session of version {VERSION}"
        )
    sections: dict[str, Any] = {}
    if not isinstance(table.get("assigned", []), list):
        raise InputError(where, "'assigned' is not a list", "write [[assigned]] before each entry")
    for section, fields in table.items():
        if section == "assigned":
            sections[section] = tuple(_assigned(entry, where) for entry in fields)
        elif section == "hidden":
            sections[section] = _hidden(fields, where)
        elif section in _LISTS:
            sections[section] = tuple(_listed(section, entry, where) for entry in _tables(section, fields, where))
        elif section == "snapshots":
            sections[section] = tuple(_snapshot(entry, where) for entry in _tables(section, fields, where))
        elif section in _SECTIONS and isinstance(fields, dict):
            default = Orbit() if section == "orbit" else getattr(Document(), section)
            sections[section] = dataclasses.replace(default, **_fields(section, default, fields, where))
        elif section != "version":
            raise InputError(where, f"the section [{section}] is unknown", f"use {', '.join(_SECTIONS)}")
    return Document(**sections)


def _assigned(entry: Any, where: str) -> Assigned:
    number = entry.get("object") if isinstance(entry, dict) else None
    fields = entry.get("material") if isinstance(entry, dict) else None
    if type(number) is not int or number < 0 or not isinstance(fields, dict) or len(entry) != 2:
        raise InputError(
            f"{where}, [[assigned]]",
            "the entry names no object and no material",
            "add object = 0, and [assigned.material]",
        )
    return Assigned(number, dataclasses.replace(Material(), **_fields("material", Material(), fields, where)))


def _tables(section: str, entries: Any, where: str) -> list[dict[str, Any]]:
    if not isinstance(entries, list) or not all(isinstance(one, dict) for one in entries):
        raise InputError(where, f"{section} is not a list of tables", f"write [[{section}]] before each entry")
    return entries


def _listed(section: str, entry: dict[str, Any], where: str) -> Any:
    kind = SECTIONS[_LISTS[section]]
    fields = dict(entry)
    number = fields.pop("object", 0) if kind is Placed else 0
    if type(number) is not int or number < 0:
        raise InputError(
            f"{where}, [[{section}]]", f"object = {number!r}", "give the number of an object, counted from 0"
        )
    found = dataclasses.replace(kind(), **_fields(_LISTS[section], kind(), fields, where))
    return dataclasses.replace(found, object=number) if isinstance(found, Placed) else found


def _snapshot(entry: dict[str, Any], where: str) -> Snapshot:
    fields = dict(entry)
    name = fields.pop("name", None)
    if not isinstance(name, str) or not name or "snapshots" in fields:
        raise InputError(
            f"{where}, [[snapshots]]",
            "a snapshot has no name, or contains other snapshots",
            "give each snapshot a name",
        )
    return Snapshot(name, from_table(fields, f"{where}, snapshot {name}"))


def _hidden(numbers: Any, where: str) -> tuple[int, ...]:
    if not isinstance(numbers, list) or not all(type(one) is int and one >= 0 for one in numbers):
        raise InputError(where, f"hidden = {numbers!r}", "give a list of object numbers, such as [0, 2]")
    return tuple(sorted(set(numbers)))


def _fields(section: str, default: Any, fields: dict[str, Any], where: str) -> dict[str, Any]:
    found = {}
    for key, value in fields.items():
        if key in _FORMER.get(section, ()):
            continue
        if key not in default.__dataclass_fields__:
            raise InputError(f"{where}, [{section}]", f"the key {key!r} is unknown", "check the spelling")
        try:
            found[key] = checked(f"{section}.{key}", value, getattr(default, key))
        except InputError as error:
            raise InputError(where, str(error)) from None
    return found


def save_session(path: str | Path, document: Document) -> None:
    """Write a document atomically.

    Raises
    ------
    RenderError
        If the file cannot be written, or the package that writes TOML is missing.
    """
    tomli_w = require_package("tomli_w", f"session {str(path)!r}")
    text = tomli_w.dumps(to_table(document))

    def write(file: Path) -> None:
        file.write_text(text, encoding="utf-8")

    write_atomically(Path(path), write)


def load_session(path: str | Path) -> Document:
    """Read a document.

    Raises
    ------
    InputError
        If there is no such file, or it is no session.
    """
    what = f"session {str(path)!r}"
    return from_table(read_toml(path, what), what)


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Read the table in a file; errors name it `what`."""
    text = read_text(path, what)
    try:
        return toml_value(text)
    except ValueError as error:
        raise InputError(what, f"the file is not valid TOML: {error}", "correct the file") from None


def put_first(one: str, others: Sequence[str]) -> list[str]:
    """Recent files or folders after one more has been used, the latest first."""
    return [one, *(other for other in others if other != one)][:MAX_RECENT]


@dataclass(frozen=True)
class Preferences:
    """Choices that one window leaves to the next, each in a text file of the user's folder.

    Attributes
    ----------
    recent : list of str
        Recently opened files, the latest first.
    folders : list of str
        Folders in which files were used last.
    environments : str
        Folder of environments, or nothing.
    stage : str
        Stage of the last window; at first, the choice of ``translucent render``.
    """

    recent: list[str] = field(default_factory=list)
    folders: list[str] = field(default_factory=list)
    environments: str = ""
    stage: str = AUTO

    @classmethod
    def read(cls) -> Preferences:
        """Read the preferences, without files and folders that are gone."""

        def lines(name: str) -> list[str]:
            try:
                return (config_folder() / f"{name}.txt").read_text(encoding="utf-8").splitlines()
            except (OSError, UnicodeDecodeError):
                return []  # a file that cannot be read is no reason not to start

        return cls(
            list(filter(os.path.exists, lines("recent"))),
            list(filter(os.path.isdir, lines("folders"))),
            next(filter(os.path.isdir, lines("environments")), ""),
            next((line for line in lines("stage")[:1] if line in STAGE_WORDS), AUTO),
        )

    def write(self) -> None:
        """Write the preferences, if possible."""
        with suppress(OSError):  # nor is a file that cannot be written a reason to fail at the end
            config_folder().mkdir(parents=True, exist_ok=True)
            for name, value in dataclasses.asdict(self).items():
                text = "\n".join([value] if isinstance(value, str) else value)
                (config_folder() / f"{name}.txt").write_text(text, encoding="utf-8")
