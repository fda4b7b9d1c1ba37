"""Sphere lights: soft shadows, highlights, media, photons and random paths, against closed forms and the reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests import references
from translucent.geometry.solids import Box, Sphere
from translucent.reference.light_paths import LightPaths
from translucent.reference.surfaces import sheet_thicknesses

Array = npt.NDArray[np.float64]

BLACK = tl.Environment.constant((0, 0, 0))
RADIANCE, HEIGHT, EDGE = 10.0, 4.0, (1.9, 2.0)
COUNT = 96


def occluded(radius: float) -> tuple[tl.Scene, Array]:
    """Penumbra on a ground at y = 0 of a box where x < 0, with the light above its edge; and x at pixels."""
    box = tl.Object(Box((-2.5, EDGE[0], -2.5), (0, EDGE[1], 2.5)).tessellate(), color=(0, 0, 0))
    ground = tl.Object(Box((-5, -0.1, -5), (5, 0, 5)).tessellate(), color=(1, 1, 1))
    camera = tl.Camera.orthographic((0, 1.5, 0), (0, 0, 0), up=(0, 0, -1), height=4.0 * radius * 8 / COUNT)
    light = tl.SphereLight.from_radiance((0, HEIGHT, 0), RADIANCE, radius)
    scene = tl.Scene([speck((-1, 1.95, 0)), ground, box], camera, [light], BLACK)
    return scene, ((np.arange(COUNT) + 0.5) / COUNT - 0.5) * 4.0 * radius


def speck(place: tuple[float, float, float]) -> tl.Object:
    """Something translucent, out of sight: scenes are about such."""
    matrix = np.diag([0.01, 0.01, 0.01, 1.0])
    matrix[:3, 3] = place
    return tl.Object(Sphere().tessellate(8), tl.Medium(absorption=1.0), matrix)


def irradiance(x: Array, radius: float, *, free: bool = False) -> Array:
    """On the ground: the cosine over the part of the sphere's solid angle that is seen past both edges of the box."""
    n = 100
    share, angle = (np.arange(n) + 0.5) / n, 2.0 * np.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    found = []
    for at in x:
        to_light = np.array([-at, HEIGHT, 0.0])
        distance = float(np.linalg.norm(to_light))
        axis, sine = to_light / distance, radius / distance
        across = np.array([axis[1], -axis[0], 0.0])
        cosines, sines = np.sqrt(1.0 - share * sine**2), np.sqrt(share) * sine
        ring = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0])
        ways = cosines[:, None, None] * axis + sines[:, None, None] * ring
        past = np.minimum(*(at + ways[..., 0] / ways[..., 1] * y for y in EDGE)) > 0.0
        weights = sine**2 / n / (2.0 * cosines)[:, None] * (np.pi / n)
        found.append(RADIANCE * (weights * ways[..., 1] * (past | free)).sum())
    return np.array(found)


def off_penumbra(radius: float, radiance: Array) -> Array:
    """Errors of the radiance of a white ground, of what the whole sphere gives there."""
    _, x = occluded(radius)
    return (np.pi * radiance - irradiance(x, radius)) / irradiance(np.zeros(1), radius, free=True)


def tell(what: object, off: Array) -> None:
    print(f"{what}: mean {off.mean():+.1e}, RMS {np.sqrt((off**2).mean()):.1e}, most {np.abs(off).max():.1e}")


