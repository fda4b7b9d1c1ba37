"""Formulas against closed forms, quadrature and the numbers of the literature; identities as properties."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from translucent.formulas import optics

EPS = float(np.finfo(np.float64).eps)

depths = st.floats(0, 300)
shares = st.floats(0, 1)
cosines = st.floats(0.05, 1)
iors = st.floats(1.05, 2.5)


# Beer-Lambert


@pytest.mark.parametrize("tau", [0.0, 1e-300, 1e-12, 0.5, 1.0, 20.0, 700.0])
def test_transmittance_is_exp_of_minus_tau(tau: float) -> None:
    # exp of a rounded argument: one ulp of exp, and of its argument none, since tau is given.
    assert optics.transmittance(tau) == pytest.approx(math.exp(-tau), rel=4 * EPS, abs=0)


def test_nothing_is_lost_at_depth_zero() -> None:
    assert optics.transmittance([0.0, -0.0]).tolist() == [1.0, 1.0]
    assert np.copysign(1.0, optics.opacity([0.0])).tolist() == [1.0]
    assert optics.opacity(0.0) == 0.0


@pytest.mark.parametrize("tau", [1e4, 1e300, np.inf])
def test_a_huge_depth_underflows_to_exactly_zero(tau: float) -> None:
    assert optics.transmittance(tau) == 0.0
    assert optics.opacity(tau) == 1.0


@pytest.mark.parametrize("tau", [5e-324, 1e-300, 1e-16, 1e-12, 1e-9])
def test_opacity_keeps_its_digits_at_small_depth(tau: float) -> None:
    # The series tau - tau^2/2; its next term is tau^3/6, below 2e-19 tau here.
    with np.errstate(under="ignore"):
        expected = tau - np.float64(tau) * tau / 2
    assert optics.opacity(tau) == pytest.approx(expected, rel=2 * EPS, abs=0)


@given(depths, depths)
def test_transmittance_of_two_layers_is_the_product(a: float, b: float) -> None:
    # The sum a + b rounds by EPS/2 of itself, which exp turns into a relative error of that size; 3 exps, 1 product.
    both = optics.transmittance(a) * optics.transmittance(b)
    assert optics.transmittance(a + b) == pytest.approx(both, rel=EPS * (a + b + 8), abs=0)


@given(depths)
def test_transmittance_and_opacity_share_the_light(tau: float) -> None:
    assert optics.transmittance(tau) + optics.opacity(tau) == pytest.approx(1.0, abs=4 * EPS)


@given(depths, depths)
def test_more_depth_never_passes_more_light(a: float, b: float) -> None:
    low, high = sorted((a, b))
    assert optics.transmittance(high) <= optics.transmittance(low)


# Color at a distance


@given(st.floats(1e-30, 1), st.floats(1e-6, 1e6))
def test_color_to_extinction_to_color_is_the_identity(color: float, distance: float) -> None:
    # A relative error e of sigma_t is a relative error e tau of exp(-tau): tau is the condition number.
    extinction = optics.extinction_from_color(color, distance)
    again = optics.transmittance(extinction * distance)
    assert again == pytest.approx(color, rel=1e-14 * max(1.0, -math.log(color)), abs=0)


@given(st.floats(1e-9, 1e9), st.floats(1e-6, 1e6))
def test_extinction_to_color_to_extinction_is_the_identity(tau: float, distance: float) -> None:
    # Here the condition number is that of log: e / tau for a relative error e of the color.
    tau = min(tau, 600.0)
    again = optics.extinction_from_color(optics.transmittance(tau), distance) * distance
    assert again == pytest.approx(tau, rel=1e-14 * max(1.0, 1.0 / tau), abs=0)


@pytest.mark.parametrize("distance", [1e-6, 0.02, 1.0, np.inf])
def test_white_has_exactly_positive_zero_extinction(distance: float) -> None:
    extinction = optics.extinction_from_color([1.0, 1.0, 1.0], distance)
    assert extinction.tolist() == [0.0, 0.0, 0.0]
    assert not np.signbit(extinction).any()


def test_extinction_of_a_color_by_hand() -> None:
    # exp(-1) after 1 m, after 10 cm; a quarter after 2 m.
    result = optics.extinction_from_color([math.exp(-1), math.exp(-1), 0.25], [1.0, 0.1, 2.0])
    assert result == pytest.approx([1.0, 10.0, math.log(2)], rel=4 * EPS, abs=0)


# Emission


def test_without_extinction_emission_adds_up_with_distance() -> None:
    assert optics.emitted_radiance([3.0, 0.0, 5.0], 0.0, 0.5).tolist() == [1.5, 0.0, 2.5]


@pytest.mark.parametrize("tau", [1e4, 1e9])
def test_deep_emission_is_the_source_function(tau: float) -> None:
    assert optics.emitted_radiance(3.0, 7.0, tau / 7.0) == pytest.approx(3.0 / 7.0, rel=8 * EPS, abs=0)


def test_faint_extinction_takes_half_its_depth_from_emission() -> None:
    # q d (1 - x/2 + x^2/6 ...): at x = 1e-9 the third term is below rounding.
    x = 1e-9
    assert optics.emitted_radiance(1.0, x, 1.0) == pytest.approx(1 - x / 2, rel=2 * EPS, abs=0)


@pytest.mark.parametrize("sigma", [0.0, 1e-12, 0.3, 1.0, 5.0, 20.0])
@pytest.mark.parametrize("distance", [0.1, 1.0, 2.0])
def test_emission_is_the_integral_of_attenuated_source(sigma: float, distance: float) -> None:
    # 64 Gauss points on exp(-x t) with x <= 40: their error, (x/2)^128 / 128!, is below 1e-49.
    nodes, weights = np.polynomial.legendre.leggauss(64)
    t = 0.5 * distance * (nodes + 1)
    integral = 0.5 * distance * np.sum(weights * 2.5 * np.exp(-sigma * t))
    assert optics.emitted_radiance(2.5, sigma, distance) == pytest.approx(integral, rel=1e-13)


@given(st.floats(0, 30), st.floats(0.1, 2))
def test_emission_solves_the_transfer_equation(sigma: float, distance: float) -> None:
    # dL/dd = q - sigma L, by the five-point difference: truncation q sigma^4 h^4 / 30, rounding 2 EPS L / h.
    h = 1e-3 / max(sigma, 1.0)
    shift = np.array([-2, -1, 1, 2]) * h
    radiance = optics.emitted_radiance(1.0, sigma, distance + shift)
    slope = float(radiance @ [1, -8, 8, -1]) / (12 * h)
    error = (sigma * h) ** 4 / 30 + 4 * EPS * float(radiance.max()) / h + 4 * EPS * distance / h
    assert slope == pytest.approx(1 - sigma * float(optics.emitted_radiance(1.0, sigma, distance)), abs=2 * error)


@given(st.floats(0, 20), st.floats(0, 2), st.floats(0, 2))
def test_two_emitting_intervals_are_one(sigma: float, a: float, b: float) -> None:
    near, far = optics.emitted_radiance(1.0, sigma, a), optics.emitted_radiance(1.0, sigma, b)
    with np.errstate(under="ignore"):
        parts = near + optics.transmittance(sigma * a) * far
    # The optical depths round relatively to themselves, up to 40 + 40.
    assert optics.emitted_radiance(1.0, sigma, a + b) == pytest.approx(parts, rel=100 * EPS, abs=100 * EPS)


@pytest.mark.parametrize("tau", [0.0, 5e-324, 1e-310, 1e-16])
def test_mean_transmittance_tends_to_one(tau: float) -> None:
    assert optics.mean_transmittance(tau) == 1.0


# Compositing


@given(st.floats(0, 0.999), st.floats(0, 8), st.floats(0, 8))
def test_steps_compose_to_the_opacity_of_the_whole_step(alpha: float, a: float, b: float) -> None:
    first, second = optics.opacity_for_step(alpha, a), optics.opacity_for_step(alpha, b)
    whole = optics.opacity_for_step(alpha, a + b)
    # log(1 - alpha) down to -6.9, times up to 16: 110 EPS in the exponent, of a transmittance below 1.
    with np.errstate(under="ignore"):
        composed = first + (1 - first) * second
    assert composed == pytest.approx(whole, abs=120 * EPS)


@pytest.mark.parametrize(
    ("alpha", "ratio", "expected"),
    [
        (0.3, 1.0, 0.3),
        (0.75, 0.5, 0.5),
        (0.5, 2.0, 0.75),
        (1e-15, 0.5, 0.5e-15),
        (0.0, 7.0, 0.0),
        (0.6, 0.0, 0.0),
        (1.0, 0.5, 1.0),
        (1.0, 0.0, 0.0),
    ],
)
def test_opacity_for_step_by_hand(alpha: float, ratio: float, expected: float) -> None:
    assert optics.opacity_for_step(alpha, ratio) == pytest.approx(expected, rel=1e-15, abs=0)


colors = st.tuples(shares, shares)


@given(colors, colors, shares)
def test_over_is_associative(a: tuple[float, float], b: tuple[float, float], background: float) -> None:
    (color_a, alpha_a), (color_b, alpha_b) = a, b
    right = optics.composite_over(color_a, alpha_a, optics.composite_over(color_b, alpha_b, background))
    merged = optics.composite_over(color_a, alpha_a, color_b)
    merged_alpha = optics.composite_over(alpha_a, alpha_a, alpha_b)
    # At most seven roundings, each of a value below 3.
    assert optics.composite_over(merged, merged_alpha, background) == pytest.approx(right, abs=12 * EPS)


def test_over_by_hand() -> None:
    assert optics.composite_over([0.25, 0.5], 0.5, [1.0, 0.0]).tolist() == [0.75, 0.5]


# Fresnel


def _reflectance_by_angles(angle: float, ior: float) -> tuple[float, float]:
    """Parallel and normal reflectance in the textbook's other form, with both angles (Born & Wolf 1.5.2, 21a)."""
    inside = math.asin(math.sin(angle) / ior)
    parallel = math.tan(angle - inside) / math.tan(angle + inside)
    normal = math.sin(angle - inside) / math.sin(angle + inside)
    return parallel**2, normal**2


