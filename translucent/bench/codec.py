"""Frozen dataclasses to JSON and back, with every field checked; arrays as compressed text."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import types
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.reading import json_value

#: Largest size of an unpacked array in bytes: a damaged file must not fill the memory.
_LARGEST = 1 << 28

T = TypeVar("T")


@dataclass(frozen=True)
class Packed:
    """Small array packed as text.

    Attributes
    ----------
    shape : (height, width)
    dtype : {"float16", "bool"}
    scale : float
        By which the stored values are multiplied: float16 alone would lose errors below 6e-8.
    data : str
        zlib-compressed, base64.
    """

    shape: tuple[int, int]
    dtype: Literal["float16", "bool"]
    scale: float
    data: str

    @classmethod
    def of(cls, array: npt.NDArray[Any]) -> Packed:
        """Pack booleans as they are, and floats as float16 with 5 of its 11 bits, relative to the largest."""
        height, width = array.shape
        if array.dtype == np.bool_:
            return cls((height, width), "bool", 1.0, _deflate(np.packbits(array).tobytes()))
        finite = np.isfinite(array)
        scale = float(np.max(np.abs(array), where=finite, initial=0.0)) or 1.0
        with np.errstate(under="ignore"):
            shares = np.where(finite, array / scale, np.nan).astype(np.float16)
        bits = shares.view(np.uint16)
        # A picture shows no more than some percent of an error, and zeros compress.
        rounded = np.where(np.isnan(shares), bits, bits & np.uint16(0xFFC0))
        return cls((height, width), "float16", scale, _deflate(rounded.tobytes()))

    def array(self) -> npt.NDArray[Any]:
        """(h, w) float64 or bool; raises `ValueError` if the text holds no such array."""
        height, width = self.shape
        size = -(-height * width // 8) if self.dtype == "bool" else 2 * height * width
        if not (height >= 0 and width >= 0 and size <= _LARGEST):
            raise ValueError(f"a shape of {height} x {width}")
        raw = zlib.decompressobj().decompress(base64.b64decode(self.data, validate=True), size + 1)
        if len(raw) != size:
            raise ValueError(f"a shape of {height} x {width} for {len(raw)} bytes of data")
        if self.dtype == "bool":
            bits = np.unpackbits(np.frombuffer(raw, np.uint8), count=height * width)
            return bits.reshape(height, width).astype(bool)
        return np.frombuffer(raw, np.float16).reshape(height, width).astype(np.float64) * self.scale

    def check(self) -> None:
        """Raise `ValueError` if the text holds no such array."""
        self.array()


def _deflate(raw: bytes) -> str:
    return base64.b64encode(zlib.compress(raw, 9)).decode("ascii")


def encode(value: Any) -> str:
    """JSON of a dataclass. Numbers that JSON has no word for are an error of ours."""
    return json.dumps(dataclasses.asdict(value), indent=1, allow_nan=False)


def decode(kind: type[T], text: str, name: str, file_format: str, version: int) -> T:
    """Decode a dataclass from a JSON text; errors name it `name`.

    Raises
    ------
    InputError
        If the text is no JSON, says another format or version, or a field is missing, unknown or of another type.
    """
    try:
        found = json_value(text)
    except ValueError as error:
        raise InputError(
            f"reading {name}", f"it is cut off or no JSON ({error})", "give a report.json that was written completely"
        ) from None
    if not isinstance(found, dict) or found.get("format") != file_format:
        raise InputError(f"reading {name}", "it is JSON, but no report", "give the report.json of 'translucent report'")
    if found.get("version") != version:
        raise InputError(
            f"reading {name}",
            f"it is of version {found.get('version')!r}; this program reads {version}",
            "make the report again",
        )
    try:
        return _read(kind, found, "")  # type: ignore[no-any-return]
    except _WrongFieldError as error:
        raise InputError(f"reading {name}", str(error), "make the report again") from None


class _WrongFieldError(ValueError):
    """Error for a field of the wrong type or value."""


@cache
def _fields(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _read(kind: Any, value: Any, where: str) -> Any:
    """Read a JSON `value` as the annotated type `kind`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if dataclasses.is_dataclass(kind):
        return _read_dataclass(kind, value, where)
    if origin in (Union, types.UnionType):
        others = [option for option in arguments if option is not type(None)]
        return None if value is None and type(None) in arguments else _read(others[0], value, where)
    if origin is Literal:
        _require(value in arguments, where, value, f"one of {', '.join(map(repr, arguments))}")
        return value
    if origin is tuple:
        _require(isinstance(value, list), where, value, "a list")
        kinds = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        _require(len(kinds) == len(value), where, value, f"{len(kinds)} values")
        return tuple(_read(k, v, f"{where}[{i}]") for i, (k, v) in enumerate(zip(kinds, value, strict=True)))
    if origin is Mapping:
        _require(isinstance(value, dict), where, value, "an object")
        return {key: _read(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if kind is float:
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        _require(number, where, value, "a number")
        return float(value)
    _require(isinstance(value, kind) and (kind is bool or not isinstance(value, bool)), where, value, kind.__name__)
    return value


def _read_dataclass(kind: Any, value: Any, where: str) -> Any:
    _require(isinstance(value, dict), where or "the report", value, "an object")
    hints = _fields(kind)
    if unknown := value.keys() - hints:
        raise _WrongFieldError(f"{where or 'the report'} has unknown fields {', '.join(sorted(unknown))}")
    needed = {
        field.name
        for field in dataclasses.fields(kind)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    if missing := needed - value.keys():
        raise _WrongFieldError(f"{where or 'the report'} has no {', '.join(sorted(missing))}")
    made = kind(**{name: _read(hints[name], item, f"{where}.{name}".lstrip(".")) for name, item in value.items()})
    try:
        if hasattr(made, "check"):
            made.check()
    except (ValueError, zlib.error) as error:
        raise _WrongFieldError(f"{where}: {error}") from None
    return made


def _require(held: bool, where: str, value: Any, expected: str) -> None:
    if not held:
        shown = repr(value)
        raise _WrongFieldError(f"{where} is {shown if len(shown) < 60 else shown[:57] + '...'}, not {expected}")