def test_the_quadrature_is_the_irradiance_of_a_sphere() -> None:
    for radius in (0.2, 1.0, 3.0):
        exact = np.pi * RADIANCE * (radius / HEIGHT) ** 2
        assert irradiance(np.zeros(1), radius, free=True)[0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("radius", [0.2, 1.0])
def test_the_reference_in_a_penumbra(radius: float) -> None:
    """256 points; measured 5e-3 and 6e-3 RMS, at most 0.026, in the mean 1e-4. Without the shadow 2e-4 at most."""
    scene, x = occluded(radius)
    for free, rms, most in ((False, 8e-3, 0.03), (True, 1e-4, 2e-4)):
        shown = replace(scene, objects=scene.objects[:2]) if free else scene
        paths = LightPaths(shown, sheet_thicknesses(shown))
        points = np.stack([x, 0 * x, 0 * x], axis=1) - shown.camera.eye
        arrivals = [paths.arrival(light, points) for light in paths.lights]
        found = sum(one.irradiance[:, 0] * -one.travel[:, 1] for one in arrivals)
        off = (found - irradiance(x, radius, free=free)) / (np.pi * RADIANCE * (radius / HEIGHT) ** 2)
        print(
            f"{radius} {free}: mean {off.mean():+.1e}, RMS {np.sqrt((off**2).mean()):.1e}, most {np.abs(off).max():.1e}"
        )
        assert np.sqrt((off**2).mean()) <= rms
        assert np.abs(off).max() <= most


@pytest.mark.parametrize("radius", [0.2, 1.0])
def test_penumbrae(renderer: tl.Renderer, radius: float) -> None:
    """16 points, shadows filtered over their discs: measured .022 and .018 RMS, at most .053; unfiltered .027, .09."""
    scene, _ = occluded(radius)
    found = renderer.render(scene, (COUNT, 8)).radiance[4, :, 0].astype(np.float64)
    off = off_penumbra(radius, found)
    tell(radius, off)
    assert abs(off.mean()) <= 4e-3
    assert np.sqrt((off**2).mean()) <= 0.025
    assert np.abs(off).max() <= 0.07


def test_penumbrae_on_the_cpu() -> None:
    """As many points, whose shadows are sharp: measured .023 RMS."""
    scene, _ = occluded(0.4)
    with tl.Renderer(backend="cpu") as cpu:
        off = off_penumbra(0.4, cpu.render(scene, (COUNT, 8)).radiance[4, :, 0].astype(np.float64))
    assert abs(off.mean()) <= 4e-3
    assert np.sqrt((off**2).mean()) <= 0.03


def test_the_colored_shadow_of_a_body(renderer: tl.Renderer) -> None:
    """Against the reference's 256 points."""
    wine = tl.Object(Sphere(radius=0.5).tessellate(24), tl.Medium(absorption=(0.5, 2, 1)))
    ground = tl.Object(Box((-5, -1.1, -5), (5, -1, 5)).tessellate(), color=(1, 1, 1))
    camera = tl.Camera.look_at((0, 1.2, 5), (0, -0.8, 0), fov_y=35)
    scene = tl.Scene([wine, ground], camera, [tl.SphereLight((-1.2, 2.5, 0.8), 10.0, 0.5)], BLACK)
    frame, truth = renderer.render(scene, (24, 18)), references.render(scene, (24, 18))
    off = (frame.radiance - truth.radiance) / truth.radiance.max()
    colored = truth.radiance[..., 0] - truth.radiance[..., 1]
    assert (colored > 0.03 * truth.radiance.max()).mean() > 0.05
    tell("shadow", off)
    assert abs(off.mean()) <= 1e-3
    assert np.sqrt((off**2).mean()) <= 6e-3


def wall(surface: tl.Surface, *, opaque: bool = False) -> tl.Scene:
    """A wall that mirrors a light, and shows nothing behind its face."""
    medium = None if opaque else tl.Medium(absorption=1e3, ior=1.5)
    slab = tl.Object(Box.slab((6.0, 6.0), 0.2).tessellate(), medium, surface=surface)
    camera = tl.Camera.look_at((1.5, 0, 6), (0, 0, 0), fov_y=35)
    objects = [slab, speck((0, 0, -4))] if opaque else [slab]
    return tl.Scene(objects, camera, [tl.SphereLight.from_radiance((-1.5, 0, 6.1), 4.0, 1.0)], BLACK)


SMOKE = tl.Medium(absorption=(0.25, 1.0, 2.0), scattering=(0.25, 1.0, 2.0), anisotropy=0.3)


@pytest.fixture
def follows(renderer: tl.Renderer) -> None:
    """Skip where this OpenGL follows no light into media."""
    if not renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers, without which no light is followed")


def smoke(radius: float = 0.6) -> tl.Scene:
    camera = tl.Camera.look_at((0, 0.2, 5), (0, 0, 0), fov_y=26)
    light = tl.SphereLight((0.5, 1.6, 1.5), 1.0, radius)
    return tl.Scene([tl.Object(Sphere().tessellate(8), SMOKE)], camera, [light], BLACK)


def test_light_in_smoke(renderer: tl.Renderer, follows: None) -> None:
    """From 8 points, as many as are followed into media: measured 1e-2 at most; one point is off by 6e-2."""
    frame = renderer.render(smoke(), (1, 2), tl.FragmentLists(light_points=8))
    truth = references.render(smoke(), (1, 2))
    off = (frame.radiance - truth.radiance) / truth.radiance.max()
    tell("smoke", off)
    assert frame.valid.all()
    assert np.abs(off).max() <= 0.02
    assert abs(off.mean()) <= 5e-3
    told = "shadows of 8 point lights, not of 16, because at most 8 lights can shine into media"
    assert any(told in note for note in frame.plan.unmodelled)


def test_random_paths_in_smoke(renderer: tl.Renderer, follows: None) -> None:
    """Light from anywhere on the discs: against random paths of the reference with points, whose noise is 2 %."""
    light = smoke().lights[0]
    points = [tl.PointLight(one.position, one.intensity) for one in light.points(8)]  # type: ignore[union-attr]
    found = renderer.render(smoke(), (4, 4), tl.PathTraced(1024)).radiance.mean(axis=(0, 1))
    truth = tl.reference.path_trace(replace(smoke(), lights=points), (4, 4), 256)[0].radiance.mean(axis=(0, 1))
    print(found / truth - 1.0)
    np.testing.assert_allclose(found, truth, rtol=0.06)


@pytest.mark.parametrize("roughness", [0.2, 0.4])
def test_highlights_in_rough_interfaces(renderer: tl.Renderer, roughness: float) -> None:
    """Against the reference, which samples the sphere. Measured .026, .005 and .003 RMS, in the mean 3e-4."""
    scene = wall(tl.Surface(roughness=roughness))
    truth = references.render(scene, (16, 12), refraction=True, paths=2).radiance
    with tl.Renderer(backend="cpu") as cpu:
        for one in (renderer, cpu):
            found = one.render(scene, (16, 12), interfaces=tl.TracedInterfaces()).radiance
            off = (found - truth) / truth.max()
            tell(roughness, off)
            assert abs(off.mean()) <= 1e-3
            assert np.sqrt((off**2).mean()) <= (0.04 if roughness == 0.2 else 0.01)
    if roughness == 0.4 and renderer.gpu.capabilities.shader_storage:
        found = renderer.render(scene, (16, 12), tl.PathTraced(256)).radiance
        off = (found - truth) / truth.max()
        tell(f"{roughness}, paths", off)
        assert abs(off.mean()) <= 2e-3


@pytest.mark.parametrize(
    ("opaque", "backend"),
    [(False, "opengl"), (True, "opengl"), (False, "cpu")],
    ids=["interface", "opaque", "cpu"],
)
def test_a_mirror_shows_a_disc(renderer: tl.Renderer, opaque: bool, backend: str) -> None:
    """Radiance of the sphere times the reflectance where mirrored rays hit it."""
    surface = tl.Surface(roughness=0.0, metallic=1.0, color=(0.5, 0.5, 0.5)) if opaque else tl.Surface()
    scene = wall(surface, opaque=opaque)
    if backend == "cpu":
        with tl.Renderer(backend="cpu") as cpu:
            found = cpu.render(scene, (64, 48)).radiance[..., 0].astype(np.float64)
    else:
        found = renderer.render(scene, (64, 48)).radiance[..., 0].astype(np.float64)
    origins, directions = scene.camera.rays((64, 48))
    points = origins + ((0.1 - origins[..., 2:]) / directions[..., 2:]) * directions
    mirrored = directions * (1.0, 1.0, -1.0)
    way = np.asarray(scene.lights[0].position) - points
    apart = np.linalg.norm(np.cross(way, mirrored), axis=-1)
    reflectance = 0.5 if opaque else ((1.5 - 1.0) / 2.5) ** 2
    off = (found - np.where(apart < 1.0, 4.0 * reflectance, 0.0)) / (4.0 * reflectance)
    tell("mirror", off)
    clear = np.abs(apart - 1.0) > 0.2  # the edge is as soft as the smallest lobe
    assert (apart < 0.8).sum() > 50
    assert np.abs(off[clear]).max() <= 0.25  # a rounding of a cosine of 1 is that much of so sharp a peak
    assert np.abs(np.median(off[apart < 0.8])) <= 0.02
    assert abs(off.sum()) <= 0.05 * (apart < 1.0).sum()
