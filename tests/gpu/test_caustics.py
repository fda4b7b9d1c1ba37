"""Caustics on the GPU: the closed form of a ball, the float64 reference, conservation of energy, what shows them."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import moderngl
import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.ball_light import ball_light, flux_within, fresnel
from translucent.formulas.interface import slab_reflectance, slab_transmittance
from translucent.geometry.ray_caster import embree_refusal
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.passes import caustics as caustics_pass
from translucent.gpu.passes import light_views
from translucent.gpu.passes.caustics import CausticsPass
from translucent.planning import caustics as planned_caustics
from translucent.planning.passes import PassName
from translucent.reference import photon_irradiance, trace_photons

Array = npt.NDArray[np.float64]

SEGMENTS = 64
BALL, CORE = Sphere().tessellate(SEGMENTS), Sphere(radius=0.5).tessellate(SEGMENTS)
QUAD = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], dtype=np.float64)
TILTED = np.array([(np.sqrt(0.5), -np.sqrt(0.5), 0), (np.sqrt(0.5), np.sqrt(0.5), 0), (0, 0, 1)])  # by 45 degrees
GROUND = tl.Object(tl.Mesh(60 * QUAD, [(0, 2, 1), (0, 3, 2)], name="ground"))
CAMERA = tl.Camera.look_at((0, 5, 9), (0, 0, 0))
SUN = tl.DirectionalLight((0, -1, 0), 1.0)
CLEAR = tl.Medium(ior=1.5)
#: As dark as what photons go through is to straight light.
DARK = tl.Medium(1e4 / np.sqrt(12.0), ior=1.5)
NIGHT = tl.Environment.constant((0.0, 0.0, 0.0))
FENCE = [tl.Object(Box((x, 0.5, 2.0), (x + 0.05, 1.2, 2.02)).tessellate()) for x in np.linspace(-0.3, 0.25, 6)]
RADII = (0.3, 0.6, 1.2, 3.0)


def at(x: float, y: float, z: float) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def ball(medium: tl.Medium = CLEAR, height: float = 2.0, mesh: tl.Mesh = BALL, **options: object) -> tl.Object:
    return tl.Object(mesh, medium, at(0, height, 0), **options)  # type: ignore[arg-type]


def scene(
    *objects: tl.Object, light: tl.PointLight | tl.SphereLight | tl.DirectionalLight = SUN, **options: object
) -> tl.Scene:
    given = {"camera": CAMERA, "environment": NIGHT, **options}
    return tl.Scene(objects or (ball(), GROUND), lights=[light], **given)  # type: ignore[arg-type]


class Landed:
    """Photons of the frames that are rendered meanwhile: points in the world, power, and how many were given up."""

    def __init__(self) -> None:
        self.parts: list[npt.NDArray[np.float32]] = []

    def keep(self, framebuffer: moderngl.Framebuffer, count: int) -> None:
        parts = [
            np.frombuffer(framebuffer.read(components=4, attachment=i, dtype="f4"), np.float32).reshape(-1, 4)[:count]
            for i in range(2)
        ]
        self.parts.append(np.concatenate(parts, axis=1))

    @property
    def all(self) -> Array:
        return np.concatenate(self.parts).astype(np.float64)

    def points(self, one: tl.Scene) -> Array:
        boxes = np.stack([body.bounds for body in one.bodies])
        center = 0.5 * (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0))
        return np.asarray(self.all[self.all[:, 3] == 1, :3] + center)

    @property
    def power(self) -> Array:
        return np.asarray(self.all[self.all[:, 3] == 1, 4:7])


@pytest.fixture
def landed(monkeypatch: pytest.MonkeyPatch) -> Landed:
    kept, add = Landed(), CausticsPass._add

    def spy(self: CausticsPass, job: object, framebuffer: moderngl.Framebuffer, count: int) -> None:
        kept.keep(framebuffer, count)
        add(self, job, framebuffer, count)  # type: ignore[arg-type]

    monkeypatch.setattr(CausticsPass, "_add", spy)
    return kept


@pytest.mark.parametrize(("light", "lamp", "absorption"), [(SUN, None, 0.0), (tl.PointLight((0, 5, 0), 1.0), 3.0, 0.4)])
def test_a_ball_throws_what_its_rays_carry(
    light: tl.PointLight, lamp: float | None, absorption: float, renderer: tl.Renderer, landed: Landed
) -> None:
    """In all, and within circles around the focus."""
    one = scene(ball(tl.Medium(absorption, ior=1.5)), GROUND, light=light)
    renderer.render(one, (8, 8), caustics=tl.Caustics(60_000))
    points = landed.points(one)
    found = flux_within(landed.power[:, 0], np.hypot(points[:, 0], points[:, 2]), RADII)
    flux, distance = ball_light(2.0, 1.5, lamp=lamp, absorption=absorption)
    # What the facets of the ball cut off its disc, and chance at its interfaces: a twelfth of the light is mirrored.
    error = np.abs(found - flux_within(flux, distance, RADII)) / flux.sum()
    assert (error < (np.pi / SEGMENTS) ** 2 + 4.0 * np.sqrt(0.1 / 60_000)).all()
    assert np.abs(points[:, 1]).max() < 1e-5
    assert (landed.all[:, 3] >= 0).all()


@pytest.mark.parametrize("where", [(3.0, 1.0, 0.0), (0.0, 0.7, 0.0), (0.1, 0.2, 0.0)])
def test_no_light_is_lost(where: tuple[float, float, float], renderer: tl.Renderer, landed: Landed) -> None:
    """A lossless rough ball with another one in it, in a closed box, and a lamp beside them, in one, in both: all that
    meets the interfaces lands.
    """
    box = tl.Object(Box((-4.0, -4.0, -4.0), (4.0, 4.0, 4.0)).tessellate())
    lamp, frosted = tl.PointLight(where, (1.0, 2.0, 3.0)), tl.Surface(roughness=0.3)
    objects = [ball(height=0.0, surface=frosted), tl.Object(CORE, tl.Medium(ior=1.2), priority=1), box]
    renderer.render(scene(*objects, light=lamp, overlap="priority"), (8, 8), caustics=tl.Caustics(1_000))
    distance = float(np.linalg.norm(where))
    truth = 4.0 * np.pi if distance < 1 else 2.0 * np.pi * (1.0 - np.sqrt(1.0 - distance**-2))
    # What the facets of the ball cut off its disc; beside it a photon in a thousand is lost after many events.
    np.testing.assert_allclose(landed.power[:, 0].sum() / truth, 1.0, atol=2.0 * (np.pi / SEGMENTS) ** 2 + 1e-3)
    np.testing.assert_allclose(landed.power / landed.power[:, :1], [(1.0, 2.0, 3.0)] * len(landed.power), rtol=1e-5)


def blurred(picture: Array) -> Array:
    """Over a pixel: a tent of two."""
    for axis in (0, 1):
        moved = [np.roll(picture, by, axis) for by in (-1, 1)]
        picture = 0.5 * picture + 0.25 * (moved[0] + moved[1])
    return picture


LAMP = tl.PointLight((1.5, 6.0, 1.0), (10.0, 20.0, 30.0))
TINTED = tl.Medium((0.2, 0.1, 0.05), ior=1.5)
COARSE = Sphere().tessellate(24)
COARSE_CORE = Sphere(radius=0.5).tessellate(16)
PLATE = tl.Object(Box((-2.5, 0.0, -2.5), (0.9, 0.05, 0.6)).tessellate(), color=(0.6, 0.6, 0.6))
#: Reflects a fifth to a third of the light.
FILM_AND_COAT = tl.Surface(iridescence=1.0, iridescence_ior=2.4, iridescence_thickness=1.2e-7, clearcoat=1.0)
#: Balls over a ground, and how far off the energy may be: with a plate in the light, pixels at its edges show one side.
#: And the pixels: the reference's few photons of a rough ball alone are 0.18 to 0.33 off by other seeds.
PAIRS = {
    "ball and core": (
        scene(
            ball(TINTED, mesh=COARSE),
            tl.Object(COARSE_CORE, tl.Medium((1.0, 0.5, 0.1), ior=1.2), at(0.2, 2, 0), priority=1),
            GROUND,
            PLATE,
            light=LAMP,
            overlap="priority",
        ),
        0.05,
        0.2,
    ),
    "film and coat": (scene(ball(CLEAR, mesh=COARSE, surface=FILM_AND_COAT), GROUND, light=SUN), 0.01, 0.2),
    "rough film and coat": (
        scene(ball(TINTED, mesh=COARSE, surface=replace(FILM_AND_COAT, roughness=0.4)), GROUND, light=LAMP),
        0.01,
        0.3,
    ),
    "sphere light": (scene(ball(CLEAR, mesh=COARSE), GROUND, light=tl.SphereLight((1.5, 6, 1), 20.0, 0.6)), 0.01, 0.2),
    "dispersive": (scene(ball(CLEAR, mesh=COARSE, surface=tl.Surface(dispersion=2.0)), GROUND, light=SUN), 0.01, 0.2),
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_irradiance_is_that_of_the_reference(name: str, renderer: tl.Renderer) -> None:
    """In a picture from beneath the ball: energy, and pixels."""
    one, tolerance, most = PAIRS[name]
    camera, size = tl.Camera.look_at((0.5, 1.2, 3.5), (-0.4, 0, 0), fov_y=40), (48, 32)
    one = tl.Scene(one.objects, camera, one.lights, NIGHT, one.overlap)
    found = photons_in(renderer, one, size, tl.Caustics(30_000))
    halves = [trace_photons(one, 1200, seed) for seed in range(2)]
    a, b = (photon_irradiance(one, size, landed) for landed in halves)
    # Photons that land differ in power little; four standard errors.
    noise = 4.0 / np.sqrt(2.0 * min(np.count_nonzero(landed.power[:, c]) for landed in halves for c in range(3)))
    share = found.sum(axis=(0, 1)) / (0.5 * (a + b)).sum(axis=(0, 1))
    np.testing.assert_allclose(share, 1.0, atol=tolerance + noise)
    a, b, found = blurred(a), blurred(b), blurred(found)
    assert np.sqrt(max(((found - a) * (found - b)).mean(), 0.0)) / (0.5 * (a + b).mean()) < most


#: Bodies that share places: one in another, both on the ground and on a plate; a pane beside them, whose back is open.
STANDING = (
    tl.Object(Box((-0.6, 0.0, -0.6), (0.6, 1.0, 0.6)).tessellate(), TINTED, priority=1),
    tl.Object(Box((-0.6, 0.0, -0.2), (0.2, 0.7, 0.2)).tessellate(), tl.Medium((1.0, 0.5, 0.1), ior=1.33)),
    ball(CLEAR, 1.5, COARSE_CORE, surface=tl.Surface(dispersion=2.0)),
    tl.Object(tl.Mesh(QUAD @ TILTED, [(0, 2, 1), (0, 3, 2)]), CLEAR, at(1.2, 1, 0), sheet_thickness=1e-3),
    replace(PLATE, surface=tl.Surface(double_sided=False)),
    GROUND,
)
STREAMS = {
    "rough film and coat": PAIRS["rough film and coat"][0],
    "standing, dispersive, from a sphere": scene(
        *STANDING, light=tl.SphereLight((1.5, 6, 1), (10.0, 20.0, 30.0), 0.6), overlap="priority"
    ),
}


@pytest.mark.parametrize("name", STREAMS)
def test_photons_by_embree_land_where_those_of_shaders_do(name: str, renderer: tl.Renderer, landed: Landed) -> None:
    """Each with the same power, but for few at edges of triangles, where either side is as right."""
    if embree_refusal() or not renderer.gpu.capabilities.shader_storage:
        pytest.skip("no Embree, or no compute shaders")
    count, found, gpu = 20_000, list[Array](), renderer.gpu
    plan = renderer.plan(STREAMS[name], caustics=tl.Caustics(count))
    assert plan.hits == "embree"
    others = tuple(one.name for one in plan.passes if one.name not in (PassName.OPAQUE, PassName.CAUSTICS))
    for hits in ("embree", "gl"):
        landed.parts.clear()
        with gpu.context.current():
            job = gpu.prepare(replace(plan, hits=hits), (8, 8))
            gpu.run(job, leave_out=others)
            job.release()
        found.append(landed.all)
    one, other = found
    assert len(one) == len(other) >= count - 2
    assert (other[:, 3] == 1.0).mean() > 0.2
    different = (one[:, 3] != other[:, 3]) | (np.abs(one - other).max(axis=1) > 1e-3 * np.abs(other).max(axis=1))
    assert different.mean() < 2e-3
    np.testing.assert_allclose(one[:, 4:].sum(axis=0), other[:, 4:].sum(axis=0), rtol=2e-3)


def photons_in(renderer: tl.Renderer, one: tl.Scene, size: tuple[int, int], caustics: tl.Caustics) -> Array:
    """(h, w, 3): irradiance of photons on the opaque objects that a picture shows."""
    gpu, plan = renderer.gpu, renderer.plan(one, caustics=caustics)
    with gpu.context.current():
        job = gpu.prepare(plan, size)
        gpu.run(job)
        data = job.targets["photons"].read(components=4, dtype="f4")
        job.release()
    return np.frombuffer(data, np.float32).reshape(*size[::-1], 4)[::-1, :, :3].astype(np.float64)


def top(height: float = 4.0) -> tl.Camera:
    return tl.Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), height=height)


def test_a_focus_is_as_sharp_as_its_photons(renderer: tl.Renderer, landed: Landed) -> None:
    """Half of its light is in a few pixels; with squares of half a pixel for all the error is six times the bar."""
    camera = tl.Camera.orthographic((0.01, 9, 0.01), (0.01, 0, 0.01), (0, 0, 1), height=4.0)  # a sixth of a pixel aside
    one = scene(ball(height=1.5), GROUND, camera=camera)
    found = photons_in(renderer, one, (60, 60), tl.Caustics(20_000))[..., 0]
    points, edges = landed.points(one), np.linspace(-2.0, 2.0, 61)
    points -= camera.eye
    rows, columns = -points @ camera.up, points @ camera.right
    truth = np.histogram2d(rows, columns, (edges, edges), weights=landed.power[:, 0])[0] * 15.0**2
    assert found.sum() == pytest.approx(truth.sum(), rel=1e-3)
    assert np.linalg.norm(found - truth) < 0.03 * np.linalg.norm(truth)


def test_samples_do_not_blur_a_focus(renderer: tl.Renderer, landed: Landed) -> None:
    """The mean of samples shows photons in the pixels in which they land, below a ball: counted in squares around the
    points of the samples, the error is .14.
    """
    aside = 2.0 / 60.0  # the focus in the middle of a pixel
    camera = tl.Camera.orthographic((aside, 0.4, aside), (aside, 0, aside), (0, 0, 1), height=4.0)
    one, dark = (scene(ball(medium, height=1.5), GROUND, camera=camera) for medium in (CLEAR, DARK))
    edges = np.linspace(-2.0, 2.0, 61)
    for samples in (4, 16):  # of 16, four have photons
        landed.parts.clear()
        found = renderer.render(one, (60, 60), samples=samples, caustics=tl.Caustics(20_000)).radiance[..., 0]
        points = landed.points(one) - camera.eye
        given = -points @ camera.up, points @ camera.right
        truth = np.histogram2d(*given, (edges, edges), weights=landed.power[:, 0] / samples)[0] * 15.0**2 * 0.6 / np.pi
        straight = renderer.render(dark, (60, 60), samples=samples).radiance[..., 0]
        assert np.linalg.norm(found - straight - truth) < 0.03 * np.linalg.norm(truth), samples


def test_a_light_with_a_size_has_a_sharp_image(renderer: tl.Renderer, landed: Landed) -> None:
    """Photons that start side by side begin at nearly one point of the light. If any point counted, each would be
    as wide as a pixel, and the error .05; it is .004.
    """
    camera = tl.Camera.orthographic((0.01, 0.4, 0.01), (0.01, 0, 0.01), (0, 0, 1), height=4.0)
    one = scene(ball(height=1.5), GROUND, light=tl.SphereLight((0.0, 8.0, 0.0), 50.0, 0.2), camera=camera)
    found = photons_in(renderer, one, (60, 60), tl.Caustics(100_000))[..., 0]
    points, edges = landed.points(one) - camera.eye, np.linspace(-2.0, 2.0, 61)
    given = -points @ camera.up, points @ camera.right
    truth = np.histogram2d(*given, (edges, edges), weights=landed.power[:, 0])[0] * 15.0**2
    assert np.linalg.norm(found - truth) < 0.01 * np.linalg.norm(truth)


def test_even_light_is_even(renderer: tl.Renderer) -> None:
    """Through a flat window: half as wide photons vary more than the bar, and by chance twice as much."""
    window = tl.Object(Box((-1, 1, -1), (1, 1.2, 1)).tessellate(), tl.Medium(ior=1.9))
    one = scene(window, GROUND, light=tl.DirectionalLight((0.1, -1, 0.06), 1.0), camera=top())
    middle = photons_in(renderer, one, (60, 60), tl.Caustics(5000))[20:40, 20:40, 0]  # 5.6 of a pixel
    mirrored = (0.9 / 2.9) ** 2  # by each face
    assert middle.mean() == pytest.approx((1.0 - mirrored) / (1.0 + mirrored) / np.sqrt(1.0136), rel=0.005)
    assert middle.std() < 0.085 * middle.mean()


def test_the_ground_shows_what_lands_on_it(renderer: tl.Renderer, landed: Landed) -> None:
    """Diffuse reflection of its power, in one sample and in several; less the share that its coat and metal mirror."""
    gray, camera = (0.5, 0.25, 1.0), tl.Camera.look_at((0, 0.9, 2.5), (0, 0, 0), fov_y=30)
    half = tl.Surface(color=gray, metallic=0.5, roughness=1.0, ior=1.0)
    for ground, kept in ((tl.Object(GROUND.mesh, color=gray), 1.0), (tl.Object(GROUND.mesh, surface=half), 0.5)):
        one = scene(ball(), ground, camera=camera)
        shadowed = scene(ball(DARK), ground, camera=camera)
        for samples in (1, 4):
            landed.parts.clear()
            without = renderer.render(shadowed, (32, 24), samples=samples).radiance.astype(np.float64)
            frame = renderer.render(one, (32, 24), samples=samples, caustics=tl.Caustics(20_000))
            added = frame.radiance - without
            shown = photons_in(renderer, one, (32, 24), tl.Caustics(20_000)) * kept * np.array(gray) / np.pi
            np.testing.assert_allclose(
                added.sum(axis=(0, 1)), shown.sum(axis=(0, 1)), rtol=2e-2 if samples > 1 else 1e-4
            )
            if samples == 1:  # but for where few photons are spread
                error = blurred(added) - blurred(shown)
                assert np.sqrt(np.square(error).mean()) < 0.1 * shown.mean()
            assert sum(len(part) for part in landed.parts) == 40_000  # of both frames, and each photon once
    assert frame.plan.caustics == tl.Caustics(20_000)
    assert frame.plan.opaque_to_shadows == {0}
    assert frame.seconds["caustics"] > 0.0


def test_few_photons_are_spread_and_none_of_their_light_is_lost(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Less noise than without, the same power; and the fence that is seen before the ground has none of it."""
    camera, size = tl.Camera.look_at((0, 0.9, 2.5), (0, 0, 0), fov_y=30), (48, 36)
    dark = renderer.render(scene(ball(DARK), GROUND, *FENCE, camera=camera), size).radiance.astype(np.float64)
    one = scene(ball(), GROUND, *FENCE, camera=camera)
    truth = photons_in(renderer, one, size, tl.Caustics(200_000)) * 0.6 / np.pi
    errors = []
    for enough in (caustics_pass.ENOUGH, 0.0):
        monkeypatch.setattr(caustics_pass, "ENOUGH", enough)
        added = renderer.render(one, size, caustics=tl.Caustics(5000, seed=2)).radiance - dark
        shown = photons_in(renderer, one, size, tl.Caustics(5000, seed=2)) * 0.6 / np.pi
        assert added.sum() == pytest.approx(shown.sum(), rel=5e-3)
        errors.append(np.sqrt(np.square(added - truth).mean()))
        hidden = (dark == 0.0) & (truth == 0.0)  # the fence, and the middle of the shadow if nothing lights it
        assert np.count_nonzero(hidden[14:22]) > 200
        assert np.abs(added[14:22][hidden[14:22]]).max() == 0.0
    assert errors[0] < 0.42 * errors[1]  # .90 with sides of whole pixels


