"""Shadows on opaque objects: what the straight way from a light leaves of it, colored by bodies, 0 behind walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.special import expn

import translucent as tl
from translucent.arrays import Array
from translucent.formulas import optics
from translucent.geometry.solids import Box, Sphere
from translucent.reference import light_transmittance, line_hits, pixel_rays, shade_hits, sheet_thicknesses

DOWN = tl.Camera.orthographic((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), height=4.0)
DARK = tl.Environment.constant(0.0)
SUN = tl.DirectionalLight((0.3, 0.2, -1.0), 3.0)
LAMP = tl.PointLight((0.4, -0.3, 4.0), 50.0)
RED, BLUE = tl.Medium(absorption=(0.1, 1.0, 2.0)), tl.Medium(absorption=(1.5, 0.7, 0.2))
BALL = Sphere().tessellate(24)
SLAB = Box((-4.0, -4.0, 1.0), (4.0, 4.0, 1.5)).tessellate()
BOX = Box((-1.0, -1.0, 0.5), (1.0, 1.0, 2.0)).tessellate()
#: On the ground, and above it.
POINTS = np.random.default_rng(5).uniform((-2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (400, 3))


def wall(z: float = 0.0, half: float = 6.0, flipped: bool = False) -> tl.Mesh:
    corners = [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    return tl.Mesh(corners, faces[:, ::-1] if flipped else faces, name="ground")


GROUND = tl.Object(wall())


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scene(*objects: tl.Object, light: Any = SUN, **more: Any) -> tl.Scene:
    return tl.Scene([*objects, GROUND], DOWN, [light], environment=more.pop("environment", DARK), **more)


def towards(light: Any, points: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) from points to a light, and how far it is (k,)."""
    if isinstance(light, tl.DirectionalLight):
        return np.tile(-np.asarray(light.direction), (len(points), 1)), np.full(len(points), np.inf)
    way = np.asarray(light.position) - points
    distance = np.linalg.norm(way, axis=1)
    return way / distance[:, None], distance


def span(mesh: tl.Mesh, light: Any, points: Array, offset: Sequence[float] = (0, 0, 0)) -> tuple[Array, Array]:
    """Distances (k,), (k,) at which ways from points to a light enter and leave a convex mesh, cut by its planes."""
    way, distance = towards(light, points)
    corner, normal = mesh.vertices[mesh.faces[:, 0]] + offset, mesh.face_normals
    begin, end = np.zeros(len(points)), distance.copy()
    for c, n in zip(corner, normal, strict=True):
        height, slope = (c - points) @ n, way @ n
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            at = height / slope
        begin = np.where(slope < 0, np.maximum(begin, at), begin)
        end = np.where(slope > 0, np.minimum(end, at), end)
    return begin, np.maximum(end, begin)


def chord(mesh: tl.Mesh, light: Any, points: Array, offset: Sequence[float] = (0, 0, 0)) -> Array:
    begin, end = span(mesh, light, points, offset)
    return end - begin


def dimmed(medium: tl.Medium, length: Array) -> Array:
    return np.exp(-np.asarray(medium.extinction) * length[:, None])


@pytest.mark.parametrize("light", [SUN, LAMP], ids=["sun", "lamp"])
def test_a_ball_colors_the_light_by_its_chord(light: Any) -> None:
    found = light_transmittance(scene(tl.Object(BALL, RED, moved(z=1.5)), light=light), 0, POINTS)
    length = chord(BALL, light, POINTS, (0, 0, 1.5))
    assert 0.1 < np.mean(length > 0) < 0.9
    assert length.max() > 1.9
    np.testing.assert_allclose(found, dimmed(RED, length), rtol=1e-12)


def test_a_slab_at_an_angle() -> None:
    points = POINTS / 2
    cosine = 1.0 / np.sqrt(1.13)
    found = light_transmittance(scene(tl.Object(SLAB, RED)), 0, points)
    np.testing.assert_allclose(found, dimmed(RED, np.full(len(points), 0.5 / cosine)), rtol=1e-13)


def test_several_media_multiply() -> None:
    bodies = tl.Object(BALL, RED, moved(z=1.5)), tl.Object(SLAB, BLUE)
    found = light_transmittance(scene(*bodies), 0, POINTS)
    expected = dimmed(RED, chord(BALL, SUN, POINTS, (0, 0, 1.5))) * dimmed(BLUE, chord(SLAB, SUN, POINTS))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("overlap", ["add", "union", "priority"])
