"""Interfaces of bodies on the GPU: energy, closed forms, and that they cost nothing where nothing happens at them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests import references
from translucent.assets import mesh_path
from translucent.formulas import interface, optics
from translucent.geometry.solids import Box, Sphere

Array = npt.NDArray[np.float64]

SIZE = (160, 120)
WHITE = tl.Environment.constant((1.0, 1.0, 1.0))
SKY = tl.Environment.gradient((0.2, 0.3, 0.4), (1.4, 1.2, 1.0))
BALL = Sphere().tessellate(300)
LAYER = tl.ScatteringLayer()  # loses nothing, whatever the shape


def shown(mesh: tl.Mesh, medium: tl.Medium, environment: tl.Environment, **options: Any) -> tl.Scene:
    scene = tl.showcase(mesh, medium, SIZE, environment=environment)
    return dataclasses.replace(scene, objects=[dataclasses.replace(scene.objects[0], **options)])


# Energy: a body that takes nothing looks like nothing where all is equally bright


LOSSLESS = {
    "glass": (tl.Medium(ior=1.5), tl.Surface()),
    "diamond": (tl.Medium(ior=2.4), tl.Surface(dispersion=1.0)),
    "frosted": (tl.Medium(ior=1.5), tl.Surface(roughness=0.5)),
    "matt": (tl.Medium(ior=1.5), tl.Surface(roughness=1.0)),
    "painted": (tl.Medium(ior=1.5), tl.Surface(transmission=0.4, diffuse_transmission=0.3)),
    "milk": (tl.Medium(scattering=40.0, ior=1.33), tl.Surface()),
    "fog": (tl.Medium(scattering=3.0), tl.Surface()),
}


@pytest.mark.parametrize("mesh", ["sphere", "knot"])
@pytest.mark.parametrize("kind", LOSSLESS)
def test_white_furnace(renderer: tl.Renderer, kind: str, mesh: str) -> None:
    medium, surface = LOSSLESS[kind]
    scene = shown(tl.load_mesh(mesh_path(mesh)), medium, WHITE, surface=surface)
    frame = renderer.render(scene, SIZE, scattering=LAYER)
    assert frame.coverage.sum() > 1000
    np.testing.assert_allclose(frame.radiance, 1.0, atol=1e-5)


def test_white_furnace_of_a_sheet_and_from_inside(renderer: tl.Renderer) -> None:
    sheet = shown(BALL, tl.Medium(ior=1.5), WHITE, sheet_thickness=1e-3)
    np.testing.assert_allclose(renderer.render(sheet, SIZE).radiance, 1.0, atol=1e-5)
    inside = tl.Scene(
        [tl.Object(BALL, tl.Medium(ior=1.5))], tl.Camera.look_at((0, 0, 0.3), (0, 0, -1)), environment=WHITE
    )
    np.testing.assert_allclose(renderer.render(inside, SIZE).radiance, 1.0, atol=1e-5)


@pytest.mark.parametrize("method", [tl.SignedDepth(), tl.BackFaceDepth(), tl.DepthPeeling(), tl.FragmentLists()])
def test_rays_of_an_orthographic_picture_that_cuts_a_body_bend_where_they_leave(
    renderer: tl.Renderer, method: tl.Method
) -> None:
    pose = np.eye(4)
    pose[2, 3] = 0.2
    camera = tl.Camera(pose, None, 0.8)  # as far as interfaces mirror little inside
    scene = tl.Scene([tl.Object(BALL, tl.Medium(ior=1.5))], camera, environment=tl.Environment.studio())
    frame, truth = renderer.render(scene, (24, 24), method), references.render(scene, (24, 24), bounces=4)
    assert frame.coverage.all()
    off = np.abs(frame.radiance - truth.radiance).max(axis=2)
    assert np.median(off) < 0.01  # 0.02 if they went straight


@pytest.mark.parametrize("kind", LOSSLESS)
def test_white_furnace_of_one_interface(renderer: tl.Renderer, kind: str) -> None:
    medium, surface = LOSSLESS[kind]
    scene = shown(tl.load_mesh(mesh_path("knot")), medium, WHITE, surface=surface)
    frame = renderer.render(scene, SIZE, interfaces=tl.FrontInterface(), scattering=LAYER)
    assert frame.coverage.sum() > 1000
    np.testing.assert_allclose(frame.radiance, 1.0, atol=1e-5)


# Closed forms


def rays(camera: tl.Camera) -> Array:
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    half_width, half_height = camera.half_extent(SIZE)
    ndc = 2 * x / SIZE[0] - 1, 1 - 2 * y / SIZE[1]
    ray = camera.forward + ndc[0][..., None] * camera.right * half_width + ndc[1][..., None] * camera.up * half_height
    return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))


def ball_radiance(scene: tl.Scene, sigma: Array, ior: float, inner: int) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Radiance of a ball of radius 1 with the first `inner` reflections inside; the rest is seen where it is mirrored.

    All interfaces on a ray are met at one angle. What is mirrored one last time is absorbed on one more chord.
    """
    eye, ray = scene.camera.eye, rays(scene.camera)
    along = -ray @ eye
    closest = eye + along[..., None] * ray
    gap = np.linalg.norm(closest, axis=-1)
    hit = gap < 0.97
    point = closest - np.sqrt(np.where(hit, 1 - gap**2, 1.0))[..., None] * ray
    normal = point / np.linalg.norm(point, axis=-1, keepdims=True)
    cosine = -np.sum(ray * normal, axis=-1)
    share = optics.fresnel_dielectric(cosine, ior)[..., None]
    into = interface.refracted_direction(ray, normal, ior)
    path = -2 * np.sum(into * normal, axis=-1, keepdims=True)
    passed = np.exp(-sigma * path)

    def light(direction: Array) -> Array:
        return scene.environment.radiance(direction, np.zeros((*direction.shape[:-1], 2)))

    radiance = share * light(interface.reflected_direction(ray, normal))
    carried = 1 - share
    for _ in range(inner + 1):
        carried = carried * passed
        point = point + path * into
        radiance = radiance + carried * (1 - share) * light(interface.refracted_direction(into, -point, 1 / ior))
        carried = carried * share
        into = interface.reflected_direction(into, -point)
    return radiance + carried * passed * light(into), hit