@pytest.mark.parametrize("ior", [1 / 2.4, 1 / 1.5, 1.0, 1.33, 1.5, 2.4])
def test_reflectance_at_normal_incidence(ior: float) -> None:
    assert optics.fresnel_dielectric(1.0, ior) == pytest.approx(((ior - 1) / (ior + 1)) ** 2, rel=1e-14)


@pytest.mark.parametrize("ior", [1 / 2.4, 1.33, 1.5, 2.4])
def test_everything_is_reflected_at_grazing_incidence(ior: float) -> None:
    # Both amplitudes are 1 up to three roundings, of a root and its square among them.
    assert optics.fresnel_dielectric(0.0, ior) == pytest.approx(1.0, abs=8 * EPS)


@pytest.mark.parametrize("cosine", [0.0, 1e-9, 0.3, 1.0])
def test_an_index_matched_boundary_reflects_nothing(cosine: float) -> None:
    assert optics.fresnel_dielectric(cosine, 1.0) == 0.0


@pytest.mark.parametrize("ior", [1 / 1.5, 1.33, 1.5, 2.4])
def test_parallel_reflectance_vanishes_at_brewsters_angle(ior: float) -> None:
    # tan(angle) = ior. What remains is half of the normal part, which is ((n^2 - 1) / (n^2 + 1))^2 there.
    cosine = 1 / math.hypot(1, ior)
    expected = 0.5 * ((ior**2 - 1) / (ior**2 + 1)) ** 2
    assert optics.fresnel_dielectric(cosine, ior) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    ("sine", "total"), [(0.999 / 1.5, False), (1.001 / 1.5, True), (0.9, True), (1.0, True)], ids=str
)
def test_total_reflection_begins_at_the_critical_angle(sine: float, total: bool) -> None:
    cosine = math.sqrt(1 - sine**2)
    assert bool(optics.fresnel_dielectric(cosine, 1 / 1.5) == 1.0) is total
    assert bool(optics.refracted_cosine(cosine, 1 / 1.5) == 0.0) is total


