"""Caustics without OpenGL: the light of a ball on the ground, by its rays."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.ball_light import ball_parts
from translucent.cpu.renderer import CausticLight
from translucent.geometry.ray_caster import RayCaster
from translucent.geometry.solids import Box, Sphere

DEEP = 2.5
BALL = tl.Object(Sphere().tessellate(64), tl.Medium(ior=1.5))
GROUND = tl.Object(Box((-9.0, -3.5, -9.0), (9.0, -DEEP, 9.0)).tessellate(), color=(0.5, 0.5, 0.5))
SUN = tl.DirectionalLight((0, -1, 0), 1.0)
SCENE = tl.Scene([BALL, GROUND], tl.Camera.look_at((0, 4, 9), (0, -1, 0)), [SUN], tl.Environment.constant(0.0))


def test_photons_light_the_ground_as_the_rays_of_the_ball_do() -> None:
    """In circles around the axis, beyond the focus; straight light ends at the ball."""
    meshes = {item.mesh: RayCaster(item.mesh) for item in SCENE.objects}
    light = CausticLight(SCENE, (None, None), meshes, tl.Caustics(10_000), frozenset({0}))
    step = 0.06
    x = step * (np.arange(-50, 50) + 0.5)
    points = np.stack(np.broadcast_arrays(x[:, None], -DEEP, x), axis=-1).reshape(-1, 3)
    up = np.tile((0.0, 1.0, 0.0), (len(points), 1))
    found = light.on_opaque(points - SCENE.camera.eye, up)[:, 0]
    from_axis = np.hypot(points[:, 0], points[:, 2])
    flux, distance, _ = ball_parts(DEEP, 1.5, rays=20_000)
    for radius in (0.4, 0.7, 0.95):
        below = step**2 * found[from_axis <= radius].sum()
        assert below == pytest.approx(flux[distance <= radius].sum(), abs=0.04 * np.pi)
    beside = found[(from_axis > 1.2) & (from_axis < 1.3)]
    assert beside.min() >= 1.0, "the sun beside its shadow"
    assert light.on_opaque(points - SCENE.camera.eye, -up).max() == 0.0
    few = CausticLight(SCENE, (None, None), meshes, tl.Caustics(200), frozenset({0}))
    sums = (step**2 * each.sum() for each in (few.on_opaque(points - SCENE.camera.eye, up)[:, 0], found))
    assert next(sums) == pytest.approx(next(sums), abs=0.1 * np.pi), "few photons have no more light than many"
    assert CausticLight(SCENE, (None, None), meshes, tl.Caustics(1), frozenset()).on_opaque(
        np.array([(0.0, -DEEP, 0.0)]) - SCENE.camera.eye, up[:1]
    ) == pytest.approx(1.0, abs=0.2), "of a body that photons do not replace"


def test_pictures_show_them() -> None:
    renderer = tl.Renderer(backend="cpu")
    with_photons, without = (
        renderer.render(SCENE, (24, 18), caustics=caustics).radiance for caustics in (tl.Caustics(3_000), None)
    )
    assert (with_photons < 0.8 * without).any(), "the shadow around the light that the ball gathers"
    assert with_photons.mean() == pytest.approx(without.mean(), rel=0.05), "of clear glass it loses what it mirrors"