def test_interfaces_show_caustics_behind_them(renderer: tl.Renderer) -> None:
    """Through a pane before the eye: what the pane lets through of them."""
    pane = tl.Object(
        tl.Mesh(QUAD @ [(1, 0, 0), (0, 0, 1), (0, 1, 0)] + (0, 0, 2), [(0, 1, 2), (0, 2, 3)]),
        tl.Medium(ior=1.5),
        sheet_thickness=1e-3,
    )
    camera = tl.Camera.look_at((0, 0.5, 4), (0, 0, 0), fov_y=12)
    one = scene(ball(), pane, GROUND, camera=camera)
    caustics = tl.Caustics(20_000)
    without = renderer.render(scene(ball(DARK), pane, GROUND, camera=camera), (16, 12)).radiance
    added = renderer.render(one, (16, 12), caustics=caustics).radiance - without
    shown = photons_in(renderer, one, (16, 12), caustics) * 0.6 / np.pi
    lit = shown[..., 0] > 0.02 * shown.max()
    share = slab_transmittance(fresnel(np.array(np.cos(np.arctan(0.125))), 1.5), 0.0)
    np.testing.assert_allclose(added[lit].sum() / shown[lit].sum(), share, rtol=0.02)


def test_nothing_is_seen_of_the_other_side_of_a_ground(renderer: tl.Renderer) -> None:
    one = scene(camera=tl.Camera.look_at((0, -9, 1), (0, 0, 0)))
    assert not photons_in(renderer, one, (16, 12), tl.Caustics(2000)).any()


