"""Bent rays against closed forms: slabs, spheres, prisms, furnaces, nested bodies, rough borders."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from translucent import interface, optics
from translucent.camera import Camera
from translucent.environment import Environment
from translucent.errors import InputError
from translucent.frame import Frame
from translucent.lights import DirectionalLight
from translucent.medium import Medium
from translucent.mesh import Mesh
from translucent.reference import bent_light, microfacets, render
from translucent.reference.bent import FAINTEST
from translucent.reference.microfacets import scattered_at_border
from translucent.scene import Object, Scene
from translucent.solids import Box, Sphere
from translucent.surface import Surface
from translucent.texture import Texture

Array = npt.NDArray[np.float64]

GLASS = Medium(absorption=(0.1, 0.4, 0.9), ior=1.5)
WHITE = Environment.constant((1.0, 1.0, 1.0))
BLACK = Environment.constant((0.0, 0.0, 0.0))
#: Tells directions apart: (1 + y) / 2 of the first channel, (1 - y) / 2 of the second.
UP_AND_DOWN = Environment.gradient((0.0, 1.0, 0.3), (1.0, 0.0, 0.8))
WIDE = 500.0


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    return Box(tuple(low), tuple(high)).tessellate()


def slab(bottom: float, top: float) -> Mesh:
    """So wide that no ray that is still followed comes to its ends."""
    return box((-WIDE, bottom, -WIDE), (WIDE, top, WIDE))


def oblique(degrees: float) -> Camera:
    """Looks down on the origin, this far from straight down."""
    angle = math.radians(degrees)
    eye = 10.0 * np.array([math.sin(angle), math.cos(angle), 0.0])
    return Camera.orthographic(eye, (0, 0, 0), (0, 0, 1), height=1e-3)


def pixel(scene: Scene, **options: int) -> Array:
    """(3,): what the middle of the picture sees."""
    frame = render(scene, (1, 1), **options)
    assert frame.valid.all()
    return frame.radiance[0, 0]


def reflectance(sine: float, ior: float) -> float:
    """Fresnel by the angles on both sides (Born & Wolf 1.5.2, 21a); a tangent at normal incidence."""
    if sine == 0.0:
        return ((ior - 1) / (ior + 1)) ** 2
    a, b = math.asin(sine), math.asin(sine / ior)
    return 0.5 * ((math.tan(a - b) / math.tan(a + b)) ** 2 + (math.sin(a - b) / math.sin(a + b)) ** 2)


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
    """By h (tan i - tan t): a target of that width stands just where the bent ray comes to, not the straight one."""
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
    # From 3.5 m to 3.17 m in sight of the far wall: the squares grow by a tenth, and their borders move so.
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
    # All other light is below what the two borders reflect.
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


@pytest.mark.parametrize("roughness", [0.0, 0.2, 1.0])
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
    found, _ = bent_light(scene, (8, 8), bounces=20, paths=4)
    assert found.valid.all()
    # Of each path, every part ends in the environment or among what is dropped; a few hundred roundings.
    np.testing.assert_allclose(found.radiance + found.residual, 1.0, rtol=0, atol=1e-13)
    assert np.median(found.residual) < 1e-4
    frame = render(scene, (8, 8), bounces=20, paths=4)
    assert frame.radiance.reshape(-1, 3) == pytest.approx(found.radiance, abs=0)
    assert float(frame.provenance["residual"]) == pytest.approx(found.residual.max(), rel=0.1)


def test_light_that_is_dropped_is_told() -> None:
    scene = Scene([Object(slab(-0.5, 0.5), Medium(ior=1.5))], oblique(0), environment=WHITE)
    # After one border, the refracted ray is dropped; after two, what is reflected inside.
    for bounces, kept in ((0, 0.0), (1, 0.04), (2, 0.04 + 0.96**2)):
        frame = render(scene, (1, 1), bounces=bounces)
        assert frame.radiance[0, 0, 0] == pytest.approx(kept, abs=1e-14)
        assert float(frame.provenance["residual"]) == pytest.approx(1 - kept, rel=0.06)


# What rays are in


def test_walls_at_one_place_are_one_border() -> None:
    """Two slabs of one glass that touch are one; of two glasses, there is one border of their relative index."""
    both = [Object(slab(0.0, 0.5), GLASS), Object(slab(-0.5, 0.0), GLASS)]
    one = [Object(slab(-0.5, 0.5), GLASS)]
    a, b = (pixel(Scene(bodies, oblique(50), environment=UP_AND_DOWN)) for bodies in (both, one))
    np.testing.assert_allclose(a, b, rtol=1e-12)
    apart = [Object(slab(0.0, 0.5), Medium(ior=1.5)), Object(slab(-0.5, 0.0), Medium(ior=2.0))]
    found, _ = bent_light(Scene(apart, oblique(0), environment=WHITE), (1, 1), bounces=2)
    r = [reflectance(0, 1.5), reflectance(0, 2 / 1.5)]
    # Two borders on the way: first light back from them is r0 and (1 - r0)^2 r1, of which the second needs a third.
    assert found.radiance[0, 0] == pytest.approx(r[0], abs=1e-14)
    assert found.residual[0, 0] == pytest.approx(1 - r[0], abs=1e-14)


def test_the_higher_priority_decides_what_light_is_in() -> None:
    """Wine that reaches into the glass is displaced by it, as if it ended there."""
    wine = Medium(absorption=(1.0, 2.0, 4.0), ior=1.34)
    overlapping = [Object(slab(0.0, 0.5), GLASS, priority=1), Object(slab(-0.5, 0.2), wine)]
    touching = [Object(slab(0.0, 0.5), GLASS), Object(slab(-0.5, 0.0), wine)]
    a = pixel(Scene(overlapping, oblique(50), environment=UP_AND_DOWN, overlap="priority"))
    b = pixel(Scene(touching, oblique(50), environment=UP_AND_DOWN))
    np.testing.assert_allclose(a, b, rtol=1e-12)


def test_a_bubble_is_a_gap() -> None:
    bubble = [Object(slab(-0.5, 0.5), GLASS), Object(slab(-0.1, 0.2), Medium(), priority=1)]
    gap = [Object(slab(0.2, 0.5), GLASS), Object(slab(-0.5, -0.1), GLASS)]
    a = pixel(Scene(bubble, oblique(50), environment=UP_AND_DOWN, overlap="priority"), bounces=12)
    b = pixel(Scene(gap, oblique(50), environment=UP_AND_DOWN), bounces=12)
    np.testing.assert_allclose(a, b, rtol=1e-12)


def test_equal_priorities_are_decided_by_the_last_entry() -> None:
    """A stone in water, in either order of the objects."""
    water, stone = Object(slab(-0.5, 0.5), Medium(ior=1.33)), Object(slab(-0.3, 0.3), Medium(ior=1.6))
    layers = [
        Object(slab(0.3, 0.5), Medium(ior=1.33)),
        Object(slab(-0.3, 0.3), Medium(ior=1.6)),
        Object(slab(-0.5, -0.3), Medium(ior=1.33)),
    ]
    expected = pixel(Scene(layers, oblique(40), environment=UP_AND_DOWN))
    for bodies in ([water, stone], [stone, water]):
        np.testing.assert_allclose(pixel(Scene(bodies, oblique(40), environment=UP_AND_DOWN)), expected, rtol=1e-12)


def test_an_eye_in_glass_looks_out_through_a_window() -> None:
    """From inside, light is totally reflected beyond 41.8 degrees."""
    body = Object(slab(-0.5, 0.5), Medium(ior=1.5))
    environment = WHITE.with_background(BLACK)
    for degrees, black in ((0.0, 0.96), (35.0, 1 - reflectance(1.5 * math.sin(math.radians(35)), 1.5)), (50.0, 0.0)):
        direction = np.array([math.sin(math.radians(degrees)), -math.cos(math.radians(degrees)), 0.0])
        camera = Camera.look_at((0, 0.1, 0), (0, 0.1, 0) + direction, (0, 0, 1), fov_y=1e-3)
        found, _ = bent_light(Scene([body], camera, environment=environment), (1, 1), bounces=30)
        assert found.radiance[0, 0] + found.residual[0, 0] == pytest.approx(1 - black, abs=3 * FAINTEST)


# Without interfaces


SCATTERING = Medium(absorption=(0.3, 1.0, 2.0), scattering=(1.0, 0.5, 0.2), emission=(0.1, 0.2, 0.3), anisotropy=0.3)


def picture(bodies: Sequence[Object], refraction: bool | None) -> Frame:
    lights = [DirectionalLight((0.3, -1.0, -0.4), (2.0, 1.0, 3.0))]
    opaque = Object(box((-0.2, -1.5, -1.6), (0.6, 1.2, -1.3)), color=(0.2, 0.5, 0.8))
    camera = Camera.look_at((0.5, 1.0, 4), (0, 0, 0), fov_y=30)
    environment = Environment.checkerboard((0.0, 0.1, 0.2), (1.0, 0.9, 0.8), tiles=4)
    return render(Scene([*bodies, opaque], camera, lights, environment), (12, 9), None, 1e-4, refraction)


def test_straight_rays_are_bent_rays_of_index_one() -> None:
    bodies = [
        Object(box((-1, -1, -1), (1, 1, 1)), SCATTERING),
        Object(Sphere().tessellate(12), Medium(absorption=1.0), np.diag([0.5, 0.5, 0.5, 1.0])),
        Object(box((-0.5, -0.5, 1.2), (0.5, 0.5, 1.3)), Medium(absorption=5.0), sheet_thickness=0.01),
    ]
    straight, bent, usual = (picture(bodies, refraction) for refraction in (False, True, None))
    np.testing.assert_array_equal(usual.radiance, straight.radiance)
    np.testing.assert_array_equal(usual.valid, straight.valid)
    # Scattered light is integrated to the tolerance in either.
    np.testing.assert_allclose(bent.radiance, straight.radiance, rtol=3e-4, atol=1e-9)
    assert "residual" not in usual.provenance


def test_all_but_the_radiance_is_that_of_straight_rays() -> None:
    bodies = [Object(Sphere().tessellate(12), Medium(absorption=(1.0, 2.0, 3.0), ior=1.5))]
    bent, straight = (picture(bodies, refraction) for refraction in (None, False))
    for name in ("thickness", "optical_depth", "transmittance", "coverage"):
        np.testing.assert_array_equal(getattr(bent, name), getattr(straight, name))
    assert np.abs(bent.radiance - straight.radiance).max() > 0.1


# Surfaces


def test_dispersion_bends_each_color_by_its_own_index() -> None:
    def seen(ior: float, dispersion: float) -> Array:
        camera = Camera.orthographic((0.3, 0.4, 5), (0.3, 0.4, 0), height=1e-3)
        body = Object(Sphere().tessellate(24), Medium(ior=ior), surface=Surface(dispersion=dispersion))
        return pixel(Scene([body], camera, environment=UP_AND_DOWN))

    found = seen(1.6, 2.0)
    for channel, ior in enumerate(interface.channel_iors(1.6, 2.0)):
        assert found[channel] == seen(float(ior), 0.0)[channel]
    assert np.abs(found - seen(1.6, 0.0))[[0, 2]].min() > 1e-4


@pytest.mark.parametrize("degrees", [0.0, 70.0])
def test_a_thin_wall_does_not_bend_light(degrees: float) -> None:
    medium = Medium(absorption=(0.0, 100.0, 400.0), ior=1.5)
    wall = Object(box((-WIDE, -1, -WIDE), (WIDE, 0, WIDE)), medium, sheet_thickness=0.01)
    # A box of sheets: the ray crosses its lid and its floor, 1 m below.
    found = pixel(Scene([wall], oblique(degrees), environment=UP_AND_DOWN), bounces=20)
    cosine = math.sqrt(1 - (math.sin(math.radians(degrees)) / 1.5) ** 2)
    r = reflectance(math.sin(math.radians(degrees)), 1.5)
    depth = np.asarray(medium.absorption) * 0.01 / cosine
    back, on = interface.slab_reflectance(r, depth), interface.slab_transmittance(r, depth)
    y = math.cos(math.radians(degrees))
    up, down = (UP_AND_DOWN.lighting([0.0, side, 0.0]) for side in (y, -y))
    both_on = on * on / (1 - back * back)
    expected = (back + on * on * back / (1 - back * back)) * up + both_on * down
    np.testing.assert_allclose(found, expected, atol=3 * FAINTEST)


def test_a_sheet_glows_as_its_source_function() -> None:
    glow = Medium(absorption=(50.0, 100.0, 300.0), emission=(50.0, 100.0, 300.0), ior=1.7)
    wall = Object(box((-WIDE, -1, -WIDE), (WIDE, 0, WIDE)), glow, sheet_thickness=0.01)
    for roughness in (0.0, 0.4):
        body = Object(wall.mesh, glow, sheet_thickness=0.01, surface=Surface(roughness=roughness))
        found, _ = bent_light(Scene([body], oblique(50), environment=WHITE), (1, 1), bounces=30, paths=50)
        np.testing.assert_allclose(found.radiance + found.residual, 1.0, atol=3 * FAINTEST)


def test_color_tints_a_body_once() -> None:
    tinted = Surface(color=(0.9, 0.5, 0.1))
    medium = Medium(absorption=(0.0, 1.0, 2.0))
    found = pixel(Scene([Object(slab(-0.5, 0.5), medium, surface=tinted)], oblique(0), environment=WHITE))
    np.testing.assert_allclose(found, np.array([0.9, 0.5, 0.1]) * np.exp([0.0, -1.0, -2.0]), rtol=1e-14)


@pytest.mark.parametrize("sheet", [None, 0.01])
def test_paint_is_an_opaque_object(sheet: float | None) -> None:
    color, lights = (0.9, 0.5, 0.1), [DirectionalLight((0.2, -1.0, 0.3), (2.0, 3.0, 4.0))]
    paint = Surface(color=color, transmission=0.0)
    mesh = slab(-0.5, 0.5)
    painted = Object(mesh, Medium(), sheet_thickness=sheet, surface=paint)
    a = pixel(Scene([painted], oblique(30), lights, UP_AND_DOWN))
    opaque = Scene([Object(mesh, color=color), Object(slab(-3, -2), Medium())], oblique(30), lights, UP_AND_DOWN)
    np.testing.assert_allclose(a, pixel(opaque), rtol=1e-13)


def test_paint_lets_light_through_from_behind() -> None:
    paint = Surface(
        color=(0.9, 0.5, 0.1), transmission=0.25, diffuse_transmission=0.7, diffuse_transmission_color=(1, 0.5, 1)
    )
    wall = Object(box((-WIDE, 0, -WIDE), (WIDE, 1e-3, WIDE)), Medium(), surface=paint)
    up, down = (UP_AND_DOWN.irradiance_on([0.0, side, 0.0]) / np.pi for side in (1.0, -1.0))
    color, through = np.array([0.9, 0.5, 0.1]), np.array([1.0, 0.5, 1.0])
    # The same at the lower face, seen through the upper one.
    painted = within = 0.3 * color * up + 0.7 * through * down
    expected = 0.75 * painted + 0.25 * color * (0.75 * within + 0.25 * UP_AND_DOWN.lighting([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(pixel(Scene([wall], oblique(0), environment=UP_AND_DOWN)), expected, rtol=1e-12)


# Rough borders


@pytest.mark.parametrize("ior", [1.5, 1 / 1.5])
@pytest.mark.parametrize(("alpha", "cosine"), [(0.01, 0.5), (0.09, 1.0), (0.09, 0.1), (0.36, 0.5), (1.0, 0.3)])
def test_light_reflected_by_one_microfacet(
    ior: float, alpha: float, cosine: float, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As F D V says, integrated over the microfacets; four standard errors."""
    count = 100_000
    direction = np.array([math.sqrt(1 - cosine**2), 0.0, -cosine])
    # The second look at the height lets light leave; nothing is met again.
    monkeypatch.setattr(microfacets, "MOST_MEETINGS", 2)
    every = np.ones(count)
    found, passed = scattered_at_border(
        np.tile(direction, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), ior * every, alpha * every, rng
    )
    once = found * (~passed)[:, None]
    u, turn = (np.arange(1500) + 0.5) / 1500, (np.arange(180) + 0.5) / 90 * np.pi
    c = 1 / np.sqrt(1 + alpha**2 * u / (1 - u))
    s = np.sqrt(1 - c * c)
    half = np.stack(np.broadcast_arrays(s[:, None] * np.cos(turn), s[:, None] * np.sin(turn), c[:, None]), axis=-1)
    facing = np.maximum(-(half @ direction), 0.0)
    out = direction + 2 * facing[..., None] * half
    lit = (facing > 0) & (out[..., 2] > 0)
    f = optics.fresnel_dielectric(facing[lit], ior)
    # Drawn with the density D cos_half, of half vectors; the light's solid angle is 4 cos_facet times theirs.
    share = f * interface.ggx_visibility(out[lit][:, 2], cosine, alpha) * out[lit][:, 2] * 4 * facing[lit]
    share /= np.broadcast_to(c[:, None], facing.shape)[lit]
    weights = [np.ones(len(share)), out[lit][:, 2], out[lit][:, 0]]
    values = [once.any(axis=1).astype(float), once[:, 2], once[:, 0]]
    for weight, value in zip(weights, values, strict=True):
        assert value.mean() == pytest.approx(
            (share * weight).sum() / facing.size, abs=4 * value.std() / math.sqrt(count)
        )


