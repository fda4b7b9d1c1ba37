"""Shadows of the environment on a ground, from a map of it: known solid angles, and the same as point by point."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.passes import shadow_maps

Array = npt.NDArray[np.float64]

EVEN = tl.Environment.constant((1.0, 1.0, 1.0))
CORNERS = 200.0 * np.array([(-1.0, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)])
MATTE = tl.Surface(color=(1.0, 1.0, 1.0), ior=1.0, roughness=1.0, double_sided=False)
GROUND = tl.Object(tl.Mesh(CORNERS, [(0, 2, 1), (0, 3, 2)], name="ground"), surface=MATTE, shadow_catcher=True)
#: Looks straight down onto 6 m of the ground.
ABOVE = tl.Camera.orthographic((0, 9, 0), (0, 0, 0), up=(0, 0, -1), height=6.0)
SIZE = (80, 80)


def light_left(renderer: tl.Renderer, mesh: tl.Mesh, *, directions: int = 256, **options: Any) -> tuple[Array, Array]:
    """(h, w): fraction of the light that is left beside an opaque body, and points of the ground (h, w, 3)."""
    black = tl.Medium(absorption=(1e4, 1e4, 1e4))
    scene = tl.Scene([tl.Object(mesh, black), GROUND], ABOVE, [], EVEN, environment_shadows=directions)
    frame = renderer.render(scene, SIZE, **{"shadows": tl.ShadowMaps(256)} | options)
    origins, _ = ABOVE.rays(SIZE)
    points = np.broadcast_to(origins * (1.0, 0.0, 1.0), (*SIZE, 3))
    return np.where(frame.coverage, np.nan, frame.radiance.mean(axis=-1)), points


def errors_of(found: Array, truth: Array) -> tuple[float, float]:
    error = np.abs(found - truth)[np.isfinite(found) & np.isfinite(truth)]
    return float(np.sqrt((error**2).mean())), float(error.max())


def test_a_ball_takes_its_solid_angle(renderer: tl.Renderer) -> None:
    """A sphere above the horizon takes sin(a)^2 cos(b) of the irradiance: angular radius a, b from the zenith."""
    center, radius = np.array([0.0, 1.2, 0.0]), 1.0
    found, points = light_left(renderer, Sphere(center=tuple(center), radius=radius).tessellate(48))
    towards = center - points
    distance = np.linalg.norm(towards, axis=-1)
    truth = 1.0 - (radius / distance) ** 2 * towards[..., 1] / distance
    rms, worst = errors_of(found, truth)
    # 128 directions above the ground, each with the light of a cell 14 degrees wide.
    assert rms < 0.009
    assert worst < 0.035
    assert truth[np.isfinite(found)].min() < 0.75


def test_a_wall_takes_what_lambert_says(renderer: tl.Renderer) -> None:
    """A long wall takes (1 - cos(e)) / 2 of the irradiance, up to the elevation e of its upper edge."""
    found, points = light_left(
        renderer, Box((-40, 0.001, -1.0), (40, 2.0, -0.9)).tessellate(), shadows=tl.ShadowMaps(1024)
    )
    beside = points[..., 2] + 0.9
    truth = np.where(beside > 0.05, 0.5 + 0.5 * beside / np.hypot(beside, 2.0), np.nan)
    rms, worst = errors_of(found, truth)
    assert rms < 0.02
    assert worst < 0.06


def test_the_map_is_that_of_the_points(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Below the bounds of the body, where no direction is blurred, it differs by what its texels make of edges."""
    ball = Sphere(center=(0.0, 1.001, 0.0), radius=1.0).tessellate(32)
    # So small a picture needs few texels.
    monkeypatch.setattr("translucent.gpu.passes.shadow_maps.PIXELS_OF_TEXEL", 0.5)
    found, points = light_left(renderer, ball, directions=32, shadows=tl.ShadowMaps(512))
    monkeypatch.setattr("translucent.gpu.passes.shadow_maps._mapped_ground", lambda job: None)
    expected, _ = light_left(renderer, ball, directions=32, shadows=tl.ShadowMaps(512))
    error = np.abs(found - expected)[np.isfinite(found) & (np.abs(points).max(axis=-1) < 1.0)]
    assert np.median(error) < 1e-3
    assert error.max() < 4.0 / 32.0  # one direction with its cell, in the zenith


