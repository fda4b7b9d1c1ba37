"""Colors to extinction and back: exact at the ends, within the conditioning between, and doubtful inputs named."""

from __future__ import annotations

import math
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.formulas.color import srgb_to_linear, to_hex
from translucent.media import conversion
from translucent.media.colors import html_swatches, parse_color
from translucent.media.conversion import (
    clamp_colors,
    color_at_distance,
    condition_number,
    distance_for_color,
    doubts,
    extinction_from_colors,
    half_value_thickness,
    mean_free_path,
    summary,
)

EDGES = np.array([1.0, np.nextafter(1, 0), 1 - 1e-9, 0.5, math.exp(-1), 1e-4, 1e-30, 1e-300, 5e-324])


def _many(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A million channels of all kinds, and distances from micrometers to kilometers."""
    parts = [
        rng.uniform(1e-6, 1, 400_000),
        np.exp(-rng.exponential(3, 400_000)),
        1 - 10 ** rng.uniform(-15, 0, 199_998),
    ]
    t = np.concatenate([*parts, np.repeat(EDGES, 9)])
    t = np.clip(t, 5e-324, 1)[: len(t) // 3 * 3].reshape(-1, 3)
    return t, 10 ** rng.uniform(-6, 3, len(t))


def test_color_to_extinction_to_color_within_its_conditioning(rng: np.random.Generator) -> None:
    t, d = _many(rng)
    assert t.size >= 1_000_000
    again = color_at_distance(extinction_from_colors(t, d), d)
    with np.errstate(under="ignore", divide="ignore"):
        # The way back multiplies a relative error by -log t, the inverse of the way there.
        relative = np.abs(again - t) / t
        condition = np.maximum(1.0, 1.0 / condition_number(t))
    normal = t >= 1e-290  # below, a double holds fewer digits
    assert (relative <= 1e-14 * condition)[normal].all()
    assert (again == 1)[t == 1].all()


def test_extinction_to_color_to_extinction_within_its_conditioning(rng: np.random.Generator) -> None:
    d = 10 ** rng.uniform(-6, 3, 100_000)
    sigma = 10 ** rng.uniform(-9, 2.5, (100_000, 3)) / d[:, None]
    t = color_at_distance(sigma, d)
    again = extinction_from_colors(t, d)
    with np.errstate(divide="ignore"):
        allowed = 1e-14 * np.maximum(1.0, condition_number(t))
    assert (np.abs(again - sigma) <= allowed * sigma)[t < 1].all()


def test_white_is_exactly_zero_and_never_minus_zero() -> None:
    sigma = extinction_from_colors([[1, 1, 1], [1, 0.5, 1]], [0.02, 1e-6])
    assert sigma[0].tolist() == [0, 0, 0]
    assert not np.signbit(sigma).any()


def test_the_numbers_by_hand() -> None:
    sigma = extinction_from_colors([math.exp(-1), 0.5, 0.25], 0.5)
    assert sigma == pytest.approx([2, 2 * math.log(2), 4 * math.log(2)], rel=4e-16)
    assert mean_free_path(sigma)[0] == pytest.approx(0.5, rel=4e-16)
    assert half_value_thickness(sigma)[1:] == pytest.approx([0.5, 0.25], rel=4e-16)
    assert mean_free_path([0.0, 5e-324, 2]).tolist() == [math.inf, math.inf, 0.5]
    assert condition_number([math.exp(-1), 1, 5e-324]).tolist() == pytest.approx([1, math.inf, 1 / 744.44], rel=1e-5)


def test_the_condition_number_is_the_measured_amplification() -> None:
    t, e = np.array([0.999, 0.9, 0.3, 1e-3]), 1e-7
    there, moved = -np.log(t), -np.log(t * (1 - e))
    assert (moved - there) / there / e == pytest.approx(condition_number(t), rel=1e-5)


@pytest.mark.parametrize("shape", [(3,), (0, 3), (4, 3), (2, 5, 3)])
def test_shapes(shape: tuple[int, ...]) -> None:
    assert extinction_from_colors(np.full(shape, 0.5), 0.1).shape == shape
    assert extinction_from_colors(np.full(shape, 0.5), np.full(shape[:-1], 0.1)).shape == shape


def test_one_color_at_many_distances() -> None:
    sigma = extinction_from_colors([0.5, 0.5, 1.0], [1.0, 2.0])
    assert sigma == pytest.approx(np.log(2) * np.array([[1, 1, 0], [0.5, 0.5, 0]]), rel=4e-16)


@pytest.mark.parametrize(
    ("colors", "distance", "message"),
    [
        (
            [0.0, 0.5, 0.5],
            1,
            r"1 of 3 channels; transmitted colors must satisfy 0 < t <= 1, but the first wrong value is red = 0;",
        ),
        ([[0.5] * 3, [0.5, 1.5, math.nan]], 1, "2 of 6 channels; .*green = 1.5 in color 1"),
        ([0.5, 0.5, -0.1], 1, "blue = -0.1"),
        (
            [0.5, np.nextafter(1, 2), 0.5],
            1,
            "1 of 3 channels; transmitted colors must satisfy 0 < t <= 1, but the first wrong value is green = 1",
        ),
        ([0.5, 0.5], 1, r"colors of shape \(2,\); the last axis must have three numbers: \(\.\.\., 3\)"),
        (0.5, 1, r"colors of shape \(\)"),
        ([0.5] * 3, 0, "distance 0 m; a distance must be above 0"),
        ([[0.5] * 3] * 2, [1, math.nan], "distance nan m; a distance must be above 0"),
        ([0.5] * 3, 1e-320, "the extinction is too large for a number; check the unit"),
    ],
)
def test_bad_colors_and_distances_are_refused(colors: object, distance: object, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        extinction_from_colors(colors, distance)  # type: ignore[arg-type]


def test_a_bad_channel_is_found_in_the_last_block() -> None:
    t = np.full((100_000, 3), 0.5)
    t[-1, 2] = 0
    with pytest.raises(tl.InputError, match="blue = 0 in color 99999"):
        extinction_from_colors(t, 1.0)


def test_zeros_are_clamped_on_request_and_told() -> None:
    clamped, changed = clamp_colors([[0, 1e-5, 0.5], [1, 1e-4, -1]])
    assert clamped.tolist() == [[1e-4, 1e-4, 0.5], [1, 1e-4, -1]]
    assert changed.tolist() == [[True, True, False], [False, False, False]]


def test_ten_million_colors_a_second(rng: np.random.Generator) -> None:
    t = rng.uniform(1e-3, 1, (1_000_000, 3))
    best = math.inf
    for _ in range(5):
        start = time.process_time()
        extinction_from_colors(t, 0.02)
        best = min(best, time.process_time() - start)
    assert best < 0.1, f"{1 / best:.0f} million colors a second"


def test_a_distance_for_a_color() -> None:
    wine = tl.Medium.from_color((0.2, 0.5, 0.9), 0.03)
    match = distance_for_color(wine.extinction, wine.transmittance(0.07))
    assert match.distance == pytest.approx(0.07, rel=1e-14)
    assert match.per_channel == pytest.approx((0.07,) * 3, rel=1e-14)
    assert np.abs(match.residual).max() < 1e-14


def test_a_color_that_the_medium_never_has_gets_the_nearest() -> None:
    sigma, color = np.array([3.0, 1.0, 0.0]), np.array([0.5, 0.6, 0.7])
    match = distance_for_color(sigma, color)
    near = np.linspace(0.9, 1.1, 1001) * match.distance
    costs = ((sigma * near[:, None] + np.log(color)) ** 2).sum(axis=1)
    assert costs.argmin() == 500
    assert match.per_channel[2] == math.inf
    assert match.residual == pytest.approx(np.log(np.exp(-sigma * match.distance) / color), abs=1e-15)
    assert distance_for_color(sigma, (1, 1, 1)).per_channel == (0, 0, None)
    with pytest.raises(
        tl.InputError,
        match=r"extinction .* the extinction must be three numbers >= 0, of which at least one is above 0",
    ):
        distance_for_color((0, 0, 0), color)
    with pytest.raises(tl.InputError, match="the distance is too large for a number"):
        distance_for_color((1e-309, 0, 0), color)


def test_a_match_shows_what_was_asked_for_and_what_is_found() -> None:
    html = distance_for_color((3.0, 1.0, 0.0), (0.5, 0.6, 0.7))._repr_html_()
    match = distance_for_color((3.0, 1.0, 0.0), (0.5, 0.6, 0.7))
    assert match.color == (0.5, 0.6, 0.7)
    found = color_at_distance((3.0, 1.0, 0.0), match.distance)
    assert f"requested<br>{to_hex((0.5, 0.6, 0.7))}" in html
    assert f"after {1e3 * match.distance:.3g} mm<br>{to_hex(found)}" in html


def test_labels_of_swatches_are_escaped() -> None:
    html = html_swatches([((1, 0, 0), "<b>&")])
    assert "&lt;b&gt;&amp;<br>#ff0000" in html
    assert "background:#ff0000" in html


@pytest.mark.parametrize(
    ("color", "distance", "words"),
    [
        ((0.2, 0.5, 0.9), 0.02, []),
        ((1, 0.5, 0.5), 0.02, ["red is 1, so the medium absorbs nothing of it"]),
        (
            (0.5, 0.99, 0.5),
            0.02,
            ["green 0.99 is near white: rounding to 8 bits changes the extinction by up to 44 %"],
        ),
        ((0.5, 0.5, 5e-4), 0.02, ["blue 0.0005 is near black"]),
        ((0.2, 0.5, 0.9), 2e-6, ["the distance 2e-06 m is outside 1e-05 to 100 m"]),
        ((0.2, 0.5, 0.9), 101, ["outside"]),
        ((1e-30,) * 3, 1, ["red", "green", "blue", "nearly black even at a tenth"]),
        ((0.995,) * 3, 1, ["red", "green", "blue", "nearly clear even at ten times"]),
    ],
)
def test_doubts_are_named(color: tuple[float, ...], distance: float, words: list[str]) -> None:
    lines = doubts(color, distance)
    assert len(lines) == len(words)
    for line, word in zip(lines, words, strict=True):
        assert word in line


def test_eight_bits_near_white_are_as_bad_as_said() -> None:
    whole = np.arange(253, 255)  # the steps whose linear value is above 0.98
    exact, rounded = (srgb_to_linear(v / 255) for v in (whole + 0.5, whole + 0.0))
    error = np.abs(np.log(rounded) / np.log(exact) - 1)
    assert error == pytest.approx(0.5 * 2.4 / 1.055 / 255 * condition_number(exact), rel=0.05)


def test_the_summary_is_plain_json() -> None:
    told = summary((1, 0.5, 0.25), 0.02, extinction_from_colors((1, 0.5, 0.25), 0.02), "cm")
    assert told["mean_free_path"][0] is None
    assert told["extinction_per_unit"] == pytest.approx(np.array(told["extinction"]) / 100)
    assert list(told["transmittance"]) == [f"{factor:g}" for factor in conversion.FACTORS]


def test_a_medium_tells_its_paths_and_shows_swatches() -> None:
    medium = tl.Medium(absorption=(1, 2, 0), scattering=(1, 0, 0))
    assert medium.mean_free_path.tolist() == [0.5, 0.5, math.inf]
    assert medium.half_value_thickness == pytest.approx([math.log(2) / 2, math.log(2) / 2, math.inf])
    html = medium._repr_html_()
    assert html.count("background:#") == 5
    assert "750 mm<br>" in html  # 1 / mean extinction
    for extreme in (0.0, 1e-310, 1e300):
        assert "background:#" in tl.Medium(absorption=extreme)._repr_html_()


# A picked pixel


#: First column and row of each pass of an interlaced PNG file, and the steps from there.
ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _png16(path: Path, values: np.ndarray, extra: bytes = b"", interlaced: bool = False, beyond: int = 0) -> None:
    height, width, channels = values.shape
    head = struct.pack(">IIBBBBB", width, height, 16, {1: 0, 2: 4, 3: 2, 4: 6}[channels], 0, 0, interlaced)
    parts = [values[y::down, x::right] for x, y, right, down in ADAM7] if interlaced else [values]
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for part in parts if part.size for row in part) + bytes(beyond)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", head)
        + extra
        + _chunk(b"IDAT", zlib.compress(rows))
        + _chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("kind", ["RGB", "RGBA", "P", "L"])
def test_a_picked_pixel_is_srgb(tmp_path: Path, rng: np.random.Generator, kind: str) -> None:
    pixels = rng.integers(0, 256, (4, 6, 3)).astype(np.uint8)
    pixels[..., :] = pixels[..., :1] if kind == "L" else pixels
    image = Image.fromarray(pixels).convert(kind) if kind != "P" else Image.fromarray(pixels).quantize(24)
    image.save(tmp_path / "a@1.png")
    expected = np.asarray(image.convert("RGB"))[1, 5]
    assert parse_color(f"{tmp_path / 'a@1.png'}@5,1").tolist() == srgb_to_linear(expected / 255).tolist()


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_picked_pixel_keeps_16_bits(tmp_path: Path, rng: np.random.Generator, channels: int) -> None:
    values = rng.integers(256, 65536, (4, 6, channels))
    _png16(tmp_path / "a.png", values)
    expected = np.broadcast_to(values[3, 2, : min(channels, 3)], 3) / 65535
    assert parse_color(f"{tmp_path / 'a.png'}@2, 3").tolist() == srgb_to_linear(expected).tolist()


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("kind", ["interlaced", "gamma", "significant bits", "more than it says"])
def test_a_picked_pixel_of_16_bits_is_as_it_is_stored(
    tmp_path: Path, rng: np.random.Generator, channels: int, kind: str
) -> None:
    values = rng.integers(256, 65536, (11, 9, channels))
    extra = {
        "gamma": _chunk(b"gAMA", struct.pack(">I", 100_000)),
        "significant bits": _chunk(b"sBIT", bytes([11] * channels)),
    }.get(kind, b"")
    beyond = 100_000_000 if kind.startswith("more") else 0
    _png16(tmp_path / "a.png", values, extra, kind == "interlaced", beyond)
    for x, y in ((0, 0), (8, 10), (5, 3), (2, 7)):
        expected = np.broadcast_to(values[y, x, : min(channels, 3)], 3) / 65535
        assert parse_color(f"{tmp_path / 'a.png'}@{x},{y}").tolist() == srgb_to_linear(expected).tolist()


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("turn", range(1, 9))
def test_a_picked_pixel_of_16_bits_follows_the_turn(
    tmp_path: Path, rng: np.random.Generator, channels: int, turn: int
) -> None:
    values, exif = rng.integers(256, 65536, (4, 6, channels)), Image.Exif()
    exif[0x0112] = turn
    _png16(tmp_path / "a.png", values, _chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0")))
    shown = values if turn < 5 else values.swapaxes(0, 1)
    across, down = {1: (1, 1), 2: (-1, 1), 3: (-1, -1), 4: (1, -1), 5: (1, 1), 6: (-1, 1), 7: (-1, -1), 8: (1, -1)}[
        turn
    ]
    shown = shown[::down, ::across]
    expected = np.broadcast_to(shown[1, 3, : min(channels, 3)], 3) / 65535
    assert parse_color(f"{tmp_path / 'a.png'}@3,1").tolist() == srgb_to_linear(expected).tolist()
    with pytest.raises(tl.InputError, match="the image has 6 x 4" if turn < 5 else "the image has 4 x 6"):
        parse_color(f"{tmp_path / 'a.png'}@9,9")


def test_a_clear_pixel_of_16_bits_is_not_picked(tmp_path: Path) -> None:
    _png16(tmp_path / "a.png", np.array([[[9000, 9, 9, 0], [9000, 9, 9, 65535]]]))
    assert parse_color(f"{tmp_path / 'a.png'}@1,0").tolist() == srgb_to_linear(np.array([9000, 9, 9]) / 65535).tolist()
    with pytest.raises(tl.InputError, match="the pixel is fully transparent"):
        parse_color(f"{tmp_path / 'a.png'}@0,0")


def test_a_picked_pixel_follows_the_turn_that_the_camera_noted(tmp_path: Path) -> None:
    image, exif = Image.new("RGB", (2, 3)), Image.Exif()
    image.putpixel((0, 2), (255, 255, 255))
    exif[0x0112] = 6  # turned by 90 degrees: shown 3 wide, its bottom left on top
    image.save(tmp_path / "a.png", exif=exif)
    assert parse_color(f"{tmp_path / 'a.png'}@0,0").tolist() == [1, 1, 1]


def _tiff16() -> bytes:
    """One pixel of three channels of 16 bits; of each tag its type and its values."""
    tags = {256: [1], 257: [1], 258: [16, 16, 16], 259: [1], 262: [2], 273: [8], 277: [3], 278: [1], 279: [6]}
    fields = b"".join(
        struct.pack("<HHIHH", tag, 3, len(values), values[0] if len(values) == 1 else 14, 0)
        for tag, values in tags.items()
    )
    return b"II*\0" + struct.pack("<I6x3H", 20, 16, 16, 16) + struct.pack("<H", len(tags)) + fields + bytes(4)


def test_pixels_that_cannot_be_picked(tmp_path: Path) -> None:
    Image.new("RGBA", (2, 2), (9, 9, 9, 0)).save(tmp_path / "clear.png")
    Image.new("CMYK", (2, 2)).save(tmp_path / "print.tif")
    (tmp_path / "deep.tif").write_bytes(_tiff16())
    _png16(tmp_path / "gray_alpha.png", np.zeros((2, 2, 2)))
    (tmp_path / "text.png").write_text("no image")
    whole = (tmp_path / "clear.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
    for name, message in [
        ("clear.png@0,0", "the pixel is fully transparent"),
        ("clear.png@2,0", "the image has 2 x 2 pixels; count pixels from 0, starting at the top left corner"),
        ("print.tif@0,0", "the pixel format"),
        ("deep.tif@0,0", "the pixel format RGB of 16 bits is not supported"),
        ("gray_alpha.png@0,0", r"the pixel format is not supported \("),
        ("text.png@0,0", "the file is not a readable image"),
        ("cut.png@0,0", "the file is not a readable image"),
        ("none.png@0,0", "no file has this path; check the path"),
        (".@0,0", "pixel 0,0 of"),
    ]:
        with pytest.raises(tl.InputError, match=message):
            parse_color(str(tmp_path / name))