def test_a_mirror_of_glass_turns_a_beam_aside(renderer: tl.Renderer, landed: Landed) -> None:
    """Light that passes a sheet goes straight, and is left to straight light."""
    half = np.sqrt(0.5)
    corners = [(-half, half, -1), (half, -half, -1), (half, -half, 1), (-half, half, 1)]
    pane = tl.Object(
        tl.Mesh(np.array(corners), [(0, 1, 2), (0, 2, 3)]), tl.Medium(100.0, ior=1.5), at(0, 3, 0), sheet_thickness=1e-3
    )
    one = scene(pane, GROUND, light=tl.DirectionalLight((1, -1e-6, 0), 2.0))
    renderer.render(one, (8, 8), caustics=tl.Caustics(20_000))
    share = slab_reflectance(fresnel(np.sqrt(0.5), 1.5), 0.1 / np.sqrt(1.0 - 0.5 / 1.5**2))
    assert landed.power[:, 0].sum() == pytest.approx(
        2.0 * np.sqrt(2.0) * 2.0 * share, rel=4.0 / np.sqrt(len(landed.power))
    )
    assert renderer.plan(one, caustics=tl.Caustics(1)).opaque_to_shadows == frozenset()


def test_light_that_passes_a_sheet_is_no_caustic(renderer: tl.Renderer, landed: Landed) -> None:
    """It falls on the ground beneath; what is mirrored leaves to the side, along the ground."""
    pane = tl.Object(tl.Mesh(QUAD @ TILTED, [(0, 2, 1), (0, 3, 2)]), CLEAR, at(0, 3, 0), sheet_thickness=1e-3)
    renderer.render(scene(pane, GROUND), (8, 8), caustics=tl.Caustics(2000))
    assert len(landed.all) == 2000
    assert len(landed.power) == 0


