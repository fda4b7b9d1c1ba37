"""Light that bodies and opaque surfaces send each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import translucent as tl
from translucent.arrays import Array, Integers
from translucent.diffusion import irradiance_maps
from translucent.diffusion.cache import FieldCache, ground_map
from translucent.diffusion.entering import environment_parts, even_directions, opaque_surfaces, suns_of
from translucent.diffusion.exchange import GroundPoints
from translucent.diffusion.field import DiffusingBody
from translucent.diffusion.lit_body import lit_body, may_light
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.ray_caster import unit
from translucent.geometry.solids import Box, Sphere
from translucent.planning.bodies import enclosed_bodies
from translucent.planning.plan import plan
from translucent.planning.scattering import Diffusion
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.grounds import ground_below

CAMERA = tl.Camera.look_at((0, 1, 5), (0, 0, 0))
WHITE = tl.Environment.constant((1, 1, 1))
BLACK = tl.Environment.constant((0, 0, 0))
LOSSLESS = tl.Medium(scattering=(6.0, 12.0, 24.0), ior=1.4)


def ground(color: float = 1.0, height: float = -1.02) -> tl.Object:
    """A wide square below a ball, which faces up."""
    corners = np.array([(-40, height, -40), (-40, height, 40), (40, height, 40), (40, height, -40)], np.float64)
    return tl.Object(tl.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), None, color=(color,) * 3)


def solver(scene: tl.Scene) -> DiffusingBody:
    """Solver of the first object."""
    body = scene.objects[0]
    assert body.medium is not None
    lit = lit_body(body, opaque_surfaces(scene.opaque), Diffusion(12).cell_size(body))
    return DiffusingBody(lit, body.medium, 0.0)


def test_nothing_is_seen_of_a_white_ground_and_a_lossless_body_in_uniform_light() -> None:
    """The light of the sky that the ground takes away it sends on; in the corner of a room, too, and not if gray."""
    ball = tl.Object(Sphere().tessellate(24), LOSSLESS)
    wall = tl.Object(Box((1.05, -1.02, -40), (1.2, 40, 40)).tessellate(), None, color=(1, 1, 1))
    alone = tl.Scene([ball], CAMERA, environment=WHITE)
    free = solver(alone).field(alone, 0)
    for around, tolerance in (((ground(),), 5e-3), ((ground(), wall), 0.02)):
        scene = tl.Scene([ball, *around], CAMERA, environment=WHITE)
        found = solver(scene).field(scene, 0)
        np.testing.assert_allclose(found.leaving, free.leaving, rtol=tolerance)
    gray = tl.Scene([ball, ground(0.5)], CAMERA, environment=WHITE)
    assert solver(gray).field(gray, 0).leaving.mean() < 0.9 * free.leaving.mean()


def test_nothing_is_seen_of_lossless_bodies_beside_each_other() -> None:
    """In uniform light each sends the other what it keeps from it, to and fro in the gap, and by a white ground."""
    ball = tl.Object(Sphere(radius=0.5, center=(-0.52, 0.0, 0.0)).tessellate(24), LOSSLESS)
    block = tl.Object(Box((0.02, -0.5, -0.5), (1.0, 0.5, 0.5)).tessellate(), LOSSLESS)

    def leaving(*objects: tl.Object) -> list[Array]:
        scene = tl.Scene(objects, CAMERA, environment=WHITE)
        return [one.leaving for one in FieldCache().of(plan(scene, scattering=Diffusion(12))).surfaces.values()]

    alone = leaving(ball) + leaving(block)
    for around in ((), (ground(1.0, -0.52),)):
        for found, free in zip(leaving(ball, block, *around), alone, strict=True):
            assert np.abs((found / free).mean(axis=0) - 1.0).max() < 0.03
            # Light of rays spreads along the surface, and uniform light need not: their parts differ between samples.
            assert np.sqrt(((found / free - 1.0) ** 2).mean()) < 0.05


@pytest.mark.parametrize("gap", [0.02, 0.1])
def test_light_goes_to_and_fro_in_a_narrow_gap_until_it_has_left(gap: float) -> None:
    """In uniform light lossless blocks are as bright as alone, in all color channels: two rounds lack 4 %."""
    blocks = [
        tl.Object(Box((x + gap / 2, -0.5, -0.5), (x + 1 - gap / 2, 0.5, 0.5)).tessellate(), LOSSLESS) for x in (-1, 0)
    ]

    def leaving(*objects: tl.Object) -> Array:
        scene = tl.Scene(objects, CAMERA, environment=WHITE)
        found = FieldCache().of(plan(scene, scattering=Diffusion(12)))
        return np.concatenate([one.leaving for one in found.surfaces.values()])

    ratio = leaving(*blocks) / np.concatenate([leaving(block) for block in blocks])
    assert np.ptp(ratio.mean(axis=0)) < 0.01
    assert np.abs(ratio.mean(axis=0) - 1.0).max() < 0.02


def test_a_body_in_another_one_does_not_receive_its_light_twice() -> None:
    """Light that the outer body sends outwards does not reach the inner body."""
    inner, outer = Sphere(radius=0.4).tessellate(16), Sphere().tessellate(16)
    shapes = [lit_body(tl.Object(mesh, LOSSLESS), None, 0.2) for mesh in (inner, outer)]
    assert not may_light(shapes[1], shapes[0])
    assert may_light(shapes[0], shapes[1])


@pytest.mark.parametrize("left", [-40.0, 0.0])
def test_a_ground_lights_a_body_from_below(left: float) -> None:
    """The underside of a small lossless ball high above a sunny ground shows its radiosity; half above its edge."""
    light = tl.DirectionalLight((0, -1, 0), (1, 2, 3))
    ball = tl.Object(Sphere(radius=0.1).tessellate(24), tl.Medium(scattering=200.0))
    slab = tl.Object(Box((left, -4, -40), (40, -3, 40)).tessellate(), None, color=(0.5, 0.5, 0.5))
    scene = tl.Scene([ball, slab], CAMERA, [light], BLACK)
    diffusing = solver(scene)
    below = diffusing.lit.grid.normals[:, 1] < -0.95
    found = diffusing.field(scene, 0).leaving[below].mean(axis=0)
    np.testing.assert_allclose(found, (0.5 if left else 0.25) * np.array((1, 2, 3)), rtol=0.1)


def test_the_light_of_a_ball_on_a_ground() -> None:
    """Irradiance below a ball of even radiosity is that times (r / d)^2 cos, where all of it is above the ground."""
    ball = tl.Object(Sphere(radius=0.5).tessellate(64), LOSSLESS)
    scene = tl.Scene([ball, ground(0.5)], CAMERA, environment=WHITE, environment_shadows=8)
    found = ground_below(scene, [0])
    assert found is not None
    assert found.height == pytest.approx(-1.02)
    points, diffusing = GroundPoints(found, 1, ball.bounds), solver(scene)

    def even(sample: Integers, _: Array) -> Array:
        return np.full((len(sample), 3), 1.0 / np.pi)

    irradiance = points.irradiance((np.zeros(3), 0.5), diffusing.lit.nearest, even)[:, 0]
    distance = np.linalg.norm(points.points, axis=1)
    near = distance < 6.0
    off = irradiance[near] / (0.5**2 * 1.02 / distance**3)[near] - 1.0
    assert np.abs(off).max() < 0.06
    assert np.sqrt((off**2).mean()) < 0.015
    assert abs(off.mean()) < 2e-3
    # Where the environment reaches the ground through the ball, that counts for the same light.
    reached, field = tl.Scene(scene.objects, CAMERA, environment=WHITE), diffusing.field(scene, 0)
    shadowed, through = (ground_map(one, {0: diffusing.lit}, {0: field}) for one in (scene, reached))
    assert shadowed is not None
    assert through is not None
    assert shadowed.values.max() > 0.3 > 0.03 > through.values.max()


def test_the_light_of_a_glowing_ball_on_a_ground() -> None:
    """A ball that emits q V W/sr, and neither absorbs nor bends light, is like a point (Newton's shell theorem)."""
    ball = tl.Object(Sphere(radius=0.5).tessellate(64), tl.Medium(emission=(1, 2, 3)))
    glass = tl.Object(Sphere(radius=0.7).tessellate(64), tl.Medium(ior=1.4), priority=-1)
    board = tl.Object(Box((0.7, -0.98, -0.4), (4, -0.93, 0.4)).tessellate(), None)
    hidden, bare = (plan(tl.Scene(objects, CAMERA)) for objects in ([ball, ground(), board], [ball, ground()]))
    assert bare.glowing == (0,)
    alone, beside = (FieldCache().of(one).ground for one in (bare, hidden))
    assert alone is not None
    assert beside is not None
    x = np.linspace(-2, 2, 9)
    at, up = np.stack([x, 0 * x - 1.02, 0 * x], axis=1), np.tile((0.0, 1.0, 0.0), (9, 1))
    point = ball.mesh.volume * 1.02 / (x**2 + 1.02**2)[:, None] ** 1.5 * (1, 2, 3)
    np.testing.assert_allclose(alone.irradiance(at, up), point, rtol=0.03)
    # Below the board it is dark; and a ball in glass, which traps none of this light, sends as much.
    np.testing.assert_allclose(beside.irradiance(at, up)[-3:], 0.0, atol=1e-6)
    np.testing.assert_allclose(beside.irradiance(at, up)[:2], point[:2], rtol=0.03)
    inside = plan(tl.Scene([ball, ground(), glass], CAMERA, overlap="priority"))
    assert inside.glowing == (0, 2)
    around = FieldCache().of(inside).ground
    assert around is not None
    assert around.irradiance(at, up).mean() == pytest.approx(point.mean(), rel=0.05)


def test_bodies_on_a_ground_hide_each_other() -> None:
    """A surface that a ball hides from every point of the ground exchanges no light with the ground."""
    outer, inner = Sphere(radius=0.5).tessellate(24), Sphere(radius=0.3).tessellate(24)
    dark = tl.Medium(absorption=300.0, scattering=30.0)
    cover = tl.Object(outer, dark)
    hidden = [tl.Object(inner, within, color=(1, 1, 1)) for within in (dark, None)]
    scenes = [
        tl.Scene([cover, ground(0.5), *objects], CAMERA, environment=WHITE) for objects in ((), hidden[:1], hidden[1:])
    ]
    alone, *others = [FieldCache().of(plan(one, scattering=Diffusion(8))).ground for one in scenes]
    assert alone is not None
    assert alone.values.min() < -0.3
    for found in others:
        assert found is not None
        np.testing.assert_allclose(found.values, alone.values, atol=0.01)


@pytest.mark.parametrize(("degrees", "rotation"), [(1.0, 0.0), (0.4, 40.0)])
def test_suns_of_pictures_keep_their_light_and_direction(degrees: float, rotation: float) -> None:
    """However small they are, and wherever they stand between the directions in which samples look."""
    towards = np.array((0.5, 0.6, -0.3)) / np.linalg.norm((0.5, 0.6, -0.3))
    cosine, sine = np.cos(np.radians(rotation)), np.sin(np.radians(rotation))
    world = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]) @ towards

    def radiance(directions: Array) -> Array:
        return 0.1 + 1e4 * (directions @ towards > np.cos(np.radians(degrees)))[..., None] * np.ones(3)

    around = tl.Environment.image(EnvironmentMap.from_formula(radiance, 512), rotation=rotation)
    suns, directions, total = suns_of(around), even_directions(128), 4.0 * np.pi * around.mean
    sent = np.sum([sun.irradiance for sun in suns], axis=0)
    rest = environment_parts(around, directions, suns=False)
    np.testing.assert_allclose(rest.sum(axis=0) + sent, total, rtol=1e-9)
    np.testing.assert_allclose(environment_parts(around, directions).sum(axis=0), total, rtol=1e-9)
    assert sent[0] > 0.5 * total[0]
    assert min(-np.asarray(sun.direction) @ world for sun in suns) > np.cos(np.radians(2.0))


