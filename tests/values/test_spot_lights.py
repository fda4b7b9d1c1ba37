"""Spot lights: their cones, where they are looked from, and the light that they bring into media."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.diffusion.field import DiffusingBody
from translucent.diffusion.keys import diffusion_key
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.volume import _mean_attenuation
from translucent.formulas.light import ALL_AROUND, cone_attenuation, light_cone
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.light_cameras import light_cameras

CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))
BLACK = tl.Environment.constant((0, 0, 0))
BALL = Sphere().tessellate(16)
WAX = tl.Medium(absorption=0.5, scattering=20.0, ior=1.4)
DOWN = (0.0, 0.0, -3.0)


def around(degrees: float, turn: float = 0.7) -> np.ndarray[Any, Any]:
    """Unit vector at an angle from straight down."""
    angle = math.radians(degrees)
    return np.array([math.sin(angle) * math.cos(turn), math.sin(angle) * math.sin(turn), -math.cos(angle)])


def scene(*lights: Any, medium: tl.Medium = WAX, mesh: tl.Mesh = BALL) -> tl.Scene:
    return tl.Scene([tl.Object(mesh, medium)], CAMERA, lights, BLACK)


# Cones


@pytest.mark.parametrize(("inner", "outer"), [(0, 45), (20, 30), (10, 90), (0, 1), (44.999, 45)])
def test_the_fall_off_is_that_of_gltf(inner: float, outer: float) -> None:
    """KHR_lights_punctual: lightAngleScale = 1 / (cos inner - cos outer), lightAngleOffset = -cos outer * scale."""
    spot = tl.SpotLight((1, 2, 3), DOWN, (2, 4, 8), inner, outer)
    scale = 1 / (math.cos(math.radians(inner)) - math.cos(math.radians(outer)))
    offset = -math.cos(math.radians(outer)) * scale
    for degrees in (0.0, 0.5 * inner, 0.3 * inner + 0.7 * outer, 0.7 * inner + 0.3 * outer, 0.999 * outer):
        way = around(degrees)
        share = min(max(-way[2] * scale + offset, 0.0), 1.0) ** 2
        found = spot.irradiance_on(np.add((1, 2, 3), 5 * way), -way)
        # The scale of narrow differences multiplies the roundings of the cosines on the right.
        np.testing.assert_allclose(found, np.array([2, 4, 8]) * share / 25, rtol=1e-12, atol=1e-14 * scale)
    for degrees in (1.0001 * outer, 100.0, 180.0):
        way = around(degrees)
        assert (spot.irradiance_on(np.add((1, 2, 3), 5 * way), -way) == 0).all()


def test_within_the_inner_cone_it_is_a_point_light() -> None:
    spot, point = tl.SpotLight((1, 2, 3), DOWN, 7.0, 30, 40), tl.PointLight((1, 2, 3), 7.0)
    normals = np.eye(3)
    for degrees in (0.0, 29.9):
        points = np.add((1, 2, 3), 0.3 * around(degrees))
        np.testing.assert_array_equal(spot.irradiance_on(points, normals), point.irradiance_on(points, normals))
    assert (spot.irradiance_on((1, 2, 3), (0, 0, 1)) == 0).all()


def test_narrow_cones_keep_their_digits_in_float32() -> None:
    """By cosines, whose float32 steps are 6e-8, this cone would have three steps from its middle to its edge."""
    cone = light_cone((0.6, 0.0, -0.8), 0.0, math.radians(0.03)).astype(np.float32)
    across = np.array([0.8, 0.0, 0.6])
    for share in (0.0, 0.3, 0.6, 0.9):
        angle = math.radians(0.03 * share)
        travel = (math.cos(angle) * np.array([0.6, 0.0, -0.8]) + math.sin(angle) * across).astype(np.float32)
        apart = np.linalg.norm(cone[:3]) * travel - cone[:3]
        level = np.float32(cone[3] - (apart * apart).sum())
        assert level**2 == pytest.approx((1 - share**2) ** 2, abs=2e-3)


def test_a_cone_of_all_directions_changes_nothing() -> None:
    directions = np.array([around(a) for a in np.linspace(0, 180, 7)])
    assert (cone_attenuation(directions, ALL_AROUND) == 1).all()
    assert tuple(tl.PointLight((0, 0, 0), 1).cone) == ALL_AROUND
    assert tl.PointLight((0, 0, 0), 1).mean_share == 1


@pytest.mark.parametrize(("inner", "outer"), [(0, 45), (20, 30), (10, 90), (0, 0.1)])
def test_the_mean_over_all_directions_is_the_integral(inner: float, outer: float) -> None:
    """In the cosine, on either side of the kink."""
    spot = tl.SpotLight((0, 0, 0), DOWN, 1.0, inner, outer)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    total = 0.0
    for low, high in ((0.0, inner), (inner, outer)):
        ends = [1 - 2 * math.sin(0.5 * math.radians(a)) ** 2 for a in (high, low)]
        cosine = ends[0] + (ends[1] - ends[0]) * (nodes + 1) / 2
        ways = np.stack([np.sqrt(1 - np.minimum(cosine, 1) ** 2), 0 * cosine, -cosine], axis=1)
        total += 0.5 * (ends[1] - ends[0]) / 2 * (weights * spot.intensity_along(ways)[:, 0]).sum()
    assert spot.mean_share == pytest.approx(total, rel=1e-9)


def test_a_spot_holds_a_unit_direction_and_read_only_arrays() -> None:
    spot = tl.SpotLight((1, 2, 3), (0, 0, -4), 5)
    assert np.asarray(spot.direction).tolist() == [0, 0, -1]
    assert (spot.inner_cone, spot.outer_cone) == (0, 45)
    for array in (spot.position, spot.direction, spot.intensity, spot.cone):
        assert not np.asarray(array).flags.writeable
    assert isinstance(replace(spot, position=(0, 0, 0)), tl.SpotLight)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tl.SpotLight((0, 0), DOWN, 1), "light position (0, 0); the value must be three finite numbers"),
        (lambda: tl.SpotLight((0, 0, 0), (0, 0, 0), 1), "light direction; the direction has the length 0"),
        (lambda: tl.SpotLight((0, 0, 0), "down", 1), "light direction 'down'; the value must be three finite numbers"),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, -1),
            "light intensity (-1.0, -1.0, -1.0); the value must lie in 0 to 1e+18",
        ),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, 1, -1),
            "light with inner_cone -1; the angle must lie in 0 to 90; give the half angle",
        ),
        (lambda: tl.SpotLight((0, 0, 0), DOWN, 1, 0, 91), "light with outer_cone 91; the angle must lie in 0 to 90"),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, 1, 0, math.nan),
            "light with outer_cone nan; the angle must lie in 0 to 90",
        ),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, 1, "narrow"),
            "light with inner_cone 'narrow'; the angle must lie in 0 to 90",
        ),  # type: ignore[arg-type]
        (lambda: tl.SpotLight((0, 0, 0), DOWN, 1, 30, 30), "light with inner_cone 30 and outer_cone 30 degrees; the"),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, 1, 50),
            "inner_cone 50 and outer_cone 45 degrees; the inner cone must be smaller than the outer cone, and the",
        ),
        (
            lambda: tl.SpotLight((0, 0, 0), DOWN, 1, 0, 1e-4),
            "outer_cone 0.0001 degrees; the inner cone must be smaller than the outer cone, and the outer cone at",
        ),
    ],
)
def test_there_is_no_such_spot(make: Callable[[], object], message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        make()


# Views from it


def test_the_view_of_a_spot_is_no_wider_than_its_cone() -> None:
    inside = tl.SpotLight((0, 0, 0.2), DOWN, 1, 0, 30)
    (camera,) = light_cameras(inside, scene(inside))
    assert 60 < camera.fov_y < 62
    np.testing.assert_allclose(camera.forward, (0, 0, -1), atol=1e-15)
    aside = replace(inside, position=(0, 0, 9), direction=(0.1, 0, -1))
    (camera,), (whole,) = light_cameras(aside, scene()), light_cameras(tl.PointLight((0, 0, 9), 1), scene())
    np.testing.assert_array_equal(camera.pose, whole.pose)
    assert camera.fov_y == whole.fov_y < 15
    assert len(light_cameras(replace(inside, outer_cone=60), scene())) == 6


# Media


def test_a_spot_on_all_of_a_body_diffuses_as_a_point_light() -> None:
    body = scene().objects[0]
    diffusing = DiffusingBody(lit_body(body, None, tl.Diffusion(12).cell_size(body)), WAX, 0.0)
    place = (0.5, 0.2, 4.0)
    point = diffusing.field(scene(tl.PointLight(place, 3.0)), 0)
    whole = diffusing.field(scene(tl.SpotLight(place, np.negative(place), 3.0, 20, 21)), 0)
    np.testing.assert_array_equal(whole.fluence, point.fluence)
    some = diffusing.field(scene(tl.SpotLight(place, np.negative(place), 3.0, 0, 8)), 0)
    assert 0.01 < some.entering.sum() / point.entering.sum() < 0.5
    # Inside, its power is what counts.
    inside = tl.SpotLight((0.1, 0, 0), DOWN, 3.0, 20, 40)
    as_point = tl.PointLight((0.1, 0, 0), 3.0 * inside.mean_share)
    found, expected = diffusing.field(scene(inside), 0), diffusing.field(scene(as_point), 0)
    np.testing.assert_allclose(found.fluence, expected.fluence, rtol=1e-6)


@pytest.mark.parametrize("outer", [4, 20, 70])
def test_beams_thinner_than_cells_keep_their_power(outer: float) -> None:
    """The integral of share / r^2 over a block before it: 4 pi times the mean share, times the depth of the block."""
    spot, step = tl.SpotLight((0.03, 0.02, 0.0), (0.1, 0.05, -1.0), 1.0, 0, outer), 0.125
    axis = (np.arange(64) + 0.5) * step
    points = np.stack(np.meshgrid(axis - 4, axis - 4, -axis - 1, indexing="ij"), axis=-1).reshape(-1, 3)
    radius = np.linalg.norm(points - np.asarray(spot.position), axis=1)
    shell = (radius > 1.2) & (radius < 3.0)
    found = (_mean_attenuation(spot, points[shell], step) / radius[shell] ** 2).sum() * step**3
    if outer == 70:  # some of it passes above the block
        assert found < 4 * np.pi * spot.mean_share * 1.8
    else:
        assert found == pytest.approx(4 * np.pi * spot.mean_share * 1.8, rel=0.03)


def test_light_is_solved_for_anew_where_a_cone_changes() -> None:
    spot = tl.SpotLight((0, 0, 3), DOWN, 1, 10, 20)
    others = [spot, replace(spot, inner_cone=11), replace(spot, outer_cone=21), replace(spot, direction=(0, 0.1, -1))]
    keys = {diffusion_key(tl.plan(scene(light))) for light in (*others, tl.PointLight((0, 0, 3), 1))}
    assert len(keys) == 5
    assert diffusion_key(tl.plan(scene(replace(spot)))) in keys


def test_fog_is_marched_by_equal_angles_from_spots() -> None:
    fog = tl.Medium(scattering=2.0)
    box = Box().tessellate()
    for light, quadrature in (
        (tl.PointLight((0, 0, 3), 1), "gauss"),
        (tl.SpotLight((0, 0, 3), DOWN, 1), "equiangular"),
    ):
        method = tl.plan(scene(light, medium=fog, mesh=box)).method
        assert isinstance(method, tl.RayMarched)
        assert method.quadrature == quadrature
