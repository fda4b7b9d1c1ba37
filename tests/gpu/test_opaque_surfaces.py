"""Opaque objects with surfaces: energy, closed forms of metal, paint and glints, textures, holes and normal maps."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tools.brdf_quadrature import albedo
from translucent.formulas.interface import ggx_distribution, ggx_visibility
from translucent.formulas.optics import fresnel_dielectric
from translucent.geometry.solids import Box, Sphere
from translucent.scene.environment_map import EnvironmentMap

Array = npt.NDArray[np.float64]

SIZE = (32, 24)
BLACK, WHITE = tl.Environment.constant((0.0, 0.0, 0.0)), tl.Environment.constant((1.0, 1.0, 1.0))
BALL = Sphere().tessellate(100)
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
PLATE = tl.Mesh(CORNERS, [[0, 1, 2], [0, 2, 3]], (CORNERS[:, :2] + 1) / 2)
FRONT = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=1.0)


def at(position: tuple[float, float, float]) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


#: Out of sight: a plan needs a medium.
HIDDEN = tl.Object(BALL, tl.Medium(absorption=1.0), at((0, 50, 0)))


def picture(renderer: tl.Renderer, *objects: tl.Object, camera: tl.Camera = FRONT, **scene: Any) -> Array:
    frame = renderer.render(tl.Scene([*objects, HIDDEN], camera, **{"environment": BLACK, **scene}), SIZE)
    return np.asarray(frame.radiance, dtype=np.float64)


def plate(surface: tl.Surface | None, mesh: tl.Mesh = PLATE, transform: Any = None) -> tl.Object:
    return tl.Object(mesh, None, transform, surface=surface)


# Energy


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.45, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("passed", [0.0, 0.7])
def test_what_takes_no_light_cannot_be_told_from_white_surroundings(
    renderer: tl.Renderer, roughness: float, metallic: float, passed: float
) -> None:
    surface = tl.Surface(roughness=roughness, metallic=metallic, diffuse_transmission=passed)
    camera = tl.Camera.look_at((0, 0, 6), (0, 0, 0), fov_y=25)
    found = picture(renderer, plate(surface, BALL), camera=camera, environment=WHITE)
    # The filters and the table are normalized; float32 textures and sums leave 1e-5.
    np.testing.assert_allclose(found, 1.0, atol=1e-5)


def test_an_object_without_a_surface_is_drawn_as_ever(renderer: tl.Renderer) -> None:
    plain, shiny = plate(None, BALL), plate(tl.Surface(metallic=1.0), BALL, at((1.2, 0.2, -3)))
    light = [tl.DirectionalLight((-1, -1, -1), (1, 2, 3))]
    sky = tl.Environment.gradient((0.2, 0.2, 0.2), (0.6, 0.7, 1.0))
    camera = tl.Camera.look_at((0, 0, 9), (0, 0, 0), fov_y=25)
    alone = picture(renderer, plain, camera=camera, lights=light, environment=sky)
    both = picture(renderer, shiny, plain, camera=camera, lights=light, environment=sky)
    covered = renderer.render(tl.Scene([plain, HIDDEN], camera), SIZE).radiance[..., 0] < 0.9
    assert covered.sum() > 30
    # To the last bits of a map of shadows, which fits what there is.
    np.testing.assert_allclose(both[covered], alone[covered], rtol=1e-6)
    assert (alone != both).any()


# Closed forms


def test_without_a_step_in_ior_paint_is_lamberts(renderer: tl.Renderer) -> None:
    light = [tl.PointLight((1, 2, 3), (5, 6, 7)), tl.DirectionalLight((-1, 0.5, -1), (1, 1, 2))]
    painted = picture(renderer, plate(tl.Surface(color=(0.8, 0.2, 0.1), ior=1.0)), lights=light, environment=WHITE)
    plain = picture(renderer, tl.Object(PLATE, color=(0.8, 0.2, 0.1)), lights=light, environment=WHITE)
    np.testing.assert_allclose(painted, plain, rtol=1e-5)


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_polished_metal_mirrors_the_environment(renderer: tl.Renderer, rng: np.random.Generator, turn: float) -> None:
    smooth = np.kron(rng.uniform(0.2, 1.0, (4, 8, 3)), np.ones((16, 16, 1)))
    sky = tl.Environment.image(EnvironmentMap(smooth.astype(np.float32)), rotation=35.0, exposure=1.0)
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
    found = picture(renderer, plate(tl.Surface(metallic=1.0), transform=matrix), environment=sky)[12, 16]
    ray, normal = np.array([0.0, 0.0, -1.0]), np.array([s, 0.0, c])
    mirrored = ray - 2 * (ray @ normal) * normal
    np.testing.assert_allclose(found, sky.lighting(mirrored), rtol=1e-4)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_paint_and_glint_of_a_light_are_those_of_gltf(renderer: tl.Renderer, roughness: float, metallic: float) -> None:
    color, towards = np.array([0.9, 0.5, 0.2]), np.array([0.6, 0.0, 0.8])
    surface = tl.Surface(color=color, roughness=roughness, metallic=metallic, ior=1.5)
    camera = tl.Camera.orthographic((-2, 0, 4), (0, 0, 0), height=0.1)
    found = picture(renderer, plate(surface), camera=camera, lights=[tl.DirectionalLight(-towards, (2, 2, 2))])[12, 16]
    eye = np.array([-2, 0, 4]) / np.sqrt(20)
    half = (eye + towards) / np.linalg.norm(eye + towards)
    facing = color if metallic else np.full(3, 0.04)
    single = albedo(eye[2], roughness)
    regained = 1 + facing * (1 / single.sum() - 1)
    fresnel = facing + (1 - facing) * (1 - half @ towards) ** 5
    glint = fresnel * ggx_distribution(half[2], roughness**2) * ggx_visibility(0.8, eye[2], roughness**2) * regained
    entered = (1 - metallic) * (1 - ((facing * single[0] + single[1]) * regained).max())
    # The table is read between its points: 1e-3 of the albedo.
    np.testing.assert_allclose(found, (glint + entered * color / np.pi) * 0.8 * 2, rtol=3e-3)


def test_balls_mirror_as_much_light_at_grazing_angles(renderer: tl.Renderer) -> None:
    """A ball of radius r mirrors r^2 / 4 of the irradiance in each direction, times the reflectance at half the angle.

    Measured .86 to 1.01. A filter in the plane of the surface finds .43 at 160 degrees.
    """
    ratios = []
    black = tl.Object(BALL, tl.Medium(absorption=1e6, ior=1.5))
    metal = tl.Object(BALL, surface=tl.Surface(metallic=1.0))
    for angle in np.radians([90.0, 160.0]):
        eye = 200.0 * np.array([np.sin(angle), 0.0, np.cos(angle)])
        camera = tl.Camera.orthographic(eye, (0, 0, 0), height=2.2)
        for objects, mirrored in (([black], fresnel_dielectric(np.cos(angle / 2), 1.5)), ([metal, HIDDEN], 1.0)):
            scene = tl.Scene(objects, camera, [tl.DirectionalLight((0, 0, -1), 1.0)], BLACK)
            found = renderer.render(scene, (48, 48), samples=16).radiance[..., 0].sum() * (2.2 / 48) ** 2
            ratios.append(4.0 * float(found / mirrored))
    np.testing.assert_allclose(ratios, 1.0, atol=0.15)


@pytest.mark.parametrize("angle", [0.0, 45.0, 80.0])
@pytest.mark.parametrize("opaque", [True, False], ids=["metal", "glass"])
def test_flat_mirrors_show_small_lights_whole(renderer: tl.Renderer, angle: float, opaque: bool) -> None:
    """Light of the mirror image: I / (t + r)^2 at the eye, or in parallel rays I / r^2, and E of the sun.

    Where a filter does not know how view rays turn, 2 samples find .005 to 1.12 of it.
    """
    away, size = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))]), 96
    flat = tl.Mesh(40.0 * CORNERS, PLATE.faces)
    black = tl.Object(Box((-40, -40, -1), (40, 40, 0)).tessellate(), tl.Medium(absorption=1e3, ior=1.5))
    objects = [plate(tl.Surface(metallic=1.0), flat), HIDDEN] if opaque else [black]
    reflectance = 1.0 if opaque else float(fresnel_dielectric(away[2], 1.5))
    seen = tl.Camera.look_at(3.0 * away, (0, 0, 0), up=(0, 1, 0), fov_y=22.0)
    along = tl.Camera.orthographic(3.0 * away, (0, 0, 0), up=(0, 1, 0), height=1.0)
    solid_angle, area = (2.0 * np.tan(np.radians(11.0)) / size) ** 2, 1.0 / size**2
    mirrored = away * (-1.0, 1.0, 1.0)
    point = tl.PointLight(tuple(0.5 * mirrored), 1.0)
    ratios = []
    for camera, light, expected in (
        (seen, tl.DirectionalLight(tuple(-mirrored), 1.0), 1.0 / solid_angle),
        (seen, point, 1.0 / 3.5**2 / solid_angle),
        (seen, tl.SphereLight(point.position, 1.0, 3.5 * np.sqrt(solid_angle)), 1.0 / 3.5**2 / solid_angle),
        (along, point, 1.0 / 0.5**2 * 0.5**2 / area),
    ):
        found = renderer.render(tl.Scene(objects, camera, [light], BLACK), (size, size), samples=2)
        ratios.append(float(found.radiance[..., 0].sum() / (reflectance * expected)))
    print(angle, opaque, ratios)
    np.testing.assert_allclose(ratios, 1.0, atol=0.03)


@pytest.mark.parametrize("angle", [80.0, 86.0])
def test_wide_highlights_on_flat_faces_are_as_they_are_at_a_point(renderer: tl.Renderer, angle: float) -> None:
    """Seen at grazing angles, far from the mirror direction: view rays turn less in a pixel than microfacets differ."""
    eye = 3.0 * np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    towards = np.array([0.3, 0.4, np.sqrt(0.75)])
    flat = plate(tl.Surface(color=(0, 0, 0), roughness=0.5, ior=1.5), tl.Mesh(40.0 * CORNERS, PLATE.faces))
    camera = tl.Camera.look_at(eye, (0, 0, 0), up=(0, 1, 0), fov_y=40.0)
    found = picture(renderer, flat, camera=camera, lights=[tl.DirectionalLight(tuple(-towards), 2.0)])[12, 15, 0]
    away = -camera.rays(SIZE)[1][12, 15]
    half = (away + towards) / np.linalg.norm(away + towards)
    fresnel = (0.04 + 0.96 * (1 - half @ towards) ** 5) * (1 + 0.04 * (1 / albedo(away[2], 0.5).sum() - 1))
    glint = fresnel * ggx_distribution(half[2], 0.25) * ggx_visibility(towards[2], away[2], 0.25) * towards[2] * 2
    np.testing.assert_allclose(found, glint, rtol=3e-3)  # as above


def test_light_from_behind_passes_paint(renderer: tl.Renderer) -> None:
    surface = tl.Surface(diffuse_transmission=0.5, diffuse_transmission_color=(1, 0.5, 0.2), ior=1.0)
    found = picture(renderer, plate(surface), lights=[tl.DirectionalLight((0, 0.6, 0.8), (3, 3, 3))])[12, 16]
    np.testing.assert_allclose(found, np.array([1, 0.5, 0.2]) * 0.5 / np.pi * 3 * 0.8, rtol=1e-5)


def test_what_passes_paint_is_not_reflected_whatever_its_color(renderer: tl.Renderer) -> None:
    """KHR_materials_diffuse_transmission mixes with the factor; the color tints what passes."""
    color, tint = np.array([0.9, 0.6, 0.3]), np.array([0.5, 0.25, 0.1])
    surface = tl.Surface(color=color, diffuse_transmission=0.7, diffuse_transmission_color=tint, ior=1.0)
    front, behind = tl.DirectionalLight((0, 0, -1), (3, 3, 3)), tl.DirectionalLight((0, 0, 1), (2, 2, 2))
    found = picture(renderer, plate(surface), lights=[front, behind])[12, 16]
    np.testing.assert_allclose(found, (0.3 * color * 3 + 0.7 * tint * 2) / np.pi, rtol=1e-5)


# Textures


def four(*colors: Any) -> Array:
    """A picture of 2 x 2 squares, of 8 x 8 pixels each: upper left, upper right, lower left, lower right."""
    return np.kron(np.array(colors, dtype=np.float64).reshape(2, 2, -1), np.ones((8, 8, 1)))


def test_textures_multiply_color_and_glow_where_their_coordinates_say(renderer: tl.Renderer) -> None:
    colors = four((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))
    full = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.0)
    texture = tl.Texture(colors)
    for surface in (
        tl.Surface(color=(0, 0, 0), ior=1.0, emissive=(2, 3, 4), emissive_texture=texture),
        tl.Surface(color=(0.2, 0.3, 0.4), ior=1.0, color_texture=texture, emissive=(0, 0, 0)),
    ):
        light = [tl.DirectionalLight((0, 0, -1), np.full(3, 10 * np.pi))]
        found = picture(renderer, plate(surface), camera=full, lights=light)
        whole = np.array([2.0, 3.0, 4.0])
        for (row, column), color in {
            (6, 10): (1, 0, 0),
            (6, 22): (0, 1, 0),
            (18, 10): (0, 0, 1),
            (18, 22): (1, 1, 1),
        }.items():
            np.testing.assert_allclose(found[row, column], whole * color, rtol=1e-3)  # half floats


@pytest.mark.parametrize("wrap", [("clamp", "repeat"), ("repeat", "clamp")])
def test_a_texture_is_turned_and_moved_as_on_the_cpu(
    renderer: tl.Renderer, rng: np.random.Generator, wrap: Any
) -> None:
    # Few pixels, so that none is smaller than one of the frame, and no mipmap blurs it.
    texture = tl.Texture(rng.uniform(0, 1, (4, 4, 3)), (1.5, -1.25), (0.3, 0.6), 40.0, wrap)
    surface = tl.Surface(color=(0, 0, 0), ior=1.0, emissive=(1, 1, 1), emissive_texture=texture)
    full = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.0)
    found = picture(renderer, plate(surface), camera=full)
    columns, rows = np.meshgrid(np.arange(4, 28), np.arange(24))
    uv = np.stack([0.5 + (columns + 0.5 - 16) / 24, 1 - (rows + 0.5) / 24], axis=-1)
    expected = texture.sample(uv)
    # Rasterizers place texels to 1/256, and pixels hold half floats.
    np.testing.assert_allclose(found[:, 4:28], expected, atol=8e-3)


def test_holes_show_what_is_behind_and_let_it_count(renderer: tl.Renderer) -> None:
    full = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.0)
    alpha = np.concatenate([np.ones((16, 16, 3)), four((1,), (0.2,), (0.6,), (0.4,))], axis=-1)
    surface = tl.Surface(color=(0, 0, 0), ior=1.0, color_texture=tl.Texture(alpha), alpha_cutoff=0.5)
    body = tl.Object(BALL, tl.Medium(absorption=0.1), at((0, 0, -3)))
    frame = renderer.render(tl.Scene([plate(surface), body], full, environment=WHITE), SIZE)
    hit = {(row, column): bool(frame.coverage[row, column]) for row in (9, 15) for column in (13, 19)}
    assert hit == {(9, 13): False, (9, 19): True, (15, 13): False, (15, 19): True}
    assert frame.radiance[9, 13].max() == 0
    assert frame.radiance[9, 19].min() > 0.5


def test_one_side_is_seen_from_that_side_only(renderer: tl.Renderer) -> None:
    glowing = tl.Surface(emissive=(1, 1, 1), double_sided=False)
    back = tl.Camera.orthographic((0, 0, -5), (0, 0, 0), height=1.0)
    for surface, seen_behind in ((glowing, 0.0), (dataclasses.replace(glowing, double_sided=True), 1.0)):
        assert picture(renderer, plate(surface))[12, 16, 0] == pytest.approx(1.0, abs=1e-6)
        assert picture(renderer, plate(surface), camera=back)[12, 16, 0] == pytest.approx(seen_behind, abs=1e-6)


@pytest.mark.parametrize("mirrored", [False, True], ids=["uv as is", "uv mirrored"])
@pytest.mark.parametrize("behind", [False, True], ids=["front", "back"])
@pytest.mark.parametrize("turn", [0.0, 90.0])
def test_a_normal_map_leans_right_with_red_and_up_with_green(
    renderer: tl.Renderer, mirrored: bool, behind: bool, turn: float
) -> None:
    """Tangents run along the coordinates, as those of MikkTSpace do on a plane: mirrored ones turn red around."""
    uv = np.asarray(PLATE.uv) * ((-1, 1) if mirrored else (1, 1))
    mesh = tl.Mesh(PLATE.vertices, PLATE.faces, uv)
    mapped = np.array([0.36, 0.48, 0.8])
    texture = tl.Texture(np.broadcast_to(0.5 + 0.5 * mapped, (4, 4, 3)), rotation=turn)
    surface = tl.Surface(color=(1, 1, 1), ior=1.0, normal_texture=texture)
    red, green = (np.array([-1.0 if mirrored else 1.0, 0, 0]), np.array([0, 1.0, 0]))
    if turn == 90.0:  # the picture's u is minus v of the mesh, and its v is u
        red, green = -green, red
    normal = mapped[0] * red + mapped[1] * green + mapped[2] * np.array([0, 0, 1.0])
    camera, side = FRONT, 1.0
    if behind:
        camera, side = tl.Camera.orthographic((0, 0, -5), (0, 0, 0), height=1.0), -1.0
    for towards in ([0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.6, 0.8], [0, -0.6, 0.8]):
        direction = side * np.array(towards)
        light = tl.DirectionalLight(-direction, (np.pi,) * 3)
        found = picture(renderer, plate(surface, mesh), camera=camera, lights=[light])[12, 16, 0]
        assert found == pytest.approx(max(side * normal @ direction, 0.0), abs=2e-3)  # half floats


@pytest.mark.parametrize("angle", [20.0, 80.0])
def test_a_ball_of_polished_metal_mirrors_a_light_whole(renderer: tl.Renderer, angle: float) -> None:
    """As a mirroring sphere does: its intensity is E R^2 / 4 to all sides."""
    towards = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    camera = tl.Camera.orthographic((0.013, 0.007, 5), (0.013, 0.007, 0), height=2.4)
    ball = plate(tl.Surface(metallic=1.0, roughness=0.0), Sphere().tessellate(300))
    found = picture(renderer, ball, camera=camera, lights=[tl.DirectionalLight(-towards, (3, 3, 3))])
    assert found[..., 0].sum() * (2.4 / SIZE[1]) ** 2 == pytest.approx(3 / 4, rel=0.15)
