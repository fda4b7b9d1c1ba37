"""Average colors over thickness, and the extinction for one: analytic distributions, hard ones, and refusals."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import translucent as tl
from translucent.frames.appearance import (
    QUANTILES,
    appearance_of,
    average_color,
    extinction_for_average_color,
    medium_for_average_color,
    thickness_samples,
)
from translucent.geometry.solids import Sphere

TARGETS = [(0.9, 0.5, 0.1), (1.0, 1 - 1e-12, 0.999), (1e-4, 0.01, 0.3)]


def _distributions() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {
        "one pixel": np.array([0.02]),
        "slab": np.full(1000, 0.3),
        "even": rng.uniform(0, 1, 10_000),
        "over nine decades": 10 ** rng.uniform(-9, 0, 10_000),
        "thin but for one pixel": np.append(np.full(99_999, 1e-7), 1.0),
        "two shells": np.repeat([1e-3, 5.0], 500),
        "kilometers": rng.uniform(1e3, 2e3, 1000),
        "thin everywhere": rng.uniform(1e-12, 2e-12, 1000),
        "some clear": np.append(np.full(9_999_9, 0.1), [0.0] * 5),
    }


@pytest.mark.parametrize("target", TARGETS, ids=str)
@pytest.mark.parametrize("name", _distributions())
def test_the_average_is_the_target(name: str, target: tuple[float, float, float]) -> None:
    thickness = _distributions()[name]
    medium = medium_for_average_color(thickness, target)
    assert average_color(thickness, medium) == pytest.approx(target, rel=1e-11)
    assert (medium.extinction[np.array(target) == 1] == 0).all()


def test_an_even_distribution_in_closed_form() -> None:
    d = (np.arange(100_000) + 0.5) / 1e5  # midpoints: the mean is (1 - exp(-x)) / x to x^2 / 24e10
    sigma = np.array([0.5, 3.0, 20.0])
    expected = -np.expm1(-sigma) / sigma
    assert average_color(d, tl.Medium(absorption=sigma)) == pytest.approx(expected, rel=1e-8)
    assert extinction_for_average_color(d, expected) == pytest.approx(sigma, rel=1e-7)


def test_a_slab_is_a_color_at_a_distance() -> None:
    expected = tl.Medium.from_color((0.2, 0.5, 1.0), 0.03).extinction
    assert extinction_for_average_color(np.full(7, 0.03), (0.2, 0.5, 1.0)) == pytest.approx(expected, rel=1e-14)


def test_a_darker_target_needs_more_extinction() -> None:
    d = _distributions()["over nine decades"]
    targets = np.geomspace(1e-4, 1, 30)
    found = np.array([extinction_for_average_color(d, (t,) * 3)[0] for t in targets])
    assert (np.diff(found) < 0).all()


@pytest.mark.parametrize(
    ("thickness", "color", "message"),
    [
        ([0.1], (0.0, 0.5, 0.5), r"red = 0; the value must satisfy 0\.0001 <= t <= 1; use 0.0001 or more"),
        ([0.1], (0.5, 5e-5, 0.5), "green = 5e-05; the value must satisfy"),
        ([0.1], (0.5, 0.5, 1.5), "blue = 1.5; .*a medium cannot amplify light"),
        ([0.0, 0.1], (0.5, 0.9, 0.9), "red = 0.5; 50 % of the pixels have a thickness of 0 and stay white"),
        ([0.0, 0.0], (0.9,) * 3, "100 % of the pixels have a thickness of 0"),
        ([1e-320], (0.5,) * 3, "so thin that the extinction overflows"),
        ([], (0.5,) * 3, "no pixel shows a valid part of the model"),
        ([-1.0], (0.5,) * 3, "negative or not finite"),
        ([math.nan], (0.5,) * 3, "negative or not finite"),
    ],
)
def test_what_no_medium_can_do_is_refused(thickness: list[float], color: object, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        extinction_for_average_color(thickness, color)  # type: ignore[arg-type]


def test_a_mesh_that_is_invalid_everywhere_says_so() -> None:
    color, flag = np.zeros((1, 2, 3)), np.array([[True, True]])
    thickness = np.ones((1, 2), dtype=np.float32)
    plan = tl.plan(tl.showcase(Sphere().tessellate(8), stage="none"))
    with pytest.raises(
        tl.InputError,
        match="all 2 pixels that the mesh covers are marked invalid; close the holes of the mesh, which",
    ):
        thickness_samples(tl.Frame(color, color, color, thickness, flag, ~flag, plan))


def test_an_appearance_goes_from_thin_to_thick() -> None:
    thickness = (np.arange(1000) + 0.5) / 1000  # its quantiles are the shares themselves, to half a pixel
    medium = tl.Medium(absorption=(0.0, 1.0, 30.0))
    looks = appearance_of(thickness[::-1], medium)
    assert (looks.medium, looks.pixels) == (medium, 1000)
    assert looks.mean_thickness == pytest.approx(0.5, rel=1e-12)
    assert looks.thickness == pytest.approx(QUANTILES, abs=5e-4)
    assert looks.color == pytest.approx(average_color(thickness, medium), rel=1e-14)
    assert looks.colors == pytest.approx(np.exp(-np.outer(looks.thickness, [0, 1, 30])), rel=1e-13)
    # Of an even distribution, the share of light up to thickness x is (1 - exp(-sigma x)) / (1 - exp(-sigma)).
    expected = [0.05, -np.expm1(-0.05) / -np.expm1(-1.0), -np.expm1(-1.5) / -np.expm1(-30.0)]
    assert looks.thin_share == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("thickness", [[0.1], [0.0, 0.0], [1e3, 2e3]])
def test_an_appearance_of_little_or_of_black_is_plain_json(thickness: list[float]) -> None:
    looks = appearance_of(thickness, tl.Medium(absorption=(0.0, 1.0, 1e4)))
    told = json.loads(json.dumps(looks.summary(), allow_nan=False))
    assert told["average_color"] == looks.color.tolist()
    assert [part["thinner"] for part in told["parts"]] == list(QUANTILES)
    assert (looks.thin_share > 0).all()
    assert looks._repr_html_().count("background:#") == 6


def test_white_needs_nothing_even_without_thickness() -> None:
    for thickness in ([0.0, 0.1], [0.0]):
        assert medium_for_average_color(thickness, (1, 1, 1), ior=1.2) == tl.Medium(ior=1.2)


def test_of_a_frame_only_covered_and_valid_pixels_count() -> None:
    thickness = np.array([[1.0, 2.0], [-1e-9, 9.0]], dtype=np.float32)
    covered, valid = np.array([[True, False], [True, True]]), np.array([[True, True], [True, False]])
    color = np.zeros((2, 2, 3))
    frame = tl.Frame(
        color, color, color, thickness, covered, valid, tl.plan(tl.showcase(Sphere().tessellate(8), stage="none"))
    )
    assert thickness_samples(frame).tolist() == [1.0, 0.0]
