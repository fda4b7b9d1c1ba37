"""Rough interfaces: microfacets against closed forms, reciprocity, highlights, noise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.dielectrics import BLACK, UP_AND_DOWN, Array, oblique, slab
from translucent.formulas import interface, optics
from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.reference import microfacets, refracted_light
from translucent.reference.microfacets import lit_at_interface, scattered_at_interface
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface


@pytest.mark.parametrize("ior", [1.5, 1 / 1.5])
@pytest.mark.parametrize(("alpha", "cosine"), [(0.01, 0.5), (0.09, 1.0), (0.09, 0.1), (0.36, 0.5), (1.0, 0.3)])
def test_light_reflected_by_one_microfacet(
    ior: float, alpha: float, cosine: float, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As F D V says, integrated over the microfacets; four standard errors."""
    count = 100_000
    direction = np.array([math.sqrt(1 - cosine**2), 0.0, -cosine])
    # The second look at the height lets light leave; nothing is met again.
    monkeypatch.setattr(microfacets, "MOST_INTERACTIONS", 2)
    every = np.ones(count)
    found, passed = scattered_at_interface(
        np.tile(direction, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), ior * every, alpha * every, rng
    )
    once = found * (~passed)[:, None]
    u, turn = (np.arange(1500) + 0.5) / 1500, (np.arange(180) + 0.5) / 90 * np.pi
    c = 1 / np.sqrt(1 + alpha**2 * u / (1 - u))
    s = np.sqrt(1 - c * c)
    half = np.stack(np.broadcast_arrays(s[:, None] * np.cos(turn), s[:, None] * np.sin(turn), c[:, None]), axis=-1)
    facing = np.maximum(-(half @ direction), 0.0)
    out = direction + 2 * facing[..., None] * half
    lit = (facing > 0) & (out[..., 2] > 0)
    f = optics.fresnel_dielectric(facing[lit], ior)
    # Drawn with the density D cos_half, of half vectors; the light's solid angle is 4 cos_facet times theirs.
    share = f * interface.ggx_visibility(out[lit][:, 2], cosine, alpha) * out[lit][:, 2] * 4 * facing[lit]
    share /= np.broadcast_to(c[:, None], facing.shape)[lit]
    weights = [np.ones(len(share)), out[lit][:, 2], out[lit][:, 0]]
    values = [once.any(axis=1).astype(float), once[:, 2], once[:, 0]]
    for weight, value in zip(weights, values, strict=True):
        assert value.mean() == pytest.approx(
            (share * weight).sum() / facing.size, abs=4 * value.std() / math.sqrt(count)
        )


