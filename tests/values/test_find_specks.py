"""The tool that looks for specks in pictures finds them, and neither lines nor edges nor noise."""

from __future__ import annotations

import numpy as np

from tools.find_specks import specks


def test_single_pixels_are_specks_and_lines_are_none(rng: np.random.Generator) -> None:
    smooth = 1.0 + np.linspace(0.0, 1.0, 60)[:, None, None] * np.ones((60, 60, 3))
    inside = np.ones((60, 60), bool)
    noisy = smooth * rng.uniform(0.98, 1.02, smooth.shape)
    assert not specks(smooth, inside).any()
    assert not specks(noisy, inside).any()
    marked = noisy.copy()
    marked[20, 30] *= 1.5
    marked[40, 10] *= 0.6
    marked[:, 45:] *= 3.0
    marked[10, 5:40] *= 2.0
    found = specks(marked, inside)
    assert np.argwhere(found).tolist() == [[20, 30], [40, 10]]
    assert not specks(marked, np.zeros_like(inside)).any()
