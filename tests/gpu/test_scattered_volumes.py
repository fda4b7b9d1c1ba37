"""Light that is scattered many times where density varies: path-traced truth, uniform light, what is solved again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import gaussian_filter

import translucent as tl
from translucent.diffusion.volume import DiffusingVolume, VolumeField, VolumeGrid
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.planning.rendered import Treatment
from translucent.scene.environment_map import texel_directions

SIZE = (12, 12)
SKY = tl.Environment.gradient((0.2, 0.1, 0.05), (1, 1, 1))
DARK = tl.Environment.constant((0, 0, 0))
SUN = tl.DirectionalLight((-1, -0.7, -0.3), (3, 3, 3))
BEHIND = tl.DirectionalLight((0.4, 0.1, 1.0), (3, 3, 3))
CAMERA = tl.Camera.look_at((0.6, 0.5, 2.2), (0, 0, 0), fov_y=24.0)
ALBEDO = np.array([0.99, 0.98, 0.96])
HALF = np.diag([0.5, 0.5, 0.5, 1.0])
BALL = Sphere((0, 0, 0), 0.5)


@pytest.fixture(autouse=True)
def opengl_marches(renderer: tl.Renderer) -> None:
    """Skip where no density that varies can be drawn."""
    if not renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers, without which nothing marches")


def puffs(voxels: int = 24) -> tl.DensityGrid:
    """A ball of noise with nothing around it."""
    place = (np.arange(voxels) + 0.5) / voxels - 0.5
    radius = np.linalg.norm(np.stack(np.meshgrid(place, place, place)), axis=0)
    noise = gaussian_filter(np.random.default_rng(0).normal(size=(voxels,) * 3), voxels / 14, mode="wrap")
    return tl.DensityGrid(np.clip((0.42 - radius) * 8 + 0.5 * noise / noise.std(), 0, 1))


def cloud(
    lights: list[tl.DirectionalLight],
    environment: tl.Environment,
    depth: float = 16.0,
    albedo: npt.ArrayLike = ALBEDO,
    density: tl.DensityGrid | tl.LinearDensity | None = None,
    **medium: float,
) -> tl.Scene:
    filling = tl.Medium(depth * (1 - np.asarray(albedo)), depth * np.asarray(albedo), **medium)
    body = tl.Object(Box().tessellate(), filling, HALF, density=density or puffs())
    return tl.Scene([body], CAMERA, lights, environment)


def patch() -> tl.Environment:
    """A dark environment with a bright patch behind what is seen."""
    directions = texel_directions(32, 64)
    towards = np.array([-0.3, -0.15, -1.0]) / np.linalg.norm([-0.3, -0.15, -1.0])
    bright = 30.0 * np.clip((directions @ towards - 0.95) / 0.05, 0.0, 1.0)
    return tl.Environment.image(0.1 + bright[..., None] * np.array([1.0, 0.8, 0.6]))


#: Scenes, the most error, and paths: fewer where these are alike.
TRUTHS = {
    "sky": (cloud([], SKY), 0.03, 16),
    "sun": (cloud([SUN], DARK), 0.08, 32),
    "profile": (cloud([], SKY, density=tl.LinearDensity(1, 1.0, 0.05)), 0.03, 16),
    "ahead": (cloud([], SKY, 40.0, anisotropy=0.8), 0.12, 16),
    "patch": (cloud([], patch(), 12.0, density=tl.LinearDensity(1, 1.0, 0.5), anisotropy=0.85), 0.12, 32),
    "behind": (cloud([BEHIND], DARK, anisotropy=0.85), 0.12, 32),
}


@pytest.mark.parametrize(("scene", "most", "paths"), TRUTHS.values(), ids=TRUTHS)
def test_clouds_are_near_full_light_transport(renderer: tl.Renderer, scene: tl.Scene, most: float, paths: int) -> None:
    """Root mean square error over the mean, without the noise of the truth. Measured with 24 x 24 pixels and 192 paths:
    .005, .056, .00, .087; of single scattering .4 to 1.0.
    """
    one, other = (tl.reference.path_trace(scene, SIZE, paths=paths, seed=seed)[0] for seed in (1, 2))
    frame = renderer.render(scene, SIZE, scattering=tl.Diffusion(24))
    once = renderer.render(scene, SIZE, scattering=tl.SingleScattering())
    inside = one.thickness > 0.05

    def error(found: npt.NDArray[np.float32]) -> float:
        square = ((found - one.radiance) * (found - other.radiance))[inside].mean()
        return float(np.sqrt(max(square, 0.0)) / one.radiance[inside].mean())

    print(f"{error(frame.radiance):.3f}, scattered once {error(once.radiance):.3f}")
    assert frame.plan.treated(Treatment.VOLUME) == (0,)
    assert frame.valid.all()
    assert error(frame.radiance) < most
    assert error(once.radiance) > 0.25


def field(scene: tl.Scene, resolution: int = 16) -> VolumeField:
    body = scene.objects[0]
    assert body.medium is not None
    return DiffusingVolume(VolumeGrid(body, tl.Diffusion(resolution).cell_size(body)), body.medium).field(scene)


@pytest.mark.parametrize(("depth", "off", "mean"), [(0.1, 1e-3, 1e-4), (16.0, 0.02, 4e-3), (1e5, 0.12, 0.03)])
@pytest.mark.parametrize("anisotropy", [0.0, 0.8])
def test_what_loses_nothing_is_invisible_in_uniform_light(
    depth: float, off: float, mean: float, anisotropy: float
) -> None:
    """Up to the change at which rounds end, 2 % of what has been scattered, and of diffusion in cells that no sweep
    gets through.
    """
    scene = cloud([], tl.Environment.constant((1, 1, 1)), depth, albedo=1.0, anisotropy=anisotropy)
    found = field(scene).mean_radiance - 1.0
    assert np.abs(found).max() < off
    assert np.abs(found).mean() < mean


@pytest.mark.parametrize("depth", [2.0, 100.0])
def test_there_is_no_less_than_no_light_where_media_scatter_backwards(depth: float) -> None:
    found = field(cloud([SUN], DARK, depth, anisotropy=-0.8)).mean_radiance
    assert found.min() >= 0.0
    assert found.max() > 0.05


def test_light_adds_up() -> None:
    both, sky, sun = (
        field(cloud(lights, environment)).mean_radiance
        for lights, environment in (([SUN], SKY), ([], SKY), ([SUN], DARK))
    )
    np.testing.assert_allclose(both, sky + sun, atol=0.01 * both.max())


def test_a_lamp_inside_lights_from_there() -> None:
    lamp = tl.PointLight((0.2, 0.0, 0.0), (1, 1, 1))
    found = field(replace(cloud([], DARK), lights=[lamp]))
    size = np.array(found.mean_radiance.shape[:3])
    brightest = np.unravel_index(found.mean_radiance.sum(axis=-1).argmax(), size)
    place = found.low + (np.array(brightest) + 0.5) * found.step
    assert np.linalg.norm(place - lamp.position) < 2 * found.step
    assert np.isfinite(found.mean_radiance).all()


def test_a_glowing_cloud_scatters_its_own_light(renderer: tl.Renderer) -> None:
    """As the path tracer has it: more than comes out unscattered."""
    scene = cloud([], DARK, emission=2.0)
    truth, standard_error = tl.reference.path_trace(scene, SIZE, paths=64)
    frame = renderer.render(scene, SIZE, scattering=tl.Diffusion(24))
    inside = truth.thickness > 0.05
    found, expected = (image.radiance[inside].mean(axis=0) for image in (frame, truth))
    noise = np.sqrt((standard_error[inside] ** 2).sum(axis=0)) / inside.sum()
    print(found, expected, noise)
    assert (np.abs(found - expected) < 3 * noise + 0.02 * expected).all()


def test_several_clouds_have_their_own_light(renderer: tl.Renderer) -> None:
    """In one picture, next to what does not vary; the same as alone, up to what one keeps from the other."""
    scene = cloud([SUN], SKY)
    body = scene.objects[0]
    aside = HALF.copy()
    aside[:3, 3] = 0.0, 1.1, 0.0
    other = replace(body, transform=aside, density=tl.LinearDensity(0, 0.2, 1.0))
    drop = tl.Object(Sphere((0.0, 5.0, 0.0), 0.1).tessellate(8), tl.Medium(absorption=1.0))
    coarse = tl.Diffusion(16)
    together = renderer.render(replace(scene, objects=[body, other, drop]), SIZE, scattering=coarse)
    alone = renderer.render(scene, SIZE, scattering=coarse)
    assert together.plan.treated(Treatment.VOLUME) == (0, 1)
    clear = renderer.render(replace(scene, objects=[other]), SIZE, scattering=coarse).thickness == 0.0
    both = clear & (alone.thickness > 0.0)
    assert both.any()
    np.testing.assert_allclose(together.radiance[both], alone.radiance[both], rtol=0.03)


def test_ways_of_scattering_have_their_own_views_from_lights(renderer: tl.Renderer) -> None:
    """In any order: what a march reads of the way to a light is not what points of an interval read."""
    scene = tl.Scene([tl.Object(Sphere().tessellate(16), tl.Medium(scattering=4.0))], CAMERA, [SUN], DARK)
    ways = [None, tl.SingleScattering(), tl.Diffusion(12), tl.ScatteringLayer()]
    first = [renderer.render(scene, SIZE, scattering=way).radiance for way in ways]
    again = [renderer.render(scene, SIZE, scattering=way).radiance for way in reversed(ways)]
    for one, other in zip(first, reversed(again), strict=True):
        np.testing.assert_allclose(other, one, atol=1e-3 * one.max())


def test_only_what_changes_the_light_is_solved_for_again(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved = []
    original = DiffusingVolume.field
    monkeypatch.setattr(
        DiffusingVolume, "field", lambda self, scene, *more: solved.append(scene) or original(self, scene, *more)
    )
    scene = cloud([SUN], SKY)
    for changed, times in (
        (scene, 1),
        (replace(scene, camera=tl.Camera.look_at((2, 0, 0), (0, 0, 0))), 0),
        (replace(scene, lights=[tl.DirectionalLight((-1, -0.7, -0.3), (3, 3, 3))]), 0),
        (replace(scene, lights=[]), 1),
        (replace(scene, objects=[replace(scene.objects[0], density=tl.LinearDensity(0, 0.1, 1.0))]), 1),
        (replace(scene, objects=[replace(scene.objects[0], medium=tl.Medium(scattering=7.0))]), 1),
    ):
        solved.clear()
        renderer.render(changed, SIZE, scattering=tl.Diffusion(12))
        assert len(solved) == times


@pytest.mark.parametrize(
    ("solid", "scattering", "absorption"),
    [(BALL, 2.0, 1.5), (BALL, 12.0, 0.5), (BALL, 12.0, 0.02), (Torus(0.4, 0.12), 12.0, 0.02)],
)
def test_glowing_bodies_vanish_in_the_light_of_their_like(
    renderer: tl.Renderer, solid: Sphere | Torus, scattering: float, absorption: float
) -> None:
    """A body that emits as much as it absorbs is invisible in uniform light (Kirchhoff), also behind an interface.

    Measured: at most .015.
    """
    medium = tl.Medium(absorption, scattering, emission=absorption, ior=1.4)
    camera = tl.Camera.look_at((0.8, 1.8, 2.4), (0, 0, 0), fov_y=24.0)
    scene = tl.Scene([tl.Object(solid.tessellate(32), medium)], camera, environment=tl.Environment.constant((1, 1, 1)))
    frame = renderer.render(scene, SIZE, samples=4)
    assert frame.plan.treated(Treatment.DIFFUSION) == (0,)
    off = np.abs(frame.radiance[frame.coverage] - 1.0)
    print(np.median(off), off.max())
    assert off.max() < 0.02


@pytest.mark.parametrize("depth", [1.0, 6.0])
def test_glowing_glass_scatters_its_own_light(renderer: tl.Renderer, depth: float) -> None:
    """With an interface, too, as random paths have it; light that nothing scatters is a third to six sevenths less."""
    medium = tl.Medium(absorption=0.5, scattering=depth, emission=1.0, ior=1.4)
    scene = tl.Scene([tl.Object(Sphere((0, 0, 0), 0.5).tessellate(32), medium)], CAMERA, environment=DARK)
    truth = renderer.render(scene, SIZE, method=tl.PathTraced(96)).radiance.mean()
    assert renderer.render(scene, SIZE, samples=4).radiance.mean() == pytest.approx(truth, rel=0.06)
    assert renderer.render(scene, SIZE, scattering=tl.SingleScattering()).radiance.mean() < 0.75 * truth
