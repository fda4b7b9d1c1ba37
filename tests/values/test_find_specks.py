"""The tool that looks for specks in pictures finds them, and neither lines nor edges nor noise."""

from __future__ import annotations

import numpy as np

from tools.find_specks import FINER, confirmed, isolated


def test_single_pixels_are_specks_and_lines_are_none(rng: np.random.Generator) -> None:
    smooth = 1.0 + np.linspace(0.0, 1.0, 60)[:, None, None] * np.ones((60, 60, 3))
    inside = np.ones((60, 60), bool)
    noisy = smooth * rng.uniform(0.98, 1.02, smooth.shape)
    assert not isolated(smooth, inside).any()
    assert not isolated(noisy, inside).any()
    marked = noisy.copy()
    marked[20, 30] *= 1.5
    marked[40, 10] *= 0.6
    marked[:, 45:] *= 3.0
    marked[10, 5:40] *= 2.0
    found = isolated(marked, inside)
    assert np.argwhere(found).tolist() == [[20, 30], [40, 10]]
    assert not isolated(marked, np.zeros_like(inside)).any()


def test_flanks_of_highlights_are_not_isolated() -> None:
    picture = np.full((30, 30, 3), 0.3)
    picture[15, 12:17] = np.array([0.9, 10.9, 16.0, 4.3, 0.9])[:, None]
    picture[16, 12:17] = np.array([1.0, 10.0, 11.0, 1.9, 0.5])[:, None]
    assert not isolated(picture, np.ones((30, 30), bool)).any()


def test_what_finer_pictures_have_too_is_of_the_scene() -> None:
    picture = np.ones((10, 12, 3))
    picture[4, 5] = picture[7, 8] = 2.0
    fine = np.ones((10 * FINER, 12 * FINER, 3))
    fine[4 * FINER + 1, 5 * FINER + 2] = 1.0 + 0.6 * FINER**2
    fine[7 * FINER, 8 * FINER] = 1.0 - 0.6 * FINER**2
    there = confirmed(picture, fine)
    assert there[4, 5]
    assert not there[7, 8]