def test_bodies_in_one_place_follow_the_overlap_of_the_scene(overlap: Any) -> None:
    inner = tl.Object(BALL, BLUE, moved(z=1.25) @ np.diag((0.5, 0.5, 0.5, 1.0)), priority=2)
    outer = tl.Object(BOX, RED, priority=1)
    small = tl.Mesh(0.5 * BALL.vertices, BALL.faces)
    own, around = chord(small, SUN, POINTS, (0, 0, 1.25)), chord(BOX, SUN, POINTS)
    around = around - own if overlap == "priority" else around
    found = light_transmittance(scene(outer, inner, overlap=overlap), 0, POINTS)
    np.testing.assert_allclose(found, dimmed(BLUE, own) * dimmed(RED, around), rtol=1e-11)


def test_union_counts_one_medium_once() -> None:
    other = tl.Object(BOX, RED, moved(z=0.5))
    found = light_transmittance(scene(tl.Object(BOX, RED), other, overlap="union"), 0, POINTS)
    tall = Box((-1.0, -1.0, 0.5), (1.0, 1.0, 2.5)).tessellate()
    np.testing.assert_allclose(found, dimmed(RED, chord(tall, SUN, POINTS)), rtol=1e-12)


def test_sheets_dim_by_their_path() -> None:
    metres, glass = 0.2, tl.Medium(absorption=(0.1, 1.0, 2.0), ior=1.5)
    found = light_transmittance(scene(tl.Object(wall(1.0), glass, sheet_thickness=metres)), 0, POINTS)
    path = optics.thin_layer_thickness(metres, 1.0 / np.sqrt(1.13), 1.5)
    np.testing.assert_allclose(found, dimmed(glass, np.full(len(POINTS), path)), rtol=1e-13)


@pytest.mark.parametrize("light", [SUN, LAMP], ids=["sun", "lamp"])
def test_opaque_bodies_throw_sharp_shadows(light: Any) -> None:
    found = light_transmittance(scene(tl.Object(BALL, transform=moved(z=1.5)), light=light), 0, POINTS)
    length = chord(BALL, light, POINTS, (0, 0, 1.5))
    assert np.array_equal(found, np.where(length > 0, 0.0, 1.0)[:, None] * np.ones(3))


def test_the_umbra_of_a_round_ball_is_its_outline() -> None:
    ball = Sphere().tessellate(256)
    found = light_transmittance(scene(tl.Object(ball, transform=moved(z=1.5))), 0, POINTS)[:, 0]
    center, way = np.array((0, 0, 1.5)), -np.asarray(SUN.direction)
    from_axis = np.linalg.norm(np.cross(POINTS - center, way), axis=1)
    clear = np.abs(from_axis - 1.0) > 2e-4  # faces cut the corners of the sphere by (pi / 256)^2
    assert np.array_equal(found[clear] == 0.0, from_axis[clear] < 1.0)


def test_a_light_inside_a_body_shines_out_of_it() -> None:
    lamp = tl.PointLight((0.2, 0.1, 1.0), 1.0)
    for body, way in ((tl.Object(BOX, RED), chord(BOX, lamp, POINTS)), (tl.Object(SLAB, RED), None)):
        found = light_transmittance(scene(body, light=lamp), 0, POINTS)
        if way is None:  # the slab ends where the light is: all of it is above
            way = np.zeros(len(POINTS))
        np.testing.assert_allclose(found, dimmed(RED, way), rtol=1e-12)
    inside_opaque = light_transmittance(scene(tl.Object(BOX), light=lamp), 0, POINTS)
    assert not inside_opaque.any()


def test_a_light_on_a_body_shines_outwards() -> None:
    below, above = (tl.PointLight((0.2, 0.1, z), 1.0) for z in (0.5, 2.0))
    assert (light_transmittance(scene(tl.Object(BOX), light=below), 0, POINTS) == 1.0).all()
    assert not light_transmittance(scene(tl.Object(BOX), light=above), 0, POINTS).any()
    np.testing.assert_allclose(light_transmittance(scene(tl.Object(BOX, RED), light=below), 0, POINTS), 1.0, rtol=1e-14)