@pytest.mark.parametrize("ior", [1.01, 1.33, 1.5, 2.4])
@pytest.mark.parametrize("far", [1.0, 1e3])
@pytest.mark.parametrize(
    ("interfaces", "inner", "median", "most"),
    [(tl.ScreenInterfaces(), 0, 2e-3, 2e-2), (tl.TracedInterfaces(16, 4), 4, 2e-4, 2e-3)],
    ids=["screen", "traced"],
)
def test_a_ball_bends_light_as_its_closed_form(
    renderer: tl.Renderer,
    ior: float,
    far: float,
    interfaces: tl.ScreenInterfaces | tl.TracedInterfaces,
    inner: int,
    median: float,
    most: float,
) -> None:
    """The tessellated ball's normals are off by some 1e-4; in screen space they are looked up at whole pixels."""
    sigma = np.array((0.5, 0.1, 0.9))
    camera = tl.Camera.look_at(np.array((2.0, 1.5, 4.0)) * far, (0, 0, 0), fov_y=30.0 if far == 1 else 30 / far)
    scene = tl.Scene([tl.Object(BALL, tl.Medium(absorption=sigma, ior=ior))], camera, environment=SKY)
    frame = renderer.render(scene, SIZE, interfaces=interfaces)
    expected, hit = ball_radiance(scene, sigma, ior, inner)
    error = np.abs(frame.radiance - expected)[hit]
    print(f"ior {ior}, {far:g}: median {np.median(error):.1e}, p99 {np.quantile(error, 0.99):.1e}")
    assert hit.sum() > 3000
    assert np.median(error) < median
    assert np.quantile(error, 0.99) < most


