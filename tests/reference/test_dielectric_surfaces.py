"""Surfaces of bodies whose interfaces bend light: dispersion, thin walls, tint, paint."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.reference.dielectrics import UP_AND_DOWN, WHITE, WIDE, Array, box, oblique, pixel, reflectance, slab
from translucent.formulas import interface
from translucent.geometry.solids import Sphere
from translucent.media.medium import Medium
from translucent.reference import refracted_light
from translucent.reference.refracted import FAINTEST
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface


def test_dispersion_bends_each_color_by_its_own_index() -> None:
    def seen(ior: float, dispersion: float) -> Array:
        camera = Camera.orthographic((0.3, 0.4, 5), (0.3, 0.4, 0), height=1e-3)
        body = Object(Sphere().tessellate(24), Medium(ior=ior), surface=Surface(dispersion=dispersion))
        return pixel(Scene([body], camera, environment=UP_AND_DOWN))

    found = seen(1.6, 2.0)
    for channel, ior in enumerate(interface.channel_iors(1.6, 2.0)):
        assert found[channel] == seen(float(ior), 0.0)[channel]
    assert np.abs(found - seen(1.6, 0.0))[[0, 2]].min() > 1e-4


@pytest.mark.parametrize("degrees", [0.0, 70.0])
def test_a_thin_wall_does_not_bend_light(degrees: float) -> None:
    medium = Medium(absorption=(0.0, 100.0, 400.0), ior=1.5)
    wall = Object(box((-WIDE, -1, -WIDE), (WIDE, 0, WIDE)), medium, sheet_thickness=0.01)
    # A box of sheets: the ray crosses its lid and its floor, 1 m below.
    found = pixel(Scene([wall], oblique(degrees), environment=UP_AND_DOWN), bounces=20)
    cosine = math.sqrt(1 - (math.sin(math.radians(degrees)) / 1.5) ** 2)
    r = reflectance(math.sin(math.radians(degrees)), 1.5)
    depth = np.asarray(medium.absorption) * 0.01 / cosine
    back, on = interface.slab_reflectance(r, depth), interface.slab_transmittance(r, depth)
    y = math.cos(math.radians(degrees))
    up, down = (UP_AND_DOWN.lighting([0.0, side, 0.0]) for side in (y, -y))
    both_on = on * on / (1 - back * back)
    expected = (back + on * on * back / (1 - back * back)) * up + both_on * down
    np.testing.assert_allclose(found, expected, atol=3 * FAINTEST)


def test_a_sheet_glows_as_its_source_function() -> None:
    glow = Medium(absorption=(50.0, 100.0, 300.0), emission=(50.0, 100.0, 300.0), ior=1.7)
    wall = Object(box((-WIDE, -1, -WIDE), (WIDE, 0, WIDE)), glow, sheet_thickness=0.01)
    for roughness in (0.0, 0.4):
        body = Object(wall.mesh, glow, sheet_thickness=0.01, surface=Surface(roughness=roughness))
        found, _ = refracted_light(Scene([body], oblique(50), environment=WHITE), (1, 1), bounces=30, paths=50)
        np.testing.assert_allclose(found.radiance + found.residual, 1.0, atol=3 * FAINTEST)


def test_color_tints_a_body_once() -> None:
    tinted = Surface(color=(0.9, 0.5, 0.1))
    medium = Medium(absorption=(0.0, 1.0, 2.0))
    found = pixel(Scene([Object(slab(-0.5, 0.5), medium, surface=tinted)], oblique(0), environment=WHITE))
    np.testing.assert_allclose(found, np.array([0.9, 0.5, 0.1]) * np.exp([0.0, -1.0, -2.0]), rtol=1e-14)


@pytest.mark.parametrize("sheet", [None, 0.01])
def test_paint_is_an_opaque_object(sheet: float | None) -> None:
    color, lights = (0.9, 0.5, 0.1), [DirectionalLight((0.2, -1.0, 0.3), (2.0, 3.0, 4.0))]
    paint = Surface(color=color, transmission=0.0)
    mesh = slab(-0.5, 0.5)
    painted = Object(mesh, Medium(), sheet_thickness=sheet, surface=paint)
    a = pixel(Scene([painted], oblique(30), lights, UP_AND_DOWN))
    opaque = Scene([Object(mesh, color=color), Object(slab(-3, -2), Medium())], oblique(30), lights, UP_AND_DOWN)
    np.testing.assert_allclose(a, pixel(opaque), rtol=1e-13)


def test_paint_lets_light_through_from_behind() -> None:
    paint = Surface(
        color=(0.9, 0.5, 0.1), transmission=0.25, diffuse_transmission=0.7, diffuse_transmission_color=(1, 0.5, 1)
    )
    wall = Object(box((-WIDE, 0, -WIDE), (WIDE, 1e-3, WIDE)), Medium(), surface=paint)
    up, down = (UP_AND_DOWN.irradiance_on([0.0, side, 0.0]) / np.pi for side in (1.0, -1.0))
    color, through = np.array([0.9, 0.5, 0.1]), np.array([1.0, 0.5, 1.0])
    # The same at the lower face, seen through the upper one.
    painted = within = 0.3 * color * up + 0.7 * through * down
    expected = 0.75 * painted + 0.25 * color * (0.75 * within + 0.25 * UP_AND_DOWN.lighting([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(pixel(Scene([wall], oblique(0), environment=UP_AND_DOWN)), expected, rtol=1e-12)
