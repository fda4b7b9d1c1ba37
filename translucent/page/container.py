"""Container of a page's data: a header, and arrays in sections that are packed and compressed."""

from __future__ import annotations

import gzip
import json
from typing import Any

import numpy as np
import numpy.typing as npt

#: First bytes of a container.
MAGIC = b"TLPAGE01"


class Container:
    """Header and sections of a page's data.

    Attributes
    ----------
    sections : list of dict
        Where each array is, and how it is packed.
    """

    def __init__(self) -> None:
        self.sections: list[dict[str, Any]] = []
        self._offsets: dict[bytes, int] = {}
        self._end = 0

    def add(self, values: npt.NDArray[Any], packing: str = "plain", bits: int = 23) -> int:
        """Number of a new section that holds an array. Sections of the same bytes share them.

        Parameters
        ----------
        values : ndarray
            Of float32, float16, uint32 or uint8.
        packing : {"plain", "rows", "picture"}
            As it is; of 4-byte values, differences along the last axis but one; or differences to what the pixels to
            the left and above let expect, along the last axes but one. Bytes of one rank are together.
        bits : int
            Bits of the mantissa of floats that are kept; 23 are all.
        """
        held = np.ascontiguousarray(values)
        kinds = {"f4": "float32", "f2": "float16", "u4": "uint32", "u1": "uint8"}
        section: dict[str, Any] = {"type": kinds[held.dtype.str[1:]], "shape": list(held.shape), "packing": packing}
        if packing == "plain":
            packed = held.tobytes()
        else:
            section["shift"] = 23 - bits
            packed = _planes(held.view(np.uint32), packing, 23 - bits)
        padded = packed + bytes(-len(packed) % 8)
        offset = self._offsets.setdefault(padded, self._end)
        if offset == self._end:
            self._end += len(padded)
        self.sections.append(section | {"offset": offset, "bytes": len(packed)})
        return len(self.sections) - 1

    def packed(self, header: dict[str, Any]) -> bytes:
        """Header and sections, compressed."""
        text = json.dumps({**header, "sections": self.sections}, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 8)
        whole = MAGIC + len(text).to_bytes(8, "little") + text + b"".join(self._offsets)
        return gzip.compress(whole, 9, mtime=0)


def header_of(data: bytes) -> dict[str, Any]:
    """Header of a packed container."""
    whole = gzip.decompress(data)
    start = len(MAGIC) + 8
    header: dict[str, Any] = json.loads(whole[start : start + int.from_bytes(whole[len(MAGIC) : start], "little")])
    return header


def _planes(words: npt.NDArray[np.uint32], packing: str, shift: int) -> bytes:
    """Differences of words, their lowest `shift` bits rounded away, as planes of bytes."""
    rounded = (words.astype(np.uint64) + ((1 << shift) >> 1)) >> np.uint64(shift)
    found = rounded.astype(np.uint32)
    if packing == "picture":
        found = np.diff(found, axis=-3, prepend=np.zeros_like(found[..., :1, :, :]))
    found = np.diff(found, axis=-2, prepend=np.zeros_like(found[..., :1, :]))
    signed = found.view(np.int32)
    folded = ((signed << 1) ^ (signed >> 31)).view(np.uint32)
    return b"".join((folded >> np.uint32(8 * plane)).astype(np.uint8).tobytes() for plane in range(4))