def test_a_pane_shifts_light_and_does_not_turn_it(renderer: tl.Renderer) -> None:
    """Through parallel faces a ray leaves as it came; its path inside is d / cos of the refracted angle."""
    sigma, ior = 2.0, 1.5
    pane = tl.Object(Box((-4.0, -4.0, -0.2), (4.0, 4.0, 0.2)).tessellate(), tl.Medium(absorption=sigma, ior=ior))
    camera = tl.Camera.look_at((2.0, 0.0, 3.0), (0, 0, 0), fov_y=10)
    scene = tl.Scene([pane], camera, environment=SKY)
    frame = renderer.render(scene, SIZE)
    ray = rays(camera)
    cosine = -ray[..., 2]
    share = optics.fresnel_dielectric(cosine, ior)[..., None]
    path = 0.4 / optics.refracted_cosine(cosine, ior)[..., None]
    mirrored = ray * (1, 1, -1)
    sky, back = (SKY.radiance(direction, np.zeros((*ray.shape[:2], 2))) for direction in (ray, mirrored))
    passed = np.exp(-sigma * path)
    expected = share * back + (1 - share) * passed * ((1 - share) * sky + share * passed * back)
    np.testing.assert_allclose(frame.radiance, expected, rtol=1e-3)


@pytest.mark.parametrize("ior", [1.2, 1.5, 2.4])
def test_a_pane_with_one_interface_turns_light_once(renderer: tl.Renderer, ior: float) -> None:
    """The ray goes on as it goes inside, and its path is that of the straight one: d / cos of the angle outside."""
    sigma = 2.0
    pane = tl.Object(Box((-4.0, -4.0, -0.2), (4.0, 4.0, 0.2)).tessellate(), tl.Medium(absorption=sigma, ior=ior))
    camera = tl.Camera.look_at((2.0, 1.0, 3.0), (0, 0, 0), fov_y=10)
    scene = tl.Scene([pane], camera, environment=SKY)
    frame = renderer.render(scene, SIZE, interfaces=tl.FrontInterface())
    ray = rays(camera)
    cosine = -ray[..., 2]
    share = optics.fresnel_dielectric(cosine, ior)[..., None]
    into = interface.refracted_direction(ray, np.broadcast_to((0.0, 0.0, 1.0), ray.shape), ior)
    nowhere = np.zeros((*ray.shape[:2], 2))
    passed = np.exp(-sigma * 0.4 / cosine[..., None])
    mirrored = SKY.radiance(ray * (1, 1, -1), nowhere)
    expected = share * mirrored + (1 - share) * passed * SKY.radiance(into, nowhere)
    np.testing.assert_allclose(frame.radiance, expected, rtol=2e-5)  # some float32 roundings
    np.testing.assert_allclose(frame.transmittance, np.broadcast_to(passed, (*passed.shape[:2], 3)), rtol=2e-5)


def test_one_interface_without_a_step_in_index_is_not_there(renderer: tl.Renderer) -> None:
    """Rays through a tinted ball go straight, to what is behind and to what is inside."""
    color, medium = (1.0, 0.5, 0.25), tl.Medium(absorption=(0.5, 0.1, 0.9))
    camera = tl.Camera.look_at((2.0, 1.5, 4.0), (0, 0, 0), fov_y=30.0)
    wall = tl.Object(Box((-9.0, -9.0, -3.2), (9.0, 9.0, -3.0)).tessellate(), color=(0.8, 0.3, 0.1))
    core = tl.Object(Sphere(radius=0.4).tessellate(60), color=(0.1, 0.6, 0.3))
    for opaque in ([], [wall], [wall, core]):
        plain = tl.Scene([tl.Object(BALL, medium), *opaque], camera, environment=SKY)
        tinted = tl.Scene([tl.Object(BALL, medium, surface=tl.Surface(color=color)), *opaque], camera, environment=SKY)
        straight = renderer.render(plain, SIZE)
        found = renderer.render(tinted, SIZE, interfaces=tl.FrontInterface()).radiance[straight.coverage]
        error = np.abs(found / (straight.radiance[straight.coverage] * color) - 1).max(axis=-1)
        assert error.size > 3000
        # Opaque surfaces are found at whole pixels: all is well but for the edge of the core.
        assert np.quantile(error, 0.97 if core in opaque else 1.0) < 1e-4


