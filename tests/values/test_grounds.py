"""Grounds: flat objects, and planes of others, which bodies stand on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import translucent as tl
from translucent.arrays import Array
from translucent.diffusion.cache import FieldCache
from translucent.geometry.solids import Box, Sphere
from translucent.planning.bodies import held_objects, may_hold
from translucent.planning.plan import plan
from translucent.planning.rendered import Treatment
from translucent.planning.scattering import Diffusion
from translucent.scene.grounds import WIDE, ground_below

CAMERA = tl.Camera.look_at((0, 1, 5), (0, 0, 0))
DARK = tl.Environment.constant((0, 0, 0))
SUN = tl.DirectionalLight((0.3, -1, 0.2), 2.0)
MILK = tl.Medium(absorption=0.1, scattering=3.0)
BALL = tl.Object(Sphere(radius=0.5, center=(0, 0.51, 0)).tessellate(24), MILK)


def flat(half: float) -> tl.Object:
    """Square through the origin, of the same corners and triangles as the top of `slab`."""
    full = slab(half).mesh
    faces = full.faces[(full.vertices[full.faces][:, :, 1] == 0.0).all(axis=1)]
    return tl.Object(tl.Mesh(full.vertices, faces), color=(0.5, 0.6, 0.7))


def slab(half: float, segments: int = 1, transform: Array | None = None) -> tl.Object:
    """Box below the origin, whose top reaches so far to all sides."""
    box = Box((-half, -0.3 * half, -half), (half, 0, half)).tessellate(segments)
    return tl.Object(box, transform=transform, color=(0.5, 0.6, 0.7))


def rotation() -> Array:
    """Some transform (4, 4): rotated, scaled and moved."""
    turn, matrix = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0], np.eye(4)
    matrix[:3, :3] = 0.03 * turn * np.linalg.det(turn)
    matrix[:3, 3] = 0.4, -2.0, 1.0
    return matrix


def scene(*objects: tl.Object) -> tl.Scene:
    """Objects in sunlight."""
    return tl.Scene(objects, CAMERA, [SUN], tl.Environment.constant((0.3, 0.4, 0.5)))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("segments", [1, 7])
def test_the_top_of_a_slab_is_a_ground(segments: int, mirrored: bool) -> None:
    """However it and what stands on it are turned, and however many triangles it has."""
    place = rotation()
    if mirrored:
        place[:3, 0] *= -1.0
    ball = tl.Object(BALL.mesh, MILK, place)
    found = ground_below(scene(ball, slab(3.0, segments=segments, transform=place)), [0])
    assert found is not None
    np.testing.assert_allclose(found.normal, place[:3, 1] / 0.03, atol=1e-9)
    assert found.height == pytest.approx(found.normal @ place[:3, 3], abs=1e-9)
    assert not found.has_walls


def test_which_planes_are_grounds() -> None:
    """The nearest plane in front of which all bodies stand, and which fills enough of the view of one of them."""
    table, floor, beside = slab(1.0), flat(9.0), tl.Object(Box((0.9, 0, -0.1), (1.1, 0.5, 0.1)).tessellate())
    below = tl.Object(Box((-9, -2, -9), (9, -1, 9)).tessellate())
    ceiling = tl.Object(Box((-9, 2, -9), (9, 3, 9)).tessellate())
    for objects, height, owner in (
        ((table,), 0.0, table),
        ((below, table), 0.0, table),
        ((below,), -1.0, below),
        ((beside, below), -1.0, below),
        ((floor, beside), 0.0, floor),
        ((ceiling,), -2.0, ceiling),
    ):
        found = ground_below(scene(BALL, *objects), [0])
        assert found is not None
        assert found.ground is owner
        assert found.height == pytest.approx(height)
    assert ground_below(scene(BALL, beside), [0]) is None
    assert ground_below(scene(BALL, tl.Object(Sphere(radius=9.0, center=(0, -9, 0)).tessellate(64))), [0]) is None
    # Before none of its planes are both of two bodies at opposite sides.
    other = tl.Object(Sphere(radius=0.5, center=(0, -0.81, 0)).tessellate(24), MILK)
    assert ground_below(scene(BALL, other, table), [0, 1]) is None


def test_bodies_may_be_sunk_in_grounds() -> None:
    """Up to their middles, but not in flat objects: light would diffuse through these."""
    for depth, found in ((0.01 - 1e-6, True), (0.4, True), (0.6, False)):
        down = np.eye(4)
        down[1, 3] = -depth
        sunk = tl.Object(BALL.mesh, MILK, down)
        assert (ground_below(scene(sunk, slab(3.0)), [0]) is not None) == found
        assert (ground_below(scene(sunk, flat(3.0)), [0]) is not None) == (depth < 0.01)


def test_how_wide_a_ground_is() -> None:
    """A square of half width a at distance d fills 4 atan(a^2 / (d sqrt(2 a^2 + d^2))) / (2 pi) of the half space."""
    d = 0.51
    a = np.linspace(0.05, 1.0, 400)
    seen = 2.0 / np.pi * np.arctan(a**2 / (d * np.sqrt(2.0 * a**2 + d**2)))
    least = float(np.interp(WIDE, seen, a))
    assert ground_below(scene(BALL, slab(1.01 * least)), [0]) is not None
    assert ground_below(scene(BALL, slab(0.99 * least)), [0]) is None
    assert ground_below(scene(BALL, flat(0.99 * least)), [0]) is not None  # flat objects are there for nothing else


@pytest.mark.parametrize("outwards", [False, True])
def test_the_floor_of_a_room_is_a_ground(outwards: bool) -> None:
    """The walls are no part of it, and plans say so."""
    box = Box((-1.0, 0, -1.2), (3, 3, 3)).tessellate()
    open_above = box.faces[(box.vertices[box.faces][:, :, 1] < 3).any(axis=1)]
    room = tl.Object(tl.Mesh(box.vertices, open_above if outwards else open_above[:, ::-1], name="room"))
    found = ground_below(scene(BALL, room), [0])
    assert found is not None
    assert (*found.normal, found.height) == pytest.approx((0, 1, 0, 0), abs=1e-12)
    assert found.has_walls
    body = tl.Object(BALL.mesh, tl.Medium(0.1, 3.0, ior=1.4))
    for told in ("does not reach 'room'", "parts of 'room' do not light each other"):
        assert told in str(plan(scene(body, room)))
    for silent in ("does not reach", "do not light each other"):
        assert silent not in str(plan(scene(body, slab(3.0))))


def test_even_parts_of_a_terrain_are_grounds() -> None:
    """Not its hills, behind which no light of bodies comes."""
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-4, 4, 33), np.linspace(-4, 4, 33), indexing="ij"))
    y = np.where(x > 1.5, np.minimum(x - 1.5, 2.0) * (1.0 + 0.2 * np.sin(3.0 * z)), 0.0)
    corner = (33 * np.arange(32)[:, None] + np.arange(32)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 33], 1), np.stack([corner + 34, corner + 33, corner + 1], 1)]
    )
    terrain = tl.Object(tl.Mesh(np.stack([x, y, z], 1), faces), color=(0.5, 0.6, 0.7))
    found = ground_below(scene(BALL, terrain), [0])
    assert found is not None
    assert (*found.normal, found.height) == pytest.approx((0, 1, 0, 0), abs=1e-12)
    black = [replace(scene(BALL, replace(one, color=(0, 0, 0))), environment=DARK) for one in (terrain, slab(4.0))]
    light, free = (FieldCache().of(plan(one, scattering=Diffusion(8))).ground for one in black)
    assert light is not None
    assert free is not None
    at, up = np.array([(-1.0, 0.0, 0.0), (3.9, 0.0, 0.0)]), np.tile((0.0, 1.0, 0.0), (2, 1))
    ratio = light.irradiance(at, up) / free.irradiance(at, up)
    np.testing.assert_allclose(ratio, [[1.0] * 3, [0.0] * 3], atol=1e-3)


@pytest.mark.parametrize("ior", [1.0, 1.4])
def test_a_slab_is_as_a_plane(ior: float) -> None:
    """Its top is the same triangles; only where rays start depends on the size of all."""
    up = np.eye(4)
    up[1, 3] = 0.037  # off the borders of the cells in which hits are grouped
    body = tl.Object(BALL.mesh, tl.Medium(0.1, 3.0, ior=ior), up)
    grounds = [replace(one, transform=up) for one in (flat(20.0), slab(20.0))]
    plans = [plan(scene(body, one), scattering=Diffusion(12)) for one in grounds]
    assert [one.treated(Treatment.DIFFUSION) for one in plans] == [(0,), (0,)]
    one, other = (FieldCache().of(found) for found in plans)
    assert one.ground is not None
    assert other.ground is not None
    np.testing.assert_allclose(other.surfaces[0].leaving, one.surfaces[0].leaving, rtol=1e-3)
    np.testing.assert_allclose(other.ground.values, one.ground.values, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("sunk", [0.0, 1e-6])
def test_what_a_body_stands_on_is_not_inside(sunk: float) -> None:
    """However tilted both are, so that their boxes overlap; but what pierces a face of its box is."""
    place, shift = rotation(), np.eye(4)
    shift[1, 3] = -0.01 - sunk
    ball = tl.Object(BALL.mesh, tl.Medium(ior=1.4), place @ shift)
    rod = tl.Object(Box((-0.1, -2, -0.1), (0.1, 0.2, 0.1)).tessellate(), transform=place)
    room = Box((-3, 0, -3), (3, 3, 3)).tessellate()
    around = tl.Object(tl.Mesh(room.vertices, room.faces[:, ::-1]), transform=place)
    ground = slab(3.0, transform=place)
    assert (ball.bounds[1] > ground.bounds[0]).all()
    for item, held in ((ground, False), (around, False), (rod, True)):
        assert may_hold(ball, item) == held
        assert held_objects(scene(ball, item)) == ((1,) if held else ())