def test_points_on_and_in_bodies() -> None:
    """Ways end at the point: what lies beyond it does not dim."""
    lamp = tl.DirectionalLight((0, 0, -1), 1.0)
    heights = np.array([2.5, 2.0, 1.5, 0.5, 0.25])
    points = np.stack([0.1 + 0 * heights, 0.2 + 0 * heights, heights], axis=1)
    found = light_transmittance(scene(tl.Object(BOX, RED), light=lamp), 0, points)
    np.testing.assert_allclose(found, dimmed(RED, np.clip(2.0 - heights, 0, 1.5)), rtol=1e-14)
    opaque = light_transmittance(scene(tl.Object(BOX), light=lamp), 0, points)
    assert opaque[:, 0].tolist() == [1.0, 1.0, 0.0, 0.0, 0.0]


def test_layers_throw_no_shadows() -> None:
    layer = tl.Object(wall(1.0), tl.Medium(), sheet_thickness=1e-3, surface=tl.Surface(opacity=0.9))
    assert (light_transmittance(scene(layer), 0, POINTS) == 1.0).all()


def seen(shown: tl.Scene, size: tuple[int, int]) -> Array:
    """(n, 3): radiance of a picture; scenes of opaque objects alone have no plan."""
    hits = [line_hits(body.mesh, body.matrix, shown.camera, size) for body in shown.objects]
    rays = pixel_rays(shown.camera, size)
    return shade_hits(shown, rays, hits, sheet_thicknesses(shown))["radiance"]


def radiance(*objects: tl.Object, **more: Any) -> Array:
    return tl.reference.render(scene(*objects, **more), (24, 24), refraction=False).radiance


def on_ground() -> Array:
    """(576, 3): where the pixels of `radiance` see the ground."""
    origins, directions = DOWN.rays((24, 24))
    return (origins + 9.0 * directions).reshape(-1, 3)


@pytest.mark.parametrize("light", [SUN, LAMP], ids=["sun", "lamp"])
def test_pictures_show_the_shadow_on_the_ground(light: Any) -> None:
    # Out of the view, between the light and what is seen.
    body = tl.Object(BALL, RED, moved(z=20.0))
    far = tl.DirectionalLight((0, 0, -1), 3.0) if light is SUN else tl.PointLight((0.0, 0.0, 25.0), 900.0)
    way, distance = towards(far, on_ground())
    falling = way[:, 2] * (3.0 if light is SUN else 900.0 / distance**2)
    expected = 0.6 / np.pi * falling[:, None] * dimmed(RED, chord(BALL, far, on_ground(), (0, 0, 20.0)))
    assert expected.max() > 2.0 * expected.min()
    np.testing.assert_allclose(radiance(body, light=far).reshape(-1, 3), expected, rtol=1e-11)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_light_below_the_ground_does_not_light_its_upper_side(flipped: bool) -> None:
    ground = tl.Object(wall(0.0, flipped=flipped))
    lamps = [tl.PointLight((0.2, 0.1, -1.0), 9.0), tl.DirectionalLight((0, 0, 1), 1.0)]
    assert not seen(tl.Scene([ground], DOWN, lamps, DARK), (8, 8)).any()
    # On the ground, all of it comes in edge-on.
    lamp = tl.PointLight((0.2, 0.1, 0.0), 9.0)
    assert not seen(tl.Scene([ground], DOWN, [lamp], DARK), (8, 8)).any()


def test_opaque_bodies_do_not_shadow_what_faces_the_light_and_shadow_others() -> None:
    """A ball has no dark spots; a box above it keeps the sun from it."""
    camera = tl.Camera.look_at((0.5, 3.0, 7.0), (0, 0, 0), fov_y=20.0)
    ball = tl.Object(BALL)
    sun, sky = tl.DirectionalLight((0.3, -1.0, -0.4), np.pi), tl.Environment.constant(0.1)
    lit = seen(tl.Scene([ball], camera, [sun], sky), (48, 48))
    # The same without shadows: by the normals of the faces.
    hits = tl.reference.camera_hits(BALL, np.eye(4), camera, (48, 48))
    pixel, first = np.unique(hits.pixel, return_index=True)
    cosine = np.maximum(-(BALL.face_normals[hits.face[first]] @ np.asarray(sun.direction)), 0.0)
    np.testing.assert_allclose(lit[pixel, 0], 0.6 * (cosine + 0.1), rtol=1e-12)
    roof = tl.Object(wall(), transform=moved(y=5.0) @ np.diag((3.0, 1.0, 3.0, 1.0))[[0, 2, 1, 3]])
    shaded = seen(tl.Scene([ball, roof], camera, [sun], sky), (48, 48))
    np.testing.assert_allclose(shaded[pixel], 0.06, rtol=1e-12)


