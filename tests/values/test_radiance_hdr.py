"""Radiance pictures, from bytes that are put together here as the format describes."""

from __future__ import annotations

import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.scene.environment_files import read_radiance

HEAD = b"#?RADIANCE\nSOFTWARE=none\nFORMAT=32-bit_rle_rgbe\n\n"


def size(rows: int, columns: int, text: bytes = b"-Y %d +X %d\n") -> bytes:
    return text % (rows, columns)


def by_channel(pixels: np.ndarray) -> bytes:
    """Rows of four channels, runs where a byte comes three times or more."""
    out = bytearray()
    for row in pixels:
        out += bytes((2, 2, len(row) >> 8, len(row) & 255))
        for channel in row.T:
            at = 0
            while at < len(channel):
                run = 1
                while at + run < len(channel) and run < 127 and channel[at + run] == channel[at]:
                    run += 1
                if run >= 3:
                    out += bytes((128 + run, channel[at]))
                    at += run
                else:
                    out += bytes((1, channel[at]))
                    at += 1
    return bytes(out)


def stored(rows: int = 3, columns: int = 9, seed: int = 2) -> np.ndarray:
    pixels = np.random.default_rng(seed).integers(2, 256, (rows, columns, 4), dtype=np.uint8)
    pixels[..., 3] = pixels[..., 3] % 8 + 124
    pixels[:, columns // 2 :, 0] = 7  # something to run along
    return pixels


def exact(pixels: np.ndarray) -> np.ndarray:
    return pixels[..., :3] * 2.0 ** (pixels[..., 3:].astype(float) - 136)


def read(tmp_path: Path, data: bytes) -> np.ndarray:
    (tmp_path / "sky.hdr").write_bytes(data)
    return read_radiance(tmp_path / "sky.hdr")


def test_flat_pixels(tmp_path: Path) -> None:
    pixels = stored()
    found = read(tmp_path, HEAD + size(3, 9) + pixels.tobytes())
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, exact(pixels))


def test_rows_by_channel(tmp_path: Path) -> None:
    for columns in (8, 9, 300):  # a run ends at 127, and a width needs two bytes from 256 on
        pixels = stored(4, columns)
        data = by_channel(pixels)
        assert len(data) != pixels.size
        np.testing.assert_array_equal(read(tmp_path, HEAD + size(4, columns) + data), exact(pixels))


def test_literal_bytes_by_channel(tmp_path: Path) -> None:
    pixels = stored(1, 9)
    data = bytes((2, 2, 0, 9)) + b"".join(
        bytes((4,)) + c[:4].tobytes() + b"\x05" + c[4:].tobytes() for c in pixels[0].T
    )
    np.testing.assert_array_equal(read(tmp_path, HEAD + size(1, 9) + data), exact(pixels))


def test_repeated_pixels(tmp_path: Path) -> None:
    first, second = bytes((10, 20, 30, 128)), bytes((40, 50, 60, 129))
    # 1 + 5, then 1 + (4 + 1 * 256) of the other: two repetitions in a row are digits.
    data = first + bytes((1, 1, 1, 5)) + second + bytes((1, 1, 1, 4)) + bytes((1, 1, 1, 1))
    found = read(tmp_path, HEAD + size(1, 267) + data)
    pixels = np.frombuffer(first * 6 + second * 261, dtype=np.uint8).reshape(1, 267, 4)
    np.testing.assert_array_equal(found, exact(pixels))


def test_a_run_that_is_too_long_fills_the_picture_and_no_memory(tmp_path: Path) -> None:
    pixel = bytes((5, 5, 5, 128))
    data = HEAD + size(20, 10) + pixel + bytes((1, 1, 1, 0)) * 2 + bytes((1, 1, 1, 2))  # 1 + 2 * 65536 pixels
    tracemalloc.start()
    try:
        found = read(tmp_path, data)
        assert tracemalloc.get_traced_memory()[1] < 100_000
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(found, exact(np.full((20, 10, 4), np.frombuffer(pixel, dtype=np.uint8))))


