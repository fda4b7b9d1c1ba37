"""Presets as text: the format that the head of ``presets.toml`` describes, read and written."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import cast

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import toml_value
from translucent.media.medium import Medium
from translucent.media.preset import Kind, Preset, Triple
from translucent.units import metres_per_unit, parse_length

_ALWAYS = {"kind", "source", "ior"}
_OPTIONAL = {"group", "note", "aliases", "roughness"}
_BY_COLOR = {"color", "distance"}
_BY_COEFFICIENTS = {"unit", "absorption"}
_UNREDUCED = {"scattering", "anisotropy"}
_KNOWN = _ALWAYS | _OPTIONAL | _BY_COLOR | _BY_COEFFICIENTS | _UNREDUCED | {"reduced_scattering", "emission"}


def read_presets(text: str, file: str = "presets.toml") -> dict[str, Preset]:
    """Presets of a TOML text; the head of ``presets.toml`` describes the format.

    Parameters
    ----------
    text : str
    file : str
        What errors call it.

    Raises
    ------
    InputError
        If an entry lacks a key, has an unknown one or a value of the wrong type, or a name is given twice.
    """
    found = {name: _Entry(file, name, entry).preset() for name, entry in _entries(text, file).items()}
    taken = set(found)
    for one in found.values():
        for alias in one.aliases:
            if alias in taken:
                raise InputError(f"{file}, [{one.name}]", f"alias {alias!r} is a name already", "choose another")
            taken.add(alias)
    return found


def read_good_presets(text: str, file: str) -> tuple[dict[str, Preset], list[InputError]]:
    """Presets of a TOML text that can be read, and what is wrong with the others, each with its line."""
    found: dict[str, Preset] = {}
    wrong = []
    try:
        entries = _entries(text, file)
    except InputError as error:
        return {}, [error]
    for name, entry in entries.items():
        try:
            found[name] = _Entry(file, name, entry).preset()
        except InputError as error:
            line = _line(text, name, str(error).partition("; ")[2])
            wrong.append(InputError(f"{file}, line {line}, {str(error).removeprefix(f'{file}, ')}"))
    return found, wrong


def preset_text(one: Preset) -> str:
    """Text of an entry, which `read_presets` reads."""
    medium = one.medium
    values: dict[str, object] = {"kind": one.kind}
    values |= {"group": one.group} if one.group else {}
    values |= {"source": one.source, "unit": "m", "absorption": one.absorption.tolist()}
    if one.reduced:
        values |= {"reduced_scattering": one.scattering.tolist()}
    elif medium.scatters:
        values |= {"scattering": one.scattering.tolist(), "anisotropy": list(one.channel_anisotropy)}
    emission = np.asarray(medium.emission, dtype=np.float64).tolist()
    values |= {"emission": emission} if any(emission) else {}
    values |= {"ior": float(medium.ior)}
    values |= {"roughness": one.roughness} if one.roughness else {}
    values |= {"note": one.note} if one.note else {}
    values |= {"aliases": list(one.aliases)} if one.aliases else {}
    # JSON's numbers, lists and strings are TOML's.
    return "\n".join([f"[{one.name}]", *(f"{key} = {_toml(value)}" for key, value in values.items()), ""])


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _entries(text: str, file: str) -> dict[str, object]:
    try:
        return toml_value(text)
    except ValueError as error:
        raise InputError(file, f"no TOML: {error}", "correct the file") from None


def _line(text: str, name: str, reason: str) -> int:
    """Number of the line of an entry that a reason speaks of: that of its key, or the entry's first."""
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if re.match(rf"\s*\[?{re.escape(name)}\b", line)]
    first = heads[0] if heads else 0
    for i in range(first + 1, len(lines)):
        if lines[i].lstrip().startswith("["):
            break
        key = lines[i].partition("=")[0].strip()
        if key and re.search(rf"\b{re.escape(key)}\b", reason.partition("; ")[0]):
            return i + 1
    return first + 1


