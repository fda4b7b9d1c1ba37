"""Rays traced through the meshes: against the float64 tree, truth images, energy, and validity."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests import references
from tests.textured import TEXTURED
from translucent.assets import mesh_path
from translucent.bench.shapes import joined
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.gpu.passes import traced_interfaces
from translucent.scene.showcase import framing

Array = npt.NDArray[np.float64]

SIZE = (24, 20)
SKY = tl.Environment.gradient((0.2, 0.3, 0.4), (1.4, 1.2, 1.0))
WHITE = tl.Environment.constant((1.0, 1.0, 1.0))
CAMERA = tl.Camera.look_at((2.0, 1.5, 4.0), (0, 0, 0), fov_y=30.0)
INSIDE = tl.Camera.look_at((0.0, 0.1, 0.2), (0.3, 0, -1), fov_y=60.0)
DEEP = tl.TracedInterfaces(depth=24, forks=4)

GLASS = tl.Medium(absorption=(0.5, 0.1, 0.9), ior=1.5)
RED = tl.Medium(absorption=(0.1, 0.8, 1.2), ior=1.33)
EMITS = tl.Medium(absorption=(0.5, 0.1, 0.9), emission=(0.1, 0.2, 0.3), ior=1.5)
TINT = tl.Medium(absorption=(0.5, 0.9, 0.2))
FILM = tl.Medium(absorption=(300.0, 50.0, 100.0))
GLOWING_FILM = dataclasses.replace(FILM, emission=(20.0, 10.0, 5.0))

BALL = Sphere().tessellate(24)
CORE = Sphere(radius=0.5).tessellate(24)
BOX = Box((-1, -1, -1), (1, 1, 1)).tessellate()
PANE = tl.Mesh(np.array([(-2.0, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]), np.array([(0, 1, 2), (0, 2, 3)]))
ON_BALL = BALL.vertices[BALL.faces[300]].mean(axis=0)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def at(*position: float, by: Any = 1.0) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = by if np.ndim(by) == 2 else np.diag(np.broadcast_to(by, 3))
    matrix[:3, 3] = position
    return matrix


def seen(*objects: tl.Object, camera: tl.Camera = CAMERA, environment: tl.Environment = SKY, **rest: Any) -> tl.Scene:
    return tl.Scene(list(objects), camera, environment=environment, **rest)


def body(mesh: tl.Mesh, medium: tl.Medium | None = GLASS, *place: float, by: Any = 1.0, **rest: Any) -> tl.Object:
    return tl.Object(mesh, medium, at(*(place or (0.0, 0.0, 0.0)), by=by), **rest)


def hollow() -> tl.Mesh:
    inner = Sphere(radius=0.8).tessellate(24)
    return joined([(BALL.vertices, BALL.faces), (inner.vertices, inner.faces[:, ::-1])], "hollow")


def goblet(environment: tl.Environment = SKY, absorbs: float = 1.0) -> tl.Scene:
    """Wine in a glass: their surfaces coincide, the glass displaces the wine."""
    camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    glass, wine = tl.Medium(absorption=5.0 * absorbs, ior=1.54), tl.Medium(absorption=80.0 * absorbs, ior=1.34)
    cup, fill = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    return seen(
        tl.Object(cup, glass, priority=1),
        tl.Object(fill, wine),
        camera=camera,
        environment=environment,
        overlap="priority",
    )


@pytest.fixture(scope="module")
def second_renderer() -> Iterator[tl.Renderer]:
    with tl.Renderer() as made:
        yield made


@pytest.fixture
def thorough(second_renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> tl.Renderer:
    """Renderer that follows fainter rays than pictures need: its tree is that of the reference."""
    monkeypatch.setattr(traced_interfaces, "faintest_throughput", lambda forks: 1e-4)
    return second_renderer


def leniently(
    renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int] = SIZE, interfaces: tl.TracedInterfaces = DEEP
) -> tl.Frame:
    """Render without warnings about invalid pixels."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.TranslucentWarning)
        return renderer.render(scene, size, samples=1, interfaces=interfaces)


