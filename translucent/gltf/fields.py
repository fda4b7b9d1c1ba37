"""Checked values of a glTF file's JSON, and the common form of its errors."""

from __future__ import annotations

import math

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.gltf.file import GltfFile, Json


def refused(file: GltfFile, found: str, do: str = "export the file again") -> InputError:
    """Error for a file that cannot be read as a scene."""
    return InputError(f"glTF {str(file.path)!r}", found, do)


def label(items: list[Json], index: int) -> str:
    """Label of a list's item in messages: its name in quotes, or its index."""
    name = items[index].get("name")
    return repr(name) if isinstance(name, str) and name else f"number {index}"


def section(file: GltfFile, where: str, holder: Json, key: str) -> Json:
    """Object of `holder` under `key`; empty if it has none.

    Raises
    ------
    InputError
        If it is something else.
    """
    found = holder.get(key, {})
    if not isinstance(found, dict):
        raise refused(file, f"{where}: {key} is {found!r}, not an object")
    return found


def extension(file: GltfFile, where: str, holder: Json, name: str) -> Json:
    """Object of an extension of `holder`; empty if it is absent."""
    return section(file, where, section(file, where, holder, "extensions"), name)


def number(file: GltfFile, where: str, holder: Json, key: str, default: float | None = None) -> float:
    """Number of `holder`; raises `InputError` if it is not a number, or missing without a default."""
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refused(file, f"{where}: {key} is {value!r}, not a number")
    return float(value)


def share(file: GltfFile, where: str, holder: Json, key: str, default: float) -> float:
    """Number of `holder` in 0..1; raises `InputError` if it is not one."""
    value = number(file, where, holder, key, default)
    if not 0 <= value <= 1:
        raise refused(file, f"{where}: {key} {value:g} is not in 0..1", "mend the file")
    return value


def shares(file: GltfFile, where: str, holder: Json, key: str, default: tuple[float, ...]) -> Array:
    """Numbers in 0..1, as many as the default has; raises `InputError` otherwise."""
    values = numbers(file, where, holder, key, default)
    if not ((values >= 0) & (values <= 1)).all():
        raise refused(file, f"{where}: {key} {values.tolist()} is not in 0..1", "mend the file")
    return values


def whole(file: GltfFile, where: str, holder: Json, key: str, default: int | None = None) -> int:
    """Nonnegative integer of `holder`; raises `InputError` if it is not one."""
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise refused(file, f"{where}: {key} is {value!r}, not a whole number of 0 or more")
    return value


def numbers(file: GltfFile, where: str, holder: Json, key: str, default: tuple[float, ...]) -> Array:
    """Numbers, as many as the default has; raises `InputError` otherwise."""
    values = holder.get(key, list(default))
    if not isinstance(values, list) or len(values) != len(default):
        raise refused(file, f"{where}: {key} is {values!r}, not {len(default)} numbers")
    return np.array([number(file, where, {key: value}, key) for value in values])


Triple = tuple[float, float, float]


class Fields:
    """Reader of the checked values of one JSON object; errors go into `problems`."""

    def __init__(self, owner: object, where: str, problems: list[str]) -> None:
        self.problems = problems
        if not isinstance(owner, dict):
            problems.append(f"{where} is {owner!r}, not an object")
        self.values: Json = owner if isinstance(owner, dict) else {}

    def number(self, key: str, default: float, low: float, high: float = math.inf, *, above: bool = False) -> float:
        """A number in `low`..`high`; excluding `low` itself with `above`."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.problems.append(f"{key} is {value!r}, not a number")
            return default
        if not low <= value <= high or (above and value == low):
            allowed = f"above {low:g}" if above else f"{low:g} or more" if math.isinf(high) else f"in {low:g}..{high:g}"
            self.problems.append(f"{key} {value:g} is not {allowed}")
            return default
        return float(value)

    def triple(self, key: str, default: Triple) -> Triple:
        """Three numbers in 0..1."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != 3:
            self.problems.append(f"{key} is {value!r}, not three numbers")
            return default
        channels = Fields({f"{key}[{i}]": channel for i, channel in enumerate(value)}, key, self.problems)
        red, green, blue = (channels.number(f"{key}[{i}]", default[i], 0.0, 1.0) for i in range(3))
        return red, green, blue

    def pair(self, key: str, default: tuple[float, float]) -> tuple[float, float]:
        """Two numbers."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != 2:
            self.problems.append(f"{key} is {value!r}, not two numbers")
            return default
        parts = Fields({f"{key}[{i}]": part for i, part in enumerate(value)}, key, self.problems)
        return parts.number(f"{key}[0]", default[0], -math.inf), parts.number(f"{key}[1]", default[1], -math.inf)

    def whole(self, key: str, default: int) -> int:
        """A nonnegative integer."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.problems.append(f"{key} is {value!r}, not a whole number of 0 or more")
            return default
        return value


#: Largest number of names in a line.
FIRST = 3


class LeftOut:
    """Record of features left out: one line per kind, with the names of the objects concerned."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Record a loss; the same one again counts once."""
        self._names.setdefault(what, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Lines of text such as ``base color textures ('Label', 'Table', 'Wall' and 2 more)``."""
        return tuple(f"{what} ({_listed(list(names))})" for what, names in self._names.items())


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - FIRST} more" if len(names) > FIRST else ""
    return ", ".join(names[:FIRST]) + more
