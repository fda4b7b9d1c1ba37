"""Formulas of boundaries against closed forms and series; symmetries and energy as properties."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from translucent.formulas import interface, optics

Array = npt.NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)

shares = st.floats(0, 1)
cosines = st.floats(1e-3, 1)
iors = st.floats(0.4, 2.5)
depths = st.floats(0, 50)
alphas = st.floats(1e-3, 1)


def arriving(cosine: float) -> tuple[Array, Array]:
    """A direction at this cosine to a normal that lies askew."""
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    return turn @ [math.sqrt(1 - cosine**2), 0.0, -cosine], turn @ [0.0, 0.0, 1.0]


# Fresnel


@pytest.mark.parametrize("ior", [0.4, 1 / 1.5, 1.0001, 1.33, 1.5, 2.4, 100.0])
def test_at_grazing_incidence_exactly_everything_is_reflected(ior: float) -> None:
    assert optics.fresnel_dielectric(0.0, ior) == 1.0


@pytest.mark.parametrize("cosine", [0.0, 1e-300, 1e-9, 0.5, 1.0])
def test_between_equal_media_exactly_nothing_is(cosine: float) -> None:
    assert optics.fresnel_dielectric(cosine, 1.0) == 0.0


@given(cosines, st.floats(0.01, 0.99))
def test_total_reflection_is_exact(cosine: float, share: float) -> None:
    # cos < sqrt(1 - n^2) is beyond the critical angle.
    ior = math.sqrt(max(1 - (cosine / share) ** 2, 1e-6)) if cosine < share else 0.0
    if ior > 1e-2:
        assert optics.fresnel_dielectric(cosine * 0.999, ior) == 1.0


@given(shares, iors)
def test_reflectance_never_exceeds_one(cosine: float, ior: float) -> None:
    assert 0.0 <= float(optics.fresnel_dielectric(cosine, ior)) <= 1.0


# Directions


@given(cosines, iors)
def test_reflection_turns_the_normal_part_around(cosine: float, ior: float) -> None:
    direction, normal = arriving(cosine)
    mirrored = interface.reflected_direction(direction, normal)
    assert mirrored @ normal == pytest.approx(cosine, abs=8 * EPS)
    np.testing.assert_allclose(interface.reflected_direction(mirrored, -normal), direction, atol=8 * EPS)
    np.testing.assert_allclose(mirrored, interface.reflected_direction(direction, -normal), atol=8 * EPS)


@given(cosines, iors)
def test_refraction_is_snells_law(cosine: float, ior: float) -> None:
    direction, normal = arriving(cosine)
    found = interface.refracted_direction(direction, normal, ior)
    k = ior**2 - 1 + cosine**2
    if abs(k) < 1e-9:
        return
    if k < 0:
        assert found.tolist() == [0.0, 0.0, 0.0]
        return
    # The root keeps an absolute error of some roundings, divided by itself.
    error = 16 * EPS / math.sqrt(k) * max(ior, 1 / ior) ** 2
    np.testing.assert_allclose(np.cross(normal, found) * ior, np.cross(normal, direction), atol=error)
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=error)
    assert -(found @ normal) == pytest.approx(float(optics.refracted_cosine(cosine, ior)), abs=error)


@given(cosines, st.floats(1.05, 2.5))
def test_light_goes_back_the_way_it_came(cosine: float, ior: float) -> None:
    direction, normal = arriving(cosine)
    inside = interface.refracted_direction(direction, normal, ior)
    back = interface.refracted_direction(-inside, -normal, 1 / ior)
    # Out at a cosine c, whose square is left of terms near n^2.
    np.testing.assert_allclose(back, -direction, atol=32 * EPS * ior**2 / cosine)


@pytest.mark.parametrize("cosine", [0.0, 1e-200, 0.3, 1.0])
def test_equal_media_do_not_bend_light(cosine: float) -> None:
    direction, normal = arriving(cosine)
    np.testing.assert_array_equal(interface.refracted_direction(direction, normal, 1.0), direction)


def test_directions_broadcast() -> None:
    direction, normal = arriving(0.7)
    found = interface.refracted_direction(np.tile(direction, (2, 3, 1)), normal, [1.0, 1.5, 2.0])
    assert found.shape == (2, 3, 3)
    np.testing.assert_allclose(found[1, 2], interface.refracted_direction(direction, normal, 2.0), atol=EPS)


# Dispersion


def test_indices_of_the_channels() -> None:
    # Polycarbonate: V = 32, so that 0.585 / 32 separates blue and red; to the roundings of a sum.
    red, green, blue = interface.channel_iors(1.585, 20 / 32)
    assert green == 1.585
    assert blue - red == pytest.approx(0.585 / 32, abs=4 * EPS)
    assert green - red == pytest.approx(blue - green, abs=4 * EPS)
    assert interface.channel_iors([1.0, 1.5], 0.0).tolist() == [[1.0] * 3, [1.5] * 3]
    assert interface.channel_iors(1.5, 100.0)[0] == 1.0


# Microfacets


@pytest.mark.parametrize("alpha", [1e-3, 0.1, 0.5, 1.0])
def test_microfacets_cover_the_surface(alpha: float) -> None:
    """The integral of D cos over the hemisphere is 1 (Walter et al. 2007, eq. 4), in the tangent over alpha."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    # t = tan / alpha = s / (1 - s) for s in 0..1; dw = 2 pi sin dtheta, dtan = dtheta / cos^2.
    s = 0.5 * (nodes + 1)
    tan = alpha * s / (1 - s)
    cos = 1 / np.sqrt(1 + tan**2)
    integrand = interface.ggx_distribution(cos, alpha) * cos * 2 * np.pi * tan * cos**3 * alpha / (1 - s) ** 2
    # Cosines near 1 keep sin^2 to EPS / sin^2: facets within some alpha of the normal, that is EPS / alpha^2.
    assert 0.5 * (weights * integrand).sum() == pytest.approx(1.0, abs=1e-10 + 4 * EPS / alpha**2)


