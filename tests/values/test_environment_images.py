"""Environments of pictures: projection, lookups, reductions, refusals, backgrounds and the studio."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.scene.environment import equirectangular_uv
from translucent.scene.environment_map import EnvironmentMap, row_solid_angles, texel_directions

EPS = float(np.finfo(np.float64).eps)
NAN, INF = float("nan"), float("inf")


def picture(height: int = 8, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).random((height, 2 * height, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("direction", "uv"),
    [
        ((0, 0, -1), (0.5, 0.5)),
        ((1, 0, 0), (0.75, 0.5)),
        ((-1, 0, 0), (0.25, 0.5)),
        ((0, 1, 0), (0.5, 0.0)),
        ((0, -1, 0), (0.5, 1.0)),
        ((0, 1, -1), (0.5, 0.25)),
    ],
)
def test_the_center_is_ahead_and_the_top_is_up(direction: tuple[int, int, int], uv: tuple[float, float]) -> None:
    unit = np.array(direction) / np.linalg.norm(direction)
    assert equirectangular_uv(unit, 0.0) == pytest.approx(uv, abs=4 * EPS)


def test_a_turn_moves_the_center_counterclockwise_as_seen_from_above() -> None:
    # About +Y, -Z turns to -X by a quarter.
    assert equirectangular_uv((-1.0, 0.0, 0.0), 0.25) == pytest.approx((0.5, 0.5), abs=4 * EPS)
    pixels = picture()
    still, turned = tl.Environment.image(pixels), tl.Environment.image(pixels, rotation=90)
    ahead = np.array([[0.3, 0.5, -0.8]]) / np.linalg.norm((0.3, 0.5, -0.8))
    left = ahead @ np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # rows: what +X, +Y and +Z become
    assert left[0] @ (-1, 0, 0) == pytest.approx(ahead[0] @ (0, 0, -1))
    np.testing.assert_allclose(turned.lighting(left), still.lighting(ahead), rtol=1e-12)


def test_lookups_hit_pixel_centers_wrap_around_and_stop_at_the_poles() -> None:
    pixels = picture()
    environment = tl.Environment.image(pixels)
    np.testing.assert_allclose(environment.lighting(texel_directions(8, 16)), pixels, rtol=1e-12)
    half_way = environment.map.at((0.0, 3.5 / 8))  # the seam is half way between the last column and the first
    assert half_way == pytest.approx(0.5 * (pixels[3, 0].astype(float) + pixels[3, 15]), rel=1e-12)
    assert environment.map.at((1.0, 3.5 / 8)) == pytest.approx(half_way, rel=1e-12)
    at_pole = environment.map.at(((2 + 0.5) / 16, 0.0))
    assert at_pole == pytest.approx(pixels[0, 2], rel=1e-12)


def test_exposure_counts_in_stops_and_text_is_not_taken_for_pixels() -> None:
    dark, bright = tl.Environment.image(picture()), tl.Environment.image(picture(), exposure=2.0)
    ahead = np.array([[0.0, 0.0, -1.0]])
    np.testing.assert_allclose(bright.lighting(ahead), 4 * dark.lighting(ahead), rtol=1e-12)
    np.testing.assert_allclose(bright.mean, 4 * dark.mean, rtol=1e-12)
    np.testing.assert_allclose(bright.irradiance_on(ahead), 4 * dark.irradiance_on(ahead), rtol=1e-12)


def test_solid_angles_are_exact_and_make_the_mean() -> None:
    angles = row_solid_angles(6, 12)
    assert 12 * angles.sum() == pytest.approx(4 * np.pi, rel=8 * EPS)
    assert 12 * angles[0] == pytest.approx(2 * np.pi * (1 - np.cos(np.pi / 6)), rel=8 * EPS)
    pixels = np.zeros((6, 12, 3))
    pixels[0] = 1.0
    assert EnvironmentMap(pixels).mean == pytest.approx(np.full(3, 12 * angles[0] / (4 * np.pi)), rel=8 * EPS)


@pytest.mark.parametrize("size", [(4, 8), (3, 5), (8, 16)])
def test_reduction_keeps_the_integral(size: tuple[int, int]) -> None:
    source = EnvironmentMap(picture())
    integral = row_solid_angles(*size) @ source.reduced(*size).sum(axis=1)
    assert integral == pytest.approx(4 * np.pi * source.mean, rel=1e-12)
    np.testing.assert_allclose(EnvironmentMap(np.ones((8, 16, 3))).reduced(*size), 1.0, rtol=1e-14)


def test_all_kinds_are_pictures_to_light_with() -> None:
    gradient = tl.Environment.gradient((0.0, 0.1, 0.2), (1.0, 0.8, 2.0))
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = gradient.light_map.at(equirectangular_uv(directions, 0.0))
    # Half a row from the pole the picture ends: there the sine is off by (pi / 512)^2 / 2 of half the contrast.
    np.testing.assert_allclose(seen, gradient.lighting(directions), atol=0.5 * (np.pi / 512) ** 2 * 0.9 + 2e-5)
    board = tl.Environment.checkerboard((1, 0, 0.5), (0, 0.5, 0.5))
    np.testing.assert_allclose(board.light_map.pixels, np.broadcast_to((0.5, 0.25, 0.5), (2, 4, 3)), rtol=1e-7)
    np.testing.assert_allclose(board.lighting(directions), np.broadcast_to((0.5, 0.25, 0.5), (200, 3)))


def test_a_background_is_seen_and_does_not_light() -> None:
    sky, board = tl.Environment.gradient(0.1, 1.0), tl.Environment.checkerboard(1.0, 0.0, tiles=2)
    both = sky.with_background(board)
    ahead, position = np.array([[0.0, 1.0, 0.0]]), np.array([[0.6, 0.1]])
    assert both.radiance(ahead, position).tolist() == [[0.0, 0.0, 0.0]]
    assert both.lighting(ahead) == pytest.approx(np.ones((1, 3)))
    assert both.irradiance_on(ahead) == pytest.approx(sky.irradiance_on(ahead))
    assert both.mean == pytest.approx(sky.mean)
    assert both.seen is board
    assert sky.seen is sky
    assert sky.with_background(both).seen is board  # of a background only what is seen of it counts


def test_pixels_that_are_no_radiance_become_black_and_are_counted() -> None:
    pixels = picture()
    pixels[0, 0, 0], pixels[1, 1, 1], pixels[2, 2, 2] = NAN, INF, -1.0
    with pytest.warns(tl.TranslucentWarning) as caught:
        environment = tl.Environment.image(pixels)
    assert [str(w.message) for w in caught] == [
        "environment image: 2 of 128 pixels are not finite, taken as 0",
        "environment image: 1 of 128 pixels are below 0, taken as 0",
    ]
    found = environment.map.pixels
    assert (found[0, 0, 0], found[1, 1, 1], found[2, 2, 2]) == (0, 0, 0)
    assert found[0, 0, 1] == pixels[0, 0, 1]
    assert caught[0].filename == __file__


def test_a_picture_too_bright_is_limited() -> None:
    with pytest.warns(tl.TranslucentWarning, match=r"1 of 8 pixels are above 1e\+18, taken as that"):
        environment = tl.Environment.image(np.where(np.arange(24).reshape(2, 4, 3) == 5, 1e30, 1.0))
    assert environment.map.pixels.max() == np.float32(1e18)


def test_a_picture_of_another_shape_is_stretched_with_a_warning() -> None:
    with pytest.warns(tl.TranslucentWarning, match="environment image: 8x8 pixels: .* twice as wide as high"):
        tl.Environment.image(np.ones((8, 8, 3)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tl.Environment.image(np.zeros((0, 0, 3))), r"environment image; the array has shape \(0, 0, 3\)"),
        (lambda: tl.Environment.image(np.ones((2, 4))), r"environment image; the array has shape \(2, 4\)"),
        (lambda: tl.Environment.image(np.full((2, 4, 3), "x")), "environment image; the pixels are not numbers"),
        (
            lambda: tl.Environment.image(np.full((2, 4, 3), NAN)),
            "environment image; no pixel has a finite radiance of 0 or above",
        ),
        (lambda: tl.Environment.image("sky.tga"), r"environment 'sky.tga'; suffix '.tga'; use one of .hdr"),
        (lambda: tl.Environment.image("no such.hdr"), "environment 'no such.hdr'; no file has this path"),
        (lambda: tl.Environment.image(np.ones((2, 4, 3)), rotation=INF), "rotation inf of an environment"),
        (
            lambda: tl.Environment.image(np.ones((2, 4, 3)), exposure=99),
            "exposure 99 of an environment; the exposure must lie within 32",
        ),
        (lambda: tl.Environment("image", 0.0, 0.0), "image environment; an image environment needs its pixels"),
        (lambda: tl.Environment.constant(1.0).with_background("red"), "background 'red'; of type str"),
    ],
)
def test_refusals(make: Callable[[], object], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        make()


def test_png_files_are_decoded(tmp_path: Path) -> None:
    from PIL import Image

    pixels = np.random.default_rng(1).integers(0, 256, (4, 8, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "sky.png")
    found = tl.Environment.image(tmp_path / "sky.png").map.pixels
    encoded = pixels / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    (tmp_path / "broken.png").write_bytes(b"\x89PNG nothing")
    with pytest.raises(tl.InputError, match=r"broken.png'; the file is not a readable image"):
        tl.Environment.image(tmp_path / "broken.png")


@pytest.mark.parametrize("names", ["RGB", "RGBA", "Y"])
def test_exr_files_are_read(tmp_path: Path, names: str) -> None:
    import OpenEXR

    pixels = (1000 * picture(4)).astype(np.float32)
    channels = {name: np.ascontiguousarray(pixels[..., i % 3]) for i, name in enumerate(names)}
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(tmp_path / "sky.exr"))
    found = tl.Environment.image(str(tmp_path / "sky.exr")).map.pixels
    np.testing.assert_array_equal(found, np.repeat(pixels[..., :1], 3, axis=2) if names == "Y" else pixels)


def test_broken_exr_files_are_refused(tmp_path: Path) -> None:
    import OpenEXR

    (tmp_path / "broken.exr").write_bytes(b"nothing")
    with pytest.raises(tl.InputError, match=r"broken.exr'; the file is not an OpenEXR file \("):
        tl.Environment.image(tmp_path / "broken.exr")
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Z": np.ones((2, 4), np.float32)}) as file:
        file.write(str(tmp_path / "depth.exr"))
    with pytest.raises(tl.InputError, match=r"depth.exr'; the file has the channels Z; use the channels R, G and B"):
        tl.Environment.image(tmp_path / "depth.exr")


def test_the_studio_is_made_once_and_balanced_for_pictures() -> None:
    studio = tl.Environment.studio()
    assert tl.Environment.studio(rotation=90).map is studio.map
    pixels = studio.map.pixels
    # Something that glass mirrors far brighter than paper, and cards that are all but black.
    assert pixels.max() > 5
    assert 0 < pixels.min() < 0.02
    # White matt surfaces come out between a shade and a little above white.
    assert 0.6 < studio.mean.mean() < 1.0
    normals = texel_directions(8, 16).reshape(-1, 3)
    white = studio.irradiance_on(normals).mean(axis=1) / np.pi
    assert white.min() > 0.2
    assert white.max() < 2.0
    # Seen ahead is the bright backdrop, below it the floor, which is warm.
    ahead, below = studio.lighting(np.array([[0.0, 0.1, -1.0], [0.0, -1.0, 0.0]]) / [[np.hypot(1, 0.1)], [1.0]])
    assert ahead.mean() > 0.8
    assert below[0] > 1.2 * below[2]
