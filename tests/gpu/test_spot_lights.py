"""Spot lights: opaque surfaces, media, diffusion and random paths, against the reference and against point lights."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests import references
from translucent.formulas.light import cone_attenuation
from translucent.geometry.solids import Box, Sphere
from translucent.planning.rendered import Treatment
from translucent.reference import path_trace

BLACK = tl.Environment.constant((0, 0, 0))
WALL = Box.slab((6.0, 6.0), 0.2).tessellate()
BALL, COARSE = Sphere().tessellate(40), Sphere().tessellate(16)
SMOKE = tl.Medium(absorption=(0.25, 1.0, 2.0), scattering=(0.25, 1.0, 2.0), anisotropy=0.3)
CAMERA = tl.Camera.look_at((0.4, 0.3, 7), (0, 0, 0), fov_y=40)
SIZE = (32, 32)
ABOVE = tl.SpotLight((0.5, 0.3, 3), (-0.2, -0.1, -1), (5, 4, 3))
CONES = {"wide": (0, 45), "ring": (10, 25), "edge": (24.99, 25), "narrow": (0, 3)}


@pytest.fixture
def follows(renderer: tl.Renderer) -> None:
    """Skip where this OpenGL follows no light into media."""
    if not renderer.gpu.capabilities.shader_storage:
        pytest.skip("this OpenGL has no shader storage buffers, without which no light is followed")


def lit(*lights: Any, surface: tl.Surface | None = None, medium: tl.Medium | None = None) -> tl.Scene:
    return tl.Scene([tl.Object(WALL, medium, surface=surface), speck()], CAMERA, lights, BLACK)


def speck() -> tl.Object:
    """Something translucent, out of sight: scenes are about such."""
    matrix = np.diag([0.1, 0.1, 0.1, 1.0])
    matrix[:3, 3] = (0, 0, -4)
    return tl.Object(BALL, tl.Medium(absorption=1.0), matrix)


@pytest.mark.parametrize("cones", CONES.values(), ids=CONES)
def test_a_spot_on_a_wall_is_that_of_the_reference(renderer: tl.Renderer, cones: tuple[float, float]) -> None:
    scene = lit(replace(ABOVE, inner_cone=cones[0], outer_cone=cones[1]))
    frame, truth = renderer.render(scene, SIZE), references.render(scene, SIZE)
    off = np.abs(frame.radiance - truth.radiance) / truth.radiance.max()
    assert truth.radiance.max() > 0.05
    # An edge of a hundredth of a degree multiplies roundings by ten thousand.
    assert off.max() <= (1e-2 if cones == CONES["edge"] else 2e-5)
    assert np.quantile(off, 0.99) <= 2e-6


OPAQUE = tl.Surface(roughness=0.5, metallic=0.5), None
# So dark that nothing behind their face is seen.
HIGHLIGHT = tl.Surface(roughness=0.4), tl.Medium(absorption=1e3, ior=1.5)
PAINT = tl.Surface(roughness=0.4, transmission=0.3), tl.Medium(absorption=1e3, ior=1.5)


def require_dimmed(
    renderer: tl.Renderer, surface: tl.Surface, medium: tl.Medium | None, interfaces: Any = None
) -> None:
    """All light is the lamp's: a point light's, times the attenuation where rays meet the face of the wall."""
    spot = replace(ABOVE, inner_cone=5, outer_cone=25)
    point = tl.PointLight(spot.position, spot.intensity)
    dimmed, whole = (
        renderer.render(lit(light, surface=surface, medium=medium), SIZE, samples=1, interfaces=interfaces).radiance
        for light in (spot, point)
    )
    origins, directions = CAMERA.rays(SIZE)
    points = origins + ((0.1 - origins[..., 2]) / directions[..., 2])[..., None] * directions
    travel = points - np.asarray(spot.position)
    share = cone_attenuation(travel / np.linalg.norm(travel, axis=-1, keepdims=True), spot.cone)
    inside = (np.abs(points[..., :2]) < 2.9).all(axis=-1)
    assert 0.05 < (share[inside] > 0).mean() < 0.95
    assert whole[inside].max() > 0.01
    np.testing.assert_allclose(dimmed[inside], (whole * share[..., None])[inside], rtol=1e-4, atol=1e-6 * whole.max())


@pytest.mark.parametrize("interfaces", [tl.FrontInterface(), tl.TracedInterfaces()], ids=["front", "traced"])
@pytest.mark.parametrize("parts", [OPAQUE, HIGHLIGHT, PAINT], ids=["opaque surface", "highlight", "paint"])
def test_surfaces_dim_a_spot_by_its_cone(renderer: tl.Renderer, parts: Any, interfaces: Any) -> None:
    require_dimmed(renderer, *parts, interfaces)


@pytest.mark.parametrize("parts", [HIGHLIGHT, PAINT], ids=["highlight", "paint"])
def test_so_does_the_cpu(parts: Any) -> None:
    with tl.Renderer(backend="cpu") as cpu:
        require_dimmed(cpu, *parts)


POSITIONS = {"outside": ((0, 1.6, 2.0), (0, -0.8, -1.0)), "inside": ((0.1, 0.4, 0.2), (0.3, -1, -0.2))}


@pytest.mark.parametrize("cones", CONES.values(), ids=CONES)
@pytest.mark.parametrize("where", POSITIONS)
def test_beams_in_smoke_are_those_of_the_reference(
    renderer: tl.Renderer, follows: None, where: str, cones: tuple[float, float]
) -> None:
    """As point lights: what the texels of the view cost, where the surface is steep, and 8 Gauss-Legendre points.

    Measured, of the mean: outside 5e-4, 4e-4, 4e-4, 1e-4; inside 4e-6 to 3e-5. Without an end of each part at the cones
    the points miss beams: 2e-2 to .14 at edges.
    """
    spot = tl.SpotLight(*POSITIONS[where], 1.0, *cones)
    scene = tl.Scene([tl.Object(COARSE, SMOKE)], near_camera(), [spot], BLACK)
    frame = renderer.render(scene, (12, 12), tl.FragmentLists(light_points=8))
    truth = references.render(scene, (12, 12))
    assert frame.valid.all()
    off = frame.radiance - truth.radiance
    rms = np.sqrt((off**2).mean(axis=(0, 1))) / truth.radiance.mean(axis=(0, 1))
    print(f"{where} {cones}: {rms}")
    assert (rms <= (3e-3 if where == "outside" else 2e-4)).all()


def test_beams_end_at_opaque_objects_among_other_lights(renderer: tl.Renderer, follows: None) -> None:
    """Away from the edge of the shadow, which is as sharp as a texel of the view."""
    stop = np.diag([0.15, 0.15, 0.15, 1.0])
    stop[:3, 3] = (0.0, 0.3, 0.1)
    spots = [tl.SpotLight((-0.6, 0.5, 0.1), (1.0, -0.35, 0.0), 1.0, 5, 20), tl.SpotLight((0, 3, 1), (0, -3, -1), 5.0)]
    lights = [spots[0], tl.PointLight((2, 2, 2), 2.0), spots[1], tl.DirectionalLight((1, -0.3, -1), 0.1)]
    ball = Sphere().tessellate(8)
    objects = [tl.Object(ball, SMOKE), tl.Object(ball, None, stop, color=(0.0, 0.0, 0.0))]
    scene = tl.Scene(objects, near_camera(), lights, BLACK)
    frame = renderer.render(scene, (8, 8), tl.FragmentLists(light_points=8))
    truth = references.render(scene, (8, 8))
    off = np.abs(frame.radiance - truth.radiance)[truth.valid] / truth.radiance.max()
    print(f"median {np.median(off):.1e}, p90 {np.quantile(off, 0.9):.1e}, max {off.max():.1e}")
    assert np.median(off) <= 1e-4
    assert np.quantile(off, 0.9) <= 5e-3


def near_camera() -> tl.Camera:
    return tl.Camera.look_at((0, 0.2, 5), (0, 0, 0), fov_y=26)


@pytest.mark.parametrize("cone", [(0, 0, 1), (0, 1, 0)], ids=["from the ball", "aside"])
def test_a_spot_that_shines_elsewhere_is_dark(renderer: tl.Renderer, follows: None, cone: Any) -> None:
    spot = tl.SpotLight((0, 0, 2.5), cone, 1.0, 10, 20)
    frame = renderer.render(tl.Scene([tl.Object(BALL, SMOKE)], near_camera(), [spot], BLACK), (16, 16))
    assert frame.valid.all()
    assert (frame.radiance == 0).all()


def test_views_are_made_anew_where_a_spot_turns(renderer: tl.Renderer, follows: None) -> None:
    def seen(spot: tl.SpotLight) -> Any:
        scene = tl.Scene([tl.Object(BALL, SMOKE)], near_camera(), [spot], BLACK)
        return renderer.render(scene, (16, 16), scattering=tl.SingleScattering()).radiance

    first = tl.SpotLight((0.1, 0.4, 0.2), (0.3, -1, -0.2), 1.0, 10, 20)
    alone = seen(first)
    for other in (replace(first, direction=(-1, 0, 0)), replace(first, outer_cone=11)):
        seen(replace(other, position=(0.1, 0.4, 0.3)))
        assert (seen(other) != alone).any()
        np.testing.assert_array_equal(seen(first), alone)


@pytest.mark.parametrize("quadrature", ["midpoint", "equiangular"])
def test_marching_sums_as_the_reference_does(renderer: tl.Renderer, follows: None, quadrature: Any) -> None:
    spot = tl.SpotLight((0.5, 2, 0.4), (-0.3, -1.0, -0.2), 3.0, 8, 25)
    box = tl.Object(Box().tessellate(), SMOKE, density=tl.LinearDensity(1, 0.2, 1.0))
    scene = tl.Scene([box], tl.Camera.look_at((1, 1.5, 4), (0, 0, 0)), [spot], BLACK)
    method = tl.RayMarched(steps=8, quadrature=quadrature)
    frame = renderer.render(scene, SIZE, method, scattering=tl.SingleScattering())
    truth = tl.reference.march(scene, SIZE, method)
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE))
    off = np.abs(frame.radiance - truth.radiance)[inside] / truth.radiance.max()
    assert off.max() <= 1e-3
    assert np.quantile(off, 0.95) <= 1e-5


def test_diffused_light_is_where_the_spot_shines(renderer: tl.Renderer) -> None:
    """A spot on all of the body is a point light; a beam is as bright in its middle, and dark behind."""
    wax = tl.Object(BALL, tl.Medium(absorption=(1.0, 2.0, 4.0), scattering=60.0, ior=1.0))
    place = (2.0, 0.8, 3.0)

    def seen(light: Any) -> Any:
        return renderer.render(tl.Scene([wax], CAMERA, [light], BLACK), SIZE, scattering=tl.Diffusion(24)).radiance

    point = seen(tl.PointLight(place, 9.0))
    whole = seen(tl.SpotLight(place, np.negative(place), 9.0, 18, 20))
    np.testing.assert_allclose(whole, point, atol=1e-6 * point.max())
    beam = seen(tl.SpotLight(place, np.negative(place), 9.0, 8, 9))
    # Where the axis of the beam meets the ball.
    middle = np.array(place) / np.linalg.norm(place)
    right, up = (middle - CAMERA.eye) @ CAMERA.right, (middle - CAMERA.eye) @ CAMERA.up
    ahead = (middle - CAMERA.eye) @ CAMERA.forward * np.tan(np.radians(20))
    column, row = (int(SIZE[0] * (0.5 + 0.5 * value / ahead)) for value in (right, -up))
    assert 0.8 < beam[row, column, 2] / point[row, column, 2] < 1.001
    assert 0.02 < beam.sum() / point.sum() < 0.6
    assert (beam <= point + 1e-5 * point.max()).all()


def test_fog_shows_a_beam_as_random_paths_do(renderer: tl.Renderer, follows: None) -> None:
    """In the mean, as for point lights: 3 % too dark, of what is scattered many times."""
    fog = tl.Object(BALL, tl.Medium(absorption=0.02, scattering=3.0))
    scene = tl.Scene([fog], near_camera(), [tl.SpotLight((2.5, 1, 2), (-2.5, -1, -2), 9.0, 4, 10)], BLACK)
    frame = renderer.render(scene, (12, 12), scattering=tl.Diffusion(20))
    truth = renderer.render(scene, (12, 12), tl.PathTraced(300))
    assert frame.plan.treated(Treatment.VOLUME) == (0,)
    assert frame.radiance.mean() == pytest.approx(truth.radiance.mean(), rel=0.08)


@pytest.mark.parametrize("body", ["smoke", "frosted glass on a floor"])
def test_random_paths_are_those_of_the_reference(renderer: tl.Renderer, body: str) -> None:
    """Mean square of the differences in standard errors: 1, within five of its own."""
    ball, spot = Sphere().tessellate(10), tl.SpotLight((2, 4, 3), (-2.3, -4.5, -3), 60.0, 8, 15)
    camera = tl.Camera.look_at((0.4, 0.5, 6.0), (0, 0, 0), fov_y=21)
    objects, environment = [tl.Object(ball, SMOKE)], BLACK
    if body != "smoke":
        glass = tl.Object(ball, tl.Medium((0.1, 0.3, 0.6), ior=1.5), surface=tl.Surface(roughness=0.6))
        objects = [glass, tl.Object(Box((-3.0, -3.0, -4.0), (3.0, -1.05, 4.0)).tessellate())]
        environment = tl.Environment.gradient((1.0, 0.5, 0.2), (0.1, 0.5, 1.0))
    scene = tl.Scene(objects, camera, [spot], environment)
    frame = renderer.render(scene, (8, 8), tl.PathTraced(600))
    truth, error = path_trace(scene, (8, 8), paths=60, seed=2)
    assert frame.standard_error is not None
    variance = np.square(frame.standard_error, dtype=np.float64) + error**2
    noisy = variance.min(axis=2) > 1e-12
    found = (frame.radiance - truth.radiance)[noisy] / np.sqrt(variance[noisy])
    assert len(found) > 30
    assert abs(np.square(found).mean() - 1.0) < 5.0 * np.sqrt(2.0 / len(found))
    assert (np.abs(found.mean(axis=0)) < 5.0 / np.sqrt(len(found))).all()
    assert np.abs(frame.radiance - truth.radiance)[~noisy].max(initial=0.0) < 1e-5
