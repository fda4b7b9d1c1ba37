"""Environments from picture files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.images import open_picture, read_exr
from translucent.files.paths import require_file
from translucent.files.reading import read_bytes, require_room, shown
from translucent.formulas.color import srgb_to_linear
from translucent.scene.environment_map import EnvironmentMap, row_blocks

Bytes = npt.NDArray[np.uint8]

#: Widths of rows that may be encoded channel by channel.
CHANNEL_WIDTHS = range(8, 32768)

_RESOLUTION = re.compile(rb"([+-])([XY]) +(\d{1,10}) +([+-])([XY]) +(\d{1,10})\s*")


class _Header(NamedTuple):
    """Header of a Radiance picture: rows and columns as stored, their directions, and the exposure multiplied in."""

    rows: int
    columns: int
    first: bytes  # sign and axis along which rows follow each other
    second: bytes
    exposure: float
    start: int


def read_radiance(path: str | Path) -> npt.NDArray[np.float32]:
    """Linear radiance of a Radiance picture, (h, w, 3) float32; row 0 is the top row.

    A mantissa m with exponent e is m 2^(e - 136), and exposures noted in the file are divided out.

    Raises
    ------
    InputError
        If there is no such file, it is no RGBE picture, or it ends early.
    """
    data = read_bytes(path, f"picture {str(path)!r}")
    header = _header(path, data)
    stored = _pixels(path, np.frombuffer(data, dtype=np.uint8)[header.start :], header.rows, header.columns)
    # What an exponent means, looked up: no array of the picture's size in between.
    exponents = np.arange(256)
    with np.errstate(under="ignore", over="ignore"):
        factors = np.where(exponents > 0, np.ldexp(1.0 / header.exposure, exponents - 136), 0.0)
        pixels = np.empty((*stored.shape[:2], 3), dtype=np.float32)
        for rows in row_blocks(header.rows, header.columns):
            pixels[rows] = stored[rows, :, :3] * factors[stored[rows, :, 3], None]
    return np.ascontiguousarray(_upright(pixels, header))


def _header(path: str | Path, data: bytes) -> _Header:
    if not data.startswith(b"#?"):
        raise _refused(path, "the file does not begin with #?RADIANCE", "give an .hdr file")
    text, blank, rest = data.partition(b"\n\n")
    line, end, _ = rest.partition(b"\n")
    match = _RESOLUTION.fullmatch(line)
    if not (blank and end and match) or match[2] == match[5]:
        raise _refused(path, "the header has no picture size", "save it again")
    exposure = 1.0
    for entry in text.split(b"\n")[1:]:
        name, _, value = entry.partition(b"=")
        if name.strip() == b"FORMAT" and value.strip() != b"32-bit_rle_rgbe":
            raise _refused(path, f"the format is {value.strip().decode(errors='replace')}", "save it as RGBE")
        if name.strip() == b"EXPOSURE":
            exposure *= _exposure(path, value)
    rows, columns = int(match[3]), int(match[6])
    if not rows * columns:
        raise _refused(path, f"{columns}x{rows} pixels", "save it again")
    require_room(f"picture {str(path)!r}", f"{columns}x{rows} pixels", 28 * rows * columns, len(data))
    start = len(text) + len(blank) + len(line) + len(end)
    return _Header(rows, columns, match[1] + match[2], match[4] + match[5], exposure, start)


def _exposure(path: str | Path, value: bytes) -> float:
    try:
        exposure = float(value)
    except ValueError:
        exposure = 0.0
    if not 1e-30 < exposure < 1e30:
        raise _refused(path, f"the exposure is {value.strip().decode(errors='replace')}", "save it again")
    return exposure


def _pixels(path: str | Path, data: Bytes, rows: int, columns: int) -> Bytes:
    """(rows, columns, 4) as stored."""
    if columns in CHANNEL_WIDTHS and data[:3].tolist() == [2, 2, columns >> 8]:
        return _by_channel(path, data, rows, columns)
    flat = data[: 4 * rows * columns].reshape(-1, 4) if len(data) >= 4 * rows * columns else None
    if flat is not None and not (flat[:, :3] == 1).all(axis=1).any():
        return flat.reshape(rows, columns, 4)
    return _by_pixel(path, data, rows * columns).reshape(rows, columns, 4)


def _by_channel(path: str | Path, data: Bytes, rows: int, columns: int) -> Bytes:
    """Decode rows of four channels each, in runs (more than 128: of one byte) and literal bytes."""
    source = data.tobytes()
    stored, at = np.empty((rows, 4, columns), dtype=np.uint8), 0
    marker = bytes((2, 2, columns >> 8, columns & 255))
    for row in range(rows):
        if source[at : at + 4] != marker:
            raise _refused(path, f"row {row} of {rows} is missing or broken", "copy the file again")
        at += 4
        line = bytearray()
        while len(line) < 4 * columns:
            if at + 1 >= len(source):
                raise _refused(path, f"the file ends in row {row} of {rows}", "copy the file again")
            count = source[at]
            if count > 128:
                line += source[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                line += source[at + 1 : at + 1 + count]
                at += 1 + count
                if count == 0 or at > len(source):
                    raise _refused(path, f"the file ends, or is broken, in row {row} of {rows}", "copy the file again")
        if len(line) != 4 * columns:
            raise _refused(path, f"row {row} of {rows} is too long", "copy the file again")
        stored[row] = np.frombuffer(line, dtype=np.uint8).reshape(4, columns)
    return np.moveaxis(stored, 1, 2)


def _by_pixel(path: str | Path, data: Bytes, count: int) -> Bytes:
    """Decode pixels of four bytes, where (1, 1, 1, n) repeats the last one n times; several in turn are digits of n."""
    words = data[: len(data) // 4 * 4].reshape(-1, 4)
    repeats = (words[:, :3] == 1).all(axis=1)
    times = np.ones(len(words), dtype=np.int64)
    digit = 0
    for i in np.flatnonzero(repeats).tolist():
        digit = digit + 1 if i > 0 and repeats[i - 1] else 0
        if i == 0 or digit > 3:
            raise _refused(path, "the file repeats a pixel before the first pixel", "copy the file again")
        times[i] = int(words[i, 3]) << (8 * digit)
    ends = np.cumsum(times)
    enough = int(np.searchsorted(ends, count)) + 1
    if enough > len(words):
        raise _refused(path, f"the file ends after {int(times.sum())} of {count} pixels", "copy the file again")
    times[enough - 1] -= ends[enough - 1] - count  # a damaged run may be of billions
    # A repetition repeats the last pixel before it.
    last = np.maximum.accumulate(np.where(repeats, 0, np.arange(len(words))))
    return np.asarray(np.repeat(words[last[:enough]], times[:enough], axis=0))


def _upright(pixels: npt.NDArray[np.float32], header: _Header) -> npt.NDArray[np.float32]:
    if header.first.endswith(b"X"):  # columns are stored one after the other
        pixels = pixels.swapaxes(0, 1)
    signs = header.first + header.second
    if b"+Y" in signs:  # upwards
        pixels = pixels[::-1]
    return pixels[:, ::-1] if b"-X" in signs else pixels


def _refused(path: str | Path, found: str, do: str) -> InputError:
    return InputError(f"picture {str(path)!r}", found, do)


Pixels = npt.NDArray[Any]


def read_environment_map(path: str | Path) -> EnvironmentMap:
    """Read an environment map from a picture file.

    Parameters
    ----------
    path : str or Path
        ``.hdr`` or ``.pic`` (Radiance), ``.exr`` (linear Rec.709), or ``.png`` or ``.jpg`` (sRGB, in which no light is
        brighter than white paper).

    Raises
    ------
    InputError
        If the file has another suffix, cannot be read, or holds no picture.
    RenderError
        If the OpenEXR package is needed and not installed.
    """
    path = Path(path)
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise InputError(f"environment {str(path)!r}", f"suffix {path.suffix!r}", f"use one of {', '.join(READERS)}")
    require_file(path, f"environment {str(path)!r}")
    return EnvironmentMap(read(path))


def read_linear(path: Path) -> Pixels:
    """Linear values (h, w, 3) of a ``.exr`` file, or else of one of Radiance; raises as `read_environment_map`."""
    if path.suffix.lower() != ".exr":
        return read_radiance(path)
    what = f"picture {str(path)!r}"
    _, channels = read_exr(path, what)
    for names in ("RGB", "YYY"):
        if set(names) <= channels.keys():
            return np.stack([channels[name] for name in names], axis=-1)
    raise InputError(what, f"the file has the channels {', '.join(channels)}", "use the channels R, G and B")


def _read_encoded(path: Path) -> Pixels:
    what = f"environment {str(path)!r}"
    try:
        with open_picture(read_bytes(path, what), what, ("PNG", "JPEG"), per_pixel=38) as image:
            encoded = np.asarray(image.convert("RGB"))
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(what, f"the file is not a readable image ({shown(error)})", "check the file") from error
    return np.asarray(srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)[encoded])


READERS: dict[str, Callable[[Path], Pixels]] = {
    ".hdr": read_linear,
    ".pic": read_linear,
    ".exr": read_linear,
    ".png": _read_encoded,
    ".jpg": _read_encoded,
    ".jpeg": _read_encoded,
}