def differences(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int] = SIZE, bounces: int = 20) -> Array:
    """Differences of covered pixels, as shares of the mean of the reference.

    Light reaches opaque objects straight in both: scattering once leaves out maps of the light that interfaces refract.
    """
    frame = renderer.render(scene, size, samples=1, interfaces=DEEP, scattering=tl.SingleScattering())
    truth = references.render(scene, size, bounces=bounces)
    assert frame.valid.all()
    assert (frame.coverage != truth.coverage).sum() <= 1
    off = np.abs(frame.radiance - truth.radiance).max(axis=2)[truth.coverage] / truth.radiance[truth.coverage].mean()
    assert off.size >= 40
    return np.asarray(off)


# Against the reference: the same tree in float64. Rounding grows with each interface by the ratio of the path to the
# radius of curvature; near silhouettes a ray falls on another triangle, and the normals of these tessellations jump.


def spread(count: int) -> tl.Scene:
    return seen(*(body(CORE, GLASS, 0.9 * i, 0.0, -0.8 * i) for i in range(-1, count - 1)))


ONE: dict[str, Callable[[], tl.Scene]] = {
    "ball": lambda: seen(body(BALL)),
    "hollow ball": lambda: seen(body(hollow())),
    "box": lambda: seen(body(BOX)),
    "knot": lambda: tl.showcase(
        tl.load_mesh(mesh_path("knot")), tl.Medium(absorption=9.0, ior=1.5), SIZE, environment=SKY
    ),
    "squeezed torus": lambda: seen(body(Torus().tessellate(32), by=0.8 * TURN @ np.diag((1, 1.4, 0.5)))),
    "mirrored": lambda: seen(body(BALL, by=TURN @ np.diag((1, -1, 0.7)))),
    "wound backwards": lambda: seen(body(tl.Mesh(BALL.vertices, BALL.faces[:, ::-1]))),
    "two balls in one mesh": lambda: seen(
        body(joined([(BALL.vertices, BALL.faces), (0.5 * BALL.vertices + 0.9, BALL.faces)], "crossing"))
    ),
    "1e6 m away": lambda: seen(
        body(BALL, GLASS, 1e6, 1e6, -1e6),
        camera=tl.Camera.look_at((1e6 + 2, 1e6 + 1.5, -1e6 + 4), (1e6, 1e6, -1e6), fov_y=30),
    ),
    "1e-6 m wide": lambda: seen(
        body(BALL, dataclasses.replace(GLASS, absorption=np.array((5e5, 1e5, 9e5))), by=1e-6),
        camera=tl.Camera.look_at((2e-6, 1.5e-6, 4e-6), (0, 0, 0), fov_y=30),
    ),
    "from 1e4 diameters": lambda: seen(
        body(BALL), camera=tl.Camera.look_at((2e4, 1.5e4, 4e4), (0, 0, 0), fov_y=2.5e-3)
    ),
    "orthographic": lambda: seen(body(BALL), camera=tl.Camera.orthographic((2, 1.5, 4), (0, 0, 0), height=2.2)),
    "eye at the surface": lambda: seen(body(BALL), camera=tl.Camera.look_at((0, 0, 1.0001), (0, 0.2, 0), fov_y=60)),
    "checkerboard": lambda: seen(body(BALL), environment=tl.Environment.checkerboard()),
}


