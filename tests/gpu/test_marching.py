"""Ray marching on the GPU: the same sums as the reference's, and their convergence."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.planning.methods.ray_marched import Quadrature

SIZE = (32, 24)
DUSK = tl.Environment.constant((0.2, 0.3, 0.1))
MILK = tl.Medium(absorption=(0.5, 1, 2), emission=(1, 0.2, 0.1), scattering=(1, 0.5, 0.2), anisotropy=0.3)
EMBER = tl.Medium(absorption=(2, 0.5, 0.2), emission=(0.1, 0.3, 1))
LIGHTS = {
    "no light": [],
    "sun": [tl.DirectionalLight((-0.3, -1, 0.2), (2, 2, 2))],
    "lamp": [tl.PointLight((0.5, 2, 0.4), (3, 3, 3))],
}


def two_boxes(lights: list[Any], **options: Any) -> tl.Scene:
    right, left = np.eye(4), np.eye(4)
    right[0, 3], left[0, 3] = 0.4, -0.3
    cube = Box().tessellate()
    objects = [tl.Object(cube, MILK, left, priority=1), tl.Object(cube, EMBER, right)]
    return tl.Scene(objects, tl.Camera.look_at((1, 1.5, 4), (0, 0, 0)), lights, DUSK, **options)


@pytest.mark.parametrize("lights", LIGHTS.values(), ids=LIGHTS)
@pytest.mark.parametrize("quadrature", [rule for rule in get_args(Quadrature) if rule != "jittered"])
@pytest.mark.usefixtures("large_views")
def test_every_quadrature_sums_as_the_reference_does(renderer: tl.Renderer, lights: list[Any], quadrature: Any) -> None:
    scene, method = two_boxes(lights), tl.RayMarched(steps=8, quadrature=quadrature)
    frame, truth = renderer.render(scene, SIZE, method), tl.reference.march(scene, SIZE, method)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    error = np.abs(frame.radiance - truth.radiance)[inside] / truth.radiance.max()
    print(f"{quadrature}: max {error.max():.1e}")
    # Steep faces within a texel of a lamp's view are what is left; all else is float32.
    assert error.max() <= 1e-4
    assert np.quantile(error, 0.99) <= 2e-6
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness[inside], truth.thickness[inside], atol=1e-5)


@pytest.mark.parametrize("policy", ["union", "priority"])
def test_marching_keeps_to_the_overlap_policy(renderer: tl.Renderer, policy: Any) -> None:
    scene, method = two_boxes(LIGHTS["sun"], overlap=policy), tl.RayMarched(steps=8)
    frame, truth = renderer.render(scene, SIZE, method), tl.reference.march(scene, SIZE, method)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    assert np.abs(frame.radiance - truth.radiance)[inside].max() <= 1e-4 * truth.radiance.max()


def test_random_steps_are_right_in_the_mean_and_the_same_for_a_seed(renderer: tl.Renderer) -> None:
    scene = two_boxes(LIGHTS["sun"])
    exact = renderer.render(scene, SIZE, tl.RayMarched(steps=256)).radiance
    frames = [
        renderer.render(scene, SIZE, tl.RayMarched(steps=4, quadrature="jittered", seed=seed)).radiance
        for seed in (1, 1, *range(2, 34))
    ]
    np.testing.assert_array_equal(frames[0], frames[1])
    assert (frames[1] != frames[2]).any()
    spread = np.std(frames[1:], axis=0)
    off = np.abs(np.mean(frames[1:], axis=0) - exact)
    # 33 seeds: the mean is off by more than 4 of its standard errors in 6 pixels of 100,000.
    assert (off <= 4 * spread / np.sqrt(33) + 1e-5).mean() >= 0.995


def test_a_jitter_moves_all_steps_of_a_pixel(renderer: tl.Renderer) -> None:
    scene = two_boxes(LIGHTS["sun"])
    still, moved = (renderer.render(scene, SIZE, tl.RayMarched(steps=4, jitter=j)).radiance for j in (False, True))
    assert (still != moved).any()
    np.testing.assert_allclose(moved, still, atol=0.3)


@pytest.mark.parametrize(("quadrature", "order"), [("left", 1.0), ("midpoint", 2.0)])
def test_the_error_falls_as_the_rule_promises(renderer: tl.Renderer, quadrature: Any, order: float) -> None:
    """The slope over five doublings, of emission alone, which has no kinks."""
    glow = tl.Medium(absorption=2.0, emission=1.0)
    scene = tl.Scene([tl.Object(Sphere().tessellate(32), glow)], tl.Camera.look_at((0, 0, 4), (0, 0, 0)), [], DUSK)
    exact = renderer.render(scene, SIZE).radiance
    steps = 2 ** np.arange(1, 7)
    errors = [
        np.abs(renderer.render(scene, SIZE, tl.RayMarched(int(n), quadrature)).radiance - exact).mean() for n in steps
    ]
    slope = -np.polyfit(np.log2(steps), np.log2(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.2)


def test_marching_and_gauss_points_meet(renderer: tl.Renderer) -> None:
    scene = two_boxes(LIGHTS["lamp"])
    many = renderer.render(scene, SIZE, tl.RayMarched(steps=512)).radiance
    few = renderer.render(scene, SIZE, tl.FragmentLists(light_points=16)).radiance
    assert np.sqrt(((many - few) ** 2).mean() / (many**2).mean()) <= 5e-3