def test_a_fence_before_the_eye_hides_what_is_behind_it(renderer: tl.Renderer) -> None:
    """Photons go to the next pixel from beyond the edges of their own surface alone: pixels that show the fence have
    none. Those that show the ground beside it lose what they do not show of it: a third of an edge.
    """
    camera = tl.Camera.look_at((0, 0.9, 2.5), (0, 0, 0), fov_y=30)
    one = scene(ball(), GROUND, *FENCE, camera=camera)
    found = photons_in(renderer, one, (64, 48), tl.Caustics(20_000)).sum()
    truth = photon_irradiance(one, (64, 48), trace_photons(one, 4000)).sum()
    free = scene(ball(), GROUND, camera=camera)
    assert truth < 0.8 * photons_in(renderer, free, (64, 48), tl.Caustics(20_000)).sum()
    assert 0.85 < found / truth < 1.05


def test_a_spot_lights_what_is_in_its_cone(renderer: tl.Renderer, landed: Landed) -> None:
    """A narrow one through the middle of the ball, from above and from inside; one that looks away lights nothing."""
    for height, direction in ((5.0, (0, -1, 0)), (2.0, (0, -1, 0)), (5.0, (0, 1, 0))):
        spot = tl.SpotLight((0, height, 0), direction, 1.0, inner_cone=2.0, outer_cone=4.0)
        landed.parts.clear()
        renderer.render(scene(light=spot), (8, 8), caustics=tl.Caustics(100_000))
        # The mean over all directions times 4 pi; of what comes from outside, two faces of glass mirror the rest up.
        faces = 2 if height > 3 else 1
        power = 4.0 * np.pi * spot.mean_share * 0.96**faces * (direction[1] < 0)
        assert landed.power[:, 0].sum() == pytest.approx(power, rel=0.1)