@pytest.mark.parametrize("color", [0.0, 0.5, 1.0])
def test_an_opaque_ball_in_a_ball_takes_what_diffusion_brings_to_it(color: float) -> None:
    """Uniform light on a lossless ball around it: phi = A + B / r between the two surfaces, which lose c phi each."""
    radius, scattering = 0.5, 40.0
    outer = tl.Object(Sphere().tessellate(32), tl.Medium(scattering=scattering, ior=1.3))
    inner = tl.Object(Sphere(radius=radius).tessellate(32), None, color=(color,) * 3)
    found = plan(tl.Scene([outer, inner], CAMERA, environment=WHITE), scattering=Diffusion(24))
    field = FieldCache().of(found).surfaces[0]
    interface, d = diffuse_interface(1.3), 1.0 / (3.0 * scattering)
    entering, leaves = np.pi * interface.entering, interface.conductance
    lost = max((1.0 - color) / (2.0 * (1.0 + color)), 1e-9)
    # Below the first events, somewhat deep, the fluence is higher than at the surface.
    deeper = 1.0 + 3.0 * interface.mean_cosine * leaves
    taken = entering / (1.0 + leaves / deeper * (1.0 / (radius**2 * lost) + (1.0 / radius - 1.0) / d))
    np.testing.assert_allclose(np.pi - field.leaving.mean(), taken, rtol=0.1, atol=0.003)
    # Fluence phi at the inner ball, which receives phi / (2 (1 + a)).
    on_it = taken / radius**2 / (1.0 - color) if color < 1.0 else np.pi * 1.3**2
    assert field.inclusions is not None
    step = field.placement.step
    place = np.argwhere(field.inclusions[..., 0] > 0.0) * step + 0.5 * step + field.placement.low
    near = np.abs(np.linalg.norm(place, axis=1) - radius) < step
    values = field.inclusions[field.inclusions[..., 0] > 0.0][near]
    np.testing.assert_allclose(values.mean(), on_it, rtol=0.1)


