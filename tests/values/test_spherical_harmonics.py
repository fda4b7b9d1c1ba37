"""Real spherical harmonics, and those of environments."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.spherical_harmonics import exit_lobe, real_harmonics, scattered_radiance
from translucent.scene.environment_map import row_solid_angles, texel_directions

DIRECTIONS, ANGLES = texel_directions(64, 128), row_solid_angles(64, 128)[:, None, None]


def test_the_harmonics_are_orthonormal() -> None:
    basis = real_harmonics(DIRECTIONS)
    # The midpoint rule over rows of 2.8 degrees is good to its square over 24.
    np.testing.assert_allclose(np.einsum("yxi,yxj->ij", basis * ANGLES, basis), np.eye(9), atol=5e-4)


def test_the_harmonics_are_those_of_scipy() -> None:
    """Y_lm from the complex ones, whose sign (-1)^m ours do not have; scipy's polar axis is z."""
    special = pytest.importorskip("scipy.special")
    if not hasattr(special, "sph_harm_y"):
        pytest.skip("this SciPy has no sph_harm_y")
    x, y, z = np.moveaxis(DIRECTIONS, -1, 0)
    for i, found in enumerate(np.moveaxis(real_harmonics(DIRECTIONS), -1, 0)):
        band = int(np.sqrt(i))
        m = i - band * (band + 1)
        full = special.sph_harm_y(band, abs(m), np.arccos(z), np.arctan2(y, x)) * (-1.0) ** m
        wanted = full.real if m == 0 else np.sqrt(2.0) * (full.real if m > 0 else full.imag)
        np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_the_light_of_formulas() -> None:
    uniform = tl.Environment.constant((1.0, 0.5, 0.0)).harmonics()
    np.testing.assert_allclose(uniform[0], np.sqrt(4 * np.pi) * np.array([1, 0.5, 0]), rtol=1e-12)
    np.testing.assert_allclose(uniform[1:], 0, atol=3e-4)
    rising = tl.Environment.gradient(0.0, 1.0).harmonics()[:, 0]
    # 1/2 + y/2: of y, the integral of y^2 over the sphere is 4 pi / 3.
    np.testing.assert_allclose(rising[[0, 1]], [np.sqrt(np.pi), np.sqrt(np.pi / 3)], rtol=2e-4)
    np.testing.assert_allclose(rising[2:], 0, atol=3e-4)


def test_light_that_is_turned() -> None:
    """Against finer sums; of a coarse picture, of the same turned, and of one with more rows than the sums have."""
    rng = np.random.default_rng(3)
    picture = rng.random((8, 16, 3))
    for rotation, fine in ((0.0, 1), (67.5, 1), (67.5, 40)):
        pixels = picture.repeat(fine, axis=0).repeat(fine, axis=1)
        environment = tl.Environment.image(pixels, rotation, exposure=1.0)
        directions = texel_directions(400, 800)
        angles = row_solid_angles(400, 800)[:, None, None]
        wanted = np.einsum("yxi,yxc->ic", real_harmonics(directions) * angles, environment.lighting(directions))
        np.testing.assert_allclose(environment.harmonics(), wanted, atol=2e-3)


def test_no_radiance_is_below_nothing() -> None:
    transfer = np.zeros((2, 9, 3))
    transfer[0, 0], transfer[1, 1] = 2.0, (1.0, -1.0, 0.5)
    light = np.ones((9, 3))
    assert scattered_radiance(transfer, light).tolist() == [[2.0, 2.0, 2.0], [1.0, 0.0, 0.5]]


def test_the_lobe_gives_back_what_leaves() -> None:
    """Its mean over directions, weighted by their cosines, is 1."""
    cosine, weight = np.polynomial.legendre.leggauss(64)
    cosine, weight = 0.5 * (cosine + 1), 0.5 * weight
    for ior in (1.0, 1.33, 1.5, 2.4):
        lobe = exit_lobe(cosine, ior, diffuse_interface(ior).entering)
        assert (2 * cosine * weight * lobe).sum() == pytest.approx(1, abs=1e-9)
    assert exit_lobe(0.3, 1.0, 1.0) == 1.0
