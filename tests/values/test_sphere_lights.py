"""Sphere lights as values: the points that they are drawn by, and what is refused."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.scene.lights import SPREADS, with_points
from translucent.scene.stages import moved


@pytest.mark.parametrize("spread", SPREADS, ids=len)
def test_points_look_like_an_even_disc(spread: Any) -> None:
    """Moments of a disc of radius 1 along each direction: 0, 1 / 4 and 0. The third of a tetrahedron is not 0."""
    ways = np.random.default_rng(3).normal(size=(64, 3))
    across = spread @ (ways / np.linalg.norm(ways, axis=1, keepdims=True)).T
    assert np.linalg.norm(spread, axis=1).max() <= 1.0 + 1e-12
    np.testing.assert_allclose(across.mean(axis=0), 0.0, atol=1e-14)
    if len(spread) > 1:
        np.testing.assert_allclose((across**2).mean(axis=0), 0.25, rtol=1e-12)
    if len(spread) > 4:
        np.testing.assert_allclose((across**3).mean(axis=0), 0.0, atol=1e-14)


def test_points_have_the_light_of_the_sphere() -> None:
    sphere = tl.SphereLight.from_radiance((1, 2, 3), (4.0, 2.0, 1.0), 0.5)
    np.testing.assert_allclose(sphere.intensity, np.pi * 0.25 * np.array([4.0, 2.0, 1.0]), rtol=1e-15)
    for count, made in ((100, 16), (16, 16), (15, 8), (7, 4), (3, 1), (1, 1)):
        points = sphere.points(count)
        assert len(points) == made
        np.testing.assert_allclose(sum(np.asarray(one.intensity) for one in points), sphere.intensity, rtol=1e-14)
        for one in points:
            np.testing.assert_allclose(one.position + np.array(one.disc[:3]), (1, 2, 3), rtol=1e-14)
            assert one.disc[3] == 0.5
            # With the discs of the points, the sphere's is neither wider nor narrower.
            spread = np.mean([((other.position - np.array((1, 2, 3))) ** 2).sum() for other in points])
            assert spread / 3.0 + one.part_radius**2 / 4.0 == pytest.approx(0.5**2 / 4.0)


def test_as_many_points_as_lights_are_held() -> None:
    sphere, lamp = tl.SphereLight((0, 0, 1), 1.0, 0.5), tl.PointLight((0, 0, 2), 1.0)
    for lights, most, found in (
        ([sphere, lamp], 32, 17),
        ([sphere] * 2, 32, 32),
        ([sphere] * 2 + [lamp], 32, 17),
        ([sphere, lamp], 8, 5),
        ([sphere] * 9, 8, 9),
        ([lamp], 8, 1),
    ):
        assert len(with_points(lights, most)) == found


def test_a_sphere_moves_with_its_scene() -> None:
    turn = np.array([[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
    found = moved(tl.SphereLight((1, 0, 0), 2.0, 0.5), turn)
    assert isinstance(found, tl.SphereLight)
    np.testing.assert_allclose(found.position, (1, 3, 3))
    assert found.radius == 0.5


@pytest.mark.parametrize(
    ("radius", "message"),
    [
        (0.0, "light with radius 0.0; the radius must be above 0 and at most"),
        (-1.0, "light with radius -1.0; the radius must be above 0 and at most"),
        (np.nan, "light with radius nan; the radius must be above 0 and at most"),
        (1e30, "light with radius 1e+30; the radius must be above 0 and at most"),
        ("wide", "light with radius 'wide'; the radius must be above 0 and at most"),
        (True, "light with radius True; the radius must be above 0 and at most"),
    ],
)
def test_radii_that_are_none(radius: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.SphereLight((0, 0, 0), 1.0, radius)
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.SphereLight.from_radiance((0, 0, 0), 1.0, radius)