def test_a_white_ball_in_thin_milk_is_as_bright_as_uniform_light() -> None:
    """All light that comes to it goes on: nothing of it counts twice, however much of it is unscattered."""
    outer = tl.Object(Sphere().tessellate(24), tl.Medium(scattering=(0.5, 1.5, 4.0), ior=1.3))
    inner = tl.Object(Sphere(radius=0.5).tessellate(16), None, color=(1.0, 1.0, 1.0))
    field = (
        FieldCache().of(plan(tl.Scene([outer, inner], CAMERA, environment=WHITE), scattering=Diffusion(16))).surfaces[0]
    )
    assert field.inclusions is not None
    on_it = [channel[channel > 0.0].mean() for channel in np.moveaxis(field.inclusions, -1, 0)]
    np.testing.assert_allclose(on_it, np.pi * 1.3**2, rtol=0.02)
    assert (0.6 * np.pi < field.leaving.mean(axis=0)).all()
    assert (field.leaving.mean(axis=0) < np.pi).all()


def test_objects_beside_a_body_are_not_inside() -> None:
    """A ball that touches it, a ground, and a room around it."""
    ball = tl.Object(Sphere().tessellate(24), LOSSLESS)
    beside = np.eye(4)
    beside[0, 3] = 1.6
    touching = tl.Object(Sphere(radius=0.6).tessellate(24), None, transform=beside)
    room = tl.Object(Box((-9, -9, -9), (9, 9, 9)).tessellate(), None)
    for item in (touching, ground(), room):
        found = FieldCache().of(plan(tl.Scene([ball, item], CAMERA), scattering=Diffusion(12)))
        assert found.surfaces[0].inclusions is None


