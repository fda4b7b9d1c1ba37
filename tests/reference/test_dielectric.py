"""Refracted rays against closed forms: slabs, spheres, prisms, furnaces; and what cannot be followed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.reference.dielectrics import BLACK, GLASS, UP_AND_DOWN, WHITE, Array, box, oblique, pixel, reflectance, slab
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.medium import Medium
from translucent.reference import refracted_light, render
from translucent.reference.refracted import FAINTEST
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

# Slabs


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 80.0])
def test_a_slab_reflects_between_its_faces_without_end(degrees: float) -> None:
    sine = math.sin(math.radians(degrees))
    r, cosine = reflectance(sine, 1.5), math.sqrt(1 - (sine / 1.5) ** 2)
    a = np.exp(-np.asarray(GLASS.absorption) / cosine)
    through = (1 - r) ** 2 * a / (1 - r * r * a * a)
    back = r + r * a * through
    found = pixel(Scene([Object(slab(-0.5, 0.5), GLASS)], oblique(degrees), environment=UP_AND_DOWN), bounces=20)
    y = math.cos(math.radians(degrees))
    up, down = (UP_AND_DOWN.lighting([0.0, side, 0.0]) for side in (y, -y))
    # What is dropped is below a hundred-thousandth at each of two ends.
    np.testing.assert_allclose(found, back * up + through * down, rtol=0, atol=2 * FAINTEST)


def test_what_is_seen_through_a_slab_is_shifted() -> None:
    """By h (tan i - tan t): a target of that width is just where the refracted ray ends, not the straight one."""
    angle, inside = math.radians(60), math.asin(math.sin(math.radians(60)) / 1.5)
    shift = math.tan(angle) - math.tan(inside)
    # The straight ray, through the origin, is at x = -1.5 tan(angle) at the target's height.
    x = -1.5 * math.tan(angle) + shift
    target = Object(box((x - 0.01, -1.51, -1), (x + 0.01, -1.5, 1)), color=(1.0, 0.5, 0.25))
    body = Object(slab(-0.5, 0.5), Medium(ior=1.5))
    frame = render(Scene([body, target], oblique(60), environment=WHITE), (1, 1))
    r = reflectance(math.sin(angle), 1.5)
    # Each further way through it adds r^2 of the light, somewhere else, where all is white.
    expected = 1 - (1 - r) ** 2 * (1 - np.array([1.0, 0.5, 0.25]))
    np.testing.assert_allclose(frame.radiance[0, 0], expected, atol=2 * FAINTEST)
    assert frame.thickness[0, 0] == pytest.approx(1 / math.cos(angle)), "that of the straight ray"
    missed = Object(box((x + 0.02, -1.51, -1), (x + 0.04, -1.5, 1)), color=(0.0, 0.0, 0.0))
    assert pixel(Scene([body, missed], oblique(60), environment=WHITE)) == pytest.approx(1.0, abs=2 * FAINTEST)


@pytest.mark.parametrize("degrees", [0.0, 60.0])
def test_a_slab_glows_as_its_source_function(degrees: float) -> None:
    """In a furnace, at the temperature of the environment: q = sigma_a L adds what absorption takes."""
    glow = Medium(absorption=(0.5, 1.0, 3.0), emission=(0.5, 1.0, 3.0), ior=1.7)
    found = pixel(Scene([Object(slab(-0.5, 0.5), glow)], oblique(degrees), environment=WHITE))
    np.testing.assert_allclose(found, 1.0, atol=2 * FAINTEST)


def test_background_is_seen_through_and_light_is_reflected() -> None:
    environment = WHITE.with_background(BLACK)
    found = pixel(Scene([Object(slab(-0.5, 0.5), Medium(ior=1.5))], oblique(0), environment=environment))
    # All but what goes straight through has been reflected: (1 - r)^2 is black.
    np.testing.assert_allclose(found, 1 - 0.96**2, atol=2 * FAINTEST)


@pytest.mark.parametrize("perspective", [False, True])
def test_squares_behind_a_slab_stay_where_they_are(perspective: bool) -> None:
    """Seen straight on by parallel rays; in perspective, a slab brings them nearer by its h (1 - 1/n)."""
    environment = Environment.checkerboard((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), tiles=5)
    up = (0, 0, 1)
    orthographic = Camera.orthographic((0, 3, 0), (0, 0, 0), up, height=2.0)
    camera = Camera.look_at((0, 3, 0), (0, 0, 0), up, fov_y=2.0) if perspective else orthographic
    size = (30, 20)
    bodies = [Object(slab(-0.5, 0.5), Medium(ior=1.5))]
    seen = render(Scene(bodies, camera, environment=environment), size).radiance
    straight = render(Scene(bodies, camera, environment=environment), size, refraction=False).radiance
    expected = 0.96**2 * straight + (1 - 0.96**2) * 0.5
    apart = np.abs(seen - expected).max(axis=2) > 3 * FAINTEST
    # From 3.5 m to 3.17 m in sight of the far wall: the squares grow by a tenth, and their edges move so.
    assert apart.mean() < (0.35 if perspective else 1e-9)
    assert perspective == bool(apart.any())


def test_squares_light_like_their_mean_where_light_turns_back() -> None:
    """A ray near the rim of a dense sphere leaves it backwards, by 105 degrees, and meets no backdrop."""
    camera = Camera.orthographic((0.003, 0.99, 5), (0.003, 0.99, 0), height=1e-4)
    squares = Environment.checkerboard((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    found = pixel(Scene([Object(Sphere().tessellate(128), Medium(ior=2.0))], camera, environment=squares), bounces=30)
    np.testing.assert_allclose(found, 0.5, atol=10 * FAINTEST)


# Spheres and prisms


def sphere_series(x: float, y: float, ior: float, environment: Environment) -> Array:
    """(3,): what a ray along -z sees of a clear unit sphere at the origin, with up to 60 inner reflections."""
    height = math.hypot(x, y)
    angle, inside = math.asin(height), math.asin(height / ior)
    r = reflectance(height, ior)

    def seen(turn: float) -> Array:
        # A positive turn is towards the axis and beyond it.
        across = -math.sin(turn) / height
        return environment.lighting([across * x, across * y, -math.cos(turn)])

    total = r * seen(2 * angle - math.pi)
    for k in range(60):
        total = total + (1 - r) ** 2 * r**k * seen(2 * (angle - inside) + k * (math.pi - 2 * inside))
    return np.asarray(total)


def test_a_sphere_bends_light_as_by_snell() -> None:
    errors = []
    for segments in (32, 128):
        mesh, apart = Sphere().tessellate(segments), []
        for x, y in ((0.011, 0.0), (0.1, 0.2), (0.03, 0.45), (-0.2, 0.7), (0.02, -0.85)):
            camera = Camera.orthographic((x, y, 5), (x, y, 0), height=1e-4)
            found = pixel(Scene([Object(mesh, Medium(ior=1.5))], camera, environment=UP_AND_DOWN), bounces=16)
            apart.append(np.abs(found - sphere_series(x, y, 1.5, UP_AND_DOWN)).max())
        errors.append(max(apart))
    # Positions and interpolated normals are good to the second order: 16 times better.
    assert errors[1] < 5e-3, errors
    assert errors[1] < errors[0] / 8


def prism(ior: float) -> Scene:
    """A right-angled prism, its faces at x = 0 and y = 0, the third at 45 degrees; a ray along -y at x = 0.3."""
    outline = [(0, 0), (1, 0), (0, 1)]
    vertices = [(x, y, z) for z in (-5.0, 5.0) for x, y in outline]
    faces = [(0, 2, 1), (3, 4, 5)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        faces += [(i, j, j + 3), (i, j + 3, i + 3)]
    # From below, through the face at y = 0.
    camera = Camera.orthographic((0.3, -2, 0.1), (0.3, 0, 0.1), (0, 0, 1), height=1e-3)
    return Scene([Object(Mesh(vertices, faces), Medium(ior=ior))], camera, environment=AXES)


#: Brighter upwards, which is where light goes that is not turned.
AXES = Environment.gradient((0.2, 0.2, 0.2), (1.0, 1.0, 1.0))


def test_a_prism_turns_light_by_total_reflection() -> None:
    """45 degrees are beyond the critical angle of 41.8: light leaves sideways; none sees what is straight ahead."""
    f = 0.04
    sideways, back = AXES.lighting([-1.0, 0.0, 0.0]), AXES.lighting([0.0, -1.0, 0.0])
    expected = f * back + (1 - f) ** 2 / (1 - f * f) * (sideways + f * back)
    np.testing.assert_allclose(pixel(prism(1.5)), expected, atol=2 * FAINTEST)


def test_a_prism_of_little_index_lets_light_through() -> None:
    found = pixel(prism(1.2))
    inside, outside = 45.0, math.degrees(math.asin(1.2 * math.sin(math.radians(45))))
    turn = math.radians(outside - inside)
    ahead = AXES.lighting([-math.sin(turn), math.cos(turn), 0.0])
    r, f = reflectance(math.sin(math.radians(outside)), 1.2), (0.2 / 2.2) ** 2
    # All other light is below what the two interfaces reflect.
    assert found[0] == pytest.approx((1 - f) * (1 - r) * ahead[0], abs=f + r)
    assert found[0] > 0.9, "sideways is darker"


# Furnaces: energy is neither made nor lost


FURNACES = {
    "sphere": [Object(Sphere().tessellate(16), Medium(ior=1.5))],
    "shell": [Object(Sphere().tessellate(16), Medium(ior=1.5), sheet_thickness=1e-3)],
    "wine in a glass": [
        Object(box((-1, -1, -1), (1, 1, 1)), Medium(ior=1.5)),
        Object(box((-0.6, -0.6, -0.6), (0.6, 1, 0.6)), Medium(ior=1.34)),
    ],
    "bubble": [
        Object(box((-1, -1, -1), (1, 1, 1)), Medium(ior=1.5)),
        Object(Sphere().tessellate(16), Medium(), np.diag([0.5, 0.5, 0.5, 1.0]), priority=1),
    ],
    "diamonds": [
        Object(Sphere().tessellate(5), Medium(ior=2.4), surface=Surface(dispersion=0.4)),
        Object(box((1.2, -1, -1), (1.5, 1, 1)), Medium(ior=1.6)),
    ],
}


@pytest.mark.parametrize("roughness", [0.0, 0.6])
@pytest.mark.parametrize("name", FURNACES)
def test_all_light_is_accounted_for(name: str, roughness: float) -> None:
    bodies = [
        Object(
            o.mesh, o.medium, o.transform, o.priority, o.sheet_thickness,
            surface=Surface(roughness=roughness, dispersion=o.surface.dispersion if o.surface else 0.0),
        )
        for o in FURNACES[name]
    ]  # fmt: skip
    camera = Camera.look_at((0.3, 0.8, 5), (0, 0, 0), fov_y=32)
    scene = Scene(bodies, camera, environment=WHITE, overlap="priority" if name == "bubble" else "add")
    found, _ = refracted_light(scene, (8, 8), bounces=20, paths=4)
    assert found.valid.all()
    # Of each path, every part ends in the environment or among what is dropped; a few hundred roundings.
    np.testing.assert_allclose(found.radiance + found.residual, 1.0, rtol=0, atol=1e-13)
    assert np.median(found.residual) < 1e-4
    frame = render(scene, (8, 8), bounces=20, paths=4)
    assert frame.radiance.reshape(-1, 3) == pytest.approx(found.radiance, abs=0)
    assert float(frame.provenance["residual"]) == pytest.approx(found.residual.max(), rel=0.1)


def test_light_that_is_dropped_is_told() -> None:
    scene = Scene([Object(slab(-0.5, 0.5), Medium(ior=1.5))], oblique(0), environment=WHITE)
    # After one interface, the refracted ray is dropped; after two, what is reflected inside.
    for bounces, kept in ((0, 0.0), (1, 0.04), (2, 0.04 + 0.96**2)):
        frame = render(scene, (1, 1), bounces=bounces)
        assert frame.radiance[0, 0, 0] == pytest.approx(kept, abs=1e-14)
        assert float(frame.provenance["residual"]) == pytest.approx(1 - kept, rel=0.06)


# Bad input


def test_what_cannot_be_followed_is_refused() -> None:
    camera = oblique(0)
    scene = Scene([Object(slab(-0.5, 0.5), Medium(ior=1.5))], camera)
    with pytest.raises(InputError, match="bounces"):
        render(scene, (1, 1), bounces=-1)
    with pytest.raises(InputError, match="paths"):
        render(scene, (1, 1), paths=1)
    mesh = slab(-0.5, 0.5)
    with_uv = Mesh(mesh.vertices, mesh.faces, uv=np.zeros((len(mesh.vertices), 2)))
    mapped = Surface(normal_texture=Texture(np.ones((2, 2, 3))))
    picture = Scene([Object(with_uv, Medium(ior=1.5), surface=mapped)], camera)
    with pytest.raises(InputError, match="normal_texture"):
        render(picture, (1, 1))
    assert render(picture, (1, 1), refraction=False).valid.all()


def test_light_in_an_open_body_is_invalid() -> None:
    mesh = box((-1, -1, -1), (1, 1, 1))
    bottom = (mesh.vertices[mesh.faces][..., 1] == -1).all(axis=1)
    scene = Scene([Object(Mesh(mesh.vertices, mesh.faces[~bottom]), Medium(ior=1.5))], oblique(0), environment=WHITE)
    found, _ = refracted_light(scene, (1, 1))
    assert not found.valid.any()
