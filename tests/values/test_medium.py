"""Media: their numbers and their refusals."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.media.colors import parse_color
from translucent.media.medium import Medium

NAN, INF = math.nan, math.inf
JADE = (0.18, 0.62, 0.35)


def test_a_medium_has_its_color_at_its_distance() -> None:
    jade = Medium.from_color(JADE, distance=0.02)
    # log, division, product and exp: 4 roundings, times the optical depth, 1.8 at most.
    assert jade.transmittance(0.02) == pytest.approx(JADE, rel=2e-15)
    assert jade.transmittance(0.04) == pytest.approx(np.square(JADE), rel=4e-15)
    assert jade.extinction == pytest.approx(-np.log(JADE) / 0.02, rel=1e-15)


@given(st.tuples(*[st.floats(1e-30, 1)] * 3), st.floats(1e-6, 1e6), st.floats(0, 10))
def test_color_distance_and_extinction_agree(color: tuple[float, ...], distance: float, factor: float) -> None:
    medium = Medium.from_color(color, distance)
    with np.errstate(under="ignore"):
        depth = -np.log(color) * factor
        expected = np.exp(-depth)
    assert medium.transmittance(factor * distance) == pytest.approx(expected, rel=1e-14 * max(1.0, depth.max()), abs=0)


@pytest.mark.parametrize(
    ("distance", "told"),
    [
        (-1, "transmittance after -1 m; the length is below 0; give lengths of paths through the medium, 0 or above"),
        (
            [0.0, -0.5, np.nan, -2.0],
            "transmittance after -0.5 m; the length is below 0 at 2 of 4 places; give lengths of paths through the",
        ),
        (-np.inf, "transmittance after -inf m; the length is below 0;"),
    ],
)
def test_no_way_is_shorter_than_nothing(distance: Any, told: str) -> None:
    medium = Medium(absorption=(1, 2, 3))
    for of in (medium.transmittance, lambda some: tl.color_at_distance(medium.extinction, some)):
        with pytest.raises(tl.InputError, match=re.escape(told)):
            of(distance)
        assert of(-0.0).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("shape", [(), (4,), (2, 3), (0,)])
def test_transmittance_adds_a_channel_axis(shape: tuple[int, ...]) -> None:
    assert Medium(absorption=(1, 2, 3)).transmittance(np.ones(shape)).shape == (*shape, 3)


def test_no_distance_no_loss_and_a_huge_one_all() -> None:
    medium = Medium(absorption=(1.0, 1e-3, 5.0))
    assert medium.transmittance([0.0, 1e9]).tolist() == [[1, 1, 1], [0, 0, 0]]


def test_extinction_is_absorption_plus_scattering() -> None:
    medium = Medium(absorption=(1, 2, 3), scattering=(0.5, 0, 4))
    assert medium.extinction.tolist() == [1.5, 2.0, 7.0]
    assert medium.extinction.dtype == np.float64


def test_hex_is_srgb_and_a_bare_triple_is_linear() -> None:
    assert Medium.from_color("#7b1e3a", 0.01) == Medium.from_color(parse_color("#7b1e3a"), 0.01)
    assert Medium.from_color("#808080", 1.0) != Medium.from_color((128 / 255,) * 3, 1.0)


def test_a_single_number_stands_for_all_channels() -> None:
    assert Medium(absorption=2.0) == Medium(absorption=(2.0, 2.0, 2.0))


def test_white_absorbs_exactly_nothing() -> None:
    medium = Medium.from_color((1, 1, 1), 0.02)
    assert medium.extinction.tolist() == [0, 0, 0]
    assert not np.signbit(medium.extinction).any()
    assert medium == Medium()


@pytest.mark.parametrize("distance", [INF, 1e308])
def test_a_color_infinitely_far_away_leaves_light_as_it_is(distance: float) -> None:
    medium = Medium.from_color((0.18, 0.999999, 1.0), distance)
    assert medium.transmittance(1e3).tolist() == [1.0, 1.0, 1.0]
    if distance == INF:
        assert medium.extinction.tolist() == [0.0, 0.0, 0.0]


def test_tiny_and_huge_distances_are_fine_while_the_extinction_is_finite() -> None:
    for distance in (1e-30, 1e30):
        assert Medium.from_color((0.5,) * 3, distance).transmittance(distance) == pytest.approx((0.5,) * 3, rel=4e-16)


@pytest.mark.parametrize(
    ("color", "distance", "message"),
    [
        (
            (0.0, 0.5, 0.5),
            1,
            "color (0.0, 0.5, 0.5); red = 0 is not in 0 < t <= 1; a channel of 0 would need an infinite extinction;",
        ),
        ((0.5, -0.0, 0.5), 1, "green = -0 is not in 0 < t <= 1"),
        (
            (0.5, 0.5, -0.1),
            1,
            "blue = -0.1 is not in 0 < t <= 1; a channel of 0 would need an infinite extinction; use a value such",
        ),
        (
            (0.5, 1.5, 0.5),
            1,
            "green = 1.5 is not in 0 < t <= 1; a medium cannot amplify light; scale the color to at most 1",
        ),
        ((0.5, 0.5, NAN), 1, "a channel of the color is not a finite number"),
        ((0.5, 0.5, INF), 1, "a channel of the color is not a finite number"),
        ("#ff0000", 1, "color '#ff0000'; green = 0 is not in 0 < t <= 1"),
        ("nonsense", 1, "color 'nonsense'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ((0.5, 0.5), 1, "not (3,)"),
        (JADE, 0, "distance 0; the distance must be above 0; give the distance in metres"),
        (JADE, -0.02, "distance -0.02; the distance must be above 0"),
        (JADE, -INF, "distance -inf; the distance must be above 0"),
        (JADE, NAN, "distance nan; the distance must be above 0"),
        (JADE, "2cm", "distance '2cm'; the distance is a text with a unit; give the distance in metres: 0.02"),
        (JADE, None, "distance None; the distance must be above 0"),
        (JADE, 1e-309, "distance 1e-309 m; the distance is so short that the extinction overflows"),
        ((1e-300,) * 3, 1e-306, "so short that the extinction overflows"),
    ],
    ids=str,
)
def test_no_medium_has_such_a_color(color: Any, distance: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        Medium.from_color(color, distance)


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"absorption": (1, -1, 0)}, "medium absorption (1.0, -1.0, 0.0); a value is negative or not finite"),
        ({"absorption": (1, NAN, 0)}, "medium absorption (1.0, nan, 0.0); a value is negative or not finite"),
        ({"absorption": INF}, "medium absorption (inf, inf, inf); a value is negative or not finite"),
        ({"scattering": (0, 0, -1e-9)}, "medium scattering"),
        ({"emission": (-1, 0, 0)}, "medium emission"),
        ({"absorption": (1, 2)}, "medium absorption (1, 2); the value must be one or three numbers"),
        ({"absorption": "red"}, "medium absorption 'red'; the value must be one or three numbers"),
        ({"anisotropy": 1.0}, "medium anisotropy 1.0; the anisotropy must lie between -1 and 1"),
        ({"anisotropy": -1.0}, "medium anisotropy -1.0"),
        ({"anisotropy": NAN}, "medium anisotropy nan"),
        ({"ior": 0.9}, "medium ior 0.9; the index of refraction must lie in 1 to 100"),
        ({"ior": INF}, "medium ior inf"),
        ({"ior": NAN}, "medium ior nan"),
    ],
    ids=str,
)
def test_no_medium_has_such_coefficients(given_: dict[str, Any], message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        Medium(**given_)


def test_equal_media_are_equal_and_hash_alike() -> None:
    one, same = Medium(absorption=(1, 0, 3), ior=1.5), Medium(absorption=[1.0, -0.0, 3.0], ior=1.5)
    assert one == same
    assert hash(one) == hash(same)
    assert len({one, same}) == 1


@pytest.mark.parametrize(
    "change",
    [{"absorption": (1, 2, 4)}, {"scattering": 1.0}, {"emission": 1.0}, {"anisotropy": 0.5}, {"ior": 1.4}],
    ids=str,
)
def test_media_that_differ_anywhere_are_not_equal(change: dict[str, Any]) -> None:
    one = Medium(absorption=(1, 2, 3), ior=1.5)
    assert dataclasses.replace(one, **change) != one
    assert one != "jade"


def test_a_medium_cannot_be_changed() -> None:
    source = np.array([1.0, 2.0, 3.0])
    medium = Medium(absorption=source)
    source[0] = 9.0
    assert medium.absorption[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        medium.absorption[0] = 9.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        medium.ior = 2.0  # type: ignore[misc]


def test_emits_and_scatters_look_at_every_channel() -> None:
    assert (Medium().emits, Medium().scatters) == (False, False)
    assert Medium(emission=(0, 0, 1e-9)).emits
    assert Medium(scattering=(0, 0, 1e-9)).scatters


def test_an_infinite_way_through_nothing_loses_nothing() -> None:
    assert Medium(absorption=(0.0, 1.0, 2.0)).transmittance(np.inf).tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"absorption": 1e301}, r"medium absorption .* the value is above the limit of 1e\+300"),
        ({"emission": 1e19}, r"medium emission .* the value is above the limit of 1e\+18"),
        ({"ior": 1e3}, "medium ior 1000.0; the index of refraction must lie in 1 to 100"),
    ],
)
def test_what_no_float32_could_carry_is_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        Medium(**values)


def test_particles_cover_what_they_project() -> None:
    """Max 1995: sigma_t = rho pi r^2, of which the albedo scatters; what absorbs also glows."""
    medium = Medium.from_particles(1e6, 1e-3, albedo=(0.0, 0.25, 1.0), glow=(1.0, 2.0, 3.0), anisotropy=-0.3)
    assert medium.extinction == pytest.approx([math.pi] * 3, rel=1e-15)
    assert medium.scattering == pytest.approx([0, 0.25 * math.pi, math.pi], rel=1e-15)
    # Without background a deep medium of them shines as they do, where they do not scatter.
    assert medium.emission == pytest.approx([math.pi, 1.5 * math.pi, 0], rel=1e-15)
    assert medium.anisotropy == -0.3


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"number_density": -1.0, "radius": 1.0}, "number_density -1.0; the value must be a number of 0 or above"),
        ({"number_density": 1.0, "radius": NAN}, "radius nan"),
        ({"number_density": 1.0, "radius": INF}, "radius inf"),
        ({"number_density": 1.0, "radius": 1.0, "albedo": 1.5}, "albedo .* above 1"),
        ({"number_density": 1.0, "radius": 1.0, "albedo": -0.1}, "albedo .* negative"),
        ({"number_density": 1.0, "radius": 1.0, "glow": NAN}, "glow .* not finite"),
        ({"number_density": 1e300, "radius": 1e300}, "not finite"),
    ],
)
def test_particles_that_cannot_be(values: dict[str, Any], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        Medium.from_particles(**values)