def test_light_on_a_ball_in_glass_is_what_its_surface_lets_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """A black ball in the middle of a ball of glass: of its rays, those come back that the glass mirrors, to the ball.

    A white one without losses is not there: it has the light of the environment.
    """
    monkeypatch.setattr(irradiance_maps, "SAMPLES", 256)
    inner, glass = Sphere(radius=0.5).tessellate(48), tl.Medium((0.0, 0.3, 1.0), ior=1.5)
    sine = np.sqrt((np.arange(1000) + 0.5) / 1000)  # of rays distributed as the cosine
    metres = np.sqrt(1.0 - (0.5 * sine) ** 2) - 0.5 * np.sqrt(1.0 - sine**2)
    mirrored = optics.fresnel_dielectric(np.sqrt(1.0 - (0.5 * sine) ** 2), 1.0 / 1.5)
    let_in = np.exp(-np.multiply.outer(metres, glass.absorption)) * (1.0 - mirrored)[:, None]
    normals = unit(np.array([(1, 0, 0), (0, -1, 0), (0.6, 0.0, 0.8), (-0.5, 0.5, -0.7)], np.float64))
    for color, medium, expected in ((0.0, glass, let_in.mean(axis=0)), (1.0, tl.Medium(ior=1.5), np.ones(3))):
        objects = tl.Object(Sphere().tessellate(64), medium), tl.Object(inner, None, color=(color,) * 3)
        scene = tl.Scene(list(objects), CAMERA, environment=WHITE)
        assert plan(scene).exchanging == (1,)
        found = irradiance_maps.irradiance_maps(scene, (1,))[1].at(0.5 * normals, normals)
        np.testing.assert_allclose(found / np.pi, np.tile(expected, (4, 1)), atol=0.02)


