"""Differences of color, and what they mean in words."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from translucent.bench.judgement import JUST_NOTICEABLE, color_difference, lab, visibility_words
from translucent.bench.record import ColorDifference, MethodRow
from translucent.media.colors import parse_color


@pytest.mark.parametrize(
    ("color", "expected"),
    [  # the coordinates of the sRGB primaries in CIELAB (D65), as color calculators tell them
        ("#ffffff", (100.0, 0.0, 0.0)),
        ("#000000", (0.0, 0.0, 0.0)),
        ("#ff0000", (53.24, 80.09, 67.20)),
        ("#00ff00", (87.74, -86.18, 83.18)),
        ("#0000ff", (32.30, 79.19, -107.86)),
        ("#777777", (50.03, 0.0, 0.0)),
        ("#030303", (0.82, 0.0, 0.0)),  # below the knee
    ],
)
def test_lab_of_known_colors(color: str, expected: tuple[float, float, float]) -> None:
    # The matrix has four digits, as IEC 61966-2-1 gives it: half a unit of the last, times 500 / 3 / X^(2/3).
    assert lab(parse_color(color)) == pytest.approx(expected, abs=0.05)


def test_what_a_screen_cannot_show_is_no_difference() -> None:
    assert color_difference(np.full((4, 3), 3.0), np.ones((4, 3))) == ColorDifference(0.0, 0.0, 0.0)


def test_what_is_left_behind_ink_underflows_to_black() -> None:
    assert color_difference(np.full((4, 3), 1e-300), np.zeros((4, 3))).max < 1e-30
    assert color_difference(np.full((4, 3), 5e-324), np.full((4, 3), 1e-320)).max < 1e-30


def test_a_step_of_8_bits_is_not_seen_and_eight_are() -> None:
    """Steps of the gray of 18 %, which is about half of the way in lightness."""
    near, far = (parse_color(f"srgb({v},{v},{v})") for v in ((119 + 1) / 255, (119 + 8) / 255))
    assert color_difference(near[None], parse_color("#777777")[None]).max < JUST_NOTICEABLE
    assert color_difference(far[None], parse_color("#777777")[None]).max > JUST_NOTICEABLE


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ((0.1, 1.0, 2.0), "nobody would see the difference: no pixel is off by more than 2 in CIELAB, and 2.3 is just"),
        ((0.1, 2.0, 20.0), "hardly anybody would see the difference: one pixel in a thousand is off by more than 2 in"),
        ((0.1, 30.0, 50.0), "the difference would be seen in places: up to 30 in CIELAB, and 2.3 is just noticed"),
        ((9.0, 30.0, 50.0), "the difference would be seen at a glance: half of the pixels are off by 9 in CIELAB"),
    ],
)
def test_the_words(found: tuple[float, float, float], words: str) -> None:
    row = MethodRow("a", "a", "", "method", "", True, color_difference=ColorDifference(*found))
    assert visibility_words(row).startswith(words)
    assert visibility_words(dataclasses.replace(row, color_difference=None)) == ""
