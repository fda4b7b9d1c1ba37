"""Blurred environments against integrals that share nothing with them, and what blurring must keep."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.scene.environment import LEVEL_SIZE, LEVELS, FilteredEnvironment, equirectangular_uv, filtered
from translucent.scene.environment_map import EnvironmentMap, irradiance_map, row_solid_angles, texel_directions

EPS32 = float(np.finfo(np.float32).eps)


def smooth_radiance(directions: np.ndarray) -> np.ndarray:
    """A broad light, a sky that is black below the horizon, and a quadratic."""
    with np.errstate(under="ignore"):
        lamp = np.exp(20 * (directions @ np.array([0.6, 0.64, -0.48]) - 1))
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([lamp, np.maximum(y, 0.0) ** 2, 1 + x * y - 0.5 * z * z], axis=-1)


@pytest.fixture(scope="module")
def smooth() -> FilteredEnvironment:
    return filtered(tl.Environment.image(EnvironmentMap.from_formula(smooth_radiance, 256)))


def some_directions(count: int, seed: int = 4) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    directions = np.concatenate([directions, [[0, 1, 0], [0, -1, 0], [0, 0, 1], [1e-3, 1, 0]]])
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def beside_poles(directions: np.ndarray, height: int) -> np.ndarray:
    """(n, 1): 1 within half a row of a pole, where a lookup is that of the row half a row away, else 0."""
    return np.asarray(np.abs(directions[:, 1:2]) > np.cos(np.pi / height / 2), dtype=float)


def frame_around(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    side = np.cross(axis, [0.3, 0.5, 0.8])
    side /= np.linalg.norm(side)
    return side, np.cross(axis, side)


def lobe_mean(reflected: np.ndarray, alpha: float) -> np.ndarray:
    """Mean of the smooth radiance over the GGX lobe, by a product rule over half vectors around n = v = r."""
    x, weight = np.polynomial.legendre.leggauss(100)
    u = 0.5 * (x + 1)  # the share of half vectors within an angle: importance sampling of D n.h
    n_h = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))
    n_l = 2 * n_h**2 - 1
    weight = weight * np.maximum(n_l, 0)
    turn = 2 * np.pi * (np.arange(48) + 0.5) / 48
    side, other = frame_around(reflected)
    around = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    sine = np.sqrt(np.maximum(1 - n_l**2, 0))
    towards = n_l[:, None, None] * reflected + sine[:, None, None] * around
    return np.asarray(weight @ smooth_radiance(towards).mean(axis=1) / weight.sum())


@pytest.mark.parametrize("level", [0, 1, 3, 7])
def test_levels_are_means_over_ggx_lobes(smooth: FilteredEnvironment, level: int) -> None:
    directions = some_directions(40)
    alpha = smooth.roughness[level] ** 2
    exact = np.array([lobe_mean(reflected, alpha) for reflected in directions])
    found = EnvironmentMap(smooth.levels[level]).at(equirectangular_uv(directions, 0.0))
    # Pixels are means over a square of side s = pi / 128, and lookups are linear between them: for a second derivative
    # c of the radiance both together are off by at most c s^2 (1 / 24 + 1 / 8) in each of two directions. The lamp
    # has the largest c, 20 times its brightness, and the quadratic sky 2. Beside a pole a lookup is off by the slope
    # times s / 2; the slopes are at most sqrt(20 / e), 1 and 1.2.
    step, bend, slope = np.pi / 128, np.array([20.0, 2.0, 2.0]), np.array([2.8, 1.0, 1.2])
    allowed = bend * step**2 / 3 + beside_poles(directions, 128) * slope * step / 2
    assert (np.abs(found - exact) <= allowed).all()


def test_importance_sampling_finds_the_same(smooth: FilteredEnvironment) -> None:
    rng = np.random.default_rng(8)
    alpha, reflected = 0.25, np.array([0.48, 0.6, -0.64])
    u, turn = rng.random(200_000), 2 * np.pi * rng.random(200_000)
    n_h = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))
    side, other = frame_around(reflected)
    sine = np.sqrt(1 - n_h**2)[:, None]
    half = n_h[:, None] * reflected + sine * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other)
    towards = 2 * n_h[:, None] * half - reflected
    weight = np.maximum(towards @ reflected, 0.0)[:, None]
    sampled = (weight * smooth_radiance(towards)).mean(axis=0) / weight.mean()
    error = (weight * (smooth_radiance(towards) - sampled)).std(axis=0) / np.sqrt(len(u)) / weight.mean()
    level = int(np.flatnonzero(smooth.roughness == 0.5)[0])
    found = EnvironmentMap(smooth.levels[level]).at(equirectangular_uv(reflected, 0.0))
    assert (np.abs(found - sampled) <= 5 * error + 2e-4).all()


def test_uniform_light_stays_uniform() -> None:
    for environment in (tl.Environment.constant((0.2, 1.0, 30.0)), tl.Environment.image(np.full((40, 80, 3), 7.0))):
        found = filtered(environment)
        mean = environment.mean
        np.testing.assert_allclose(found.levels, np.broadcast_to(mean, found.levels.shape), rtol=1e-6)
        np.testing.assert_allclose(found.irradiance, np.broadcast_to(np.pi * mean, found.irradiance.shape), rtol=1e-6)


@pytest.mark.parametrize("texel", [(0, 17), (3, 100), (64, 255), (127, 0)])
def test_the_light_of_one_pixel_is_spread_and_not_lost(texel: tuple[int, int]) -> None:
    pixels = np.zeros((*LEVEL_SIZE, 3))
    pixels[texel] = (1.0, 10.0, 1e4)
    found = filtered(tl.Environment.image(pixels))
    angles = row_solid_angles(*LEVEL_SIZE)
    sums = np.einsum("y,nyxc->nc", angles, found.levels, dtype=np.float64)
    np.testing.assert_allclose(sums, np.broadcast_to(pixels[texel] * angles[texel[0]], (LEVELS, 3)), rtol=1e-6)
    # It is brightest where it was, and the rougher the less so.
    assert all(level[texel][2] == level[..., 2].max() for level in found.levels)
    assert (np.diff(found.levels[:, texel[0], texel[1], 2]) < 0).all()


def test_levels_get_rougher_up_to_1(smooth: FilteredEnvironment) -> None:
    np.testing.assert_allclose(smooth.roughness, np.arange(1, LEVELS + 1) / LEVELS)
    assert smooth.levels.shape == (LEVELS, *LEVEL_SIZE, 3)
    assert smooth.levels.dtype == smooth.irradiance.dtype == np.float32
    assert (smooth.levels >= 0).all()
    assert (np.diff(smooth.levels[..., 0].std(axis=(1, 2))) < 0).all()


def test_irradiance_of_a_gradient_is_its_closed_form() -> None:
    environment = tl.Environment.gradient((0.0, 0.2, 1.0), (1.0, 0.8, 0.0))
    pixels = irradiance_map(environment.light_map).pixels
    exact = environment.irradiance_on(texel_directions(*pixels.shape[:2]))
    # A clamped cosine in steps of h = pi / 64 has a kink, which leaves an error of h^2 / 12 of its slope.
    assert np.abs(pixels - exact).max() <= np.pi * (np.pi / 64) ** 2 / 12


def test_irradiance_of_low_harmonics_is_theirs_times_a_factor() -> None:
    """A cosine lobe keeps spherical harmonics but for factors pi, 2 pi / 3, pi / 4 (Ramamoorthi & Hanrahan 2001)."""

    def harmonics(directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(directions, -1, 0)
        return np.stack([2 + x, 2 + x * y, 2 + 1.5 * y * y - 0.5 + 0 * z], axis=-1)

    environment = tl.Environment.image(EnvironmentMap.from_formula(harmonics, 128))
    normals = some_directions(60)
    x, y, _ = normals.T
    exact = np.pi * np.stack([2 + 2 / 3 * x, 2 + 0.25 * x * y, 2 + 0.25 * (1.5 * y * y - 0.5)], axis=-1)
    # As above, and lookups between rows that are h apart: an eighth of h^2 times the second derivative, at most 3.
    # Beside a pole, half of h times the slope, at most 1.
    step = np.pi / 64
    allowed = np.pi * (step**2 * (1 / 12 + 3 / 8) + beside_poles(normals, 64) * step / 2)
    assert (np.abs(environment.irradiance_on(normals) - exact) <= allowed).all()


def test_blurring_is_done_once_for_each_picture() -> None:
    studio = tl.Environment.studio()
    assert filtered(studio) is filtered(tl.Environment.studio(rotation=45.0, exposure=1.0))
    assert filtered(studio).sharp is studio.map