def test_light_of_lights_on_a_ball_in_glass_is_as_much_as_the_glass_collects(monkeypatch: pytest.MonkeyPatch) -> None:
    """The inner ball looks n times as large from the light, and all that is directed there and not mirrored lands."""
    monkeypatch.setattr(irradiance_maps, "SAMPLES", 256)
    objects = (
        tl.Object(Sphere().tessellate(64), tl.Medium(ior=1.5)),
        tl.Object(Sphere(radius=0.5).tessellate(48), None, color=(0, 0, 0)),
    )
    scene = tl.Scene(list(objects), CAMERA, [tl.DirectionalLight((0, 0, -1), 1.0)], BLACK)
    places = 0.75 * np.sqrt((np.arange(1000) + 0.5) / 1000)
    passed = 1.0 - optics.fresnel_dielectric(np.sqrt(1.0 - places**2), 1.5)
    normals = even_directions(256)
    found = irradiance_maps.irradiance_maps(scene, (1,), 1 << 14)[1]
    assert found.lit
    black = 0.75**2 * passed.mean() / (4.0 * 0.5**2 * 1.5**2)
    np.testing.assert_allclose(found.at(0.5 * normals, normals).mean(), black, rtol=0.03)


def test_a_ball_of_wax_in_a_ball_of_glass(monkeypatch: pytest.MonkeyPatch) -> None:
    """What leaves it comes back where the glass mirrors it; without losses it is not there in even light."""
    monkeypatch.setattr(irradiance_maps, "PATHS", 1 << 14)
    body = tl.Object(Sphere(radius=0.5).tessellate(48), tl.Medium(scattering=200.0, ior=1.4), priority=1)
    glass = tl.Object(Sphere().tessellate(64), tl.Medium(ior=1.5))
    scene = tl.Scene([glass, body], CAMERA, environment=WHITE, overlap="priority")
    planned = plan(scene, scattering=Diffusion(12))
    assert enclosed_bodies(planned.scene) == (1,)
    paths = irradiance_maps.EnclosedPaths(planned.scene, 1, {1: lit_body(body, None, Diffusion(12).cell_size(body))})
    np.testing.assert_array_equal(paths.outside, 1.5)
    # A ray that leaves the ball at an angle meets the glass at half its sine, and comes back at the same angle.
    sine = np.sqrt((np.arange(1000) + 0.5) / 1000)
    back = optics.fresnel_dielectric(np.sqrt(1.0 - (0.5 * sine) ** 2), 1.0 / 1.5)
    entering = 1.0 - optics.fresnel_dielectric(np.sqrt(1.0 - sine**2), 1.4 / 1.5)
    returned = paths.exchange.returned(np.ones(len(paths.outside)), 0)
    assert returned.mean() == pytest.approx((back * entering).mean(), rel=0.05)
    found = FieldCache().of(planned).surfaces[1]
    np.testing.assert_allclose(found.leaving, np.pi, rtol=0.03)
    # The ball collects the sun's light as one 1.5 times as wide, and at last all of it leaves through the glass.
    lit = plan(
        replace(scene, lights=[tl.DirectionalLight((0, 0, -1), 1.0)], environment=BLACK), scattering=Diffusion(12)
    )
    sun = FieldCache().of(lit).surfaces[1].leaving.mean() * 1.5**2 * (1.0 - back.mean())
    passed = 1.0 - optics.fresnel_dielectric(np.sqrt(1.0 - (0.75 * sine) ** 2), 1.5)
    assert sun == pytest.approx(0.75**2 * (passed * entering).mean() / (4.0 * 0.5**2), rel=0.03)