def test_light_passed_by_one_microfacet(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unseen from both sides as B(1 + Lambda, 1 + Lambda) says (Heitz et al. 2016): higher places are deeper beyond."""
    monkeypatch.setattr(microfacets, "MOST_INTERACTIONS", 2)
    count, cosine = 100_000, 0.3
    hidden = 0.5 * (1 / cosine - 1)  # Lambda at alpha = 1
    every, way = np.ones(count), [math.sqrt(1 - cosine**2), 0.0, -cosine]
    # Equal media, almost: light goes straight on, and is reflected by none in a million.
    found, _ = scattered_at_interface(
        np.tile(way, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), 1.0001 * every, every, rng
    )
    expected = (1 + hidden) * math.gamma(1 + hidden) ** 2 / math.gamma(2 + 2 * hidden)
    assert found.any(axis=1).mean() == pytest.approx(expected, abs=4 * math.sqrt(expected / count) + 1e-4)


@pytest.mark.parametrize("ior", [1.5, 1 / 1.5])
@pytest.mark.parametrize(("alpha", "cosine"), [(0.09, 0.9), (0.5, 0.3)])
def test_light_turned_to_lamps_is_the_density_of_directions(
    ior: float, alpha: float, cosine: float, rng: np.random.Generator
) -> None:
    """Means over random directions, and over directions of lamps all around; four standard errors."""
    count = 100_000
    way, every = [math.sqrt(1 - cosine**2), 0.0, -cosine], np.ones(count)
    lamps = rng.normal(size=(count, 3))
    lamps /= np.linalg.norm(lamps, axis=1, keepdims=True)
    found, _, _, seen = lit_at_interface(
        np.tile(way, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), ior * every, alpha * every, lamps[None], rng
    )
    # What is hidden deep enough underflows.
    shown = 4 * np.pi * np.where(seen[0, :, 0] < 1e-100, 0.0, seen[0, :, 0])
    for value in (
        lambda v: v[:, 2] > 0,
        lambda v: v[:, 2] < 0,
        lambda v: v[:, 0],
        lambda v: np.minimum(v[:, 2], 0) ** 2,
        lambda v: (v[:, 2] > 0) & (v[:, 2] < 0.4),
    ):
        by_paths, by_lamps = value(found).astype(float), shown * value(lamps)
        error = math.hypot(by_paths.std(), by_lamps.std()) / math.sqrt(count)
        assert abs(by_paths.mean() - by_lamps.mean()) < 4 * error


@pytest.mark.parametrize("alpha", [0.1, 0.7])
def test_a_rough_interface_is_reciprocal(alpha: float, rng: np.random.Generator) -> None:
    """The fraction of diffuse light that enters is n^2 times the fraction that leaves: n^2 (1 - R_in) = 1 - R_out."""
    count, ior = 200_000, 1.5

    def passed(relative: float) -> Array:
        cosine = np.sqrt(rng.random(count))
        directions = np.stack([np.sqrt(1 - cosine**2), np.zeros(count), -cosine], axis=1)
        every = np.ones(count)
        return scattered_at_interface(
            directions, np.tile([0.0, 0.0, 1.0], (count, 1)), relative * every, alpha * every, rng
        )[1]

    into, out_of = passed(ior).mean(), passed(1 / ior).mean()
    error = math.sqrt((into * (1 - into) + ior**4 * out_of * (1 - out_of)) / count)
    assert ior**2 * out_of == pytest.approx(into, abs=4 * error)


@pytest.mark.parametrize("sheet", [None, 1e-3])
def test_a_nearly_polished_slab_is_a_polished_one(sheet: float | None) -> None:
    medium = Medium(absorption=(0.0, 1.0, 2.0) if sheet is None else (0.0, 300.0, 600.0), ior=1.5)

    def seen(roughness: float) -> tuple[Array, Array]:
        body = Object(slab(-0.5, 0.5), medium, sheet_thickness=sheet, surface=Surface(roughness=roughness))
        light, error = refracted_light(
            Scene([body], oblique(65), environment=UP_AND_DOWN), (1, 1), bounces=20, paths=20_000
        )
        return light.radiance[0], error[0]

    (rough, error), (polished, none) = seen(0.03), seen(0.0)
    assert not none.any()
    # Directions spread by alpha = 1e-3, which is what radiance may change by.
    assert (np.abs(rough - polished) <= 4 * error + 1e-3).all()


def test_highlights_of_lights_in_rough_interfaces() -> None:
    light = DirectionalLight((-0.5, -1.0, 0.1), (2.0, 1.0, 0.5))
    black = Medium(absorption=1e4, ior=1.5)
    body = Object(slab(-0.5, 0.5), black, surface=Surface(roughness=0.5))
    scene = Scene([body], oblique(30), [light], BLACK)
    to_eye, to_light = np.array([0.5, math.cos(math.pi / 6), 0.0]), -np.asarray(light.direction)
    half = (to_eye + to_light) / np.linalg.norm(to_eye + to_light)
    expected = (
        optics.fresnel_dielectric(half @ to_eye, 1.5)
        * interface.ggx_distribution(half[1], 0.25)
        * interface.ggx_visibility(to_light[1], to_eye[1], 0.25)
        * np.asarray(light.irradiance)
        * to_light[1]
    )
    found, _ = refracted_light(scene, (1, 1), paths=2)
    np.testing.assert_allclose(found.radiance[0], expected, rtol=1e-10)
    # What is between the light and the interface, and not between that and the eye, dims and blocks it.
    between = Box((8.0, 20.0, -4.0), (12.0, 20.3, 0.0)).tessellate()
    way = 0.3 * float(np.linalg.norm(light.direction)) / -light.direction[1]
    for medium, share in ((Medium(absorption=(1, 2, 3)), np.exp(-way * np.array([1, 2, 3]))), (None, np.zeros(3))):
        found, _ = refracted_light(replace(scene, objects=[body, Object(between, medium)]), (1, 1), paths=2)
        np.testing.assert_allclose(found.radiance[0], share * expected, rtol=1e-10)


def test_noise_falls_with_the_number_of_paths_and_is_told() -> None:
    body = Object(slab(-0.5, 0.5), Medium(ior=1.5), surface=Surface(roughness=0.4))
    scene = Scene([body], oblique(30), environment=UP_AND_DOWN)
    (few, rough), (many, fine) = (refracted_light(scene, (2, 2), paths=paths) for paths in (100, 2500))
    assert (rough / fine).mean() == pytest.approx(5.0, rel=0.3)
    spread = np.abs(few.radiance - many.radiance) / rough
    assert 0.1 < np.sqrt((spread**2).mean()) < 2.5
    again, _ = refracted_light(scene, (2, 2), paths=100)
    np.testing.assert_array_equal(again.radiance, few.radiance)
    other, _ = refracted_light(scene, (2, 2), paths=100, seed=1)
    assert (other.radiance != few.radiance).any()
