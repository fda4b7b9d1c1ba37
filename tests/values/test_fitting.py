"""Fits to colors at distances: exact on clean samples, right on noisy ones, and honest about what is not there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.media.fitting import fit_medium, fit_wedge

SIGMA = np.array([120.0, 40.0, 3.0])
DISTANCES = np.array([1, 2, 3, 5, 8, 13]) * 1e-3


def test_clean_samples_give_the_medium_back() -> None:
    fit = fit_medium(DISTANCES, np.exp(-DISTANCES[:, None] * SIGMA), ior=1.4)
    assert fit.medium.extinction == pytest.approx(SIGMA, rel=1e-13)
    assert fit.medium.ior == 1.4
    assert fit.standard_error is not None
    assert fit.standard_error.max() < 1e-11
    assert np.abs(fit.residuals).max() < 1e-14
    assert fit.clipped == ()


def test_no_other_medium_is_nearer(rng: np.random.Generator) -> None:
    t = np.exp(-DISTANCES[:, None] * SIGMA + rng.normal(0, 0.05, (6, 3)))
    w = rng.uniform(0.1, 2, 6)
    best = np.asarray(fit_medium(DISTANCES, t, w).medium.absorption)

    def cost(sigma: np.ndarray) -> np.ndarray:
        return (w[:, None] * (np.log(t) + DISTANCES[:, None] * sigma) ** 2).sum(axis=0)

    for factor in (0.999, 1.001):
        assert (cost(best * factor) > cost(best)).all()


def test_the_standard_error_is_the_spread_of_repeated_fits(rng: np.random.Generator) -> None:
    found, errors = [], []
    for _ in range(400):
        fit = fit_medium(DISTANCES, np.exp(-DISTANCES[:, None] * SIGMA + rng.normal(0, 0.02, (6, 3))))
        found.append(np.asarray(fit.medium.absorption))
        assert fit.standard_error is not None
        errors.append(fit.standard_error**2)
    # 1200 numbers: their spread is known to 1 / sqrt(2 * 1200) = 2 %; the third channel is clipped at times.
    spread, told = np.std(found, axis=0)[:2], np.sqrt(np.mean(errors, axis=0))[:2]
    assert told == pytest.approx(spread, rel=0.12)
    assert np.mean(found, axis=0)[:2] == pytest.approx(SIGMA[:2], abs=4 * spread.max() / 20)


def test_weights_count_and_their_scale_does_not() -> None:
    t = [(0.5, 0.5, 0.5), (0.2, 0.2, 0.2)]
    only = fit_medium([0.01, 0.02], t, [1, 0])
    assert only.medium.extinction == pytest.approx([math.log(2) / 0.01] * 3, rel=1e-14)
    assert only.standard_error is None
    one, other = fit_medium([0.01, 0.02], t, [1, 3]), fit_medium([0.01, 0.02], t, [1e-200, 3e-200])
    assert one.medium.extinction == pytest.approx(other.medium.extinction, rel=1e-14)


def test_samples_that_brighten_give_no_absorption_and_are_told() -> None:
    fit = fit_medium([0.01, 0.02], [(0.5, 1.01, 1.0), (0.25, 1.02, 1.0)])
    assert fit.medium.extinction[1:].tolist() == [0, 0]
    assert fit.clipped == ("green",)
    assert fit.residuals[:, 1] == pytest.approx(-np.log([1.01, 1.02]) * -1, rel=1e-12)


def test_texts_are_colors_and_lengths_may_be_extreme() -> None:
    assert fit_medium([0.01], ["#7b1e3a"]).medium.extinction == pytest.approx(
        tl.Medium.from_color("#7b1e3a", 0.01).extinction, rel=1e-14
    )
    for scale in (1e-200, 1e200):
        fit = fit_medium([scale, 2 * scale], [(0.5,) * 3, (0.25,) * 3])
        assert fit.medium.extinction * scale == pytest.approx([math.log(2)] * 3, rel=1e-13)


@pytest.mark.parametrize(
    ("distances", "colors", "weights", "message"),
    [
        ([], [], None, "fit to 0 distances, 0 colors and 0 weights"),
        ([1], [(0.5,) * 3, (0.2,) * 3], None, "fit to 1 distances, 2 colors and 2 weights"),
        ([1, 0], [(0.5,) * 3] * 2, None, "a distance is not finite, or not above 0"),
        ([1, math.inf], [(0.5,) * 3] * 2, None, "a distance is not finite, or not above 0"),
        ([1], [(0.5, 0, 0.5)], None, r"color \[0.5, 0.0, 0.5\]; a channel of the color is not above 0"),
        ([1], [(0.5,) * 3], [0], "weights of a fit; a weight is negative or not finite, or all weights are 0"),
        ([1, 1], [(0.5,) * 3] * 2, [1, -1], "weights of a fit"),
    ],
)
def test_bad_samples_are_refused(distances: list[float], colors: object, weights: object, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        fit_medium(distances, colors, weights)  # type: ignore[arg-type]


def test_a_photographed_wedge(tmp_path: Path) -> None:
    table = tmp_path / "wedge.csv"
    rows = [
        f"{1e3 * d:g},{','.join(repr(v) for v in np.exp(-d * SIGMA).tolist())},{i + 1}" for i, d in enumerate(DISTANCES)
    ]
    table.write_text("\ufeffDistance, R, G, B, weight\r\n" + "\r\n".join(rows) + "\r\n\r\n", encoding="utf-8")
    fit = fit_wedge(table, unit="mm")
    assert fit.medium.extinction == pytest.approx(SIGMA, rel=1e-13)
    assert fit.weights == pytest.approx(np.arange(1, 7) / 6)
    table.write_text('distance,color\n1cm,#7b1e3a\n2cm,"linear(.1,.05,.01)"\n')
    assert fit_wedge(table).distances.tolist() == [0.01, 0.02]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column 'distance': the file is empty"),
        ("distance,color\n", "no rows; add at least one row"),
        ("distance,r,g\n1,1,1\n", "no column 'color' or 'b': the first line is distance, r, g"),
        (
            "distance,color\n1,red\n",
            r"wedge.csv line 2: fit to color \[1.0, 0.0, 0.0\]; a channel of the color is not above 0",
        ),
        (
            "distance,color\n1,teal2\n",
            r"line 2: color 'teal2'; the text is neither a hex color, a CSS name, srgb\(r,g,b\) nor linear\(r,g,b\)",
        ),
        ("distance,color\n1,gray\n-1,gray\n", "line 3: length '-1'; the length must be positive"),
        (
            "distance,color\n1,linear(.1,.2,.3)\n",
            r"line 2: cells of a table row; the row has more cells than there are columns; .*into quotes",
        ),
        ("distance,color,weight\n1,gray,much\n", "line 2: weight 'much'; the value is not a number"),
        ("distance,color\n,gray\n", "line 2: distance; a value is missing; fill in the missing value"),
        ("distance,color\n1,\n", "line 2: color; a value is missing; fill in the missing value"),
    ],
)
def test_a_bad_wedge_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "wedge.csv").write_text(text)
    with pytest.raises(tl.InputError, match=message):
        fit_wedge(tmp_path / "wedge.csv")


def test_a_notebook_shows_the_fit() -> None:
    fit = fit_medium([0.01, 0.02], [(0.5, 0.4, 0.3), (0.25, 0.16, 0.09)])
    assert fit._repr_html_() == fit.medium._repr_html_()