def test_sky_shadows_are_those_of_straight_light(renderer: tl.Renderer) -> None:
    """Photons carry the light of lamps alone: what throws clear shadows from the sky throws them with photons, too."""
    camera, sky = tl.Camera.look_at((0, 0.9, 2.5), (0, 0, 0), fov_y=30), tl.Environment.constant((1.0, 1.0, 1.0))
    dim = tl.DirectionalLight((0, -1, 0), 1e-6)
    one = scene(light=dim, camera=camera, environment=sky, environment_shadows=16)
    straight = renderer.render(one, (16, 12)).radiance
    np.testing.assert_allclose(renderer.render(one, (16, 12), caustics=tl.Caustics(100)).radiance, straight, atol=1e-3)
    dark = scene(ball(DARK), GROUND, light=dim, camera=camera, environment=sky, environment_shadows=16)
    assert renderer.render(dark, (16, 12)).radiance.min() < 0.8 * straight.min()


def test_photons_are_the_same_each_time(renderer: tl.Renderer, landed: Landed) -> None:
    """The first ones of many start where those of few do, and most land there; another seed has others."""
    one = scene()
    for caustics in (tl.Caustics(600), tl.Caustics(600), tl.Caustics(1500), tl.Caustics(600, seed=1)):
        renderer.render(one, (8, 8), caustics=caustics)
    few, again, many, other = (part[:600, :4] for part in landed.parts)
    np.testing.assert_array_equal(few, again)
    assert (few == many).all(axis=1).mean() > 0.7  # others choose the next branch
    assert (few != other).any()


