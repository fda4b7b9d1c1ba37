"""Two streams in a layer against their differential equations, and against light that is scattered step by step."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from translucent.formulas import two_stream
from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.reference import path_trace
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene

EPS = float(np.finfo(np.float64).eps)

depths = st.floats(0, 40)
positive = st.floats(1e-6, 40)


def shares(k: float, s: float) -> tuple[float, float]:
    return float(two_stream.two_stream_reflectance(k, s)), float(two_stream.two_stream_transmittance(k, s))


@given(positive, positive)
def test_shares_are_those_of_kubelka_and_munk(k: float, s: float) -> None:
    """In their form, by hyperbolic functions."""
    a = (k + s) / s
    b = math.sqrt(k * (k + 2 * s)) / s
    below = a * math.sinh(b * s) + b * math.cosh(b * s)
    # Their form divides by s: for a small one a b is large, and small depths lose digits in it.
    assert shares(k, s) == pytest.approx((math.sinh(b * s) / below, b / below), rel=1e-11)


@given(depths, depths)
def test_layers_share_the_light(k: float, s: float) -> None:
    back, on = shares(k, s)
    assert 0.0 <= back < 1.0
    assert 0.0 <= on <= 1.0
    assert back + on <= 1 + 4 * EPS


@given(depths)
def test_without_absorption_nothing_is_lost(s: float) -> None:
    back, on = shares(0.0, s)
    assert back + on == pytest.approx(1.0, abs=2 * EPS)
    assert on == pytest.approx(1 / (1 + s), rel=2 * EPS)


@given(depths)
def test_without_scattering_light_goes_straight_on(k: float) -> None:
    back, on = shares(k, 0.0)
    assert back == 0.0
    assert on == pytest.approx(math.exp(-k), rel=(8 + k) * EPS)


@given(positive, positive, st.floats(0.1, 0.9))
def test_two_layers_are_one(k: float, s: float, part: float) -> None:
    """R = R1 + T1^2 R2 / (1 - R1 R2), T = T1 T2 / (1 - R1 R2), as for any two layers."""
    (r1, t1), (r2, t2) = shares(k * part, s * part), shares(k * (1 - part), s * (1 - part))
    # Little absorption: 1 - R1 R2 is down to 1 / 40.
    assert shares(k, s) == pytest.approx((r1 + t1 * t1 * r2 / (1 - r1 * r2), t1 * t2 / (1 - r1 * r2)), rel=1e-12)


@pytest.mark.parametrize("depth", [1e4, 1e200])
@pytest.mark.parametrize("ratio", [1e-6, 0.1, 10.0])
def test_deep_layers_neither_overflow_nor_lose_their_color(depth: float, ratio: float) -> None:
    """1 + K/S - sqrt((K/S)^2 + 2 K/S), to its cancellation."""
    back, on = shares(ratio * depth, depth)
    root = math.sqrt(ratio * ratio + 2 * ratio)
    infinite = 1 / (1 + ratio + root)
    # A finite layer lacks its square times exp(-2 gamma d).
    rest = math.exp(-min(2 * root * depth, 700.0))
    assert back == pytest.approx(infinite, rel=8 * EPS + 2 * rest)
    assert on <= math.exp(-min(root * depth, 700.0)) * 4


@pytest.mark.parametrize(("k", "s"), [(0.0, 0.0), (1e-300, 1e-300), (0.0, 1e300), (1e300, 0.0)])
def test_extreme_layers(k: float, s: float) -> None:
    back, on = shares(k, s)
    assert np.isfinite([back, on]).all()
    assert back + on <= 1 + 4 * EPS


@given(depths, depths)
def test_what_is_scattered_again(k: float, s: float) -> None:
    """The whole share is the part that turns around at most once, and this."""
    back, _ = shares(k, s)
    once = s / (2 * (k + s)) * -math.expm1(-2 * (k + s)) if s > 0 else 0.0
    assert two_stream.multiple_reflectance(k, s) + once == pytest.approx(back, abs=8 * EPS)
    assert two_stream.multiple_reflectance(k, s) >= 0


@pytest.mark.parametrize("k", [0.0, 0.5])
def test_thin_layers_scatter_again_with_higher_powers(k: float) -> None:
    """Back by three turns, s^3."""
    s = np.array([1e-2, 2e-2])
    back = two_stream.multiple_reflectance(k, s)
    assert back[1] / back[0] == pytest.approx(8.0, rel=0.05)


def test_coefficients_of_a_medium() -> None:
    assert two_stream.two_stream_absorption([1.0, 2.0]).tolist() == [2.0, 4.0]
    assert two_stream.two_stream_scattering([4.0, 8.0], 0.5).tolist() == [1.5, 3.0]


@np.errstate(under="ignore")
@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 0.95))
def test_interfaces_mirror_light_back_to_a_layer(back: float, kept: float, mirrored: float) -> None:
    """Pass by pass: what goes up and down in the layer, of which 1 - r leaves each time."""
    on = (1.0 - back) * kept
    up, down = back, on
    leaving = np.zeros(2)
    # After n passes r^n (R + T)^n / (1 - r) is left at most: 0.95^700 / 0.05 = 5e-15.
    for _ in range(700):
        leaving += (1.0 - mirrored) * np.array([up, down])
        up, down = (mirrored * (back * a + on * b) for a, b in ((up, down), (down, up)))
        if up + down < 1e-300:
            break
    found = [
        float(share(back, on, mirrored))
        for share in (two_stream.mirrored_reflectance, two_stream.mirrored_transmittance)
    ]
    # Sums of 700 terms round 700 times, and 1 - r (R + T) is a difference as small as 1 / 20.
    assert found == pytest.approx(leaving.tolist(), rel=700 * EPS, abs=1e-14)
    assert sum(found) <= 1 + 40 * EPS


@given(st.floats(0, 1), st.floats(0, 0.95))
def test_lossless_layers_lose_nothing_between_mirrors(back: float, mirrored: float) -> None:
    shares = [
        float(share(back, 1.0 - back, mirrored))
        for share in (two_stream.mirrored_reflectance, two_stream.mirrored_transmittance)
    ]
    assert sum(shares) == pytest.approx(1.0, abs=40 * EPS)


@pytest.mark.parametrize(("albedo", "reduced", "anisotropy"), [(0.99, 1.0, 0.0), (0.95, 4.0, 0.7), (0.9, 2.0, 0.0)])
def test_a_wide_slab_in_diffuse_light(albedo: float, reduced: float, anisotropy: float) -> None:
    """Reflectance and transmittance of a slab 1 m thick, by path tracing over the angles of view."""
    scattering = reduced / (1 - anisotropy)
    absorption = scattering * (1 - albedo) / albedo
    medium = Medium(absorption=absorption, scattering=scattering, anisotropy=anisotropy)
    slab = Object(Box((-60, -1, -60), (60, 0, 60)).tessellate(), medium)
    # Red above and green below: to the slab both are gray, and one tells what turns around, the other what goes on.
    sky = np.zeros((180, 360, 3))
    sky[:90, :, 0] = sky[90:, :, 1] = 1.0
    nodes, weights = np.polynomial.legendre.leggauss(4)
    cosines = 0.5 * (nodes + 1)
    found = np.zeros(2)
    for i, (cosine, weight) in enumerate(zip(cosines, 0.5 * weights, strict=True)):
        eye = 10 * np.array([math.sqrt(1 - cosine**2), cosine, 0.0])
        camera = Camera.orthographic(eye, (0, 0, 0), (0, 0, 1), height=1e-3)
        scene = Scene([slab], camera, environment=Environment.image(sky))
        frame, _ = path_trace(scene, (1, 1), paths=2000, seed=i)
        found += 2 * weight * cosine * frame.radiance[0, 0, :2]
    k = two_stream.two_stream_absorption(absorption)
    s = two_stream.two_stream_scattering(scattering, anisotropy)
    back, on = shares(float(k), float(s))
    # As the documentation says; and noise of 8000 paths with a spread below 1/2, twice.
    assert (back, on) == pytest.approx(tuple(found), abs=0.03 + 0.012)