def test_light_passed_by_one_microfacet(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unseen from both sides as B(1 + Lambda, 1 + Lambda) says (Heitz et al. 2016): higher places are deeper beyond."""
    monkeypatch.setattr(microfacets, "MOST_MEETINGS", 2)
    count, cosine = 100_000, 0.3
    hidden = 0.5 * (1 / cosine - 1)  # Lambda at alpha = 1
    every, way = np.ones(count), [math.sqrt(1 - cosine**2), 0.0, -cosine]
    # Equal media, almost: light goes straight on, and is reflected by none in a million.
    found, _ = scattered_at_border(
        np.tile(way, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), 1.0001 * every, every, rng
    )
    expected = (1 + hidden) * math.gamma(1 + hidden) ** 2 / math.gamma(2 + 2 * hidden)
    assert found.any(axis=1).mean() == pytest.approx(expected, abs=4 * math.sqrt(expected / count) + 1e-4)


@pytest.mark.parametrize("alpha", [0.1, 0.7])
def test_a_rough_border_is_reciprocal(alpha: float, rng: np.random.Generator) -> None:
    """Of diffuse light, n^2 times as much is reflected less from inside: n^2 (1 - R_in) = 1 - R_out."""
    count, ior = 200_000, 1.5

    def passed(relative: float) -> Array:
        cosine = np.sqrt(rng.random(count))
        directions = np.stack([np.sqrt(1 - cosine**2), np.zeros(count), -cosine], axis=1)
        every = np.ones(count)
        return scattered_at_border(
            directions, np.tile([0.0, 0.0, 1.0], (count, 1)), relative * every, alpha * every, rng
        )[1]

    into, out_of = passed(ior).mean(), passed(1 / ior).mean()
    error = math.sqrt((into * (1 - into) + ior**4 * out_of * (1 - out_of)) / count)
    assert ior**2 * out_of == pytest.approx(into, abs=4 * error)


@pytest.mark.parametrize("sheet", [None, 1e-3])
def test_a_nearly_polished_slab_is_a_polished_one(sheet: float | None) -> None:
    medium = Medium(absorption=(0.0, 1.0, 2.0) if sheet is None else (0.0, 300.0, 600.0), ior=1.5)

    def seen(roughness: float) -> tuple[Array, Array]:
        body = Object(slab(-0.5, 0.5), medium, sheet_thickness=sheet, surface=Surface(roughness=roughness))
        light, error = bent_light(Scene([body], oblique(65), environment=UP_AND_DOWN), (1, 1), bounces=20, paths=20_000)
        return light.radiance[0], error[0]

    (rough, error), (polished, none) = seen(0.03), seen(0.0)
    assert not none.any()
    # Directions spread by alpha = 1e-3, which is what radiance may change by.
    assert (np.abs(rough - polished) <= 4 * error + 1e-3).all()


def test_highlights_of_lights_in_rough_borders() -> None:
    light = DirectionalLight((-0.5, -1.0, 0.1), (2.0, 1.0, 0.5))
    black = Medium(absorption=1e4, ior=1.5)
    body = Object(slab(-0.5, 0.5), black, surface=Surface(roughness=0.5))
    scene = Scene([body], oblique(30), [light], BLACK)
    to_eye, to_light = np.array([0.5, math.cos(math.pi / 6), 0.0]), -np.asarray(light.direction)
    half = (to_eye + to_light) / np.linalg.norm(to_eye + to_light)
    expected = (
        optics.fresnel_dielectric(half @ to_eye, 1.5)
        * interface.ggx_distribution(half[1], 0.25)
        * interface.ggx_visibility(to_light[1], to_eye[1], 0.25)
        * np.asarray(light.irradiance)
        * to_light[1]
    )
    found, _ = bent_light(scene, (1, 1), paths=2)
    np.testing.assert_allclose(found.radiance[0], expected, rtol=1e-10)


def test_noise_falls_with_the_number_of_paths_and_is_told() -> None:
    body = Object(slab(-0.5, 0.5), Medium(ior=1.5), surface=Surface(roughness=0.4))
    scene = Scene([body], oblique(30), environment=UP_AND_DOWN)
    (few, rough), (many, fine) = (bent_light(scene, (2, 2), paths=paths) for paths in (100, 2500))
    assert (rough / fine).mean() == pytest.approx(5.0, rel=0.3)
    spread = np.abs(few.radiance - many.radiance) / rough
    assert 0.1 < np.sqrt((spread**2).mean()) < 2.5
    again, _ = bent_light(scene, (2, 2), paths=100)
    np.testing.assert_array_equal(again.radiance, few.radiance)
    other, _ = bent_light(scene, (2, 2), paths=100, seed=1)
    assert (other.radiance != few.radiance).any()


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
    textured = Surface(color_texture=Texture(np.ones((2, 2, 3))))
    picture = Scene([Object(with_uv, Medium(ior=1.5), surface=textured)], camera)
    with pytest.raises(InputError, match="textures"):
        render(picture, (1, 1))
    assert render(picture, (1, 1), refraction=False).valid.all()


def test_light_in_an_open_body_is_invalid() -> None:
    mesh = box((-1, -1, -1), (1, 1, 1))
    bottom = (mesh.vertices[mesh.faces][..., 1] == -1).all(axis=1)
    scene = Scene([Object(Mesh(mesh.vertices, mesh.faces[~bottom]), Medium(ior=1.5))], oblique(0), environment=WHITE)
    found, _ = bent_light(scene, (1, 1))
    assert not found.valid.any()
