"""The float64 reference of scenes that several tests ask about: rendered once for all methods that are held against it.

What is asked for is known by its values, so scenes that are made anew are the same. Arrays are read-only.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

import translucent as tl

#: Kept of each kind; a frame of 320x240 pixels takes 7 MB.
MOST = 16


def fingerprint(value: Any) -> bytes:
    """A digest of all that a value is made of."""
    digest = hashlib.sha1(repr(type(value)).encode(), usedforsecurity=False)
    if isinstance(value, np.ndarray):
        digest.update(repr((value.dtype, value.shape)).encode() + value.tobytes())
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            digest.update(fingerprint(getattr(value, field.name)))
    elif isinstance(value, list | tuple):
        for item in value:
            digest.update(fingerprint(item))
    elif isinstance(value, dict):
        digest.update(fingerprint(list(value.items())))
    elif isinstance(value, bool | int | float | str | np.generic | None):
        digest.update(repr(value).encode())
    else:
        raise TypeError(f"no digest of {type(value)}")
    return digest.digest()


def _kept(make: Callable[..., Any]) -> Callable[..., Any]:
    """The function, whose latest results are kept."""
    found: dict[bytes, Any] = {}

    @functools.wraps(make)
    def ask(*arguments: Any, **options: Any) -> Any:
        key = fingerprint((arguments, options))
        result = found.pop(key) if key in found else make(*arguments, **options)
        found[key] = result
        if len(found) > MOST:
            del found[next(iter(found))]
        return result

    return ask


@_kept
def render(scene: tl.Scene, size: tuple[int, int], method: Any = None, **options: Any) -> tl.Frame:
    """`translucent.reference.render`."""
    frame = tl.reference.render(scene, size, method, **options)
    for field in dataclasses.fields(frame):
        if isinstance(array := getattr(frame, field.name), np.ndarray):
            array.setflags(write=False)
    return frame


@_kept
def hit_counts(scene: tl.Scene, size: tuple[int, int]) -> npt.NDArray[np.int64]:
    """`translucent.reference.hit_counts`."""
    counts = tl.reference.hit_counts(scene, size)
    counts.setflags(write=False)
    return counts
