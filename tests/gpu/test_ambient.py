"""Radiance that reaches every place in the media alike: what they scatter of it, in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.formulas import optics
from translucent.geometry.solids import Box, Sphere, Torus

SIZE = (32, 24)
CAMERA = tl.Camera.look_at((1, 1.5, 4), (0, 0, 0))
DUSK = tl.Environment.constant((0.2, 0.3, 0.1))
AMBIENT = np.array([0.8, 0.5, 1.0])
MILK = tl.Medium(absorption=(0.5, 1, 0), emission=(0.1, 0, 0.3), scattering=(1, 0, 4), anisotropy=0.3)
SMOKE = tl.Medium(absorption=1.0, scattering=2.0, anisotropy=-0.5)
METHODS = (
    None,
    tl.SignedDepth(),
    tl.FragmentLists(),
    tl.DepthPeeling(),
    tl.KBuffer(),
    tl.RayMarched(16, "exponential"),
)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_the_closed_form_of_one_medium(renderer: tl.Renderer, method: Any) -> None:
    """L = T L_0 + (q + sigma_s A) / sigma_t (1 - T), and where sigma_t = 0 the product with the length."""
    mesh = Torus().tessellate(32)
    scene = tl.Scene([tl.Object(mesh, MILK)], CAMERA, [], DUSK, ambient=AMBIENT)
    frame = renderer.render(scene, SIZE, method)
    source = np.asarray(MILK.emission) + np.asarray(MILK.scattering) * AMBIENT
    length = frame.thickness[..., None].astype(np.float64)
    expected = optics.emitted_radiance(source, MILK.extinction, length)
    expected += np.array([0.2, 0.3, 0.1]) * optics.transmittance(MILK.extinction * length)
    np.testing.assert_allclose(frame.radiance, expected, rtol=5e-6)
    truth = tl.reference.render(scene, SIZE)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    # Next to an outline, faces are steep: there thickness magnifies the rounding of the picture's plane.
    np.testing.assert_allclose(frame.radiance[inside], truth.radiance[inside], rtol=1e-4)


@pytest.mark.parametrize("backend", ["reference", "cpu", "opengl"])
def test_a_white_furnace_stays_white(renderer: tl.Renderer, backend: str) -> None:
    """Albedo 1, and radiance 1 from behind and all around: radiance 1 at any depth; in the dark it tends to it."""
    ball = Sphere().tessellate(24)

    def radiance(environment: float) -> Any:
        body = tl.Object(ball, tl.Medium(scattering=(0.1, 3.0, 300.0)))
        scene = tl.Scene([body], CAMERA, [], tl.Environment.constant((environment,) * 3), ambient=(1, 1, 1))
        if backend == "reference":
            return tl.reference.render(scene, SIZE)
        if backend == "cpu":
            with tl.Renderer(backend="cpu") as other:
                return other.render(scene, SIZE)
        return renderer.render(scene, SIZE)

    np.testing.assert_allclose(radiance(1.0).radiance, 1.0, atol=1e-6)
    dark = radiance(0.0)
    np.testing.assert_allclose(dark.radiance, 1.0 - dark.transmittance, atol=1e-6)
    assert dark.radiance[..., 2].max() == pytest.approx(1.0, abs=1e-6)


def test_several_media_are_put_in_order(renderer: tl.Renderer) -> None:
    """They emit nothing, and still what is in front dims what is behind."""
    away = np.eye(4)
    away[:3, 3] = 0.3, 0.1, -0.6
    cube = Box().tessellate()
    haze = tl.Medium(absorption=(0, 1, 2), scattering=(1, 0.5, 0.1))
    objects = [tl.Object(cube, SMOKE), tl.Object(cube, haze, away)]
    lights = [tl.DirectionalLight((-0.3, -1, 0.2), (2, 2, 2))]
    for lamps, tolerance in (([], 1e-5), (lights, 5e-3)):
        scene = tl.Scene(objects, CAMERA, lamps, DUSK, ambient=AMBIENT)
        frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
        assert isinstance(frame.plan.method, tl.FragmentLists)
        inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
        np.testing.assert_allclose(frame.radiance[inside], truth.radiance[inside], rtol=tolerance)


def test_it_follows_a_density(renderer: tl.Renderer) -> None:
    grid = tl.DensityGrid(np.random.default_rng(3).random((4, 5, 6)))
    scene = tl.Scene([tl.Object(Box().tessellate(), SMOKE, density=grid)], CAMERA, [], DUSK, ambient=AMBIENT)
    method = tl.RayMarched(8, "exponential")
    frame, truth = renderer.render(scene, SIZE, method), tl.reference.march(scene, SIZE, method)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    np.testing.assert_allclose(frame.radiance[inside], truth.radiance[inside], rtol=2e-5)
    exact = tl.reference.render(scene, SIZE)
    np.testing.assert_allclose(truth.radiance[inside], exact.radiance[inside], rtol=2e-2)


def test_sheets_scatter_it_too(renderer: tl.Renderer) -> None:
    sheet = tl.Object(Box().tessellate(), SMOKE, sheet_thickness=0.01)
    scene = tl.Scene([sheet], CAMERA, [], DUSK, ambient=AMBIENT)
    frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    np.testing.assert_allclose(frame.radiance[inside], truth.radiance[inside], rtol=1e-5)
    dark = renderer.render(tl.Scene([sheet], CAMERA, [], DUSK), SIZE)
    assert (frame.radiance.mean(axis=(0, 1)) > dark.radiance.mean(axis=(0, 1))).all()
