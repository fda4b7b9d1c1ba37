"""Frozen dataclasses to JSON and back, with every field checked, by cattrs; arrays as compressed text."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeVar, get_args, get_origin

import numpy as np
import numpy.typing as npt
from cattrs import BaseValidationError, Converter, ForbiddenExtraKeysError, transform_error
from cattrs.cols import list_structure_factory, mapping_structure_factory
from cattrs.gen import make_dict_structure_fn

from translucent.errors import InputError
from translucent.files.reading import json_value

#: Largest size of an unpacked array in bytes: a damaged file must not fill the memory.
_LARGEST = 1 << 28
#: Largest number of wrong values that are collected: each takes 500 times the memory of its text.
_MOST = 100

_Hook = Callable[[Any, Any], Any]
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
            fractions = np.where(finite, array / scale, np.nan).astype(np.float16)
        bits = fractions.view(np.uint16)
        # A picture shows no more than some percent of an error, and zeros compress.
        rounded = np.where(np.isnan(fractions), bits, bits & np.uint16(0xFFC0))
        return cls((height, width), "float16", scale, _deflate(rounded.tobytes()))

    def array(self) -> npt.NDArray[Any]:
        """Unpacked array (h, w), float64 or bool; raises `ValueError` if the text holds no such array."""
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
            f"reading {name}",
            f"the file is cut off, or is not JSON ({error})",
            "give a report.json file that was written completely",
        ) from None
    if not isinstance(found, dict) or found.get("format") != file_format:
        raise InputError(
            f"reading {name}",
            "the file is JSON, but not a report",
            "give the report.json that 'translucent report' wrote",
        )
    if found.get("version") != version:
        raise InputError(
            f"reading {name}",
            f"the file has version {found.get('version')!r}, but this program reads version {version}",
            "run the report again",
        )
    try:
        return _Strict().structure(found, kind)
    except BaseValidationError as error:
        said, _, where = transform_error(error, "", _said)[0].rpartition(" @ ")
        raise InputError(
            f"reading {name}", f"{where.lstrip('.') or 'the report'} {said}", "run the report again"
        ) from None
    except _TooManyError:
        raise InputError(
            f"reading {name}", f"more than {_MOST} values in the file are wrong", "run the report again"
        ) from None


class _TooManyError(BaseException):
    """Raised past the limit of wrong values. No `Exception`: cattrs collects those."""


class _Strict(Converter):
    """Converter of JSON values that converts nothing: cattrs alone makes an int of ``"3"`` and a tuple of ``{}``."""

    def __init__(self) -> None:
        super().__init__(forbid_extra_keys=True)
        self._wrong = 0
        for kind in (bool, int, str):
            self.register_structure_hook(kind, self._exact)
        self.register_structure_hook(float, self._number)
        for origin, hook in ((Literal, self._option), (tuple, self._list), (Mapping, self._mapping)):
            self.register_structure_hook_factory(partial(lambda origin, kind: get_origin(kind) is origin, origin), hook)
        self.register_structure_hook_factory(dataclasses.is_dataclass, self._dataclass)

    def _require(self, held: bool, value: Any, expected: str) -> None:
        if not held:
            text = repr(value)
            raise self._error(f"is {text if len(text) < 60 else text[:57] + '...'}, not {expected}")

    def _error(self, said: str) -> ValueError:
        self._wrong += 1
        if self._wrong > _MOST:
            raise _TooManyError
        return ValueError(said)

    def _exact(self, value: Any, kind: type) -> Any:
        self._require(type(value) is kind, value, kind.__name__)
        return value

    def _number(self, value: Any, _: Any) -> float:
        self._require(type(value) in (int, float) and math.isfinite(value), value, "a number")
        return float(value)

    def _option(self, kind: Any) -> _Hook:
        options = get_args(kind)

        def structure(value: Any, _: Any) -> Any:
            self._require(value in options, value, f"one of {', '.join(map(repr, options))}")
            return value

        return structure

    def _holding(self, plain: _Hook, holder: type, expected: str) -> _Hook:
        def structure(value: Any, kind: Any) -> Any:
            self._require(isinstance(value, holder), value, expected)
            return plain(value, kind)

        return structure

    def _list(self, kind: Any) -> _Hook:
        """Structure a tuple, whose elements are all of one type."""
        element, *others = get_args(kind)
        plain = list_structure_factory(list[element], self)  # type: ignore[valid-type]

        def structure(value: list[Any], _: Any) -> Any:
            self._require(others == [...] or len(value) == 1 + len(others), value, f"{1 + len(others)} values")
            return tuple(plain(value, kind))

        return self._holding(structure, list, "a list")

    def _mapping(self, kind: Any) -> _Hook:
        return self._holding(mapping_structure_factory(kind, self, dict), dict, "an object")

    def _dataclass(self, kind: Any) -> _Hook:
        plain = make_dict_structure_fn(kind, self)

        def structure(value: dict[str, Any], _: Any) -> Any:
            made = plain(value, kind)
            try:
                if hasattr(made, "check"):
                    made.check()
            except (ValueError, zlib.error) as error:
                raise self._error(f"is damaged ({error})") from None
            return made

        return self._holding(structure, dict, "an object")


def _said(error: BaseException, _: Any) -> str:
    """Text of a validation error, to follow the name of its field."""
    if isinstance(error, ForbiddenExtraKeysError):
        return f"has unknown fields {', '.join(sorted(error.extra_fields))}"
    return "is missing" if isinstance(error, KeyError) else str(error)