class _Entry:
    """Reader of one table of the file, key by key."""

    def __init__(self, file: str, name: str, entry: object) -> None:
        self.where, self.name = f"{file}, [{name}]", name
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
            raise InputError(self.where, "not a name in lower_snake_case", "write for example skim_milk")
        if not isinstance(entry, Mapping):
            raise InputError(self.where, "not a table", f"write [{name}], and its keys below")
        self.entry: Mapping[str, object] = entry
        self._check_keys()

    def _check_keys(self) -> None:
        given = set(self.entry)
        for key in sorted(given - _KNOWN):
            close = get_close_matches(key, sorted(_KNOWN), n=1)
            do = f"did you mean {close[0]!r}?" if close else f"use some of {', '.join(sorted(_KNOWN))}"
            raise InputError(self.where, f"unknown key {key!r}", do)
        if given & _BY_COLOR:
            self._check_by_color(given)
            return
        if "reduced_scattering" in given:
            self._exclude(given & _UNREDUCED, "reduced_scattering")
        self._require(_ALWAYS | _BY_COEFFICIENTS | ({"scattering"} if "anisotropy" in given else set()), given)

    def _check_by_color(self, given: set[str]) -> None:
        self._exclude(given & {"absorption"}, "color")
        for key in sorted(given & _UNREDUCED):
            do = "give 'reduced_scattering', sigma_s (1 - g), in its place"
            raise InputError(self.where, f"{key!r} beside 'color'", do)
        per_length = bool(given & {"reduced_scattering", "emission"})
        if "unit" in given and not per_length:
            raise InputError(
                self.where, "'unit' beside 'color'", "leave it out: 'distance' has its own; only scattering needs one"
            )
        self._require(_ALWAYS | _BY_COLOR | ({"unit"} if per_length else set()), given)

    def _exclude(self, keys: set[str], other: str) -> None:
        for key in sorted(keys):
            raise InputError(self.where, f"both {key!r} and {other!r}", "give one or the other")

    def _require(self, keys: set[str], given: set[str]) -> None:
        for key in sorted(keys - given):
            raise InputError(self.where, f"no key {key!r}", "add it")

    def preset(self) -> Preset:
        """The preset that the table describes."""
        kind = self._text("kind")
        if kind not in ("measured", "estimated"):
            raise self._wrong("kind", '"measured" or "estimated"')
        anisotropy = self._triple("anisotropy") if "anisotropy" in self.entry else (0.0, 0.0, 0.0)
        try:
            medium = self._medium(anisotropy)
        except InputError as error:
            if str(error).startswith(self.where):
                raise
            raise InputError(self.where, str(error)) from None
        return Preset(
            self.name,
            medium,
            cast(Kind, kind),
            self._text("source"),
            self._text("note") if "note" in self.entry else "",
            self._names("aliases") if "aliases" in self.entry else (),
            anisotropy,
            "reduced_scattering" in self.entry,
            self._roughness(),
            self._text("group") if "group" in self.entry else "",
        )

    def _medium(self, anisotropy: Triple) -> Medium:
        ior = self._number("ior", self.entry["ior"])
        for g in anisotropy:
            if not -1 < g < 1:
                raise self._wrong("anisotropy", "between -1 and 1")
        key = "reduced_scattering" if "reduced_scattering" in self.entry else "scattering"
        scattering = self._per_metre(key) if key in self.entry else np.zeros(3)
        with np.errstate(over="ignore", invalid="ignore"):  # a medium refuses what is not finite
            total = float(scattering.sum())
            mean = float(scattering @ np.array(anisotropy)) / total if total > 0 else 0.0
        emission = self._per_metre("emission") if "emission" in self.entry else np.zeros(3)
        return Medium(self._absorption(), scattering, emission, mean, ior)

    def _absorption(self) -> Array:
        """sigma_a in 1/m."""
        if "color" not in self.entry:
            return self._per_metre("absorption")
        clear = Medium.from_color(self._triple("color"), self._distance())
        return np.asarray(clear.absorption, dtype=np.float64)

    def _distance(self) -> float:
        """Metres."""
        if not isinstance(self.entry["distance"], str):
            raise self._wrong("distance", 'a length with its unit, for example "1cm"')
        return parse_length(self._text("distance"))

    def _per_metre(self, key: str) -> Array:
        """Coefficients in 1/m; infinite beyond the numbers there are."""
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            return np.asarray(np.array(self._triple(key)) * (1.0 / metres_per_unit(self._text("unit"))))

    def _roughness(self) -> float:
        if "roughness" not in self.entry:
            return 0.0
        if not 0.0 <= (roughness := self._number("roughness", self.entry["roughness"])) <= 1.0:
            raise self._wrong("roughness", "0 (polished) to 1")
        return roughness

    def _text(self, key: str) -> str:
        value = self.entry[key]
        if not (isinstance(value, str) and value.strip()):
            raise self._wrong(key, "a text")
        return value

    def _names(self, key: str) -> tuple[str, ...]:
        value = self.entry[key]
        if not (isinstance(value, list) and all(isinstance(v, str) for v in value)):
            raise self._wrong(key, "a list of names")
        return tuple(value)

    def _number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._wrong(key, "a number")
        return float(value)

    def _triple(self, key: str) -> Triple:
        value = self.entry[key]
        if not (isinstance(value, list) and len(value) == 3):
            raise self._wrong(key, "three numbers [r, g, b]")
        r, g, b = (self._number(key, v) for v in value)
        return r, g, b

    def _wrong(self, key: str, do: str) -> InputError:
        return InputError(self.where, f"{key} = {self.entry[key]!r}", f"give {do}")
