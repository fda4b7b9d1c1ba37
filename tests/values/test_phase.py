"""Phase functions: over the sphere, their moments, and directions by chance."""

from __future__ import annotations

import dataclasses
import math
import pickle

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.formulas.phase import (
    Draine,
    HenyeyGreenstein,
    PhaseFunction,
    WaterDroplets,
    henyey_greenstein,
    parse_phase,
    phase_after_scattering,
    phase_cosine,
)
from translucent.reference import volume as reference

EPS = float(np.finfo(np.float64).eps)

PHASES: list[PhaseFunction] = [
    *(HenyeyGreenstein(g) for g in (-0.9, -0.3, 0.0, 1e-9, 0.5, 0.9)),
    *(Draine(g, alpha) for g in (-0.9, 0.0, 0.5, 0.9) for alpha in (0.0, 1.0, 30.0)),
    *(WaterDroplets(diameter) for diameter in (5e-6, 2e-5, 5e-5)),
]


def _sphere_rule() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Cosines and weights (2 pi included) of 24 Gauss points in each of panels that shrink to both ends."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    edges = np.concatenate([[0.0], 2.0 ** np.arange(-24, 1)])
    low, high = edges[:-1, None], edges[1:, None]
    from_end = (low + (high - low) * (nodes + 1) / 2).ravel()
    weight = ((high - low) * weights / 2).ravel()
    return np.concatenate([1 - from_end, from_end - 1]), 2 * np.pi * np.concatenate([weight, weight])


G_VALUES = [-0.99, -0.75, -0.3, 0.0, 1e-9, 0.5, 0.9, 0.99]


@pytest.mark.parametrize("g", G_VALUES)
def test_phase_function_integrates_to_one_with_mean_cosine_g(g: float) -> None:
    # Rounding of the cosine, EPS/2, against the width (1 - |g|)^2 / 2 of the peak, with the exponent 3/2.
    tolerance = 4 * EPS / (1 - abs(g)) ** 2 + 1e-14
    cosine, weight = _sphere_rule()
    phase = henyey_greenstein(cosine, g)
    assert float(weight @ phase) == pytest.approx(1.0, abs=tolerance)
    assert float(weight @ (phase * cosine)) == pytest.approx(g, abs=tolerance)


@pytest.mark.parametrize("cosine", [-1.0, -0.3, 0.0, 1.0])
def test_phase_function_without_anisotropy_is_uniform(cosine: float) -> None:
    assert henyey_greenstein(cosine, 0.0) == pytest.approx(1 / (4 * math.pi), rel=2 * EPS)


@pytest.mark.parametrize("g", G_VALUES)
def test_phase_function_straight_on_and_back(g: float) -> None:
    forward = (1 + g) / (4 * math.pi * (1 - g) ** 2)
    backward = (1 - g) / (4 * math.pi * (1 + g) ** 2)
    # Backwards the base is (1 - g)^2 + 4 g: EPS of 4, against (1 + g)^2.
    assert henyey_greenstein(1.0, g) == pytest.approx(forward, rel=8 * EPS)
    assert henyey_greenstein(-1.0, g) == pytest.approx(backward, rel=8 * EPS / (1 + g) ** 2 + 8 * EPS)