def test_a_body_that_stands_on_the_ground_dims_only_what_it_covers() -> None:
    box = Box((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0)).tessellate()
    found = light_transmittance(scene(tl.Object(box, RED)), 0, POINTS)
    np.testing.assert_allclose(found, dimmed(RED, chord(box, SUN, POINTS)), rtol=1e-12)
    assert np.array_equal(light_transmittance(scene(tl.Object(box)), 0, POINTS)[:, 0] > 0, chord(box, SUN, POINTS) == 0)


def test_refracted_rays_and_paths_land_on_the_same_shadows() -> None:
    """The ground beside a glass ball, which bends what is seen through it."""
    glass = tl.Object(BALL, tl.Medium(absorption=(0.1, 1.0, 2.0), ior=1.5), moved(z=1.5))
    sun = tl.DirectionalLight((0.9, 0.0, -1.0), 3.0)
    shown = scene(glass, light=sun)
    straight, bent = (tl.reference.render(shown, (16, 16), refraction=refraction) for refraction in (False, True))
    paths, _ = tl.reference.path_trace(shown, (16, 16), 2)
    beside = ~straight.coverage
    shadow = straight.radiance[beside][:, 2]
    assert np.mean(shadow < 0.5 * shadow.max()) > 0.05
    np.testing.assert_allclose(bent.radiance[beside], straight.radiance[beside], rtol=1e-9)
    # Paths go on from the ground, so that a few of them find light that the ball sends there.
    assert np.isclose(paths.radiance[beside], straight.radiance[beside], rtol=1e-9).mean() > 0.7


def test_paint_and_layers_are_shadowed_and_do_not_shadow_themselves() -> None:
    """A painted sheet, and a layer, above the ground; and below a body.

    What is painted is seen through the sheet: once, and not on the way of the light, too.
    """
    paint, cover = (tl.Surface(color=(0.6, 0.6, 0.6), **more) for more in ({"transmission": 0.0}, {"opacity": 1.0}))
    gray = tl.Medium(absorption=(5.0, 5.0, 5.0))
    sun = tl.DirectionalLight((0, 0, -1), 1.0)
    for own, shown in (
        (tl.Object(wall(3.0), gray, sheet_thickness=0.1, surface=paint), np.exp(-0.5)),
        (
            tl.Object(wall(3.0), tl.Medium(), sheet_thickness=0.1, surface=cover),
            1.0,
        ),
    ):
        for body, passed in ((), 1.0), ((tl.Object(SLAB, RED, moved(z=15.0)),), np.exp(-0.5 * RED.extinction)):
            found = tl.reference.render(scene(own, *body, light=sun), (2, 2)).radiance
            np.testing.assert_allclose(found, 0.6 / np.pi * shown * passed * np.ones((2, 2, 3)), rtol=1e-9)


def sky_on_ground(count: int, *objects: tl.Object, points: Array) -> Array:
    """(k, 3): irradiance at points of the ground under a sky of radiance 1."""
    from translucent.reference.light_paths import LightPaths, SurfaceLight

    shown = tl.Scene([*objects, GROUND], DOWN, environment=tl.Environment.constant(1.0), environment_shadows=count)
    light = SurfaceLight(LightPaths(shown, (None,) * len(shown.objects)))
    return light.on_opaque(points - DOWN.eye, np.tile((0.0, 0.0, 1.0), (len(points), 1)))


