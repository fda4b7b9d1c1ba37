"""Aims of photons: at each body once, and by power."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.planning.caustics import photon_aims

CLEAR = tl.Medium(1.0, ior=1.5)
SUN, LAMP = tl.DirectionalLight((0, -1, 0), (1.0, 2.0, 3.0)), tl.PointLight((0.5, 6, 0.5), 2.0)


def body(x: float = 0.0, medium: tl.Medium | None = CLEAR) -> tl.Object:
    return tl.Object(Box((x, 0, 0), (x + 1, 1, 1)).tessellate(), medium)


def scene(*objects: tl.Object, lights: Any) -> tl.Scene:
    return tl.Scene([*objects, body(9.0, None)], tl.Camera.look_at((0.5, 0.5, 9), (0.5, 0.5, 0)), lights)


@pytest.mark.parametrize("light", [SUN, LAMP])
def test_photons_aim_at_each_body_once(light: Any) -> None:
    """Rectangles around bodies as the light sees them: those that overlap are joined, and photons go by power."""
    center = np.array((0.5, 0.5, 0.5))
    one = scene(body(), body(0.5), body(5.0), lights=(light,))
    aims = sorted(photon_aims(one, center, 1000), key=lambda aim: float(aim.middle[0]))
    assert len(aims) == 2
    widths = [max(np.abs(aim.right[0]), np.abs(aim.up[0])) * 2 for aim in aims]
    assert sum(aim.photons for aim in aims) == pytest.approx(1000, abs=1)
    if light is SUN:
        np.testing.assert_allclose(widths, (1.5, 1.0), rtol=2e-3)
        assert [aim.photons for aim in aims] == [600, 400]
        np.testing.assert_allclose(aims[0].flux, (1.5, 3.0, 4.5), rtol=4e-3)


def test_a_lamp_among_bodies_shines_all_around() -> None:
    ball = tl.Object(Sphere().tessellate(16), CLEAR)
    for position, inside in (((0.0, 0.3, 0.0), (0,)), ((2.0, 0.0, 0.0), ())):
        lamps = (tl.PointLight(position, 2.0),)
        one = scene(ball, body(5.0), lights=lamps)
        (aim,) = photon_aims(one, np.zeros(3), 100)
        assert not aim.right.any()
        assert aim.inside == inside
        assert aim.flux[0] == pytest.approx(8.0 * np.pi)
    assert photon_aims(scene(body(), lights=(tl.PointLight((9, 9, 9), 0.0),)), np.zeros(3), 100) == []