@pytest.mark.parametrize("g", [1 - 1e-9, -1 + 1e-9])
def test_phase_function_is_finite_and_positive_next_to_the_limit(g: float) -> None:
    phase = henyey_greenstein(np.linspace(-1, 1, 101) * (1 - 1e-6), g)
    assert np.isfinite(phase).all()
    assert (phase > 0).all()


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_moments_are_integrals_over_the_sphere(phase: PhaseFunction) -> None:
    cosine, weight = _sphere_rule()
    found = np.polynomial.legendre.legvander(cosine, 5).T @ (weight * phase.value(cosine))
    # Rounding of the cosine against the width of the peak, as above, times the slope 15 of the fifth polynomial at 1.
    tolerance = 100 * EPS / (1 - max(map(abs, phase.parameters[:2]))) ** 2 + 1e-13
    np.testing.assert_allclose(found, phase.moments(6), atol=tolerance)
    assert phase.mean_cosine == pytest.approx(found[1], abs=tolerance)


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_sampled_cosines_follow_the_phase_function(phase: PhaseFunction) -> None:
    """Below any cosine are as many samples, for random numbers at even steps, as the phase function has light there."""
    number = 40000
    found = np.sort(phase_cosine(phase.parameters, (np.arange(number) + 0.5) / number))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    edges = np.concatenate([[-1.0], found[::500], [1.0]])
    low, high = edges[:-1, None], edges[1:, None]
    between = 2 * np.pi * (phase.value(low + (high - low) * (nodes + 1) / 2) * weights * (high - low) / 2).sum(axis=1)
    expected = np.searchsorted(found, edges[1:-1]) / number
    # A sample stands for 1 / 40000 of the light; both parts of a mixture leave half of one.
    np.testing.assert_allclose(np.cumsum(between)[:-1], expected, atol=1.5 / number)


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_the_reference_has_the_same(phase: PhaseFunction, rng: np.random.Generator) -> None:
    """Written independently: equal values, and directions by chance with the same moments."""
    cosine = np.linspace(-1, 1, 201)
    np.testing.assert_allclose(reference.phase_value(phase, cosine), phase.value(cosine), rtol=1e-12)
    straight = np.tile([0.0, 0.0, 1.0], (40000, 1))
    found = reference.scattered_directions(straight, (phase,), np.zeros(40000, np.int64), rng)[:, 2]
    moments = np.polynomial.legendre.legvander(found, 4).mean(axis=0)
    # Polynomials are within 1: three standard errors, and one, of a mean of 40,000.
    np.testing.assert_allclose(moments, phase.moments(5), atol=4 / math.sqrt(40000))


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_phase_functions_as_text(phase: PhaseFunction) -> None:
    assert parse_phase(str(phase)) == phase
    assert pickle.loads(pickle.dumps(phase)) == phase


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no phase function has this name"),
        ("mie 3", "no phase function has this name"),
        ("henyey_greenstein", "this phase function needs 1 numbers"),
        ("henyey_greenstein a", "this phase function needs 1 numbers"),
        ("henyey_greenstein 1", "the (anisotropy|parameter) must lie between -1 and 1"),
        ("draine 1 2", "the (anisotropy|parameter) must lie between -1 and 1"),
        ("draine 0.5 -1", "the parameter must lie in 0 to"),
        ("water_droplets 20", "the droplet diameter must lie in 5e-6 to 5e-5 m"),
    ],
)
def test_text_that_is_no_phase_function(text: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        parse_phase(text)


def test_a_medium_with_a_phase_function_has_its_mean_cosine() -> None:
    phase = HenyeyGreenstein(0.4)
    medium = tl.Medium(scattering=1.0, phase=phase)
    assert medium.anisotropy == 0.4
    assert medium == tl.Medium(scattering=1.0, anisotropy=0.4)
    assert dataclasses.replace(medium, ior=1.3).phase_function == phase
    with pytest.raises(tl.InputError, match="give either anisotropy or phase"):
        tl.Medium(scattering=1.0, anisotropy=0.3, phase=phase)


def test_special_cases_of_draine() -> None:
    """Rayleigh's, and that of Cornette and Shanks."""
    cosine = np.linspace(-1, 1, 41)
    np.testing.assert_allclose(Draine(0, 1).value(cosine), 3 / (16 * math.pi) * (1 + cosine**2), rtol=1e-14)
    g = 0.7
    shanks = 3 / (8 * math.pi) * (1 - g * g) * (1 + cosine**2) / ((2 + g * g) * (1 + g * g - 2 * g * cosine) ** 1.5)
    np.testing.assert_allclose(Draine(g, 1).value(cosine), shanks, rtol=1e-13)


def test_droplets_scatter_as_mie_has_it() -> None:
    """The mean cosine of droplets of water is 0.84 to 0.88 by Mie's theory, and rises with size."""
    means = [WaterDroplets(d).mean_cosine for d in (5e-6, 1e-5, 2e-5, 5e-5)]
    assert all(0.82 < mean < 0.90 for mean in means)
    assert means == sorted(means)


@pytest.mark.parametrize("g", [0.3, 0.85])
@pytest.mark.parametrize(("depth", "lever"), [(0.2, 1.0), (3.0, 1.0), (3.0, 0.8)])
def test_light_that_was_scattered_ahead_has_the_moments_of_its_path(g: float, depth: float, lever: float) -> None:
    """Legendre moment l of light scattered ahead: g^l (e^(-(1 - g^(l u)) depth) - e^-depth), lever u; g^3 for l < 3."""
    cosine, weight = np.polynomial.legendre.leggauss(400)
    found = phase_after_scattering(cosine, g, g**3, depth, lever)
    moments = 2.0 * np.pi * (weight * found) @ np.polynomial.legendre.legvander(cosine, 7)
    powers = g ** np.arange(8)
    kept = np.array([g**3, g**3, g**3, *powers[3:] ** lever])
    expected = powers * (np.exp((kept - 1.0) * depth) - np.exp(-depth))
    np.testing.assert_allclose(moments, expected, atol=1e-3)
