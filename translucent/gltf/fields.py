"""Checked values of a glTF file's JSON, and the common form of its errors."""

from __future__ import annotations

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
