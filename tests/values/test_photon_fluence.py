"""Photons in media: the closed form of a ball's light, its focus, conservation of energy, what is counted once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.ball_light import ball_parts, fresnel
from translucent.arrays import Array
from translucent.diffusion import cache
from translucent.diffusion.entering import Pose, rays_of_photons
from translucent.diffusion.grid import body_grid
from translucent.diffusion.photons import FineCells, photon_segments, photons_in_media
from translucent.geometry.solids import Box, Sphere
from translucent.planning import caustics
from translucent.planning.plan import plan

SEGMENTS = 64
BALL = Sphere().tessellate(SEGMENTS)
GLASS = tl.Object(BALL, tl.Medium(ior=1.5))
SUN = tl.DirectionalLight((0, -1, 0), 1.0)
CAMERA = tl.Camera.look_at((0, 0, 12), (0, 0, 0))
#: Below a ball of radius 1: hardly any of its light is scattered.
HAZE = tl.Object(Box((-2, -3, -2), (2, -1, 2)).tessellate(), tl.Medium(scattering=1e-9))
STEP = 0.1
CELLS = FineCells(np.array([-2.0, -3.0, -2.0]), STEP, (40, 20, 40), 1)
PHOTONS = 1 << 13


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caustics, "LEAST_IN_MEDIA", PHOTONS)


def scene(*objects: tl.Object, light: Any = SUN, **options: Any) -> tl.Scene:
    return tl.Scene(objects or (GLASS, HAZE), CAMERA, [light], tl.Environment.constant(0.0), **options)


def fluence(one: tl.Scene, cells: FineCells = CELLS, body: int = 1) -> Array:
    return photons_in_media(one, tl.Caustics(1), {body: cells}, ()).fluence[body][..., 0]


@pytest.mark.parametrize(("light", "lamp"), [(SUN, None), (tl.PointLight((0, 5, 0), 1.0), 5.0)])
def test_haze_below_a_ball_has_the_light_of_its_rays(light: Any, lamp: float | None) -> None:
    """Power times length in slices: in all, and within circles around the focus; of a ray as much as it is slanted."""
    found = fluence(scene(light=light))
    x = -2.0 + STEP * (np.arange(40) + 0.5)
    from_axis = np.hypot(*np.meshgrid(x, x))
    for row in (19, 15, 9, 2):
        deep = -(-3.0 + STEP * (row + 0.5))
        flux, distance, cosine = ball_parts(deep, 1.5, lamp=lamp, rays=20_000)
        for radius, off in ((0.45, 0.03), (0.95, 0.03), (2.0, 0.03)):
            # Cells are as wide as this, which the few rings of a circle's edge average over.
            edges = radius + np.linspace(-0.5, 0.5, 9) * STEP
            expected = np.mean([(flux / cosine)[distance <= edge].sum() for edge in edges])
            own = found[:, row] * STEP**2
            inside = np.clip((radius - from_axis) / STEP + 0.5, 0.0, 1.0)
            assert (own * inside).sum() == pytest.approx(expected, abs=off * (flux.sum()))


def test_a_body_has_what_its_interface_lets_in() -> None:
    """Light in a ball, by Fresnel, as flux at its samples: around the focus, and in all."""
    milk = tl.Object(Box((-2, -3, -2), (2, -1.5, 2)).tessellate(), tl.Medium(scattering=9.0, ior=1.33))
    photons = photons_in_media(scene(GLASS, milk), tl.Caustics(1), {}, (1,)).entering[1]
    flux, distance, cosine = ball_parts(1.5, 1.5, rays=20_000)
    entering = flux * (1.0 - fresnel(np.clip(cosine, 0.0, 1.0), 1.33))
    landed = np.hypot(photons.points[:, 0], photons.points[:, 2])
    assert np.abs(photons.points[:, 1] + 1.5).max() < 1e-9
    for radius in (0.1, 0.5, 1.9):
        expected = entering[distance <= radius].sum()
        assert photons.power[landed <= radius, 0].sum() == pytest.approx(expected, abs=0.03 * flux.sum())
    grid = body_grid(milk, 0.25)
    rays = rays_of_photons(photons, grid, Pose.of(np.eye(4))[0])
    at_samples = np.stack([np.bincount(rays.samples, part, len(grid.points)) for part in rays.entering.T], axis=1)
    # The refracted light of the focus goes downwards, in a cone.
    assert (rays.directions[:, 1] < 0.0).all()
    assert (at_samples * grid.areas[:, None]).sum() == pytest.approx(photons.power.sum())
    beside = np.hypot(grid.points[:, 0], grid.points[:, 2]) > 0.3
    assert at_samples[~beside & (grid.points[:, 1] > -1.6)].min() > 2.0 * at_samples[beside].mean()


def test_a_ball_gathers_light_at_its_focus() -> None:
    """n R / (2 (n - 1)) from its center, for rays near the axis: of a lamp far away, with a narrow cone."""
    cone = float(np.degrees(np.arctan2(0.1, 400.0)))
    lamp = tl.SpotLight((0, 400, 0), (0, -1, 0), 1.0, inner_cone=0.99 * cone, outer_cone=cone)
    column = FineCells(np.array([-0.01, -3.0, -0.01]), 0.02, (1, 100, 1), 1)
    for ior in (1.4, 1.5, 1.6):
        one = scene(replace(GLASS, medium=tl.Medium(ior=ior)), HAZE, light=lamp)
        found = fluence(one, column)[0, :, 0]
        deep = 3.0 - 0.02 * (np.arange(100) + 0.5)
        bright = found > 0.5 * found.max()
        assert (deep * found)[bright].sum() / found[bright].sum() == pytest.approx(ior / (2.0 * (ior - 1.0)), abs=0.03)


def test_no_light_is_lost() -> None:
    """All that a lamp in a frosted ball in deep fog shines is taken away from the photons there."""
    fog = tl.Object(Box((-4, -4, -4), (4, 4, 4)).tessellate(), tl.Medium(scattering=3.0, absorption=1.0))
    ball = tl.Object(BALL, tl.Medium(ior=1.5), priority=1, surface=tl.Surface(roughness=0.3))
    one = scene(ball, fog, light=tl.PointLight((0.5, 0.2, 0), 1.0), overlap="priority")
    cells = FineCells(np.full(3, -4.0), 0.2, (40, 40, 40), 1)
    taken = 4.0 * fluence(one, cells).sum() * 0.2**3
    assert taken / (4.0 * np.pi) == pytest.approx(1.0, abs=5e-3)


def covered_by_cube(points: Array) -> Array:
    """Fraction (n,) of all directions that a cube from -1 to 1 covers as seen from points (n, 3) outside."""
    found = np.zeros(len(points))
    for axis, side in ((axis, side) for axis in range(3) for side in (-1.0, 1.0)):
        high = np.maximum(side * points[:, axis] - 1.0, 0.0)
        for i, j in ((i, j) for i in (-1.0, 1.0) for j in (-1.0, 1.0)):
            u, v = i - points[:, axis - 1], j - points[:, axis - 2]
            angle = np.arctan2(u * v, high * np.sqrt(u * u + v * v + high * high))
            found += np.where(high > 0.0, i * j * angle, 0.0) / (4.0 * np.pi)
    return found


@pytest.mark.parametrize("radius", [0.2, 1.5])
def test_a_sphere_of_light_shines_its_power_onto_a_cube(radius: float) -> None:
    """Fraction of all directions that the cube covers, as seen from each point of the sphere.

    The sphere looks like an even disc from everywhere: its light has a density of 1 / sqrt(1 - r^2) over its radius r.
    """
    cube = tl.Object(Box().tessellate(), tl.Medium(ior=1.5), transform=np.diag([2.0, 2.0, 2.0, 1.0]))
    lamps = tl.SphereLight((0, 3, 0), 1.0, radius).points(4)
    parts = photon_segments(tl.Scene([cube], CAMERA, lamps), 16 * PHOTONS, 1)
    arriving = np.concatenate([part.power[~part.bent, 0] for part in parts])
    angle, number = np.meshgrid((np.arange(40) + 0.5) / 40 * np.pi / 2, np.arange(400))
    up, turn = (number + 0.5) / 200 - 1.0, np.pi * (1.0 + np.sqrt(5.0)) * number
    across = np.sqrt(1.0 - up**2)
    directions = np.stack([across * np.cos(turn), up, across * np.sin(turn)], axis=-1)
    points = np.array([0.0, 3.0, 0.0]) + radius * np.sin(angle)[..., None] * directions
    fractions = covered_by_cube(points.reshape(-1, 3))
    expected = 4.0 * np.pi * np.average(fractions, weights=np.sin(angle).ravel() ** 2)
    noise = float(np.sqrt(np.square(arriving).sum()))
    assert noise < 0.01 * expected
    assert abs(arriving.sum() - expected) < 3.0 * noise


def test_media_that_overlap_take_their_shares() -> None:
    """Two fogs that add up each see the light that both have left; one that displaces the other sees it alone."""
    first = tl.Object(Box((-1, -3, -1), (1, -1, 1)).tessellate(), tl.Medium(scattering=0.5))
    other = tl.Object(Box((-1, -2, -1), (1, -1, 1)).tessellate(), tl.Medium(absorption=0.25), priority=1)
    prism = tl.Object(Box((-1, 0, -1), (1, 1, 1)).tessellate(), tl.Medium(ior=1.5), priority=2)
    cells = FineCells(np.array([-1.0, -3.0, -1.0]), 0.25, (8, 8, 8), 1)
    # Straight down through a plate: what is mirrored between its faces, too, comes down as photons.
    passes = 0.96 / 1.04
    for overlap, left in (("add", 0.75), ("priority", 0.25)):
        found = fluence(scene(prism, first, other, overlap=overlap), cells).mean(axis=(0, 2))
        way = 0.25 * (np.arange(8) + 0.5)[::-1]
        expected = passes * np.exp(-left * np.minimum(way, 1.0) - 0.5 * np.maximum(way - 1.0, 0.0))
        # Beyond a surface light is followed by a cell or two, for what is interpolated there.
        own = slice(0, 4) if overlap == "priority" else slice(None)
        np.testing.assert_allclose(found[own], expected[own], rtol=0.015)
        assert (found[6:] == 0.0).all() == (overlap == "priority")


def test_what_goes_straight_is_no_light_of_photons() -> None:
    """Through a sheet that mirrors upwards, through tinted bodies with the index of air, and beside all bodies."""
    pane = tl.Mesh([(-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)], [(0, 2, 1), (0, 3, 2)])
    haze_above = tl.Object(Box((-2, 1, -2), (2, 3, 2)).tessellate(), HAZE.medium)
    sheet = tl.Object(pane, tl.Medium(ior=1.5), sheet_thickness=0.01)
    matched = tl.Object(BALL, tl.Medium(absorption=0.3), surface=tl.Surface(color=(0.5, 0.5, 0.5)))
    assert fluence(scene(sheet, HAZE)).max() == 0.0
    above = fluence(scene(sheet, haze_above), replace(CELLS, low=np.array([-2.0, 1.0, -2.0])))
    assert above.mean() == pytest.approx(0.08 / 1.04, rel=0.1)  # by chance; both of its faces mirror
    assert fluence(scene(matched, HAZE)).max() == 0.0


def test_photons_are_followed_again_where_something_moves_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caustics, "LEAST_IN_MEDIA", 256)
    followed = []
    original = cache.photons_in_media
    monkeypatch.setattr(cache, "photons_in_media", lambda *given: followed.append(given) or original(*given))
    fields, asked, coarse = cache.FieldCache(), tl.Caustics(1), tl.Diffusion(8)
    fog = replace(HAZE, medium=tl.Medium(scattering=0.5))
    one, moved = scene(GLASS, fog), np.diag([0.9, 0.9, 0.9, 1.0])
    aside = tl.Camera.look_at((1, 0, 12), (0, 0, 0))
    for changed, photons, times in (
        (one, None, 0),
        (one, asked, 1),
        (replace(one, camera=aside), asked, 0),
        (one, tl.Caustics(2), 0),  # as many in media
        (one, tl.Caustics(1, seed=1), 1),
        (scene(replace(GLASS, transform=moved), fog), asked, 1),
        (scene(replace(GLASS, medium=tl.Medium(ior=1.4)), fog), asked, 1),
        (scene(replace(GLASS, surface=tl.Surface(roughness=0.1)), fog), asked, 1),
        (scene(GLASS, fog, light=tl.DirectionalLight((0, -1, 0.1), 1.0)), asked, 1),
        (scene(replace(GLASS, medium=tl.Medium(1.0)), fog), asked, 0),  # which bends nothing
    ):
        followed.clear()
        fields.of(replace(plan(changed), diffusion=coarse, caustics=photons))
        assert len(followed) == times
