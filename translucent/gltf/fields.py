"""Checked values of a glTF file's JSON, and the common form of its errors."""

from __future__ import annotations

import math
from typing import TypeVar, cast

from translucent.gltf.file import GltfFile, Json

Triple = tuple[float, float, float]
Numbers = TypeVar("Numbers", bound=tuple[float, ...])

_COUNTS = {2: "two", 3: "three", 4: "four"}

#: Largest number of names in a line.
FIRST = 3


def label(items: list[Json], index: int) -> str:
    """Label of a list's item in messages: its name in quotes, or its index."""
    name = items[index].get("name")
    return repr(name) if isinstance(name, str) and name else f"number {index}"


class JsonFields:
    """Checked values of one JSON object of a file, each with the default that it has where it is absent.

    Parameters
    ----------
    file : GltfFile
    where : str
        The object, as errors call it.
    values : dict
    problems : list of str, optional
        Gets what is wrong, and a wrong value has its default. Without it, an `InputError` is raised.
    """

    def __init__(self, file: GltfFile, where: str, values: Json, problems: list[str] | None = None) -> None:
        self.file, self.where, self.values, self.problems = file, where, values, problems

    def refuse(self, found: str, do: str = "export the file again") -> None:
        """Raise `InputError` for a value, or add it to the problems."""
        if self.problems is None:
            raise self.file.refused(f"{self.where}: {found}", do)
        self.problems.append(found)

    def section(self, key: str) -> JsonFields:
        """Object in the object; empty if it is absent."""
        found = self.values.get(key, {})
        if not isinstance(found, dict):
            self.refuse(f"{key} is {found!r}, not an object")
            found = {}
        return JsonFields(self.file, self.where, found, self.problems)

    def extension(self, name: str) -> JsonFields:
        """Object of an extension; empty if it is absent."""
        return self.section("extensions").section(name)

    def number(
        self,
        key: str,
        default: float | None = None,
        low: float = -math.inf,
        high: float = math.inf,
        *,
        above: bool = False,
    ) -> float:
        """A number in `low`..`high`, excluding `low` itself with `above`; without a default, it must be there."""
        value, default = self.values.get(key, default), default or 0.0
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(f"{key} is {value!r}, not a number")
            return default
        if not low <= value <= high or (above and value == low):
            allowed = f"above {low:g}" if above else f"{low:g} or more" if math.isinf(high) else f"in {low:g}..{high:g}"
            self.refuse(f"{key} {value:g} is not {allowed}", "mend the file")
            return default
        return float(value)

    def numbers(self, key: str, default: Numbers, low: float = -math.inf, high: float = math.inf) -> Numbers:
        """As many numbers as the default has, each in `low`..`high`."""
        found = self.values.get(key, list(default))
        if not isinstance(found, list) or len(found) != len(default):
            self.refuse(f"{key} is {found!r}, not {_COUNTS[len(default)]} numbers")
            return default
        parts = JsonFields(self.file, self.where, {f"{key}[{i}]": one for i, one in enumerate(found)}, self.problems)
        checked = (parts.number(f"{key}[{i}]", one, low, high) for i, one in enumerate(default))
        return cast(Numbers, tuple(checked))

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number of 0 or more; without a default, it must be there."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.refuse(f"{key} is {value!r}, not a whole number of 0 or more")
            return default or 0
        return value


class LeftOut:
    """Record of features left out: one line per kind, with the names of the objects concerned."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Record a loss; the same one again counts once."""
        self._names.setdefault(what, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Lines of text such as ``base color textures ('Label', 'Table', 'Wall' and 2 more)``."""
        lines = []
        for what, names in self._names.items():
            more = f" and {len(names) - FIRST} more" if len(names) > FIRST else ""
            lines.append(f"{what} ({', '.join(list(names)[:FIRST])}{more})")
        return tuple(lines)