def test_zero_exponents_are_black_and_exposures_are_divided_out(tmp_path: Path) -> None:
    pixels = stored(1, 3)
    pixels[0, 1, 3] = 0
    head = b"#?RGBE\nEXPOSURE=2.0\nEXPOSURE= 4\nFORMAT=32-bit_rle_rgbe\n\n"
    found = read(tmp_path, head + size(1, 3) + pixels.tobytes())
    np.testing.assert_allclose(found[0, [0, 2]], exact(pixels)[0, [0, 2]] / 8, rtol=1e-7)
    assert found[0, 1].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("text", "turn"),
    [
        (b"+Y %d +X %d\n", lambda p: p[::-1]),
        (b"-Y %d -X %d\n", lambda p: p[:, ::-1]),
        (b"+X %d -Y %d\n", lambda p: p.swapaxes(0, 1)),
        (b"-X %d +Y %d\n", lambda p: p.swapaxes(0, 1)[::-1, ::-1]),
    ],
)
def test_other_orientations(tmp_path: Path, text: bytes, turn: object) -> None:
    pixels = stored(2, 5)
    found = read(tmp_path, HEAD + size(2, 5, text) + pixels.tobytes())
    np.testing.assert_array_equal(found, turn(exact(pixels)))  # type: ignore[operator]


BROKEN = {
    "no Radiance": (b"P6\n2 2\n255\n", "the file does not begin with #"),
    "no size": (HEAD + b"2 by 2\n", "the header has no picture size"),
    "no end of the header": (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "the header has no picture size"),
    "both the same axis": (HEAD + b"-Y 2 +Y 2\n" + bytes(16), "the header has no picture size"),
    "another format": (
        b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n" + size(1, 1) + bytes(4),
        "the format is 32-bit_rle_xyze",
    ),
    "no exposure": (b"#?RADIANCE\nEXPOSURE=0\n\n" + size(1, 1) + bytes(4), "the exposure is 0; save it again"),
    "nothing in it": (HEAD + size(0, 4), "4x0 pixels"),
    "far too much": (HEAD + size(10**9, 10**9), "1000000000x1000000000 pixels"),
    "no pixels": (HEAD + size(2, 4), "the file ends after 0 of 8 pixels"),
    "few pixels": (HEAD + size(2, 4) + stored(1, 4).tobytes(), "the file ends after 4 of 8 pixels"),
    "a repetition first": (HEAD + size(1, 4) + bytes((1, 1, 1, 4)), "the file repeats a pixel before the first pixel"),
    "a missing row": (HEAD + size(4, 9) + by_channel(stored(3, 9)), "row 3 of 4 is missing"),
    "half a row": (HEAD + size(3, 9) + by_channel(stored(3, 9))[:-3], "the file ends in row 2 of 3"),
    "half a run": (HEAD + size(1, 9) + bytes((2, 2, 0, 9, 137)), "the file ends in row 0 of 1"),
    "too long a run": (HEAD + size(1, 9) + bytes((2, 2, 0, 9)) + bytes((200, 7)) * 9, "row 0 of 1 is too long"),
    "an empty literal": (HEAD + size(1, 9) + bytes((2, 2, 0, 9, 0, 0, 0)), "the file ends, or is broken, in row 0"),
}


@pytest.mark.parametrize(("data", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        read(tmp_path, data)


def test_any_cut_of_a_file_is_refused_or_read(tmp_path: Path) -> None:
    whole = HEAD + size(3, 9) + by_channel(stored())
    for length in range(len(whole)):
        with pytest.raises(tl.InputError):
            read(tmp_path, whole[:length])


def test_an_environment_is_read_from_it(tmp_path: Path) -> None:
    pixels = stored(4, 8)
    (tmp_path / "sky.HDR").write_bytes(HEAD + size(4, 8) + by_channel(pixels))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = tl.Environment.image(tmp_path / "sky.HDR", rotation=10, exposure=1)
    np.testing.assert_array_equal(environment.map.pixels, exact(pixels).astype(np.float32))


def test_no_file_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="no file has this path; check the path"):
        read_radiance(tmp_path / "none.hdr")
