"""Densities that vary in space on the GPU: the sums of the reference, and their limit, which the reference knows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere, Torus

SIZE = (32, 24)
DUSK = tl.Environment.constant((0.2, 0.3, 0.1))
CAMERA = tl.Camera.look_at((1, 1.5, 4), (0, 0, 0))
MILK = tl.Medium(absorption=(0.5, 1, 2), emission=(1, 0.2, 0.1), scattering=(1, 0.5, 0.2), anisotropy=0.3)
EMBER = tl.Medium(absorption=(2, 0.5, 0.2), emission=(0.1, 0.3, 1))
NOISE = tl.DensityGrid(2.0 * np.random.default_rng(0).random((7, 5, 9)))
DENSITIES = {
    "grid": NOISE,
    "voxel": tl.DensityGrid([[[1.5]]]),
    "column": tl.DensityGrid(np.random.default_rng(1).random((1, 1, 12))),
    "linear": tl.LinearDensity(1, 0.1, 2.0),
    "rising": tl.ExponentialDensity(0, 0.01, 3.0),
    "falling": tl.ExponentialDensity(2, 3.0, 0.01),
}
LIGHTS = {
    "no light": [],
    "sun": [tl.DirectionalLight((-0.3, -1, 0.2), (2, 2, 2))],
    "lamp": [tl.PointLight((0.5, 2, 0.4), (3, 3, 3))],
    "lamp inside": [tl.PointLight((0.15, 0.05, 0.04), (3, 3, 3))],
}
#: Turned, mirrored, stretched and moved.
PLACED = np.array([[0.8, -0.6, 0, 0.1], [0.6, 0.8, 0, -0.1], [0, 0, -1.3, 0.1], [0, 0, 0, 1]])


def errors(renderer: tl.Renderer, scene: tl.Scene, method: tl.RayMarched) -> tuple[float, float]:
    """Largest errors of radiance and of optical depth against the same sums in float64, relative to the largest value.

    Where the neighborhood of a pixel crosses equally many surfaces.
    """
    frame, truth = renderer.render(scene, SIZE, method), tl.reference.march(scene, SIZE, method)
    assert frame.valid.all()
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    pairs = ((frame.radiance, truth.radiance), (frame.optical_depth, truth.optical_depth))
    found, depth = (float(np.abs(a - b)[inside].max() / b.max()) for a, b in pairs)
    print(f"radiance {found:.1e}, optical depth {depth:.1e}")
    return found, depth


@pytest.mark.parametrize("lights", LIGHTS.values(), ids=LIGHTS)
@pytest.mark.parametrize("density", DENSITIES.values(), ids=DENSITIES)
def test_steps_add_up_as_those_of_the_reference(renderer: tl.Renderer, density: Any, lights: list[Any]) -> None:
    body = tl.Object(Box().tessellate(), MILK, PLACED, density=density)
    radiance, depth = errors(renderer, tl.Scene([body], CAMERA, lights, DUSK), tl.RayMarched(steps=8))
    # Steep faces within a texel of a lamp's view are what is left; all else is float32.
    assert radiance <= (1e-4 if lights else 2e-6)
    assert depth <= 1e-5


@pytest.mark.parametrize("quadrature", ["left", "exponential", "jittered", "equiangular", "gauss"])
def test_every_quadrature_goes_through_a_density(renderer: tl.Renderer, quadrature: Any) -> None:
    lights = [*LIGHTS["sun"], *LIGHTS["lamp"]]
    scene = tl.Scene([tl.Object(Box().tessellate(), MILK, PLACED, density=NOISE)], CAMERA, lights, DUSK)
    assert errors(renderer, scene, tl.RayMarched(steps=8, quadrature=quadrature)) <= (1e-4, 1e-5)


@pytest.mark.usefixtures("large_views")
def test_light_on_its_way_through_a_concave_body_meets_its_density(renderer: tl.Renderer) -> None:
    torus = tl.Object(Torus().tessellate(24), MILK, PLACED, density=NOISE)
    scene = tl.Scene([torus], CAMERA, [*LIGHTS["sun"], *LIGHTS["lamp"]], DUSK)
    assert errors(renderer, scene, tl.RayMarched(steps=8)) <= (1e-4, 1e-5)


@pytest.mark.parametrize("overlap", ["add", "union", "priority"])
def test_several_densities_in_one_place(renderer: tl.Renderer, overlap: Any) -> None:
    """Two bodies of one medium but different densities, and a homogeneous one that holds both."""
    right, left = np.eye(4), np.eye(4)
    right[0, 3], left[0, 3] = 0.4, -0.3
    cube, ball = Box().tessellate(), Sphere(radius=1).tessellate(16)
    objects = [
        tl.Object(cube, MILK, left, priority=2, density=NOISE),
        tl.Object(cube, MILK, right, priority=1, density=DENSITIES["linear"]),
        tl.Object(ball, EMBER),
    ]
    scene = tl.Scene(objects, CAMERA, LIGHTS["sun"], DUSK, overlap=overlap)
    assert errors(renderer, scene, tl.RayMarched(steps=8)) <= (1e-4, 1e-5)


def test_two_grids_share_one_texture(renderer: tl.Renderer) -> None:
    away = np.eye(4)
    away[0, 3] = 1.2
    cube = Box().tessellate()
    objects = [tl.Object(cube, MILK, density=NOISE), tl.Object(cube, MILK, away, density=DENSITIES["column"])]
    assert errors(renderer, tl.Scene(objects, CAMERA, [], DUSK), tl.RayMarched(steps=8)) <= (2e-6, 1e-5)


def test_a_rock_in_a_cloud_ends_rays_and_throws_shadows(renderer: tl.Renderer) -> None:
    rock = tl.Object(Box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)).tessellate())
    cloud = tl.Object(Sphere(radius=1).tessellate(24), MILK, density=NOISE)
    scene = tl.Scene([cloud, rock], CAMERA, LIGHTS["sun"], DUSK)
    method = tl.RayMarched(steps=8)
    shadows = tl.ShadowMaps(256)
    frame, truth = renderer.render(scene, SIZE, method, shadows=shadows), tl.reference.march(scene, SIZE, method)
    error = np.abs(frame.radiance - truth.radiance) / truth.radiance.max()
    # A texel at the edge of the shadow is either lit or not.
    assert np.median(error) <= 1e-6
    assert (error.max(axis=2) > 1e-4)[frame.coverage].mean() <= 0.05
    bright = renderer.render(tl.Scene([cloud], CAMERA, LIGHTS["sun"], DUSK), SIZE, method)
    changed = np.abs(bright.radiance - truth.radiance).max(axis=2) > 1e-3
    assert changed[frame.coverage].mean() > 0.1


def test_far_from_the_origin_nothing_changes(renderer: tl.Renderer) -> None:
    there = np.array([3e5, -2e5, 1e5])
    moved = PLACED.copy()
    moved[:3, 3] += there
    cube = Box().tessellate()
    near, far = (
        renderer.render(
            tl.Scene(
                [tl.Object(cube, MILK, matrix, density=NOISE)],
                tl.Camera.look_at(np.array([1, 1.5, 4]) + offset, offset),
                LIGHTS["sun"],
                DUSK,
            ),
            SIZE,
            tl.RayMarched(steps=16),
        )
        for matrix, offset in ((PLACED, np.zeros(3)), (moved, there))
    )
    # float64 places a camera so far away to 6e-11 m; texels of the light's view may round differently.
    inside = tl.interior(near.coverage.astype(np.int64))
    assert np.abs(far.radiance - near.radiance)[inside].max() <= 1e-5


def test_one_voxel_is_a_homogeneous_body(renderer: tl.Renderer) -> None:
    cube = Box().tessellate()
    dense = tl.Medium(*(1.5 * np.asarray(v) for v in (MILK.absorption, MILK.scattering, MILK.emission)), 0.3)
    varied = tl.Scene([tl.Object(cube, MILK, density=DENSITIES["voxel"])], CAMERA, LIGHTS["sun"], DUSK)
    plain = tl.Scene([tl.Object(cube, dense)], CAMERA, LIGHTS["sun"], DUSK)
    frames = [renderer.render(scene, SIZE, tl.RayMarched(steps=32)) for scene in (varied, plain)]
    np.testing.assert_allclose(frames[0].radiance, frames[1].radiance, atol=2e-6)
    np.testing.assert_allclose(frames[0].optical_depth, frames[1].optical_depth, atol=2e-6)


def test_the_error_falls_with_the_square_of_the_steps(renderer: tl.Renderer) -> None:
    """Over five doublings, against exact means along the rays; where planes of voxels are kinks, too."""
    smooth = tl.ExponentialDensity(0, 8.0, 0.1)
    for density in (smooth, NOISE):
        scene = tl.Scene([tl.Object(Box().tessellate(), EMBER, PLACED, density=density)], CAMERA, [], DUSK)
        exact = tl.reference.render(scene, SIZE)
        inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
        steps = 2 ** np.arange(1, 7)
        errors = []
        for count in steps:
            frame = renderer.render(scene, SIZE, tl.RayMarched(steps=int(count)))
            errors.append(np.sqrt(((frame.optical_depth - exact.optical_depth)[inside] ** 2).mean()))
        slope = -np.polyfit(np.log2(steps), np.log2(errors), 1)[0]
        print(f"{density}: order {slope:.2f}, last error {errors[-1]:.1e}")
        assert slope == pytest.approx(2.0, abs=0.2)


def test_what_no_light_of_gets_through_is_not_looked_at(renderer: tl.Renderer) -> None:
    """A fire behind a depth of 12 is left out as by the reference, and seen behind 11. Depths are exact."""
    fire = tl.Medium(emission=1e4)
    behind = np.eye(4)
    behind[2, 3] = -2.0
    cube = Box().tessellate()
    camera = tl.Camera.orthographic((0, 0, 4), (0, 0, 0), height=0.5)
    for depth, seen in ((11.0, True), (12.0, False)):
        soot = tl.Object(cube, tl.Medium(absorption=depth), density=tl.DensityGrid(np.ones((2, 3, 4))))
        scene = tl.Scene([soot, tl.Object(cube, fire, behind)], camera, [], DUSK)
        method = tl.RayMarched(steps=16)
        frame = renderer.render(scene, SIZE, method)
        truth = tl.reference.march(scene, SIZE, method, termination=1e-5)
        assert (frame.radiance.min() > 0.1) == seen
        np.testing.assert_allclose(frame.radiance, truth.radiance, atol=1e-5)
        np.testing.assert_allclose(frame.optical_depth, depth, rtol=1e-5)


def test_samples_of_a_pixel_see_the_same_density(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(Box().tessellate(), MILK, density=NOISE)], CAMERA, LIGHTS["sun"], DUSK)
    one, four = (renderer.render(scene, (64, 48), tl.RayMarched(steps=16), samples=n).radiance for n in (1, 4))
    inside = tl.interior(tl.reference.hit_counts(scene, (64, 48)))
    # Four samples average over a pixel, in which the picture changes by as much as to its neighbors.
    change = max(np.abs(np.diff(one, axis=axis)).max() for axis in (0, 1))
    assert np.sqrt(((one - four)[inside] ** 2).mean()) <= 0.2 * change
    assert (one != four).any()


def test_each_frame_has_its_own_grids(renderer: tl.Renderer) -> None:
    cube = Box().tessellate()

    def radiance(density: Any) -> Any:
        scene = tl.Scene([tl.Object(cube, MILK, density=density)], CAMERA, LIGHTS["sun"], DUSK)
        return renderer.render(scene, SIZE, tl.RayMarched(steps=8)).radiance

    first, second, again = radiance(NOISE), radiance(DENSITIES["column"]), radiance(NOISE)
    assert (first != second).any()
    np.testing.assert_array_equal(first, again)


def test_the_planner_marches_unasked(renderer: tl.Renderer) -> None:
    scene = tl.Scene([tl.Object(Box().tessellate(), EMBER, PLACED, density=NOISE)], CAMERA, [], DUSK)
    frame, exact = renderer.render(scene, SIZE), tl.reference.render(scene, SIZE)
    assert frame.plan.method == tl.RayMarched(steps=64)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    assert np.abs(frame.radiance - exact.radiance)[inside].max() <= 1e-3


def test_a_grid_that_no_texture_holds(renderer: tl.Renderer) -> None:
    with renderer.gpu.context.current() as gl:
        limit = int(gl.info["GL_MAX_3D_TEXTURE_SIZE"])
    long = tl.DensityGrid(np.ones((1, 1, limit + 1)))
    scene = tl.Scene([tl.Object(Box().tessellate(), EMBER, density=long)], CAMERA, [], DUSK)
    with pytest.raises(
        tl.RenderError, match=rf"density grids of 1x1x{limit + 1} voxels .* use grids with fewer voxels"
    ):
        renderer.render(scene, SIZE, tl.RayMarched(steps=8))


def test_the_densest_place_of_a_dense_medium_is_finite(renderer: tl.Renderer) -> None:
    soot = tl.Medium(absorption=1e250, emission=1.0)
    body = tl.Object(Box().tessellate(), soot, density=tl.DensityGrid(np.full((2, 2, 2), 1e12)))
    frame = renderer.render(tl.Scene([body], CAMERA, [], DUSK), SIZE, tl.RayMarched(steps=8, quadrature="left"))
    assert np.isfinite(frame.radiance).all()
    assert np.isfinite(frame.optical_depth).all()
    assert frame.transmittance[frame.coverage].max() == 0
