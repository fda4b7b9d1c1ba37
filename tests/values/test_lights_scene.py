"""Lights, environments, objects and scenes: values by hand, and refusals."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.scene.environment import checkerboard_share, gradient_share

EPS = float(np.finfo(np.float64).eps)
NAN = math.nan

_BOX = trimesh.creation.box((2, 4, 6))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
INVERTED = tl.Mesh(_BOX.vertices, _BOX.faces[:, ::-1], name="inverted")
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))
GLASS = tl.Medium(absorption=1.0)


def turned(degrees: float, axis: tuple[float, float, float]) -> np.ndarray[Any, Any]:
    return trimesh.transformations.rotation_matrix(math.radians(degrees), axis)


# Environments


def test_a_constant_environment_is_the_same_everywhere() -> None:
    environment = tl.Environment.constant((0.1, 0.2, 0.3))
    radiance = environment.radiance(np.eye(3)[None], np.zeros((1, 3, 2)))
    assert radiance.shape == (1, 3, 3)
    assert (radiance == (0.1, 0.2, 0.3)).all()


@pytest.mark.parametrize(
    ("direction", "share"), [((0, 1, 0), 1.0), ((0, -1, 0), 0.0), ((1, 0, 0), 0.5), ((0.6, 0.8, 0), 0.9)]
)
def test_a_gradient_goes_with_the_sine_of_the_elevation(direction: tuple[float, ...], share: float) -> None:
    assert gradient_share(direction) == pytest.approx(share, abs=EPS)
    environment = tl.Environment.gradient((0.0, 0.0, 1.0), (1.0, 0.0, 3.0))
    assert environment.radiance(direction, (0, 0)) == pytest.approx([share, 0, 1 + 2 * share], abs=4 * EPS)


def test_a_checkerboard_alternates_from_the_top_left() -> None:
    rows = ["010101", "101010", "010101"]  # three squares in the height of a picture twice as wide
    right, down = np.meshgrid((np.arange(6) + 0.5) / 3, (np.arange(3) + 0.5) / 3)
    share = checkerboard_share(np.stack([right, down], axis=-1), 3)
    assert ["".join(f"{v:.0f}" for v in row) for row in share] == rows


def test_a_checkerboard_has_its_first_color_at_the_top_left() -> None:
    environment = tl.Environment.checkerboard((1, 0, 0), (0, 0, 1), tiles=2)
    backdrop = [(0.1, 0.1), (0.6, 0.1), (0.1, 0.6), (0.6, 0.6)]
    expected = [(1, 0, 0), (0, 0, 1), (0, 0, 1), (1, 0, 0)]
    assert environment.radiance(np.zeros((4, 3)), backdrop).tolist() == [list(map(float, e)) for e in expected]


def test_an_environment_takes_text_as_srgb_and_numbers_as_linear_radiance() -> None:
    assert tl.Environment.constant("#808080").first == pytest.approx([0.2158605] * 3, abs=1e-7)
    assert tl.Environment.constant(2.5).first.tolist() == [2.5] * 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: tl.Environment.constant((-1, 0, 0)),
            "environment radiance (-1.0, 0.0, 0.0); the value must lie in 0 to 1e+18",
        ),
        (lambda: tl.Environment.constant((NAN, 0, 0)), "environment radiance"),
        (
            lambda: tl.Environment.constant("reddish"),
            "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
        ),
        (
            lambda: tl.Environment.gradient((0, 0, 0), (0, 0)),
            "environment radiance (0, 0); the value must be one or three numbers",
        ),
        (
            lambda: tl.Environment.checkerboard(0, 1, tiles=0),
            "checkerboard of 0 tiles; the number of tiles must lie in 0 to 1e6",
        ),
        (
            lambda: tl.Environment.checkerboard(0, 1, tiles=NAN),
            "checkerboard of nan tiles; the number of tiles must lie in 0 to 1e6",
        ),
        (lambda: tl.PointLight((0, 0), 1), "light position (0, 0); the value must be three finite numbers"),
        (lambda: tl.PointLight((0, 0, NAN), 1), "the value must be three finite numbers"),
        (lambda: tl.PointLight((0, 0, 0), -1), "light intensity (-1.0, -1.0, -1.0); the value must lie in 0 to 1e+18"),
        (lambda: tl.PointLight((0, 0, 0), (1, 2)), "light intensity (1, 2); the value must be one or three numbers"),
        (
            lambda: tl.PointLight((0, 0, 0), "bright"),
            "light intensity 'bright'; the value must be one or three numbers",
        ),
        (lambda: tl.PointLight("here", 1), "light position 'here'; the value must be three finite numbers"),
        (lambda: tl.DirectionalLight((0, 0, 0), 1), "light direction; the direction has the length 0"),
        (
            lambda: tl.DirectionalLight((0, 0, math.inf), 1),
            "light direction (0, 0, inf); the value must be three finite",
        ),
        (
            lambda: tl.DirectionalLight((0, 0, 1), (1, -1, 0)),
            "light irradiance (1.0, -1.0, 0.0); the value must lie in 0 to 1e+18",
        ),
    ],
)
def test_there_is_no_such_light(make: Callable[[], object], message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        make()


def test_lights_hold_read_only_arrays_and_one_number_stands_for_all_channels() -> None:
    point, sun = tl.PointLight((1, 2, 3), 5), tl.DirectionalLight((0, 0, -4), (1, 2, 3))
    assert np.asarray(point.intensity).tolist() == [5, 5, 5]
    assert np.asarray(sun.direction).tolist() == [0, 0, -1]
    for array in (point.position, point.intensity, sun.irradiance, sun.direction):
        assert not np.asarray(array).flags.writeable


# Irradiance


def hemisphere(normal: np.ndarray[Any, Any], count: int = 16) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Directions (n, 3) over the hemisphere around a normal, and weights (n,) that hold the cosine: a quadrature.

    Gauss-Legendre in the cosine, even steps around: exact for polynomials of the direction up to a degree of `count`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    cosine, angle = np.meshgrid((nodes + 1) / 2, 2 * np.pi * np.arange(count) / count, indexing="ij")
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    around = np.cos(angle)[..., None] * u + np.sin(angle)[..., None] * v
    directions = np.sqrt(1 - cosine**2)[..., None] * around + cosine[..., None] * normal
    weight = cosine * (weights / 2)[:, None] * 2 * np.pi / count
    return directions.reshape(-1, 3), weight.ravel()


@pytest.mark.parametrize(
    "environment",
    [tl.Environment.constant((0.1, 0.2, 3.0)), tl.Environment.gradient((0.1, 2.0, 0.0), (1.0, 0.5, 0.25))],
    ids=["constant", "gradient"],
)
def test_irradiance_is_the_integral_of_radiance_and_cosine(environment: tl.Environment) -> None:
    normals = np.random.default_rng(3).normal(size=(20, 3))
    normals = np.vstack([normals / np.linalg.norm(normals, axis=1, keepdims=True), np.eye(3), -np.eye(3)])
    for normal in normals:
        directions, weights = hemisphere(normal)
        integral = weights @ environment.radiance(directions, np.zeros((len(directions), 2)))
        assert environment.irradiance_on(normal) == pytest.approx(integral, rel=1e-13)
    assert environment.irradiance_on(normals.reshape(2, 13, 3)).shape == (2, 13, 3)


def test_a_checkerboard_lights_like_the_mean_of_its_squares() -> None:
    environment = tl.Environment.checkerboard((1, 0, 0.5), (0, 0.5, 0.5), tiles=3)
    assert environment.irradiance_on((0, 1, 0)) == pytest.approx(np.pi * np.array((0.5, 0.25, 0.5)), rel=2 * EPS)


def test_irradiance_of_a_point_light_falls_with_the_square_and_the_cosine() -> None:
    light = tl.PointLight((1, 2, 3), (4, 8, 0))
    up, down = (0, 0, 1), (0, 0, -1)
    assert light.irradiance_on((1, 2, 1), up) == pytest.approx((1, 2, 0), rel=2 * EPS)
    assert light.irradiance_on((1, 2, 1), down).tolist() == [0, 0, 0]
    assert light.irradiance_on((4, 6, 3), up).tolist() == [0, 0, 0]
    # 5 m away, 3 m of it along the normal.
    assert light.irradiance_on((5, 2, 0), up) == pytest.approx(np.array((4, 8, 0)) * 0.6 / 25, rel=4 * EPS)
    points = np.zeros((4, 1, 3))
    assert light.irradiance_on(points, np.tile(up, (5, 1))).shape == (4, 5, 3)


def test_a_disc_receives_what_goes_into_its_solid_angle() -> None:
    """A disc of radius R that lies h below the light is seen from it under 2 pi (1 - h / sqrt(h^2 + R^2))."""
    light, height, radius = tl.PointLight((0, 0, 0.5), 3.0), 0.5, 2.0
    nodes, weights = np.polynomial.legendre.leggauss(60)
    r = radius * (nodes + 1) / 2
    points = np.stack([r, 0 * r, 0 * r], axis=-1)
    power = (weights * radius / 2 * 2 * np.pi * r) @ light.irradiance_on(points, (0, 0, 1))
    assert power == pytest.approx(np.full(3, 2 * np.pi * 3 * (1 - height / math.hypot(height, radius))), rel=1e-13)


@pytest.mark.parametrize(
    ("position", "irradiance"),
    [
        ((0, 0, 0), 0.0),
        ((0, 0, 1e-310), 1e18),
        ((0, 0, 1e-200), 1e18),
        ((0, 0, 1e-9), 1e18),
        ((0, 0, 1e18), 5e-36),
        ((-1e18, 1e18, -1e18), 0.0),
    ],
)
def test_a_point_light_anywhere_gives_a_number(position: tuple[float, ...], irradiance: float) -> None:
    found = tl.PointLight(position, (5.0, 0.0, 1e-308)).irradiance_on((0, 0, 0), (0, 0, 1))
    assert found[0] == pytest.approx(irradiance, rel=1e-14)
    assert found[1] == 0
    assert 0 <= found[2] <= 1e18


def test_irradiance_of_a_directional_light_goes_with_the_cosine() -> None:
    sun = tl.DirectionalLight((0, -3, -4), (1, 2, 5))
    normals = np.array([(0, 0, 1), (0, 1, 0), (0, 0.6, 0.8), (1, 0, 0), (0, 0, -1)])
    found = sun.irradiance_on(np.zeros(3), normals)
    assert found == pytest.approx(np.outer((0.8, 0.6, 1, 0, 0), (1, 2, 5)), abs=8 * EPS)


def test_the_faintest_light_does_not_underflow_aloud() -> None:
    tiny = 3e-308
    for irradiance in (
        tl.DirectionalLight((0, -3, -4), tiny).irradiance_on((0, 0, 0), (0, 0.28, 0.96)),
        tl.PointLight((0, 0, 3), tiny).irradiance_on((0, 0, 0), (0, 0, 1)),
        tl.Environment.gradient(tiny / 3, tiny).irradiance_on((0, 0.28, 0.96)),
    ):
        assert (irradiance > 0).all()


# Objects


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transform": np.diag([1, 0, 1, 1])}, "transform of 'box'; the transform flattens the mesh (a scale of 0)"),
        ({"transform": np.eye(3)}, "transform of 'box'; the transform must be a finite 4x4 matrix"),
        ({"transform": np.eye(4) * NAN}, "transform of 'box'; the transform must be a finite 4x4 matrix"),
        (
            {"transform": np.eye(4)[:, ::-1]},
            "transform of 'box'; the last row of the transform is (1.0, 0.0, 0.0, 0.0)",
        ),
        ({"transform": np.eye(4) * 2}, "transform of 'box'; the last row of the transform is (0.0, 0.0, 0.0, 2.0)"),
        ({"sheet_thickness": 0}, "sheet_thickness 0 of 'box'; the thickness must be above 0"),
        ({"sheet_thickness": -1e-3}, "sheet_thickness -0.001 of 'box'; the thickness must be above 0"),
        ({"sheet_thickness": NAN}, "sheet_thickness nan of 'box'; the thickness must be above 0"),
        ({"priority": "high"}, "priority of an object 'high'; of type str; give a whole number, such as 1"),
    ],
)
def test_there_is_no_such_object(options: dict[str, Any], message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.Object(BOX, GLASS, **options)


@pytest.mark.parametrize(
    ("color", "linear"),
    [
        ("#808080", [0.2158605] * 3),
        ("red", [1.0, 0.0, 0.0]),
        ("linear(0.25, 0.5, 1)", [0.25, 0.5, 1.0]),
        ((0, 0.5, 1), [0.0, 0.5, 1.0]),
        (np.zeros(3), [0.0, 0.0, 0.0]),
    ],
)
def test_a_color_is_text_or_linear(color: Any, linear: list[float]) -> None:
    kept = np.asarray(tl.Object(BOX, None, color=color).color)
    assert kept == pytest.approx(linear, abs=1e-7)
    assert not kept.flags.writeable
    assert np.asarray(tl.Object(BOX).color).tolist() == [0.6, 0.6, 0.6]


@pytest.mark.parametrize("color", [(1.1, 0, 0), (-1e-9, 0, 0), (NAN, 0, 0), (1, 1), 0.5, None, [("a", "b", "c")]])
def test_no_object_reflects_more_than_it_receives(color: Any) -> None:
    message = (
        f"color of 'box' {color!r}; the value must be three numbers in 0 to 1; use a value such as (0.6, 0.6, 0.6)"
    )
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.Object(BOX, None, color=color)


@pytest.mark.parametrize(
    ("color", "message"),
    [
        ("reddish", "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)"),
        ("linear(2, 0, 0)", "the value must be three numbers in 0 to 1"),
    ],
)
def test_the_text_of_a_color_is_checked(color: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.Object(BOX, None, color=color)


def test_an_object_needs_finite_coordinates() -> None:
    broken = tl.Mesh(np.where(_BOX.vertices > 2, np.nan, _BOX.vertices), _BOX.faces, name="broken")
    with pytest.raises(tl.InputError, match="mesh 'broken'; 4 vertices are not finite"):
        tl.Object(broken, GLASS)


def test_a_strong_but_regular_scale_does_not_flatten() -> None:
    matrix = np.diag([1e-6, 1.0, 1e6, 1.0])
    assert tl.Object(BOX, GLASS, matrix).bounds.tolist() == [[-1e-6, -2, -3e6], [1e-6, 2, 3e6]]


@pytest.mark.parametrize(
    ("mesh", "scale", "mirrored", "inwards"),
    [
        (BOX, (1, 1, 1), False, False),
        (BOX, (-1, 1, 1), True, True),
        (BOX, (-1, -2, 1), False, False),
        (BOX, (-1, -2, -3), True, True),
        (INVERTED, (1, 1, 1), False, True),
        (INVERTED, (1, 1, -1), True, False),
    ],
)
def test_a_mirror_and_an_inverted_mesh_cancel(
    mesh: tl.Mesh, scale: tuple[float, ...], mirrored: bool, inwards: bool
) -> None:
    body = tl.Object(mesh, GLASS, np.diag([*scale, 1]))
    assert (body.mirrored, body.faces_inwards) == (mirrored, inwards)


def test_bounds_follow_a_rotation_and_a_translation() -> None:
    matrix = turned(90, (0, 0, 1))
    matrix[:3, 3] = (10, 20, 30)
    assert tl.Object(BOX, GLASS, matrix).bounds == pytest.approx(np.array([[8, 19, 27], [12, 21, 33]]), abs=64 * EPS)


@given(st.floats(-180, 180), st.tuples(*[st.floats(0.1, 1)] * 3))
def test_bounds_hold_every_vertex_however_the_body_is_turned(degrees: float, axis: tuple[float, float, float]) -> None:
    matrix = turned(degrees, axis)
    low, high = tl.Object(BOX, GLASS, matrix).bounds
    world = BOX.vertices @ matrix[:3, :3].T
    assert low == pytest.approx(world.min(axis=0), abs=16 * EPS)
    assert high == pytest.approx(world.max(axis=0), abs=16 * EPS)


@pytest.mark.parametrize("mesh", [BOX, INVERTED], ids=["box", "inverted"])
@pytest.mark.parametrize(
    "matrix",
    [np.eye(4), np.diag([-1, 1, 1, 1]), np.diag([2, -3, 0.5, 1]), turned(30, (1, 2, 3)) @ np.diag([-1, 2, 3, 1])],
    ids=["plain", "mirrored", "mirrored and stretched", "turned"],
)
def test_a_body_contains_what_is_inside_it_whatever_its_winding(mesh: tl.Mesh, matrix: np.ndarray[Any, Any]) -> None:
    matrix = trimesh.transformations.translation_matrix((5, 6, 7)) @ matrix
    body = tl.Object(mesh, GLASS, matrix)
    for local, number in (((0.5, 1.9, -2.9), 1), ((0, 0, 0), 1), ((1.1, 0, 0), 0), ((0, 0, 3.1), 0), ((9, 9, 9), 0)):
        world = matrix[:3, :3] @ local + matrix[:3, 3]
        assert body.winding_number(world) == pytest.approx(number, abs=1e-13)


def test_on_its_surface_a_body_contains_a_fraction() -> None:
    body = tl.Object(BOX, GLASS)
    assert body.winding_number((1, 0.3, 0.4)) == pytest.approx(1 / 2, abs=1e-13)
    assert body.winding_number((1, 2, 0.4)) == pytest.approx(1 / 4, abs=1e-13)
    assert body.winding_number((1, 2, 3)) == pytest.approx(1 / 8, abs=1e-13)


# Scenes


def test_a_scene_needs_an_object_and_a_known_overlap() -> None:
    with pytest.raises(tl.InputError, match="scene; the scene has no objects"):
        tl.Scene([], CAMERA)
    with pytest.raises(
        tl.InputError, match="overlap 'xor'; no overlap rule has this name; use one of add, union, priority"
    ):
        tl.Scene([tl.Object(BOX, GLASS)], CAMERA, overlap="xor")  # type: ignore[arg-type]


def test_a_scene_knows_its_bodies_and_bounds() -> None:
    glass, rock = tl.Object(BOX, GLASS), tl.Object(BOX, None, trimesh.transformations.translation_matrix((10, 0, 0)))
    scene = tl.Scene([glass, rock], CAMERA)
    assert scene.bodies == (glass,)
    assert scene.opaque == (rock,)
    assert scene.bounds.tolist() == [[-1, -2, -3], [11, 2, 3]]
    assert scene.diagonal == pytest.approx(math.sqrt(144 + 16 + 36), rel=2 * EPS)
    assert scene.environment.first.tolist() == [1, 1, 1]


def test_the_showcase_frames_the_mesh_in_a_medium_of_its_size() -> None:
    for scale in (1e-3, 1.0, 1e3):
        mesh = tl.Mesh(BOX.vertices * scale, BOX.faces)
        scene = tl.showcase(mesh, stage="none")
        medium = scene.objects[0].medium
        assert medium is not None
        sides = mesh.bounds[1] - mesh.bounds[0]
        chord = 2.0 / (1.0 / sides).sum()  # 4 V / S
        assert chord > 0.15 * mesh.diagonal
        assert medium.transmittance(chord) == pytest.approx((0.18, 0.62, 0.35), rel=1e-13)
        assert scene.camera.forward == pytest.approx(tl.showcase(BOX, stage="none").camera.forward, abs=1e-12)
    assert tl.showcase(BOX, GLASS, stage="none").objects[0].medium is GLASS


@pytest.mark.parametrize("length", [1e300, 1e-300, 5e-324])
def test_directions_of_any_length_are_directions(length: float) -> None:
    lights = tl.DirectionalLight((length, 0, length), 1), tl.SpotLight((0, 0, 0), (length, 0, length), 1)
    for light in lights:
        np.testing.assert_allclose(light.direction, np.array((1, 0, 1)) / np.sqrt(2), rtol=1e-15)
