"""Light that a scattering half-space reflects: against exact moments and a published value, and in limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from translucent.arrays import Array
from translucent.formulas import diffuse_interface as diffuse
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import bare_half_space, half_space_reflectance
from translucent.formulas.phase import HenyeyGreenstein
from translucent.reference import slabs

#: The iteration ends where it changes less than this; it converges by halves, so the rest is no more.
LEFT = 4 * diffuse.H_TOLERANCE


@pytest.mark.parametrize("albedo", [1.0, 0.999999, 0.99, 0.5, 0.01])
def test_h_has_its_exact_mean(albedo: float) -> None:
    """2 / w (1 - sqrt(1 - w)): Chandrasekhar 1960, V 11."""
    cosine, weight = diffuse.interface_nodes(1.0)
    found = diffuse._chandrasekhar_h(albedo, cosine, weight)
    assert (found * weight).sum() == pytest.approx(2 / albedo * (1 - math.sqrt(1 - albedo)), abs=LEFT)


def test_h_of_a_lossless_half_space() -> None:
    """The first moment is 2 / sqrt(3), and at the zenith H is 2.90781 (Chandrasekhar 1960, V, tables)."""
    cosine, weight = diffuse.interface_nodes(1.0)
    found = diffuse._chandrasekhar_h(1.0, cosine, weight)
    assert (found * cosine * weight).sum() == pytest.approx(2 / math.sqrt(3), abs=LEFT)
    assert 1 / (0.5 * (cosine * weight * found / (1 + cosine)).sum()) == pytest.approx(2.90781, abs=5e-6)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.6])
def test_what_is_not_absorbed_comes_back(ior: float) -> None:
    assert half_space_reflectance(1.0, ior) == pytest.approx(1.0, abs=1e-8)
    assert half_space_reflectance(0.0, ior) == 0.0


@pytest.mark.parametrize("albedo", [0.9999, 0.9, 0.3])
def test_an_interface_keeps_light_inside(albedo: float) -> None:
    rising = [half_space_reflectance(albedo, ior) for ior in (1.6, 1.33, 1.0)]
    assert (np.diff(rising) > 0).all()


# Media that scatter more to one side

#: What 24 nodes on each side of the critical cosine leave behind an interface, whose mirror has a root there.
MODES = 1e-5


def bare(albedo: float, anisotropy: float, ior: float = 1.0) -> tuple[Array, Array, Array]:
    """Cosines, weights, and the matrix of a half-space."""
    cosine, weight = diffuse.interface_nodes(ior, diffuse.MODE_NODES)
    return cosine, weight, bare_half_space(albedo, HenyeyGreenstein(anisotropy), cosine, weight, 2 * diffuse.MODE_NODES)


@pytest.mark.parametrize(("albedo", "anisotropy"), [(0.5, 0.9), (0.9, 0.5), (0.99, 0.75), (0.9, -0.5)])
def test_half_spaces_are_deep_slabs(albedo: float, anisotropy: float) -> None:
    """Deep slabs are doubled layers, and have the values of van de Hulst's tables."""
    for ior in (1.0, 1.33):
        deep = slabs.scattered_fractions(albedo, 400.0, ior, anisotropy)[0]
        assert half_space_reflectance(albedo, ior, HenyeyGreenstein(anisotropy)) == pytest.approx(deep, abs=MODES)


def test_light_straight_on_comes_back_as_giovanelli_found() -> None:
    """0.2600 for an albedo of 0.9 and an index of 1.5 (Giovanelli 1955), by which MCML is checked, too.

    As much as goes the other way: of light from all sides, straight up.
    """
    cosine, _, back = bare(0.9, 1e-6, 1.5)
    mirror = optics.fresnel_dielectric(cosine, 1 / 1.5)
    up = np.linalg.solve(np.eye(len(cosine)) - back * mirror, back @ (1 - mirror))
    assert mirror[-1] + (1 - mirror[-1]) * up[-1] == pytest.approx(0.2600, abs=1e-4)


@pytest.mark.parametrize("anisotropy", [0.3, 0.8, -0.6])
def test_rare_events_are_single(anisotropy: float) -> None:
    """Light that is scattered once: w p / (4 (mu + mu')) times 2 mu' (Chandrasekhar 1960, section 20)."""
    albedo, around = 1e-7, math.pi * (np.arange(512) + 0.5) / 512
    cosine, weight, found = bare(albedo, anisotropy)
    level = np.sqrt(1 - cosine**2)
    turn = -np.outer(cosine, cosine)[..., None] + np.outer(level, level)[..., None] * np.cos(around)
    phase = ((1 - anisotropy**2) / (1 + anisotropy**2 - 2 * anisotropy * turn) ** 1.5).mean(axis=-1)
    once = 0.5 * albedo * phase / (cosine[:, None] + cosine) * cosine * weight
    # Forward peaks beyond the moments of the quadrature are unscattered, which is 2e-5 of all at 0.8.
    np.testing.assert_allclose(found.sum(axis=1), once.sum(axis=1), rtol=1e-4)
    np.testing.assert_allclose(found @ cosine, once @ cosine, rtol=1e-4)


@pytest.mark.parametrize("albedo", [0.2, 0.9, 1.0])
def test_light_goes_both_ways_through_modes(albedo: float) -> None:
    cosine, weight, back = bare(albedo, 0.7)
    flux = (cosine * weight)[:, None] * back
    np.testing.assert_allclose(flux, flux.T, atol=1e-9)
    assert back.min() > -1e-12


@pytest.mark.parametrize("ior", [1.0, 1.4])
def test_modes_go_over_into_h(ior: float) -> None:
    for albedo in (0.0, 0.3, 0.9, 0.9999, 1.0):
        assert half_space_reflectance(albedo, ior, HenyeyGreenstein(1e-6)) == pytest.approx(
            half_space_reflectance(albedo, ior), abs=MODES
        )


def test_what_scatters_ahead_turns_back_less() -> None:
    """Media with the same reduced albedo, behind interfaces; and all is alike where nothing absorbs."""
    for ior in (1.33, 1.5):
        for reduced in (0.05, 0.5, 0.95):
            found = [
                half_space_reflectance(reduced / (reduced + (1 - reduced) * (1 - g)), ior, HenyeyGreenstein(g))
                for g in (-0.5, 0.0, 0.5, 0.9)
            ]
            assert (np.diff(found) < 0).all()
        assert half_space_reflectance(1.0, ior, HenyeyGreenstein(0.9)) == pytest.approx(1.0, abs=MODES)
