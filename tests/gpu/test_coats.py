"""Thin films and clear coats in pictures, against the formulas of what one interface reflects and passes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.formulas import interface, optics, thin_film
from translucent.geometry.solids import Sphere

Array = npt.NDArray[np.float64]

SQUARE = tl.Mesh(
    np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
    [[0, 1, 2], [0, 2, 3]],
    [[0, 0], [1, 0], [1, 1], [0, 1]],
)
LEAN = np.radians(35)
TILTED = np.array([[1, 0, 0, 0], [0, np.cos(LEAN), np.sin(LEAN), 0], [0, -np.sin(LEAN), np.cos(LEAN), 0], [0, 0, 0, 1]])
CAMERA = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=0.5)
AWAY = np.array([[1.0, 0, 0, 0], [0, 1, 0, 50], [0, 0, 1, 0], [0, 0, 0, 1]])
BALL = Sphere().tessellate(200)
WHITE = tl.Environment.constant((1.0, 1.0, 1.0))
SKY = tl.Environment.gradient((0.1, 0.2, 0.4), (1.0, 0.8, 0.5))
GLASS, AIR = tl.Medium(ior=1.5), tl.Medium()
# Both have coats, so that one program draws them.
SOAP = tl.Surface(iridescence=1.0, iridescence_ior=1.33, iridescence_thickness=350e-9, clearcoat=0.25)
OXIDE = tl.Surface(iridescence=0.75, iridescence_ior=2.0, iridescence_thickness=250e-9, clearcoat=0.5)


@pytest.fixture(scope="module")
def cpu_renderer() -> Iterator[tl.Renderer]:
    with tl.Renderer(backend="cpu") as renderer:
        yield renderer


def seen(renderer: tl.Renderer, body: tl.Object, interfaces: Any) -> Array:
    scene = tl.Scene([body], CAMERA, environment=SKY)
    return np.asarray(renderer.render(scene, (4, 4), interfaces=interfaces).radiance[2, 2], np.float64)


def truth(surface: tl.Surface, ior: float) -> Array:
    """Light of the sky that a leaning pane mirrors, and lets through."""
    cosine = np.cos(LEAN)
    bare = float(optics.fresnel_dielectric(cosine, ior))
    film = thin_film.thin_film_reflectance(
        cosine, ior, surface.iridescence_ior, surface.iridescence_ior * surface.iridescence_thickness
    )
    front = bare + surface.iridescence * (film - bare)
    back, on = (
        share(front, bare, np.zeros(3))
        for share in (thin_film.film_slab_reflectance, thin_film.film_slab_transmittance)
    )
    coat = surface.clearcoat * float(optics.fresnel_dielectric(cosine, interface.CLEARCOAT_IOR))
    ahead = np.array([0.0, 0.0, -1.0])
    mirrored = interface.reflected_direction(ahead, TILTED[:3, 2])
    return np.asarray((coat + (1 - coat) * back) * SKY.lighting(mirrored) + (1 - coat) * on * SKY.lighting(ahead))


@pytest.mark.parametrize(("surface", "medium"), [(SOAP, AIR), (OXIDE, GLASS)], ids=["bubble", "pane"])
def test_a_sheet_has_its_film_and_its_coat_on_the_side_of_the_light(
    renderer: tl.Renderer, cpu_renderer: tl.Renderer, surface: tl.Surface, medium: tl.Medium
) -> None:
    pane = tl.Object(SQUARE, medium, TILTED, sheet_thickness=1e-6, surface=surface)
    expected = truth(surface, medium.ior)
    plain = seen(cpu_renderer, tl.Object(SQUARE, medium, TILTED, sheet_thickness=1e-6), None)
    assert np.abs(expected - plain).max() > 0.02  # the film is there to be seen
    for interfaces in (tl.FrontInterface(), tl.ScreenInterfaces(), tl.TracedInterfaces()):
        assert seen(renderer, pane, interfaces) == pytest.approx(expected, abs=2e-4), interfaces
    assert seen(cpu_renderer, pane, None) == pytest.approx(expected, abs=2e-5)
    reference = tl.reference.render(tl.Scene([pane], CAMERA, environment=SKY), (4, 4)).radiance[2, 2]
    assert np.asarray(reference) == pytest.approx(expected, abs=1e-9)


LOSSLESS = {
    "iridescent glass": tl.Object(BALL, GLASS, surface=OXIDE),
    "soap bubble of air": tl.Object(BALL, AIR, surface=SOAP),
}


@pytest.mark.parametrize("body", LOSSLESS.values(), ids=LOSSLESS)
def test_in_even_light_what_takes_nothing_cannot_be_seen(
    renderer: tl.Renderer, cpu_renderer: tl.Renderer, body: tl.Object
) -> None:
    scene = tl.Scene([body], tl.Camera.look_at((0, 0.5, 4), (0, 0, 0), fov_y=35), environment=WHITE)
    for interfaces in (tl.FrontInterface(), tl.ScreenInterfaces(), tl.TracedInterfaces()):
        found = renderer.render(scene, (16, 16), interfaces=interfaces).radiance
        np.testing.assert_allclose(found, 1.0, atol=2e-5)
    for roughness in (0.0, 0.4):
        coated = dataclasses.replace(body, surface=dataclasses.replace(body.surface, roughness=roughness))
        rough = dataclasses.replace(scene, objects=[coated])
        np.testing.assert_allclose(cpu_renderer.render(rough, (16, 16)).radiance, 1.0, atol=2e-5)


def test_random_paths_and_rays_see_the_same_film(renderer: tl.Renderer, cpu_renderer: tl.Renderer) -> None:
    camera = tl.Camera.look_at((0, 0.5, 4), (0, 0, 0), fov_y=35)
    scene = tl.Scene([LOSSLESS["iridescent glass"]], camera, environment=SKY)
    rays = renderer.render(scene, (8, 8), interfaces=tl.TracedInterfaces(depth=8, forks=3)).radiance
    on_cpu = cpu_renderer.render(scene, (8, 8), interfaces=tl.TracedInterfaces(depth=8, forks=3)).radiance
    # But for a pixel where a faint branch is followed by one of them alone.
    assert np.median(np.abs(rays - on_cpu)) < 1e-5
    assert np.abs(rays - on_cpu).mean() < 2e-4
    paths = renderer.render(scene, (8, 8), method=tl.PathTraced(paths=400)).radiance
    truth, error = tl.reference.path_trace(scene, (8, 8), paths=16)
    for found, deviations in ((paths, 1.0), (truth.radiance, 4.0)):  # 400 paths have a fifth of the error of 16
        allowed = deviations * np.sqrt((error**2).sum(axis=(0, 1))) / 64 + 1e-3
        assert (np.abs(found.mean(axis=(0, 1)) - rays.mean(axis=(0, 1))) < allowed).all()


def opaque(renderer: tl.Renderer, surface: tl.Surface, environment: tl.Environment, **scene: Any) -> Array:
    hidden = tl.Object(SQUARE, GLASS, AWAY, sheet_thickness=1e-6)  # a plan needs a medium
    pane = tl.Object(SQUARE, None, TILTED, surface=surface)
    frame = renderer.render(tl.Scene([pane, hidden], CAMERA, environment=environment, **scene), (4, 4))
    return np.asarray(frame.radiance[2, 2], np.float64)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_opaque_objects_have_them_too(renderer: tl.Renderer, metallic: float) -> None:
    """White under coat and film stays white in even light; black shows the coat, and the film, alone."""
    both = tl.Surface(
        roughness=0.3, metallic=metallic, clearcoat=0.8, clearcoat_roughness=0.1, iridescence=1.0, iridescence_ior=1.8
    )
    # Of metal as white as can be the index that stands for it has an end.
    np.testing.assert_allclose(opaque(renderer, both, WHITE), 1.0, atol=5e-4 if metallic else 1e-5)
    cosine = np.cos(LEAN)
    coat = tl.Surface(color=(0, 0, 0), ior=1.0, clearcoat=0.8)
    fresnel = float(optics.fresnel_dielectric(cosine, interface.CLEARCOAT_IOR))
    assert opaque(renderer, coat, WHITE) == pytest.approx(np.full(3, 0.8 * fresnel), abs=3e-3)  # Schlick 1994
    film = tl.Surface(color=(0, 0, 0), ior=1.5, iridescence=1.0, iridescence_ior=2.0, iridescence_thickness=300e-9)
    expected = thin_film.thin_film_reflectance(cosine, 1.5, 2.0, 600e-9)
    assert np.ptp(expected) > 0.02
    assert opaque(renderer, film, WHITE) == pytest.approx(expected, abs=3e-3)


def test_a_rough_coat_spreads_the_highlight_of_a_lamp(renderer: tl.Renderer) -> None:
    black = tl.Environment.constant((0.0, 0.0, 0.0))
    light = [tl.DirectionalLight((0.0, -1.0, -2.0), (1.0, 1.0, 1.0))]
    cos_light = float(-np.array([0.0, -1.0, -2.0]) @ TILTED[:3, 2] / np.sqrt(5))
    half = np.array([0.0, 1.0, 2.0]) / np.sqrt(5) + [0.0, 0.0, 1.0]
    half /= np.linalg.norm(half)
    for roughness in (0.3, 0.6):
        coat = tl.Surface(color=(0, 0, 0), ior=1.0, clearcoat=0.5, clearcoat_roughness=roughness)
        density = interface.ggx_distribution(float(half @ TILTED[:3, 2]), roughness**2)
        visible = interface.ggx_visibility(cos_light, np.cos(LEAN), roughness**2)
        mirrored = float(optics.fresnel_dielectric(float(half[2]), interface.CLEARCOAT_IOR)) * density * visible
        found = opaque(renderer, coat, black, lights=light)
        # What rough facets lose between them is given back by a factor near 1.
        assert found == pytest.approx(np.full(3, 0.5 * mirrored * cos_light), rel=0.03)