def test_an_opaque_disc_hides_its_form_factor_of_the_sky() -> None:
    """Form factor of a parallel disc, of radius r at height h, from a point at distance a from its axis (Howell,
    Menguc & Siegel 2010, C-1): (1 - (z - 2 R^2) / sqrt(z^2 - 4 R^2)) / 2 with H = h / a, R = r / a, z = 1 + H^2 + R^2.
    """
    radius, height, sides = 1.5, 1.0, 96
    angle = 2.0 * np.pi * np.arange(sides) / sides
    # As large as the disc.
    size = radius * np.sqrt(2.0 * np.pi / sides / np.sin(2.0 * np.pi / sides))
    rim = np.stack([size * np.cos(angle), size * np.sin(angle), height + 0 * angle], axis=1)
    fan = [(0, i, i + 1) for i in range(1, sides - 1)]
    disc = tl.Object(tl.Mesh(rim, fan))
    points = 2.9 * POINTS  # the shadow is on a fifth of this ground
    a = np.linalg.norm(points[:, :2], axis=1)
    z = 1.0 + (height / a) ** 2 + (radius / a) ** 2
    hidden = 0.5 * (1.0 - (z - 2.0 * (radius / a) ** 2) / np.sqrt(z**2 - 4.0 * (radius / a) ** 2))
    errors = {}
    for count in (8, 32, 128):
        found = sky_on_ground(count, disc, points=points)[:, 0] / np.pi
        errors[count] = np.sqrt(np.mean((found - (1.0 - hidden)) ** 2)) / np.mean(1.0 - hidden)
    # Of 32 directions, 16 are above the ground.
    assert errors[32] <= 0.04
    # At least as 1 / sqrt(count).
    assert errors[32] <= 0.5 * errors[8]
    assert errors[128] <= 0.5 * errors[32]


def test_a_wide_slab_dims_the_sky_by_the_exponential_integral() -> None:
    """A layer of optical depth t lets 2 E_3(t) of uniform light pass to a surface below it."""
    slab = Box((-500.0, -500.0, 1.0), (500.0, 500.0, 1.5)).tessellate()
    points = np.zeros((1, 3))
    expected = 2.0 * np.pi * expn(3, 0.5 * np.asarray(RED.extinction))
    errors = [
        np.abs(sky_on_ground(count, tl.Object(slab, RED), points=points) / expected - 1).max() for count in (32, 256)
    ]
    assert errors[0] <= 0.03
    assert errors[1] <= 0.01


def test_a_sky_that_nothing_hides_is_what_it_was() -> None:
    """The ratio is 1 then, whatever the directions are; and 1 where none shines on a surface."""
    sky = tl.Environment.gradient((0.1, 0.2, 0.3), (1.0, 0.5, 0.2))
    for normal_up, count in ((True, 1), (True, 32), (False, 3)):
        ground = tl.Object(wall(flipped=not normal_up))
        shown = [seen(tl.Scene([ground], DOWN, environment=sky, environment_shadows=k), (4, 4)) for k in (0, count)]
        np.testing.assert_allclose(shown[1], shown[0], rtol=1e-14)


def test_opaque_bodies_hide_the_sky_from_themselves() -> None:
    """Inside a closed room it is dark."""
    room = Box((-3.0, -3.0, -3.0), (3.0, 3.0, 3.0)).tessellate()
    camera = tl.Camera.look_at((0.1, 0.2, 0.3), (1.0, 0.4, 0.0))
    assert not seen(tl.Scene([tl.Object(room)], camera, environment_shadows=16), (8, 8)).any()


@pytest.mark.parametrize(
    ("light", "points", "match"),
    [(1, POINTS, "light 1"), (-1, POINTS, "light -1"), (0, np.zeros(3), "shape"), (0, [[np.nan, 0, 0]], "finite")],
)
def test_light_transmittance_refuses(light: int, points: Any, match: str) -> None:
    with pytest.raises(tl.InputError, match=match):
        light_transmittance(scene(tl.Object(BALL, RED)), light, points)


def test_surfaces_far_from_the_eye_do_not_shadow_themselves() -> None:
    """A place so far away that points are rounded to 2e-9 m."""
    camera = tl.Camera.orthographic((0.0, 0.0, 2e7), (0.0, 0.0, 0.0), height=2.0)
    sun = tl.DirectionalLight((2.0, 1.0, -1.0), np.pi)
    shown = tl.Scene([tl.Object(BOX), tl.Object(wall(-20.0))], camera, [sun], DARK)
    np.testing.assert_allclose(seen(shown, (16, 16)), 0.6 / np.sqrt(6.0), rtol=1e-12)