def test_one_interface_leaves_out_the_draw_of_the_other(renderer: tl.Renderer) -> None:
    scene = shown(BALL, tl.Medium(absorption=1.0, ior=1.5), SKY)
    on_screen = tl.ScreenInterfaces()
    both, front = (renderer.render(scene, SIZE, interfaces=one) for one in (on_screen, tl.FrontInterface()))
    assert both.plan.geometry_passes == front.plan.geometry_passes + 1
    assert (both.plan.interfaces, front.plan.interfaces) == (on_screen, tl.FrontInterface())
    for name in ("thickness", "optical_depth", "transmittance", "coverage", "valid", "normals"):
        np.testing.assert_array_equal(getattr(both, name), getattr(front, name))
    assert np.abs(both.radiance - front.radiance).max() > 0.1
    # What has been drawn with one interface leaves nothing behind.
    np.testing.assert_array_equal(renderer.render(scene, SIZE, interfaces=on_screen).radiance, both.radiance)
    # Averages and frames with alpha have it, too.
    averaged = renderer.render(scene, SIZE, samples=2, transparent=True, interfaces=tl.FrontInterface())
    assert averaged.plan == front.plan
    assert averaged.alpha is not None


def test_what_passes_paint_is_not_reflected_whatever_its_color(renderer: tl.Renderer) -> None:
    """KHR_materials_diffuse_transmission mixes with the factor; the color tints what passes."""
    color, tint = np.array([0.9, 0.6, 0.3]), np.array([0.5, 0.25, 0.1])
    paint = tl.Surface(color=color, transmission=0.0, diffuse_transmission=0.7, diffuse_transmission_color=tint)
    pane = tl.Object(Box((-4.0, -4.0, -0.2), (4.0, 4.0, 0.2)).tessellate(), tl.Medium(absorption=2.0), surface=paint)
    front, behind = tl.DirectionalLight((0, 0, -1), (3, 3, 3)), tl.DirectionalLight((0, 0, 1), (2, 2, 2))
    black = tl.Environment.constant((0.0, 0.0, 0.0))
    scene = tl.Scene([pane], tl.Camera.look_at((1, 0, 3), (0, 0, 0), fov_y=10), [front, behind], black)
    expected = (0.3 * color * 3 + 0.7 * tint * 2) / np.pi
    np.testing.assert_allclose(renderer.render(scene, SIZE).radiance, np.tile(expected, (*SIZE[::-1], 1)), rtol=1e-5)


@pytest.mark.parametrize("size", [48, 96, 200])
@pytest.mark.parametrize("angle", [20.0, 80.0])
def test_a_ball_mirrors_a_light_whole_however_few_pixels_show_it(
    renderer: tl.Renderer, angle: float, size: int
) -> None:
    """A mirroring sphere scatters alike to all sides: its intensity is F E R^2 / 4, F that of half the angle."""
    towards = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    light = tl.DirectionalLight(-towards, (3, 3, 3))
    camera = tl.Camera.orthographic((0.013, 0.007, 5), (0.013, 0.007, 0), height=2.4)
    black = tl.Environment.constant((0.0, 0.0, 0.0))
    scene = tl.Scene([tl.Object(BALL, tl.Medium(absorption=1.0, ior=1.5))], camera, [light], black)
    intensity = renderer.render(scene, (size, size)).radiance[..., 0].sum() * (2.4 / size) ** 2
    expected = optics.fresnel_dielectric(np.cos(np.radians(angle / 2)), 1.5) * 3 / 4
    # The filter is about a pixel wide: that it is met at pixel centers only is an error of up to a tenth.
    assert intensity == pytest.approx(expected, rel=0.15)


def test_straight_quantities_do_not_bend(renderer: tl.Renderer) -> None:
    """Thickness, optical depth and transmittance stay those of the view ray."""
    straight = renderer.render(shown(BALL, tl.Medium(absorption=1.0), SKY), SIZE)
    bent = renderer.render(shown(BALL, tl.Medium(absorption=1.0, ior=1.5), SKY, surface=tl.Surface(0.3)), SIZE)
    for name in ("coverage", "valid"):
        np.testing.assert_array_equal(getattr(straight, name), getattr(bent, name))
    for name in ("thickness", "optical_depth", "transmittance"):
        # Frames without interfaces hold the thickness alone, and NumPy finds the others: two roundings of a depth up to
        # 2, which are the relative error of the transmittance, and two of its own.
        np.testing.assert_allclose(getattr(straight, name), getattr(bent, name), rtol=6 * np.finfo(np.float32).eps)
    assert np.abs(straight.radiance - bent.radiance).max() > 0.1


