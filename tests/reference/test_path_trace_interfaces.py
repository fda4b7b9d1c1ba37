"""Monte Carlo path tracing through interfaces: closed forms, furnaces, and the deterministic ray tree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.reference.dielectrics import BLACK, UP_AND_DOWN, WHITE, Array, box, oblique, reflectance, slab
from translucent.errors import InputError
from translucent.formulas.interface import channel_iors, slab_reflectance, slab_transmittance
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere, Torus
from translucent.media.density import LinearDensity
from translucent.media.medium import Medium
from translucent.planning.passes import NoteKind
from translucent.reference import path_trace, refracted_light, render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

CAMERA = Camera.look_at((0.4, 0.5, 6.0), (0, 0, 0), fov_y=20)
BALL = Sphere().tessellate(12)
SHELL = Mesh(
    np.concatenate([BALL.vertices, 0.8 * BALL.vertices]),
    np.concatenate([BALL.faces, BALL.faces[:, ::-1] + len(BALL.vertices)]),
)
RING = Torus().tessellate(12)
SUN = DirectionalLight((0.3, -0.8, -0.5), 3.0)
CLEAR = Medium(ior=1.5)
WARM = np.array((1.0, 0.5, 0.2))


def assert_agree(frame: Frame, error: Array, truth: Array, rest: Array | float = 0.0) -> None:
    """The means of the picture and of its quarters, to four standard errors and the `rest` of the truth."""
    h, w = truth.shape[0] // 2, truth.shape[1] // 2
    for part in (np.s_[:, :], np.s_[:h, :w], np.s_[:h, w:], np.s_[h:, :w], np.s_[h:, w:]):
        bound = 4 * np.sqrt((error[part] ** 2).sum(axis=(0, 1))) + np.broadcast_to(rest, truth.shape)[part].sum((0, 1))
        distance = np.abs((frame.radiance[part] - truth[part]).sum(axis=(0, 1)))
        print(distance / truth[part].sum(axis=(0, 1)), bound / truth[part].sum(axis=(0, 1)))
        assert (distance <= bound + 1e-12).all()
    assert error.max() > 0.0


@pytest.mark.parametrize(("degrees", "dispersion"), [(0.0, 0.0), (60.0, 0.0), (0.0, 10.0)])
def test_an_absorbing_slab_reflects_between_its_faces_without_end(degrees: float, dispersion: float) -> None:
    medium = Medium(absorption=(0.1, 0.4, 0.9), ior=1.5)
    body = Object(slab(-1.0, 0.0), medium, surface=Surface(dispersion=dispersion))
    frame, error = path_trace(Scene([body], oblique(degrees), environment=UP_AND_DOWN), (1, 1), paths=20_000)
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    iors = channel_iors(1.5, dispersion)
    r = np.array([reflectance(sine, ior) for ior in iors])
    depth = medium.extinction / np.sqrt(1 - (sine / iors) ** 2)
    above, below = (UP_AND_DOWN.lighting(np.array([-sine, side * cosine, 0.0])) for side in (1, -1))
    truth = slab_reflectance(r, depth) * above + slab_transmittance(r, depth) * below
    assert (np.abs(frame.radiance[0, 0] - truth) < 4 * error[0, 0]).all()
    assert error.max() < 0.02


LOSSLESS = {
    "polished": [Object(BALL, CLEAR)],
    "rough": [Object(BALL, CLEAR, surface=Surface(roughness=0.6))],
    "shell": [Object(SHELL, CLEAR)],
    "dispersed": [Object(BALL, CLEAR, surface=Surface(dispersion=2.0))],
    "nested": [Object(BALL, CLEAR, priority=1), Object(RING, Medium(ior=1.3), surface=Surface(roughness=0.3))],
    "white": [Object(BALL, Medium(scattering=(3.0, 3.0, 6.0), anisotropy=0.5, ior=1.4))],
    "white in glass": [Object(BALL, Medium(scattering=8.0)), Object(SHELL, CLEAR)],
    "varied": [Object(BALL, Medium(scattering=4.0, ior=1.4), density=LinearDensity(0, 0.0, 2.0))],
    "sheet": [Object(BALL, CLEAR, sheet_thickness=0.01)],
    "rough sheet": [Object(BALL, CLEAR, surface=Surface(roughness=0.5), sheet_thickness=0.01)],
}


@pytest.mark.parametrize("name", LOSSLESS)
def test_white_furnace(name: str) -> None:
    """A body that loses nothing is invisible in uniform light: every path brings the same home."""
    overlap = "priority" if name == "nested" else "add"
    scene = Scene(LOSSLESS[name], CAMERA, environment=Environment.constant(WARM), overlap=overlap)
    frame, error = path_trace(scene, (8, 6), paths=16)
    np.testing.assert_allclose(frame.radiance, np.broadcast_to(WARM, (6, 8, 3)), rtol=1e-9)
    assert error.max() < 1e-9
    assert frame.coverage.any()


@pytest.mark.parametrize("density", [None, LinearDensity(0, 0.0, 2.0)], ids=["plain", "linear"])
@pytest.mark.parametrize("scattering", [0.0, 3.0])
def test_a_furnace_as_hot_as_its_walls(scattering: float, density: LinearDensity | None) -> None:
    """Kirchhoff: what absorbs and emits q = sigma_a L in light L; both are exact along each path, and cancel."""
    absorption = np.array([0.5, 2.0, 4.0])
    hot = Medium(absorption, scattering, emission=absorption * WARM, ior=1.5)
    sheet = Object(RING, Medium(absorption, emission=absorption * WARM), sheet_thickness=0.05)
    objects = [Object(BALL, hot, surface=Surface(roughness=0.4), density=density), sheet]
    scene = Scene(objects, CAMERA, environment=Environment.constant(WARM))
    frame, _ = path_trace(scene, (8, 6), paths=100)
    # All that is left is that of paths which end by chance.
    np.testing.assert_allclose(frame.radiance, np.broadcast_to(WARM, (6, 8, 3)), rtol=0.1)
    np.testing.assert_allclose(frame.radiance.mean(axis=(0, 1)), WARM, rtol=4e-3)


@pytest.mark.parametrize("name", ["ball", "shell", "ring", "nested", "dispersed"])
def test_against_the_ray_tree(name: str) -> None:
    glass = Medium(absorption=(0.1, 0.4, 0.9), emission=0.05, ior=1.5)
    objects = {
        "ball": [Object(BALL, glass)],
        "shell": [Object(SHELL, glass)],
        "ring": [Object(RING, glass)],
        "nested": [Object(BALL, glass, priority=1), Object(RING, Medium((0.9, 0.1, 0.5), ior=1.33))],
        "dispersed": [Object(BALL, glass, surface=Surface(dispersion=3.0, color=(0.9, 0.7, 0.4)))],
    }[name]
    overlap = "priority" if name == "nested" else "add"
    environment = Environment.gradient((0.1, 0.9, 0.3), (2.0, 0.1, 0.8))
    scene = Scene(objects, CAMERA, environment=environment, overlap=overlap)
    tree, _ = refracted_light(scene, (10, 8), bounces=12)
    frame, error = path_trace(scene, (10, 8), paths=100)
    assert_agree(frame, error, tree.radiance.reshape(8, 10, 3), 2.0 * tree.residual.reshape(8, 10, 3))


def test_unscattered_light_knows_its_media() -> None:
    """Past surfaces that bend nothing, in media so dense that paths go in steps."""
    outer = Object(BALL, Medium((0.1, 0.4, 0.9), 3.0, ior=1.4))
    inner = Object(Sphere(radius=0.6).tessellate(8), Medium((2.0, 0.5, 0.1), 0.0, emission=0.5, ior=1.4), priority=1)
    scene = Scene([outer, inner], CAMERA, environment=UP_AND_DOWN, overlap="priority")
    tree, _ = refracted_light(scene, (10, 8), bounces=12)
    frame, error = path_trace(scene, (10, 8), paths=200, max_events=0)
    assert_agree(frame, error, tree.radiance.reshape(8, 10, 3), 2.0 * tree.residual.reshape(8, 10, 3))


def test_surfaces_are_what_they_are_to_the_ray_tree() -> None:
    """Paint, tints, sheets with interfaces, layers, and an opaque body that shines: the tree ends there."""
    paint = Surface(transmission=0.4, color=(0.9, 0.5, 0.2), diffuse_transmission=0.3)
    pane = box((-1.5, -1.2, -2.0), (1.5, 1.2, -1.9))
    objects = [
        Object(BALL, Medium((0.1, 0.4, 0.9), ior=1.5), surface=paint),
        Object(RING, Medium((0.5, 0.2, 0.1), ior=1.4), sheet_thickness=0.1, surface=Surface(color=(0.5, 1.0, 0.8))),
        Object(pane, Medium(), sheet_thickness=0.1, surface=Surface(opacity=0.5, color=(0.2, 0.3, 0.9))),
        Object(box((-3, -3, -4), (3, -1.3, 4)), surface=Surface(color=(0, 0, 0), emissive=(0.7, 0.6, 0.3))),
    ]
    lights = [SUN, PointLight((2.0, 2.0, 3.0), 8.0)]
    scene = Scene(objects, CAMERA, lights, Environment.checkerboard((1.0, 0.4, 0.1), (0.1, 0.5, 0.9)))
    tree, _ = refracted_light(scene, (10, 8), bounces=12)
    frame, error = path_trace(scene, (10, 8), paths=100)
    assert_agree(frame, error, tree.radiance.reshape(8, 10, 3), 3.0 * tree.residual.reshape(8, 10, 3))


def test_a_room_lights_itself() -> None:
    """Walls of albedo a that emit L, and a lossless body: L / (1 - a) everywhere, of all bounces."""
    walls = Surface(color=(0.5, 0.2, 0.8), emissive=(1.0, 0.5, 0.25))
    room = Object(box((-3, -3, -3), (3, 3, 3)), surface=walls)
    scene = Scene([Object(BALL, Medium(0.0, 3.0, ior=1.5)), room], Camera.look_at((1, 1, 2.5), (0, 0, 0)), [], BLACK)
    frame, error = path_trace(scene, (6, 6), paths=40)
    assert_agree(frame, error, np.broadcast_to(np.array([2.0, 0.625, 1.25]), (6, 6, 3)))


def test_lights_go_straight_where_no_interface_bends_them() -> None:
    """Single scattering of the tree, in a body that only tints; and none behind a body that refracts."""
    smoke = Object(RING, Medium((0.5, 1.0, 2.0), 2.0, anisotropy=0.4), surface=Surface(color=(0.5, 0.7, 0.9)))
    scene = Scene([smoke], CAMERA, [SUN], BLACK)
    truth = render(scene, (10, 8), tolerance=1e-4).radiance
    frame, error = path_trace(scene, (10, 8), paths=400, max_events=1)
    assert_agree(frame, error, truth)
    assert not frame.plan.says(NoteKind.LIGHTS_LEFT_OUT)
    awning = Object(box((-3, 2, -3), (3, 2.1, 3)), CLEAR)
    frame, _ = path_trace(Scene([smoke, awning], CAMERA, [SUN], BLACK), (10, 8), paths=4)
    assert frame.plan.says(NoteKind.LIGHTS_LEFT_OUT)
    assert frame.radiance.max() == 0.0


def test_many_lights_through_rough_interfaces_are_a_furnace() -> None:
    """A lossless cube in suns from everywhere: what its microfacets turn to them adds up to what white light shows."""
    count = 20
    up = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + math.sqrt(5)) * np.arange(count)
    ways = np.stack([np.sqrt(1 - up**2) * np.cos(turn), up, np.sqrt(1 - up**2) * np.sin(turn)], axis=1)
    suns = [DirectionalLight(tuple(way), 4 * np.pi / count) for way in ways]
    cube = Object(box((-1, -1, -1), (1, 1, 1)), CLEAR, surface=Surface(roughness=0.8))
    camera = Camera.look_at((2, 3, 4), (0, 0, 0), fov_y=5)
    frame, error = path_trace(Scene([cube], camera, suns, BLACK), (4, 4), paths=400)
    # And what the sum over so few directions is off.
    bound = 4 * math.sqrt((error[..., 0] ** 2).sum()) / 16 + 0.02
    assert bound < 0.1
    assert abs(frame.radiance[..., 0].mean() - 1.0) < bound
    assert not frame.plan.says(NoteKind.LIGHTS_LEFT_OUT)


def test_light_that_total_reflection_holds_for_ever() -> None:
    """No light finds its way into a cube of glass in these directions; all the same, paths end."""
    camera = Camera.look_at((0.1, 0.2, 0.3), (1.1, 1.2, 1.3), fov_y=1)
    scene = Scene([Object(box((-1, -1, -1), (1, 1, 1)), CLEAR)], camera, environment=WHITE)
    frame, error = path_trace(scene, (1, 1), paths=4)
    assert frame.radiance.max() == error.max() == 0.0


def test_seeds_and_refusals() -> None:
    scene = Scene([Object(BALL, CLEAR, surface=Surface(roughness=0.3))], CAMERA, environment=UP_AND_DOWN)
    first, again, other = (path_trace(scene, (3, 2), paths=4, seed=seed)[0].radiance for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    unwrapped = Mesh(BALL.vertices, BALL.faces, uv=BALL.vertices[:, :2])
    mapped = Surface(normal_texture=Texture(np.ones((1, 1, 3))))
    with pytest.raises(InputError, match=r"normal_texture.*refraction=False"):
        path_trace(Scene([Object(unwrapped, CLEAR, surface=mapped)], CAMERA), (2, 2))
    with pytest.raises(InputError, match="the sheet scatters light"):
        path_trace(Scene([Object(BALL, Medium(1.0, 1.0, ior=1.5), sheet_thickness=0.1)], CAMERA), (2, 2))