def test_a_post_throws_one_soft_shadow_and_no_copies(renderer: tl.Renderer) -> None:
    """Around a post in even light shadows are alike in all directions: none for each direction of light."""
    post = Box((-0.1, 0.001, -0.1), (0.1, 3.0, 0.1)).tessellate()
    found, points = light_left(renderer, post, directions=128)
    away = np.hypot(points[..., 0], points[..., 2])
    ring = 1.0 - found[(away > 1.2) & (away < 1.3)]
    # As wide as the mean chord of its base, up to the elevation of its upper end; the sine and cosine of Lambert's law.
    width, elevation = 0.2 * 4.0 / np.pi / 1.25, np.arctan(3.0 / 1.25)
    np.testing.assert_allclose(ring.mean(), width / np.pi * 0.5 * np.sin(elevation) ** 2, rtol=0.1)
    # Looked up in each direction alone, it varies by 0.58 of its mean.
    assert ring.std() < 0.35 * ring.mean()


def test_what_is_far_away_is_lit_and_long_shadows_end_softly(renderer: tl.Renderer) -> None:
    ball = Sphere(center=(0.0, 1.2, 0.0), radius=1.0).tessellate(32)
    black = tl.Medium(absorption=(1e4, 1e4, 1e4))
    wide = tl.Camera.orthographic((0, 90, 0), (0, 0, 0), up=(0, 0, -1), height=120.0)
    scene = tl.Scene([tl.Object(ball, black), GROUND], wide, [], EVEN, environment_shadows=64)
    frame = renderer.render(scene, (60, 60))
    edge = np.concatenate([frame.radiance[0], frame.radiance[-1], frame.radiance[:, 0], frame.radiance[:, -1]])
    np.testing.assert_allclose(edge, 1.0, atol=2e-3)


def test_a_view_that_moves_and_rests_in_turns_makes_no_map_anew(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a window's view moves, few directions stand for all: their map of the ground is kept beside that of all."""
    made, footprints = [], shadow_maps._footprints
    monkeypatch.setattr(shadow_maps, "_footprints", lambda *given: made.append(len(given[0])) or footprints(*given))
    ball = Sphere(center=(0.0, 1.2, 0.0), radius=1.0).tessellate(16)
    for directions in (None, 8, None, 8):
        light_left(renderer, ball, directions=32, shadows=tl.ShadowMaps(256, directions=directions))
    all_above, few_above = made
    assert 0 < few_above < all_above


def test_media_and_light_change_the_map_and_nothing_is_kept_of_others(renderer: tl.Renderer) -> None:
    """Pictures of a renderer that has drawn others are those of a new one, to the bit."""
    ball = Sphere(center=(0.0, 1.2, 0.0), radius=1.0).tessellate(32)
    sky = tl.Environment.gradient((0.2, 0.2, 0.2), (1.0, 0.8, 0.5))
    first = tl.Scene([tl.Object(ball, tl.Medium((1, 2, 3))), GROUND], ABOVE, [], EVEN, environment_shadows=32)
    shown = [
        first,
        replace(first, objects=[tl.Object(ball, tl.Medium((3, 1, 0.5))), GROUND]),
        replace(first, environment=sky),
        replace(first, objects=[tl.Object(ball, tl.Medium((1, 2, 3)), transform=_moved(0.5)), GROUND]),
    ]
    pictures = [renderer.render(scene, (48, 48)).radiance for scene in (*shown, first)]
    np.testing.assert_array_equal(pictures[-1], pictures[0])
    for scene, picture in zip(shown, pictures, strict=False):
        with tl.Renderer() as fresh:
            np.testing.assert_array_equal(fresh.render(scene, (48, 48)).radiance, picture)
    assert all(np.abs(pictures[0] - other).max() > 0.02 for other in pictures[1:4])


def _moved(by: float) -> Array:
    matrix = np.eye(4)
    matrix[0, 3] = by
    return matrix


@pytest.mark.parametrize("changed", ["seen from below", "thin"])
def test_other_grounds_look_up_each_direction(renderer: tl.Renderer, changed: str) -> None:
    ball = tl.Object(Sphere(center=(0.0, 1.2, 0.0), radius=1.0).tessellate(16), tl.Medium((1, 2, 3)))
    below = tl.Camera.orthographic((0, -9, 0), (0, 0, 0), up=(0, 0, -1), height=6.0)
    ground = replace(GROUND, surface=replace(MATTE, diffuse_transmission=0.5)) if changed == "thin" else GROUND
    camera = below if changed == "seen from below" else ABOVE
    renderer.render(tl.Scene([ball, ground], camera, [], EVEN, environment_shadows=8), (16, 16))
    assert renderer.gpu.shadows.ground is None