@pytest.mark.parametrize("name", ONE)
def test_one_body_is_that_of_the_reference(thorough: tl.Renderer, name: str) -> None:
    off = differences(thorough, ONE[name]())
    print(f"{name}: median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) < 2e-4
    assert np.quantile(off, 0.8 if name in {"knot", "squeezed torus"} else 0.9) < 3e-3


@pytest.mark.parametrize("name", [name for name in TEXTURED if "rough" not in name])
def test_textures_at_all_hits_are_those_of_the_reference(thorough: tl.Renderer, name: str) -> None:
    off = differences(thorough, TEXTURED[name])
    print(f"{name}: median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) < 2e-4
    assert np.quantile(off, 0.9) < 3e-3


def test_what_only_the_picture_has_stays_in_it(renderer: tl.Renderer) -> None:
    """Objects with holes, normal maps or occlusion show through glass as the picture has them."""
    scene = TEXTURED["painted pane before a painted cube"]
    pane, cube = scene.objects
    assert cube.surface is not None
    occluded = dataclasses.replace(cube.surface, occlusion_texture=tl.Texture(np.zeros((1, 1, 3))))
    dark = dataclasses.replace(scene, objects=(pane, dataclasses.replace(cube, surface=occluded)))
    bright, less = (renderer.render(one, SIZE, samples=1, interfaces=DEEP).radiance for one in (scene, dark))
    assert (bright - less).max() > 0.1


def test_absorption_of_a_thin_slab_misses_nothing_at_its_surfaces(thorough: tl.Renderer) -> None:
    """The offset of a ray from the surface that it left is 1 % of this slab."""
    slab = body(Box.slab(thickness=1e-4).tessellate(), tl.Medium(absorption=1e4, ior=1.5))
    assert differences(thorough, seen(slab)).max() < 1e-5


SEVERAL: dict[str, Callable[[], tl.Scene]] = {
    "nested": lambda: seen(body(BALL), body(CORE, RED)),
    "overlap, one highest": lambda: seen(body(BALL, priority=1), body(BALL, RED, 0.8, 0.2, 0.3)),
    "overlap, equal": lambda: seen(body(BALL), body(BALL, RED, 0.8, 0.2, 0.3)),
    "side by side": lambda: spread(3),
    "touching": lambda: seen(
        body(Box((-1, -1, -1), (0, 1, 1)).tessellate()), body(Box((0, -1, -1), (1, 1, 1)).tessellate(), RED)
    ),
    "three in one place": lambda: seen(
        body(BOX), body(BOX, RED, priority=2), body(BOX, tl.Medium(absorption=0.3, ior=1.2), priority=1)
    ),
    "panes before and behind": lambda: seen(
        body(BALL),
        body(PANE, tl.Medium(absorption=100.0, ior=1.4), 0, 0, 1.5, sheet_thickness=1e-3),
        body(PANE, tl.Medium(absorption=100.0, ior=1.4), 0, 0, -1.5, sheet_thickness=1e-3),
    ),
    "union": lambda: seen(body(BALL), body(BALL, GLASS, 0.8, 0.2, 0.3), overlap="union"),
    "wine in a glass": goblet,
}


@pytest.mark.parametrize("name", SEVERAL)
def test_several_bodies_are_those_of_the_reference(thorough: tl.Renderer, name: str) -> None:
    off = differences(thorough, SEVERAL[name]())
    print(f"{name}: median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) < 2e-4
    assert np.quantile(off, 0.9) < 3e-3


# Before the first interface, and with the eye inside


FROM_THE_EYE: dict[str, Callable[[], tl.Scene]] = {
    "inside one": lambda: seen(body(BALL, EMITS), camera=INSIDE),
    "inside two": lambda: seen(body(BALL, EMITS), body(CORE, RED), camera=INSIDE),
    "inside two, the inner one first": lambda: seen(body(CORE, RED), body(BALL, EMITS), camera=INSIDE),
    "inside two, the outer one highest": lambda: seen(body(CORE, RED), body(BALL, EMITS, priority=1), camera=INSIDE),
    "inside two that overlap": lambda: seen(body(BALL, EMITS), body(BALL, RED, 0.6, 0.2, 0.3), camera=INSIDE),
    "inside, before another": lambda: seen(
        body(BALL, EMITS), body(BALL, RED, 0, 0, -3, surface=tl.Surface(color=(0.9, 0.2, 0.2))), camera=INSIDE
    ),
    "tinted air around": lambda: seen(body(CORE, EMITS), body(BALL, TINT)),
    "tinted air before": lambda: seen(body(BALL, EMITS), body(CORE, TINT, 0.7, 0.7, 2.0)),
    "tinted air inside": lambda: seen(body(BALL, EMITS), body(CORE, TINT)),
    "a film before": lambda: seen(body(BALL), body(PANE, FILM, 0, 0, 1.5, by=0.3, sheet_thickness=1e-3)),
    "a film inside": lambda: seen(body(BALL), body(PANE, GLOWING_FILM, 0, 0, 0.1, by=0.3, sheet_thickness=1e-3)),
    "a film behind": lambda: seen(body(BALL), body(PANE, FILM, 0, 0, -1.5, by=0.2, sheet_thickness=1e-3)),
    "a pane that glows": lambda: seen(
        body(BALL),
        body(PANE, dataclasses.replace(GLOWING_FILM, ior=1.4), 0, 0, 1.5, sheet_thickness=1e-3),
        body(CORE, TINT),
    ),
}


@pytest.mark.parametrize("name", FROM_THE_EYE)
def test_what_lies_before_the_first_interface_is_that_of_the_reference(thorough: tl.Renderer, name: str) -> None:
    off = differences(thorough, FROM_THE_EYE[name]())
    print(f"{name}: median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) < 1e-3 if "inside two" in name else 2e-4
    assert np.quantile(off, 0.9) < 3e-3


def test_an_eye_on_a_surface_is_outside_of_it_or_inside_as_each_ray_goes(thorough: tl.Renderer) -> None:
    """A surface where the eye is counts as behind it: outwards nothing is met, inwards the far side alone."""
    for target, medium, off in (((0.0, 0.0, 0.0), GLASS, 0.04), (3.0 * ON_BALL, tl.Medium(), 1e-5)):
        camera = tl.Camera.look_at(ON_BALL, target, fov_y=60)
        frame = thorough.render(seen(body(BALL), camera=camera), SIZE, samples=1, interfaces=DEEP)
        truth = references.render(seen(body(BALL, medium), camera=camera), SIZE, bounces=20)
        assert frame.valid.all()
        assert np.median(np.abs(frame.radiance - truth.radiance)) < off  # the reference mirrors 4 % where the eye is


PAINT = {"color": (0.8, 0.3, 0.1)}
OPAQUE: dict[str, Callable[[], tl.Scene]] = {
    "inside": lambda: seen(body(BALL), body(BOX, None, by=0.3 * TURN, **PAINT)),
    "behind": lambda: seen(body(BALL), body(BOX, None, 0, 0, -3.2, by=(4, 4, 1), **PAINT)),
    "mirrored, outside of the picture": lambda: seen(body(BALL), body(BOX, None, 0, 0, 7, by=(4, 4, 1), **PAINT)),
    "before": lambda: seen(body(BALL), body(BOX, None, 0.7, 0.7, 2, by=0.2, **PAINT)),
}


@pytest.mark.parametrize("name", OPAQUE)
def test_opaque_objects_are_seen_through_glass_and_mirrored_by_it(thorough: tl.Renderer, name: str) -> None:
    off = differences(thorough, OPAQUE[name]())
    print(f"{name}: median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) < 1e-4
    assert np.quantile(off, 0.9) < 3e-3


@pytest.mark.parametrize("glass_first", [True, False])
def test_glass_on_a_table_shows_the_table(thorough: tl.Renderer, glass_first: bool) -> None:
    """No light gets between surfaces that coincide: of a white world above a black table one sees the mirror image."""
    table = body(Box((-4, -1.5, -4), (4, -1, 4)).tessellate(), None, color=(0.0, 0.0, 0.0))
    glass = body(BOX, tl.Medium(ior=1.5))
    camera = tl.Camera.look_at((0.1, 6, 0.2), (0, 0, 0), up=(0, 0, 1), fov_y=10)
    objects = (glass, table) if glass_first else (table, glass)
    frame = thorough.render(seen(*objects, camera=camera, environment=WHITE), SIZE, samples=1, interfaces=DEEP)
    assert frame.valid.all()
    np.testing.assert_allclose(frame.radiance, 0.04, atol=1e-3)


def test_a_label_on_a_box_dims_it(thorough: tl.Renderer) -> None:
    """A sheet that lies on the face of a solid: its record stays right, and what passes is dimmed once."""
    box, depth = body(BOX, tl.Medium(ior=1.5)), 0.7
    label = body(PANE, tl.Medium(absorption=1e3 * depth, ior=1.2), 0, 0, 1, by=0.4, sheet_thickness=1e-3)
    for camera in [tl.Camera.orthographic((0, 0, side), (0, 0, 0), height=0.5) for side in (3.0, -3.0)]:
        frame = thorough.render(seen(box, label, camera=camera, environment=WHITE), SIZE, samples=1, interfaces=DEEP)
        assert frame.valid.all()
        reflected, passed = 0.04, np.exp(-depth)
        least, most = (1 - reflected) ** 2 * passed, (1 - reflected) ** 2 * passed + 3 * reflected
        assert (frame.radiance > least).all()
        assert (frame.radiance < most).all()


def test_colors_bend_by_their_own_index(thorough: tl.Renderer) -> None:
    ball = body(BALL, tl.Medium(absorption=0.2, ior=1.7), surface=tl.Surface(dispersion=2.0))
    off = differences(thorough, seen(ball))
    assert np.quantile(off, 0.95) < 1e-3


def test_lights_and_what_is_seen_are_looked_up_apart(thorough: tl.Renderer) -> None:
    lights = tl.Environment.gradient((0.1, 0.4, 0.1), (0.9, 0.2, 0.6))
    apart = lights.with_background(SKY)
    assert np.quantile(differences(thorough, seen(body(BALL), environment=apart)), 0.95) < 1e-3


def test_light_scattered_once_is_added_as_in_screen_space(thorough: tl.Renderer) -> None:
    """Both have the same straight rays as nothing bends."""
    fog = tl.Medium(absorption=0.3, scattering=0.5, ior=1.0001)
    scene = seen(body(BALL, fog), lights=[tl.PointLight((3, 5, 2), (20, 20, 20))])
    traced, screen = (
        thorough.render(scene, SIZE, samples=1, interfaces=way).radiance for way in (DEEP, tl.ScreenInterfaces())
    )
    np.testing.assert_allclose(traced, screen, rtol=5e-3)  # mirror images of 1e-9 at most, silhouettes


# Truth, by full light transport


@pytest.mark.parametrize(("name", "most"), [("sphere_glass", 0.03), ("goblet_wine", 0.13)])
def test_pictures_are_those_of_full_light_transport(
    transport: ModuleType, renderer: tl.Renderer, name: str, most: float
) -> None:
    """Bars of 16 samples are .02 and .10; four leave some more aliasing."""
    scene, size = transport.make(name)
    frame = renderer.render(scene, (size, size), samples=4)
    assert isinstance(frame.plan.interfaces, tl.TracedInterfaces)
    found = transport.errors(frame.radiance, transport.load(name))
    print(f"{name}: {found}")
    assert found["nrmse"] < most
    assert np.abs(found["bias"]).max() < 0.02


# Energy: a lossless body vanishes where all is equally bright


CLEAR = tl.Medium(ior=1.5)
LOSSLESS: dict[str, Callable[[], tl.Scene]] = {
    "sphere": lambda: seen(body(BALL, CLEAR), environment=WHITE),
    "from inside": lambda: seen(body(BALL, CLEAR), camera=INSIDE, environment=WHITE),
    "knot": lambda: tl.showcase(tl.load_mesh(mesh_path("knot")), CLEAR, SIZE, environment=WHITE),
    "nested": lambda: seen(body(BALL, CLEAR), body(CORE, tl.Medium(ior=1.33)), environment=WHITE),
}


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_bodies_vanish_in_a_white_furnace(thorough: tl.Renderer, name: str) -> None:
    frame = thorough.render(LOSSLESS[name](), SIZE, samples=1, interfaces=tl.TracedInterfaces(64, 4))
    assert frame.valid.all()
    np.testing.assert_allclose(frame.radiance, 1.0, atol=1e-5)


def test_rays_that_run_out_of_steps_are_not_lost(renderer: tl.Renderer) -> None:
    """Clear wine in a glass: a tree of 64 interfaces."""
    frame = renderer.render(goblet(WHITE, 0.0), SIZE, samples=1, interfaces=tl.TracedInterfaces(64, 4))
    assert frame.valid.all()
    np.testing.assert_allclose(frame.radiance, 1.0, atol=1e-5)


def test_trees_that_a_driver_cuts_short_are_marked(thorough: tl.Renderer) -> None:
    """Mesa ends all loops of a shader after 65,535 turns; what is called valid has lost nothing."""
    frame = leniently(thorough, goblet(WHITE, 0.0), interfaces=tl.TracedInterfaces(64, 4))
    assert frame.valid.mean() > 0.98
    np.testing.assert_allclose(frame.radiance[frame.valid], 1.0, atol=1e-5)


# Validity


def test_rays_that_end_in_an_open_body_are_marked(thorough: tl.Renderer) -> None:
    """Marks are where more than 0.5 % of the light went through the hole; all else differs little from the closed
    ball, but for normals at the rim."""
    torn = tl.Mesh(BALL.vertices, np.delete(BALL.faces, slice(300, 320), axis=0), name="torn")
    open_one, closed = (leniently(thorough, seen(body(mesh)), (48, 40)) for mesh in (torn, BALL))
    assert 100 < (~open_one.valid).sum() < 1000
    off = np.abs(open_one.radiance - closed.radiance).max(axis=2)[open_one.valid]
    assert np.quantile(off, 0.95) < 2e-2


def test_more_bodies_than_a_record_holds_are_marked(thorough: tl.Renderer) -> None:
    def nest(count: int) -> tl.Scene:
        balls = (Sphere(radius=1 - 0.04 * i).tessellate(16) for i in range(count))
        return seen(*(body(ball, tl.Medium(absorption=0.1, ior=1.2 + 0.03 * i)) for i, ball in enumerate(balls)))

    eight, nine = (leniently(thorough, nest(count), interfaces=tl.TracedInterfaces(12, 4)) for count in (8, 9))
    assert eight.valid.all()
    assert not nine.valid[10, 12]
    assert nine.valid[~nine.coverage].all()


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1)])
def test_frames_of_one_pixel(thorough: tl.Renderer, size: tuple[int, int]) -> None:
    scene = seen(body(BALL))
    frame, truth = thorough.render(scene, size, interfaces=DEEP), references.render(scene, size, bounces=20)
    np.testing.assert_allclose(frame.radiance, truth.radiance, atol=1e-2)


def test_triangles_without_an_area_change_nothing(thorough: tl.Renderer) -> None:
    faces = np.concatenate([BALL.faces, [(0, 0, 1), (5, 5, 5), (0, 1, 0)]])
    assert np.quantile(differences(thorough, seen(body(tl.Mesh(BALL.vertices, faces)))), 0.95) < 1e-3


def test_paths_that_end_in_a_body_see_no_image_of_a_light(renderer: tl.Renderer) -> None:
    """Straight on through a box stands a small bright light: rays see it behind two interfaces, and not behind one."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[30:34, 62:66] = 100.0
    box = Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)).tessellate()
    environment = tl.Environment.image(pixels)
    towards = next(axis for axis in (*np.eye(3), *-np.eye(3)) if environment.lighting(axis[None]).max() > 50.0)
    camera = tl.Camera.look_at(-4.0 * towards, (0, 0, 0), fov_y=5.0)
    scene = seen(body(box, tl.Medium(ior=1.5)), camera=camera, environment=environment)
    with tl.Renderer(backend="cpu") as cpu:
        for one in (renderer, cpu):
            cut, whole = (one.render(scene, (8, 8), samples=1, interfaces=tl.TracedInterfaces(n, 0)) for n in (1, 2))
            assert whole.radiance[3:5, 3:5].min() > 50.0
            # The light fills 0.02 of its hemisphere.
            assert 0.5 < cut.radiance[3:5, 3:5].mean() < 8.0


# The plan


def test_the_plan_says_which_interfaces_are_traced_and_how_far() -> None:
    plan = tl.plan(seen(body(BALL)))
    assert plan.interfaces == tl.TracedInterfaces(depth=24, forks=2)
    (step,) = (step for step in plan.passes if step.name == "traced_interfaces")
    assert "at most 24 interfaces" in step.reason
    assert "'sphere'" in str(plan)


def test_scenes_without_interfaces_trace_nothing() -> None:
    straight = tl.plan(seen(body(BALL, TINT)))
    assert "traced_interfaces" not in {step.name for step in straight.passes}


def test_a_method_that_makes_sheets_traces_sheets(thorough: tl.Renderer) -> None:
    """Nothing is left of the solid, its inside neither."""
    scene = seen(body(BALL), environment=WHITE)
    frame = thorough.render(scene, SIZE, tl.ThinLayer(1e-3), interfaces=DEEP, samples=1)
    assert frame.valid.all()
    assert frame.radiance.min() > 0.98  # a ball of glass absorbs half of the light


def test_the_environment_is_averaged_over_the_footprints_of_pixels(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    glass = tl.Object(tl.load_mesh(mesh_path("knot")), tl.Medium(absorption=(2.0, 1.0, 1.5), ior=1.5))
    scene = tl.Scene([glass], framing([glass], (48, 36)), environment=tl.Environment.studio())
    averaged = renderer.render(scene, (48, 36), samples=1, interfaces=tl.TracedInterfaces())
    monkeypatch.setattr(traced_interfaces, "FOOTPRINT_STEP", 0.0)
    plain, truth = (
        renderer.render(scene, (48, 36), samples=n, interfaces=tl.TracedInterfaces()).radiance for n in (1, 36)
    )
    inside = averaged.coverage
    errors = [np.sqrt(np.mean((found - truth)[inside] ** 2)) for found in (averaged.radiance, plain)]
    assert errors[0] < 0.8 * errors[1]
    assert averaged.radiance[inside].mean() == pytest.approx(truth[inside].mean(), rel=0.01)