def test_a_frame_that_is_run_again_shows_the_same(renderer: tl.Renderer) -> None:
    gpu, one = renderer.gpu, scene()
    plan, pictures = renderer.plan(one, caustics=tl.Caustics(500)), []
    with gpu.context.current():
        job = gpu.prepare(plan, (16, 12))
        for _ in range(2):
            gpu.run(job)
            pictures.append(job.targets["opaque"].read(components=4, attachment=1, dtype="f4"))
        job.release()
    assert np.frombuffer(pictures[0], np.float32).max() > 0.0
    np.testing.assert_allclose(*(np.frombuffer(picture, np.float32) for picture in pictures), rtol=1e-4, atol=1e-6)


def test_a_frame_without_caustics_has_no_pass_of_them(renderer: tl.Renderer) -> None:
    frame = renderer.render(scene(), (8, 8))
    assert not frame.plan.has(PassName.CAUSTICS)
    assert "caustics" not in frame.seconds
    backdrop = tl.Backdrop(np.zeros((8, 8, 3)), np.full((8, 8), np.inf))
    with pytest.raises(tl.InputError, match="caustics in front of a backdrop; the objects of a backdrop have no mesh"):
        renderer.render(scene(ball()), (8, 8), backdrop=backdrop, caustics=tl.Caustics(100))