@given(cosines, cosines, alphas)
def test_visibility_is_reciprocal(a: float, b: float, alpha: float) -> None:
    assert interface.ggx_visibility(a, b, alpha) == pytest.approx(
        float(interface.ggx_visibility(b, a, alpha)), rel=4 * EPS
    )


@given(cosines, cosines, alphas)
def test_visibility_is_heitz_formula(a: float, b: float, alpha: float) -> None:
    """G2 = 1 / (1 + Lambda(l) + Lambda(v)), below the masking of either side alone."""

    def hidden(c: float) -> float:
        return 0.5 * (math.sqrt(1 + alpha**2 * (1 - c * c) / (c * c)) - 1)

    shown = float(interface.ggx_visibility(a, b, alpha)) * 4 * a * b
    assert shown == pytest.approx(1 / (1 + hidden(a) + hidden(b)), rel=64 * EPS)
    assert shown <= min(1 / (1 + hidden(a)), 1 / (1 + hidden(b))) * (1 + 8 * EPS)


def test_visibility_edge_on() -> None:
    assert interface.ggx_visibility(0.0, 0.0, 0.3) == 0.0
    assert np.isfinite(interface.ggx_visibility(0.0, 1e-30, 0.3))
    # A perfect mirror hides nothing.
    assert interface.ggx_visibility(1.0, 1.0, 1e-3) == pytest.approx(0.25, rel=1e-14)


# Thin walls


@given(shares, depths)
def test_a_wall_is_a_geometric_series(r: float, depth: float) -> None:
    a = math.exp(-depth)
    on = sum((1 - r) ** 2 * a * (r * a) ** (2 * k) for k in range(400))
    back = r + sum((1 - r) ** 2 * a * a * r * (r * a) ** (2 * k) for k in range(400))
    # What is left of it, and the roundings of 400 terms.
    rest = (r * a) ** 800 + 400 * EPS
    assert interface.slab_transmittance(r, depth) == pytest.approx(on, abs=rest)
    assert interface.slab_reflectance(r, depth) == pytest.approx(back, abs=rest)


@given(shares, depths)
def test_a_wall_shares_the_light(r: float, depth: float) -> None:
    back, on = float(interface.slab_reflectance(r, depth)), float(interface.slab_transmittance(r, depth))
    assert on >= 0.0
    assert back >= 0.0
    assert back + on <= 1 + 4 * EPS
    assert interface.slab_reflectance(r, 0.0) + interface.slab_transmittance(r, 0.0) == pytest.approx(1.0, abs=4 * EPS)
    # Two clear faces: 2 r / (1 + r).
    assert interface.slab_reflectance(r, 0.0) == pytest.approx(2 * r / (1 + r), abs=4 * EPS)


def test_limits_of_walls() -> None:
    assert interface.slab_transmittance(0.0, 1.5) == optics.transmittance(1.5)
    assert interface.slab_reflectance(0.0, 1.5) == 0.0
    assert interface.slab_transmittance(1.0, 0.0) == 0.0
    assert interface.slab_reflectance(1.0, [0.0, 3.0, np.inf]).tolist() == [1.0, 1.0, 1.0]
    assert interface.slab_reflectance(0.04, np.inf) == 0.04
    # Near grazing incidence nothing cancels: T = (1 - r) / (1 + r).
    r = 1 - 1e-12
    assert interface.slab_transmittance(r, 0.0) == pytest.approx((1 - r) / (1 + r), rel=8 * EPS)


def test_visible_normals_are_as_often_as_they_are_seen() -> None:
    """The mean of a function over them is its integral over D times the seen area, G1 (v.m) / (v.n)."""
    rng = np.random.default_rng(3)
    alpha, view = 0.5, np.array((0.8, 0.0, 0.6))
    normals = interface.ggx_visible_normal(
        np.tile(view, (200_000, 1)), np.full(200_000, alpha), rng.random((200_000, 2))
    )
    cos, phi = np.meshgrid((np.arange(800) + 0.5) / 800, (np.arange(400) + 0.5) / 400 * 2 * np.pi, indexing="ij")
    sin = np.sqrt(1 - cos * cos)
    grid = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)
    seen = np.maximum(grid @ view, 0.0) / 0.6 / (1 + interface.smith_lambda(0.6, alpha))
    density = interface.ggx_distribution(cos, alpha) * seen * 2 * np.pi / cos.size
    assert density.sum() == pytest.approx(1.0, abs=2e-3)
    for axis in range(3):
        expected = (density * grid[..., axis]).sum()
        assert normals[:, axis].mean() == pytest.approx(expected, abs=4e-3)
