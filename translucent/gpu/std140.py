"""Uniform blocks and packed tables: NumPy dtypes are the single source of their layout, in Python and in GLSL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

#: GLSL type, size and alignment in bytes (std140) of a NumPy field. Other shapes are not used: std140 pads them oddly.
_TYPES: dict[tuple[str, tuple[int, ...]], tuple[str, int, int]] = {
    ("f", ()): ("float", 4, 4),
    ("i", ()): ("int", 4, 4),
    ("f", (2,)): ("vec2", 8, 8),
    ("f", (3,)): ("vec3", 12, 16),
    ("f", (4,)): ("vec4", 16, 16),
    ("f", (4, 4)): ("mat4", 64, 16),
}

_Fields: TypeAlias = tuple[tuple[str, str, tuple[int, ...]], ...]


@dataclass(frozen=True)
class UniformBlock:
    """A named uniform block at a fixed binding point.

    Parameters
    ----------
    name : str
        Name of the block in GLSL, and of its generated include, ``#include <name>``; after ``#include <name as other>``
        its fields are ``other.field``.
    binding : int
        Binding point, the same in every program.
    fields : tuple of (name, base, shape)
        base is "f4" or "i4"; shape one of (), (2,), (4,) or (4, 4), matrices in row-major order for column vectors;
        or (n, 4) with n > 4, an array of n vec4.
    """

    name: str
    binding: int
    fields: _Fields

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype with the offsets of std140."""
        return _std140(self.fields)

    @property
    def glsl(self) -> str:
        """Declaration for a shader."""
        return self.named("")

    def named(self, instance: str) -> str:
        """Declaration for a shader that calls the block so; without a name its fields are global."""
        members = "".join(
            f"    vec4 {name}[{shape[0]}];\n" if _is_array(shape) else f"    {_TYPES[base[0], shape][0]} {name};\n"
            for name, base, shape in self.fields
        )
        return f"layout(std140, row_major) uniform {self.name} {{\n{members}}}{f' {instance}' if instance else ''};\n"

    def pack(self, **values: npt.ArrayLike) -> bytes:
        """Bytes of the block with these values; every field must be given."""
        return _record(f"uniform block {self.name}", self.dtype, values).tobytes()


@dataclass(frozen=True)
class PackedTable:
    """Table of records in an RGBA32F texture, one record a row.

    Parameters
    ----------
    name : str
        Name of the struct in GLSL, and of its generated include, ``#include <name>``.
    sampler : str
        Name of the texture in GLSL; the function that reads a record is called so with ``_row`` behind.
    fields : tuple of (name, "f4", shape)
        shape is one of (), (2,), (3,) or (4,).
    """

    name: str
    sampler: str
    fields: _Fields

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Structured dtype with the offsets of std140, so that no field begins in one texel and ends in the next."""
        return _std140(self.fields)

    @property
    def glsl(self) -> str:
        """Declaration of struct and texture, and the function that reads a record."""
        members = "".join(f"    {_TYPES['f', shape][0]} {name};\n" for name, _, shape in self.fields)
        texels = range(self.dtype.itemsize // 16)
        fetched = "".join(f"    vec4 texel_{i} = texelFetch({self.sampler}, ivec2({i}, row), 0);\n" for i in texels)
        parts = []
        for (_, _, shape), offset in zip(self.fields, _offsets(self.fields)[0], strict=True):
            texel, first = divmod(offset // 4, 4)
            parts.append(f"texel_{texel}.{'xyzw'[first : first + int(np.prod(shape))]}")
        return (
            f"struct {self.name} {{\n{members}}};\nuniform sampler2D {self.sampler};\n"
            f"{self.name} {self.sampler}_row(int row) {{\n{fetched}    return {self.name}({', '.join(parts)});\n}}\n"
        )

    def pack(self, records: Sequence[Mapping[str, npt.ArrayLike]]) -> npt.NDArray[np.float32]:
        """(records, texels, 4): contents of the texture; every field of every record must be given."""
        packed = b"".join(_record(f"packed table {self.name}", self.dtype, record).tobytes() for record in records)
        return np.frombuffer(packed, np.float32).reshape(len(records), -1, 4)


def _offsets(fields: _Fields) -> tuple[list[int], int]:
    """Bytes at which std140 puts each field, and where the last one ends."""
    offset = 0
    offsets = []
    for _, base, shape in fields:
        size, alignment = (16 * shape[0], 16) if _is_array(shape) else _TYPES[base[0], shape][1:]
        offset = -(-offset // alignment) * alignment
        offsets.append(offset)
        offset += size
    return offsets, offset


def _std140(fields: _Fields) -> np.dtype[Any]:
    offsets, end = _offsets(fields)
    return np.dtype(
        {
            "names": [name for name, _, _ in fields],
            "formats": [(base, shape) for _, base, shape in fields],
            "offsets": offsets,
            "itemsize": -(-end // 16) * 16,
        }
    )


def _record(what: str, dtype: np.dtype[Any], values: Mapping[str, npt.ArrayLike]) -> npt.NDArray[Any]:
    record = np.zeros((), dtype=dtype)
    if values.keys() != set(dtype.names or ()):
        wrong = sorted(values.keys() ^ set(dtype.names or ()))
        raise KeyError(f"{what}: missing or unknown fields {wrong}")
    for name, value in values.items():
        record[name] = value
    return record


def _is_array(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and shape[0] > 4