def test_fog_has_what_hardly_bends_once(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Photons through a ball of nearly the index of air light fog as straight light does, which ends at the ball then.

    Measured with 40 x 40 pixels and 100,000 photons: .0026, and -.0004 in the mean.
    """
    if not renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers, without which nothing marches")
    monkeypatch.setattr(planned_caustics, "LEAST_IN_MEDIA", 1 << 14)
    monkeypatch.setattr(light_views, "_SIDES", (128,))
    fog = tl.Object(Box((-2, -3, -2), (2, 2, 2)).tessellate(), tl.Medium(absorption=0.05, scattering=0.3))
    body = tl.Object(BALL, tl.Medium(ior=1.0005))
    one = scene(body, fog, light=tl.DirectionalLight((0.3, -1, 0), 3.0))
    one = dataclasses.replace(one, camera=tl.Camera.look_at((0, -0.5, 12), (0, -0.5, 0), fov_y=28.0))
    coarse = tl.Diffusion(8)
    straight, with_photons = (
        renderer.render(one, (24, 24), method, scattering=coarse, caustics=caustics)
        for method, caustics in ((tl.RayMarched(64), None), (None, tl.Caustics(1)))
    )
    assert (with_photons.plan.method, with_photons.plan.opaque_to_shadows) == (tl.RayMarched(64), {0})
    truth = straight.radiance.astype(np.float64)
    error = with_photons.radiance - truth
    print(np.sqrt(np.square(error).mean()) / truth.mean(), error.mean() / truth.mean())
    assert np.sqrt(np.square(error).mean()) < 0.02 * truth.mean()
    assert abs(error.mean()) < 5e-3 * truth.mean()  # half of that is what facets cut off the ball


def test_light_on_a_ball_in_glass_counts_once(renderer: tl.Renderer) -> None:
    """In a body that hardly refracts, photons bring as much light to an opaque ball as comes straight."""
    eye = tl.Camera.look_at((0, 3, 6), (0, 0, 0), fov_y=8.0)
    ball = [tl.Object(BALL, tl.Medium(ior=1.0001)), tl.Object(CORE, color=(0.7, 0.7, 0.7))]
    one = tl.Scene(ball, eye, [tl.DirectionalLight((0, -0.6, -0.8), 1.0)], NIGHT)
    straight, by_photons = (
        renderer.render(one, (8, 8), samples=1, caustics=given).radiance.mean()
        for given in (None, tl.Caustics(1 << 17))
    )
    assert by_photons == pytest.approx(straight, rel=0.03)