# Where bodies touch


def test_wine_in_a_glass_is_left_at_the_outside_of_the_glass(renderer: tl.Renderer) -> None:
    """With the same index on both sides their common interface is not there: a ball in a shell is one ball."""
    outer, inner = Sphere(radius=1.0).tessellate(200), Sphere(radius=0.6).tessellate(200)
    shell = tl.Mesh(
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    glass = tl.Medium(absorption=0.3, ior=1.5)
    camera = tl.showcase(outer, glass, SIZE, stage="none").camera
    nested = tl.Scene([tl.Object(shell, glass), tl.Object(inner, glass)], camera, environment=SKY)
    whole = tl.Scene([tl.Object(outer, glass)], camera, environment=SKY)
    plan = renderer.plan(nested)
    if not plan.ordered:
        pytest.skip("needs ordered intervals")
    error = np.abs(renderer.render(nested, SIZE).radiance - renderer.render(whole, SIZE).radiance)
    assert np.quantile(error, 0.99) < 5e-3


# Model only what a scene needs


def test_matched_interfaces_add_no_pass() -> None:
    scene = shown(BALL, tl.Medium(absorption=1.0), SKY, surface=tl.Surface(roughness=0.7))
    assert tl.plan(scene).passes == tl.plan(shown(BALL, tl.Medium(absorption=1.0), SKY)).passes
    bending = shown(BALL, tl.Medium(ior=1.2), SKY)
    for interfaces, name in ((None, "traced_interfaces"), (tl.ScreenInterfaces(), "surfaces")):
        assert not {"interfaces", name} & {step.name for step in tl.plan(scene, interfaces=interfaces).passes}
        assert {"interfaces", name} <= {step.name for step in tl.plan(bending, interfaces=interfaces).passes}


def test_normals_are_those_of_the_interfaces(renderer: tl.Renderer) -> None:
    scene = shown(BALL, tl.Medium(ior=1.5), SKY)
    frame = renderer.render(scene, SIZE)
    assert frame.normals is not None
    hit = frame.normals.any(axis=-1)
    assert abs(int(hit.sum()) - int(frame.coverage.sum())) < 50
    np.testing.assert_allclose(np.linalg.norm(frame.normals[hit], axis=-1), 1.0, atol=1e-5)
    ray = rays(scene.camera)
    assert (np.sum(frame.normals * ray, axis=-1)[hit] < 0).all()
    # A ball around the origin: the normal is the position, up to the angle of a facet.
    eye = scene.camera.eye
    along = -ray @ eye - np.sqrt(np.maximum((ray @ eye) ** 2 - eye @ eye + 1, 0.0))
    position = eye + along[..., None] * ray
    inner = hit & (np.linalg.norm(np.cross(ray, eye), axis=-1) < 0.9)
    np.testing.assert_allclose(frame.normals[inner], position[inner], atol=5e-3)
    assert renderer.render(shown(BALL, tl.Medium(absorption=1.0), SKY), SIZE).normals is None


def test_pictures_of_normals_and_error(renderer: tl.Renderer, tmp_path: Any) -> None:
    scene = shown(BALL, tl.Medium(absorption=1.0, ior=1.5), SKY)
    frame, truth = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE, refraction=False)
    names = {path.name for path in frame.save_aovs(tmp_path, truth)}
    assert names == {"thickness.png", "transmittance.png", "validity.png", "normals.png", "error.png"}
    with pytest.raises(tl.InputError, match="truth of a frame; the truth has 8x8 pixels, and the frame has 160x120"):
        frame.save_aovs(tmp_path, tl.reference.render(scene, (8, 8), refraction=False))