@given(st.floats(0.01, 1.5), iors)
def test_reflectance_agrees_with_the_formula_in_angles(angle: float, ior: float) -> None:
    # The other form loses digits at small angles: differences of angles of 0.01 are good to 4 EPS / 0.0005, twice that
    # squared; the pole of tan(a + b) at Brewster's angle only makes the parallel part small.
    parallel, normal = _reflectance_by_angles(angle, ior)
    assert optics.fresnel_dielectric(math.cos(angle), ior) == pytest.approx(
        0.5 * (parallel + normal), rel=16 * EPS / 0.0004
    )


@given(cosines, iors)
def test_reflectance_is_the_same_from_both_sides(cosine: float, ior: float) -> None:
    # Going back, k = c^2 / n^2 is left of terms near 1, so its root is wrong by some EPS n / c; the slope of the
    # reflectance in it is below 2 / (sum of the cosines) < 3.
    inside = optics.refracted_cosine(cosine, ior)
    there, back = optics.fresnel_dielectric(cosine, ior), optics.fresnel_dielectric(inside, 1 / ior)
    assert back == pytest.approx(float(there), abs=16 * EPS * ior / cosine)


@given(st.floats(0, 1), st.floats(0.4, 2.5))
def test_reflectance_is_a_share(cosine: float, ior: float) -> None:
    # Up to the roundings of the amplitudes, which are below 1.
    assert 0.0 <= optics.fresnel_dielectric(cosine, ior) <= 1.0 + 8 * EPS


