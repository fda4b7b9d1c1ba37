"""Bodies around refracted rays: walls at one place, priorities, bubbles, an eye in glass, and index one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from tests.reference.dielectrics import BLACK, GLASS, UP_AND_DOWN, WHITE, box, oblique, pixel, reflectance, slab
from translucent.frames.frame import Frame
from translucent.geometry.solids import Sphere
from translucent.media.medium import Medium
from translucent.reference import light_over_pixels, refracted_light, render
from translucent.reference.refracted import FAINTEST
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import framing

# What rays are in


def test_walls_at_one_place_are_one_interface() -> None:
    """Two slabs of one glass that touch are one; of two glasses, there is one interface of their relative index."""
    both = [Object(slab(0.0, 0.5), GLASS), Object(slab(-0.5, 0.0), GLASS)]
    one = [Object(slab(-0.5, 0.5), GLASS)]
    a, b = (pixel(Scene(bodies, oblique(50), environment=UP_AND_DOWN)) for bodies in (both, one))
    np.testing.assert_allclose(a, b, rtol=1e-12)
    apart = [Object(slab(0.0, 0.5), Medium(ior=1.5)), Object(slab(-0.5, 0.0), Medium(ior=2.0))]
    found, _ = refracted_light(Scene(apart, oblique(0), environment=WHITE), (1, 1), bounces=2)
    r = [reflectance(0, 1.5), reflectance(0, 2 / 1.5)]
    # Two interfaces on the way: first light back from them is r0 and (1 - r0)^2 r1, of which the second needs a third.
    assert found.radiance[0, 0] == pytest.approx(r[0], abs=1e-14)
    assert found.residual[0, 0] == pytest.approx(1 - r[0], abs=1e-14)


def test_the_higher_priority_decides_what_light_is_in() -> None:
    """Wine that reaches into the glass is displaced by it, as if it ended there."""
    wine = Medium(absorption=(1.0, 2.0, 4.0), ior=1.34)
    overlapping = [Object(slab(0.0, 0.5), GLASS, priority=1), Object(slab(-0.5, 0.2), wine)]
    touching = [Object(slab(0.0, 0.5), GLASS), Object(slab(-0.5, 0.0), wine)]
    a = pixel(Scene(overlapping, oblique(50), environment=UP_AND_DOWN, overlap="priority"))
    b = pixel(Scene(touching, oblique(50), environment=UP_AND_DOWN))
    np.testing.assert_allclose(a, b, rtol=1e-12)


def test_a_bubble_is_a_gap() -> None:
    bubble = [Object(slab(-0.5, 0.5), GLASS), Object(slab(-0.1, 0.2), Medium(), priority=1)]
    gap = [Object(slab(0.2, 0.5), GLASS), Object(slab(-0.5, -0.1), GLASS)]
    a = pixel(Scene(bubble, oblique(50), environment=UP_AND_DOWN, overlap="priority"), bounces=12)
    b = pixel(Scene(gap, oblique(50), environment=UP_AND_DOWN), bounces=12)
    np.testing.assert_allclose(a, b, rtol=1e-12)


def test_equal_priorities_are_decided_by_the_last_entry() -> None:
    """A stone in water, in either order of the objects."""
    water, stone = Object(slab(-0.5, 0.5), Medium(ior=1.33)), Object(slab(-0.3, 0.3), Medium(ior=1.6))
    layers = [
        Object(slab(0.3, 0.5), Medium(ior=1.33)),
        Object(slab(-0.3, 0.3), Medium(ior=1.6)),
        Object(slab(-0.5, -0.3), Medium(ior=1.33)),
    ]
    expected = pixel(Scene(layers, oblique(40), environment=UP_AND_DOWN))
    for bodies in ([water, stone], [stone, water]):
        np.testing.assert_allclose(pixel(Scene(bodies, oblique(40), environment=UP_AND_DOWN)), expected, rtol=1e-12)


def test_an_eye_in_glass_looks_out_through_a_window() -> None:
    """From inside, light is totally reflected beyond 41.8 degrees."""
    body = Object(slab(-0.5, 0.5), Medium(ior=1.5))
    environment = WHITE.with_background(BLACK)
    for degrees, black in ((0.0, 0.96), (35.0, 1 - reflectance(1.5 * math.sin(math.radians(35)), 1.5)), (50.0, 0.0)):
        direction = np.array([math.sin(math.radians(degrees)), -math.cos(math.radians(degrees)), 0.0])
        camera = Camera.look_at((0, 0.1, 0), (0, 0.1, 0) + direction, (0, 0, 1), fov_y=1e-3)
        found, _ = refracted_light(Scene([body], camera, environment=environment), (1, 1), bounces=30)
        assert found.radiance[0, 0] + found.residual[0, 0] == pytest.approx(1 - black, abs=3 * FAINTEST)


# Without interfaces


SCATTERING = Medium(absorption=(0.3, 1.0, 2.0), scattering=(1.0, 0.5, 0.2), emission=(0.1, 0.2, 0.3), anisotropy=0.3)


def picture(bodies: Sequence[Object], refraction: bool | None) -> Frame:
    lights = [DirectionalLight((0.3, -1.0, -0.4), (2.0, 1.0, 3.0))]
    opaque = Object(box((-0.2, -1.5, -1.6), (0.6, 1.2, -1.3)), color=(0.2, 0.5, 0.8))
    camera = Camera.look_at((0.5, 1.0, 4), (0, 0, 0), fov_y=30)
    environment = Environment.checkerboard((0.0, 0.1, 0.2), (1.0, 0.9, 0.8), tiles=4)
    return render(Scene([*bodies, opaque], camera, lights, environment), (12, 9), None, 1e-4, refraction)


def test_straight_rays_are_refracted_rays_of_index_one() -> None:
    bodies = [
        Object(box((-1, -1, -1), (1, 1, 1)), SCATTERING),
        Object(Sphere().tessellate(12), Medium(absorption=1.0), np.diag([0.5, 0.5, 0.5, 1.0])),
        Object(box((-0.5, -0.5, 1.2), (0.5, 0.5, 1.3)), Medium(absorption=5.0), sheet_thickness=0.01),
    ]
    straight, bent, usual = (picture(bodies, refraction) for refraction in (False, True, None))
    np.testing.assert_array_equal(usual.radiance, straight.radiance)
    np.testing.assert_array_equal(usual.valid, straight.valid)
    # Scattered light is integrated to the tolerance in either.
    np.testing.assert_allclose(bent.radiance, straight.radiance, rtol=3e-4, atol=1e-9)
    assert "residual" not in usual.provenance


def test_all_but_the_radiance_is_that_of_straight_rays() -> None:
    bodies = [Object(Sphere().tessellate(12), Medium(absorption=(1.0, 2.0, 3.0), ior=1.5))]
    bent, straight = (picture(bodies, refraction) for refraction in (None, False))
    for name in ("thickness", "optical_depth", "transmittance", "coverage"):
        np.testing.assert_array_equal(getattr(bent, name), getattr(straight, name))
    assert np.abs(bent.radiance - straight.radiance).max() > 0.1


def test_light_over_pixels_is_that_of_a_box_filter() -> None:
    """The mean over seeds is that of 8 x 8 rays on a grid in each pixel, within its own standard error."""
    size, fine, seeds = (12, 12), 8, 16
    glass = Object(Sphere().tessellate(32), Medium(ior=1.5))
    scene = Scene([glass], framing([glass], size), environment=Environment.studio())
    inner = np.zeros(size[::-1], dtype=bool)
    inner[4:8, 4:8] = True
    found = np.stack([light_over_pixels(scene, size, inner, 2, seed=seed)[0] for seed in range(seeds)])
    grid, along = (
        refracted_light(scene, (k * size[0], k * size[1]))[0].radiance.reshape(size[1], k, size[0], k, 3)
        for k in (fine, 1)
    )
    truth, centers = (rays.mean(axis=(1, 3))[inner] for rays in (grid, along))
    off, error = (
        np.sqrt(np.mean((found.mean(axis=0) - truth) ** 2)),
        np.sqrt(np.mean(found.var(axis=0, ddof=1) / seeds)),
    )
    assert off < 1.3 * error
    assert 2.0 * error < np.sqrt(np.mean((centers - truth) ** 2))
    errors = found - truth
    shared = (errors[::2] * errors[1::2]).mean()
    assert abs(shared) < 0.3 * (errors**2).mean(), "errors of two seeds have nothing to do with each other"
