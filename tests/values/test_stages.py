"""Stages: where the ground is, what goes with the camera, and what a scene brings with it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import translucent as tl
from translucent.frames.animation import turntable
from translucent.geometry.solids import Box, Sphere
from translucent.media.colors import parse_color
from translucent.scene.grounds import before_page, page_radiance
from translucent.scene.showcase import DEFAULT_COLOR, default_medium, framing, showcase
from translucent.scene.stages import (
    DEFAULT_STAGE,
    GAP,
    NO_STAGE,
    STAGES,
    has_ground,
    stage_named,
    staged,
    upright,
    upright_turn,
    world_vertices,
)
from translucent.scene.studio import cove_radiance, studio_radiance

SIZE = (160, 90)
BOX = Box((-1.0, -0.5, -0.25), (1.0, 0.5, 0.25)).tessellate()
GLASS = tl.Medium(absorption=1.0, ior=1.5)
CAMERA = tl.Camera.look_at((3.0, 2.0, 5.0), (0.0, 0.0, 0.0), fov_y=40)


def placed(scale=1.0, turn=0.0, move=(0.0, 0.0, 0.0), mesh=BOX, **more):
    """An object turned about Z, so that it stands on an edge."""
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.eye(4)
    matrix[:3, :3] = scale * np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    matrix[:3, 3] = move
    return tl.Object(mesh, transform=matrix, **more)


def test_stages_have_names():
    assert DEFAULT_STAGE in STAGES
    assert stage_named(NO_STAGE) is None
    with pytest.raises(tl.InputError, match=r"stage 'studoi'; no stage has this name; did you mean studio\?"):
        stage_named("studoi")


@pytest.mark.parametrize("name", STAGES)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_ground_is_just_below_everything(name, unit):
    bodies = [
        placed(unit, 0.5, (3 * unit, -20 * unit, unit), medium=GLASS),
        placed(unit, 0.1, (0, -5 * unit, 0), color=(1, 0, 0)),
    ]
    scene = tl.Scene(bodies, CAMERA)
    ground = staged(scene, name).objects[-1]
    points = np.concatenate([world_vertices(item) for item in bodies])
    size = np.linalg.norm(np.ptp(points, axis=0))
    heights = world_vertices(ground)[:, 1]
    # float64 at coordinates of 20: far below the gap.
    np.testing.assert_allclose(points[:, 1].min() - heights, GAP * size, rtol=1e-9)
    assert 3e-4 <= GAP <= 2e-3  # more than rays step off surfaces, mirrored ones 1e-4, and less than a pixel or two
    assert (ground.bounds[0, [0, 2]] < points.min(axis=0)[[0, 2]] - 10 * size).all()
    assert (ground.bounds[1, [0, 2]] > points.max(axis=0)[[0, 2]] + 10 * size).all()
    corners = world_vertices(ground)[ground.mesh.faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] > 0).all()  # seen from above


@pytest.mark.parametrize(
    "mesh",
    [
        tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]]),  # lies flat
        tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),  # stands on an edge
        tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -9, 0]], [[0, 1, 2]]),  # what no face uses is not there
    ],
)
def test_sheets_stand_on_it_too(mesh):
    scene = showcase(mesh, GLASS, SIZE)
    assert world_vertices(scene.objects[-1])[0, 1] == pytest.approx(-GAP * np.sqrt(2), rel=1e-9)
    assert scene.camera.eye[1] > 0


def test_the_scale_of_a_scene_is_that_of_what_is_shown():
    plain = showcase(BOX, GLASS, SIZE, stage="none")
    scene = showcase(BOX, GLASS, SIZE)
    assert len(plain.objects) == 1
    assert scene.shown == scene.objects[:1]
    assert scene.diagonal == plain.diagonal
    assert scene.bounds[0, 0] < 10 * plain.bounds[0, 0]


def test_lights_and_environments_of_ones_own_take_the_place_of_the_stage():
    lamp = tl.PointLight((0, 5, 0), 1.0)
    assert len(showcase(BOX, GLASS, SIZE, lights=[lamp]).objects) == 1
    assert len(showcase(BOX, GLASS, SIZE, environment=tl.Environment.constant(1.0)).objects) == 1
    scene = showcase(BOX, GLASS, SIZE, lights=[lamp], stage="studio")
    assert scene.lights == (lamp,)
    sky = tl.Environment.constant(1.0)
    scene = showcase(BOX, GLASS, SIZE, environment=sky, stage="studio")
    assert (scene.lights, scene.environment) == ((), sky)
    assert staged(tl.Scene([placed(medium=GLASS)], CAMERA), "none").opaque == ()


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_goes_around_with_the_camera(name):
    """The stage of a turned view is the turned stage."""
    scene = tl.Scene([placed(medium=GLASS)], CAMERA)
    for view, expected in zip(turntable(staged(scene, name), 5), turntable(scene, 5), strict=True):
        other = staged(expected, name)
        np.testing.assert_allclose(view.camera.pose, other.camera.pose, atol=1e-12)
        for light, same in zip(view.lights, other.lights, strict=True):
            np.testing.assert_allclose(light.direction, same.direction, atol=1e-12)
        ways = np.random.default_rng(1).normal(size=(20, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        np.testing.assert_allclose(view.environment.lighting(ways), other.environment.lighting(ways), rtol=1e-6)
        np.testing.assert_allclose(world_vertices(view.objects[-1]), world_vertices(other.objects[-1]), atol=1e-9)
        assert view.objects[0] is scene.objects[0]


@pytest.mark.parametrize("eye", [(0, 5, 0), (0, -5, 0), (3, -1, 2)])
def test_cameras_above_and_below_have_a_stage(eye):
    camera = tl.Camera.look_at(eye, (0, 0, 0), up=(0, 0.1, 1))
    scene = staged(tl.Scene([placed(medium=GLASS)], camera))
    key = np.asarray(scene.lights[0].direction)
    assert key[1] < 0
    ahead = camera.up if abs(eye[1]) == 5 else camera.forward
    sign = 1 if eye[1] == 5 or abs(eye[1]) != 5 else -1
    assert key @ (ahead * (1, 0, 1)) * sign < 0  # from behind the model


@pytest.mark.parametrize("name", STAGES)
def test_the_default_camera_sees_model_and_shadow(name):
    scene = showcase(Sphere().tessellate(16), GLASS, SIZE, stage=name)
    light = np.asarray(scene.lights[0].direction)
    points = world_vertices(scene.objects[0])
    shadow = points - (points[:, 1:2] + 1.0) / light[1] * light
    local = (np.concatenate([points, 0.7 * shadow + 0.3 * points * (1, 0, 1)]) - scene.camera.eye) @ scene.camera.pose[
        :3, :3
    ]
    half = scene.camera.half_extent(SIZE)
    assert (local[:, 2] < 0).all()
    assert (np.abs(local[:, :2] / local[:, 2:]) < half).all()


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (0, -2, 0), (1, 2, -3)])
def test_what_is_up_becomes_y(up):
    turn = upright_turn(up)
    np.testing.assert_allclose(turn @ (np.array(up) / np.linalg.norm(up)), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    lights = [tl.PointLight((1, 2, 3), 1.0), tl.DirectionalLight((1, 0, 0), 1.0)]
    scene = tl.Scene([placed(medium=GLASS)], CAMERA, lights)
    turned = upright(scene, up)
    before = (world_vertices(scene.objects[0]) - scene.camera.eye) @ scene.camera.pose[:3, :3]
    after = (world_vertices(turned.objects[0]) - turned.camera.eye) @ turned.camera.pose[:3, :3]
    np.testing.assert_allclose(after, before, atol=1e-12)
    np.testing.assert_allclose(turned.lights[0].position, turn @ (1, 2, 3), atol=1e-12)
    np.testing.assert_allclose(turned.lights[1].direction, turn @ (1, 0, 0), atol=1e-12)


def test_grounds_are_found():
    body = placed(medium=GLASS)
    table = tl.Object(Box((-5, -1, -5), (5, -0.5, 5)).tessellate())
    room = tl.Object(Box((-5, -5, -5), (5, 5, 5)).tessellate())
    wick = tl.Object(Box((-0.1, -0.5, -0.1), (0.1, 0.5, 0.1)).tessellate())
    shelf = tl.Object(Box((-5, 1, -5), (5, 2, 5)).tessellate())
    for item, found in ((table, True), (room, True), (wick, False), (shelf, False)):
        assert has_ground(tl.Scene([body, item], CAMERA)) == found
    assert not has_ground(tl.Scene([body], CAMERA))
    assert not has_ground(tl.Scene([table], CAMERA))


@pytest.mark.parametrize("name", STAGES)
def test_a_page_is_white_where_nothing_shadows_it(name):
    scene = staged(tl.Scene([placed(medium=GLASS)], CAMERA), name)
    level = page_radiance(scene)
    assert 0.05 < level <= 1
    ground = before_page(scene, level).objects[-1]
    up = np.array([0.0, 1.0, 0.0])
    irradiance = scene.environment.irradiance_on(up) + scene.lights[0].irradiance_on(np.zeros(3), up)
    np.testing.assert_allclose(ground.base_color * irradiance / np.pi, level, rtol=1e-12)
    assert page_radiance(tl.Scene([placed(medium=GLASS)], CAMERA)) == 1


def test_light_has_to_fall_evenly_on_a_shadow_catcher():
    ball = tl.Object(Sphere().tessellate(8), shadow_catcher=True)
    with pytest.raises(tl.InputError, match="the mesh of the shadow catcher is not flat"):
        page_radiance(tl.Scene([ball], CAMERA))
    flat = tl.Object(tl.Mesh([[0, 0, 0], [0, 0, 1], [1, 0, 0]], [[0, 1, 2]]), shadow_catcher=True)
    scene = tl.Scene([flat], CAMERA)
    assert page_radiance(scene) == 1
    with pytest.raises(tl.InputError, match="a light at a finite distance illuminates the shadow catcher unevenly"):
        page_radiance(dataclasses.replace(scene, lights=[tl.PointLight((0, 1, 0), 1.0)]))
    with pytest.raises(tl.InputError, match="no light of one of the colors"):
        page_radiance(dataclasses.replace(scene, environment=tl.Environment.constant((1, 1, 0))))
    with pytest.raises(tl.InputError, match="a medium fills the object, but a shadow catcher must be opaque"):
        tl.Object(BOX, GLASS, shadow_catcher=True)


def test_png_is_right_before_white_and_where_nothing_tints_before_black():
    random = np.random.default_rng(2)
    own, passed = random.random((2, 6, 7, 3))
    passed[:3] = passed[:3, :, :1]  # no tint, neither of what passes nor of what is there
    own[:3] = own[:3, :, :1]
    passed[0], own[0] = 1.0, 0.0  # nothing there
    own[1] *= 1.0 - passed[1]
    zeros = np.zeros((6, 7))
    frame = tl.Frame(own, own, own, zeros, zeros > 0, zeros == 0, None, alpha=1 - passed.mean(axis=-1), passed=passed)
    pixels = frame.to_srgb8() / 255.0
    color, alpha = pixels[..., :3], pixels[..., 3:]
    encoded = lambda linear: dataclasses.replace(frame, radiance=np.minimum(linear, 1.0), alpha=None).to_srgb8() / 255.0  # noqa: E731
    # Color and alpha have 8 bits each.
    np.testing.assert_allclose(color * alpha + 1 - alpha, encoded(own + passed), atol=1.1 / 255)
    np.testing.assert_allclose((color * alpha)[:3], encoded(own)[:3], atol=1.1 / 255)
    assert (alpha[0] == 0).all()


def test_several_bodies_are_framed_for_a_stage():
    objects = [placed(medium=GLASS), placed(move=(0, 2, 0), medium=GLASS)]
    wide, close = framing(objects, SIZE, stage=stage_named("studio")), framing(objects, SIZE)
    assert np.linalg.norm(wide.eye) > np.linalg.norm(close.eye)


def test_a_scene_on_a_stage_gets_no_second_one() -> None:
    with pytest.raises(
        tl.InputError, match="the scene already has a ground that catches shadows; use a scene without a stage"
    ):
        tl.staged(showcase(BOX, GLASS, SIZE), "night")


def test_default_media_are_as_bright_in_compact_meshes_as_in_slender_ones() -> None:
    """The default color is that on the mean chord of a ball, 4 r / 3, and after 15 % of the diagonal of a plate."""
    ball, plate = Sphere(radius=0.3).tessellate(), Box.slab((1.0, 1.0), 0.02).tessellate()
    for mesh, distance in ((ball, 0.4), (plate, 0.15 * plate.diagonal)):
        medium = default_medium(mesh, None)
        assert np.allclose(medium.transmittance(distance), DEFAULT_COLOR, rtol=0.01)


def test_a_ground_has_a_color_or_is_left_out() -> None:
    scene = tl.showcase(BOX, GLASS, SIZE, stage="none")
    painted, bare = (tl.staged(scene, "studio", ground=one) for one in ("#204060", "none"))
    np.testing.assert_allclose(painted.objects[-1].base_color, parse_color("#204060"))
    assert painted.objects[-1].surface.color_texture is None
    assert len(bare.objects) == len(scene.objects)
    assert len(bare.lights) == len(painted.lights)
    with pytest.raises(tl.InputError, match="color 'blu'"):
        tl.staged(scene, "studio", ground="blu")


def test_far_away_the_studio_is_as_bright_as_its_backdrop() -> None:
    # Then a ground that mirrors the backdrop has its radiance at every angle, and there is no horizon.
    chosen = stage_named("studio")
    environment, (key,) = chosen.environment(), chosen.keys
    irradiance = environment.irradiance_on((0, 1, 0)) + np.sin(np.radians(key.elevation)) * np.array(key.irradiance)
    far = chosen.far * np.asarray(chosen.ground.color) * irradiance / np.pi
    np.testing.assert_allclose(far, environment.lighting(np.array([0.0, 0.02, -1.0])), rtol=0.06)


def test_the_stage_of_the_studio_has_no_black_bars() -> None:
    """Flat faces of clear bodies would mirror the dark cards that hang in the studio without a ground."""
    azimuth, elevation = np.radians(np.mgrid[-180:180:3, -60:61:5].reshape(2, -1))
    level = np.cos(elevation)
    towards = np.stack([level * np.sin(azimuth), np.sin(elevation), -level * np.cos(azimuth)], axis=-1)
    assert cove_radiance(towards).min() > 0.1
    assert studio_radiance(towards).min() < 0.02
