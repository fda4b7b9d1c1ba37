"""Slabs on a card: closed forms of the clear and the absorbing, and other solutions of the scattering ones."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expn

import translucent as tl
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.formulas.slab import reflectance_on_card
from translucent.media.preset import CARDS, SLABS
from translucent.reference import slabs

#: What eight nodes on each side of the critical cosine leave.
QUADRATURE = 1e-3


@pytest.mark.parametrize(("albedo", "depth"), [(0.9, 1.0), (0.99, 20.0), (0.5, 0.3), (0.9999, 64.0)])
def test_on_black_without_an_interface_it_is_the_bare_slab(albedo: float, depth: float) -> None:
    assert reflectance_on_card(albedo, depth, 1.0, 0.0) == pytest.approx(
        slabs.total_fractions(albedo, depth, 1.0)[0], abs=QUADRATURE
    )


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5])
@pytest.mark.parametrize("card", [0.0, 0.3, 1.0])
def test_a_thick_slab_hides_its_card(ior: float, card: float) -> None:
    for albedo in (0.5, 0.9, 0.99):
        expected = half_space_reflectance(albedo, ior) * diffuse_interface(ior).entering
        assert reflectance_on_card(albedo, 1e5, ior, card) == pytest.approx(expected, abs=QUADRATURE)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5])
@pytest.mark.parametrize(("albedo", "depth"), [(0.6, 0.5), (0.99, 3.0), (0.999, 20.0)])
def test_any_slab_is_that_of_the_reference_between_its_interface_and_its_card(
    albedo: float, depth: float, ior: float
) -> None:
    """Radiance down and up at both faces: the upper mirrors by Fresnel's equations, the lower by Lambert's law."""
    mu, weight = slabs.cosines(ior)
    back, on = slabs.bare(albedo, depth, mu, weight)
    mirror = optics.fresnel_dielectric(mu, 1 / ior) if ior > 1 else np.zeros_like(mu)
    one = np.eye(len(mu))
    for card in (0.0, 0.5, 1.0):
        lambert = np.outer(np.ones_like(mu), 2 * card * mu * weight)
        # Down at the top, up at the bottom: d = n^2 (1 - F) + F u, with u = R d + T b, and b = C (T d + R b).
        system = np.block(
            [[one - mirror[:, None] * back, -mirror[:, None] * on], [-lambert @ on, one - lambert @ back]]
        )
        down, below = np.split(np.linalg.solve(system, np.concatenate([ior**2 * (1 - mirror), np.zeros_like(mu)])), 2)
        out = float((2 * mu * weight * (1 - mirror) * (back @ down + on @ below)).sum())
        assert reflectance_on_card(albedo, depth, ior, card) == pytest.approx(out, abs=QUADRATURE)


def test_what_absorbs_alone_is_an_exponential_integral() -> None:
    """Through to a Lambertian card and back, diffuse both ways: (2 E3(tau))^2."""
    depth = np.array([0.0, 0.1, 0.5, 2.0])
    np.testing.assert_allclose(
        reflectance_on_card(0.0, depth, 1.0, 0.7), 0.7 * (2 * expn(3, depth)) ** 2, atol=QUADRATURE
    )


@given(st.floats(0, 1), st.floats(0, 1e3), st.floats(1, 2.5))
def test_a_whiter_card_is_brighter_and_nothing_is_made(albedo: float, depth: float, ior: float) -> None:
    black, gray, white = reflectance_on_card(albedo, depth, ior, [0.0, 0.5, 1.0])
    slack = 1e-6
    assert -slack <= black <= gray + slack <= white + 2 * slack
    assert white <= diffuse_interface(ior).entering + slack


def test_presets_on_cards() -> None:
    milk, crystal, wine = (tl.preset(name) for name in ("whole_milk", "crystal", "merlot"))
    for one in (milk, crystal, wine):
        assert one.slab_reflectance.shape == (len(CARDS), len(SLABS), 3)
    # Of milk, 2 cm hide what is below; of wine, black stays black, and white darkens with the thickness.
    white, black = milk.slab_reflectance
    np.testing.assert_allclose(white[2], black[2], atol=0.02)
    assert white[0].min() > black[0].max()
    white, black = wine.slab_reflectance
    assert (np.diff(white, axis=0) < 0).all()
    assert black.max() < 0.02
    shown = wine._repr_html_()
    for card in CARDS:
        slabs = shown.split(f"background:{card};")[1].split(f"on {card}")[1]
        at = [slabs.index(f"{label}<br>{color}") for label, color in wine.slab_colors()[card].items()]
        assert at == sorted(at)


def test_the_drawing_in_the_docs_is_that_of_the_presets() -> None:
    """`python tools/swatch_card.py` draws it again."""
    text = (Path(__file__).parents[2] / "docs" / "swatches.svg").read_text()
    drawn = re.findall(r"<title>(\w+), (\w+ mm) on (\w+): #(\w+)</title>", text)
    assert {name for name, *_ in drawn} == set(tl.presets())
    for name, thickness, card, color in drawn:
        own = tl.preset(name).slab_colors()[card][thickness]
        # One step of 8 bits, which rounding may go either way.
        assert np.abs(np.subtract(list(bytes.fromhex(color)), list(bytes.fromhex(own[1:])))).max() <= 1, name