@given(st.floats(0, 1.57), st.floats(1, 2.5))
def test_refracted_cosine_is_snells_law(angle: float, ior: float) -> None:
    # 1 - sin^2 keeps an absolute error of some EPS, so its root one of some EPS / cosine.
    expected = math.cos(math.asin(math.sin(angle) / ior))
    assert optics.refracted_cosine(math.cos(angle), ior) == pytest.approx(expected, abs=4 * EPS / max(expected, 1e-4))


# Thin layers


@pytest.mark.parametrize(
    ("degrees", "ior", "factor"),
    [(0, 1.0, 1.0), (60, 1.0, 2.0), (80, 1.0, 5.76), (0, 1.5, 1.0), (80, 1.5, 1.33), (90, 1.5, 1.34)],
)
def test_thin_layer_is_longer_by_the_published_factor(degrees: float, ior: float, factor: float) -> None:
    # Published to two decimals: half of the last one.
    path = optics.thin_layer_thickness(1e-3, math.cos(math.radians(degrees)), ior)
    assert path / 1e-3 == pytest.approx(factor, abs=0.005)


@given(st.floats(0, 1.55), st.floats(1, 2.5))
def test_thin_layer_is_the_path_by_snells_law(angle: float, ior: float) -> None:
    expected = 1 / math.cos(math.asin(math.sin(angle) / ior))
    # As for the refracted cosine, which is 0.02 or more here, times the square of the factor.
    assert optics.thin_layer_thickness(1.0, math.cos(angle), ior) == pytest.approx(expected, rel=8 * EPS * expected**2)


@pytest.mark.parametrize("cosine", [0.001, 1e-9, 0.0, -0.0, -0.3, -1.0])
def test_thin_layer_is_at_most_1000_times_as_long(cosine: float) -> None:
    assert optics.thin_layer_thickness(2e-3, cosine) == pytest.approx(2.0, rel=4 * EPS)
