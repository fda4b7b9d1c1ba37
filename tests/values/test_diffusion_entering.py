"""Light that enters bodies in which it diffuses: first events, shadows, what other bodies take, and haze."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.diffusing import (
    BALL,
    BLACK,
    CAMERA,
    WHITE,
    Array,
    ball_grid,
    entering_of,
    grid_of,
    lit,
    lit_by_rays,
    seen_field,
)
from translucent.diffusion import entering, field
from translucent.diffusion.cache import diffusion_key
from translucent.diffusion.entering import (
    Occluders,
    environment_parts,
    from_light,
    nearest_parts,
    opaque_surfaces,
    sky_light,
)
from translucent.diffusion.entering_rays import EnteringRays, joined_rays
from translucent.diffusion.environment_ahead import behind_body
from translucent.diffusion.field import DiffusingBody, DiffusionField
from translucent.diffusion.grid import other_plane_points, plane_points
from translucent.diffusion.lit_body import lit_body
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.diffusion import ahead_mirrored, in_scattered_shares
from translucent.formulas.interface import refracted_direction
from translucent.geometry.solids import Box, Sphere
from translucent.planning.plan import plan
from translucent.planning.scattering import Diffusion
from translucent.scene.environment_map import row_solid_angles, texel_directions

# What enters


def test_first_events_have_nothing_to_do_with_the_places_of_samples() -> None:
    """Or all light that enters at one end of a large triangle would go one way."""
    places, others = plane_points(4000), other_plane_points(4000)
    for x in places.T:
        for y in others.T:
            joint = np.histogram2d(x, y, bins=8, range=((0, 1), (0, 1)))[0]
            # 62 points in each of 64 boxes, and never as far off as by chance, by 4 of sqrt(62).
            assert np.abs(joint - 4000 / 64).max() < 4 * math.sqrt(4000 / 64)


def sunlit_ball(extinction: float, albedo: float, photons: int, zones: int, rng: np.random.Generator) -> Array:
    """Flux that has been scattered out of a ball without an interface, of radius 1, in zones from the back to the sun.

    Analog photons of a sun of 1 W/m^2, which isotropic events scatter.
    """
    across, turn = np.sqrt(rng.random(photons)), 2 * np.pi * rng.random(photons)
    place = np.stack([across * np.cos(turn), across * np.sin(turn), np.sqrt(1 - across**2)], axis=1)
    way, weight, left = np.tile([0.0, 0.0, -1.0], (photons, 1)), np.ones(photons), np.zeros(zones)
    for event in range(400):
        place = place + rng.exponential(1 / extinction, (len(place), 1)) * way
        inside = (place**2).sum(axis=1) < 1
        if event:
            back = (place * way).sum(axis=1) - np.sqrt(
                np.maximum((place * way).sum(axis=1) ** 2 - (place**2).sum(axis=1) + 1, 0.0)
            )
            height = (place - back[:, None] * way)[:, 2]
            left += np.histogram(height[~inside], zones, (-1, 1), weights=weight[~inside])[0]
        place, weight = place[inside], weight[inside] * albedo
        way = rng.normal(size=place.shape)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
    return left * np.pi / photons / (4 * np.pi / zones)


def test_light_of_a_sun_goes_on_as_it_falls(rng: np.random.Generator) -> None:
    """Flux out of a ball, in zones from the back to the sun, is that of photons; not of one that enters as uniform."""
    medium, grid = tl.Medium(absorption=0.5, scattering=4.5), ball_grid(20)
    exact = sunlit_ball(5.0, 0.9, 12000, 6, rng)
    ball, sun = tl.Object(BALL, medium), tl.DirectionalLight((0, 0, -1), (1, 1, 1))
    rays = from_light(grid, Occluders(ball), sun, 1.0, diffuse_interface(1.0))
    np.testing.assert_allclose(rays.directions, np.broadcast_to([0, 0, -1.0], rays.directions.shape), atol=1e-12)
    zone = np.minimum((3 * (grid.points[:, 2] + 1)).astype(int), 5)
    off = []
    for found in (lit_by_rays(grid, medium, rays), lit(grid, medium, entering_of(grid, rays))):
        flux = diffuse_interface(1.0).exit_share * found.fluence[:, 0]
        rest = np.bincount(zone, flux) / np.bincount(zone) - exact
        off.append(math.sqrt(float((rest**2).mean())) / exact.mean())
    print(off)
    # Photons err by 1 %. Without the shift of first events along the surface the first is .11: twilight is too dark.
    assert off[0] < 0.07 < 0.2 < off[1]


#: Mean over the disc of a ball of wax of the radiance over pi that leaves it, by 4 million photons of a sun of 1 W/m^2,
#: for angles in degrees between the directions to the sun and to the eye.
WAX_FROM_BEHIND = {120: (0.01577, 0.00853, 0.00303), 150: (0.00722, 0.00317, 0.00091)}


def test_light_leaves_beside_where_it_was_scattered_last() -> None:
    """With the sun obliquely behind it a ball is as bright as by photons; read where it leaves, 15 to 33 % darker."""
    medium = tl.Medium(absorption=(0.48, 1.04, 2.56), scattering=(8.0, 7.2, 5.6), anisotropy=0.3, ior=1.44)
    found = seen_field(tl.Object(BALL, medium), tl.DirectionalLight((0, 0, -1), (1, 1, 1)))
    x, y = (part.ravel() for part in np.meshgrid(*2 * [(np.arange(48) + 0.5) / 24 - 1]))
    x, y = x[x**2 + y**2 < 1], y[x**2 + y**2 < 1]
    z = np.sqrt(1 - x**2 - y**2)
    cosine = optics.refracted_cosine(z, 1.44)
    path, passing = 2 * cosine, 1 - optics.fresnel_dielectric(z, 1.44)[:, None]
    depth = path[:, None] * medium.extinction
    for angle, exact in WAX_FROM_BEHIND.items():
        sine, down = math.sin(math.radians(angle)), math.cos(math.radians(angle))
        points = np.stack([x * down + z * sine, y, z * down - x * sine], axis=1)
        into = refracted_direction(np.tile([-sine, 0, -down], (len(points), 1)), points, np.full(len(points), 1.44))
        off = []
        for at in (found.above_last_events(points, points, into, path, depth), points):
            light = passing * optics.opacity((1 - found.ahead) * depth)
            mean = (light * found.scattered_radiance(at, points, into, cosine)).sum(axis=0) / (24**2 * math.pi)
            off.append(np.abs(mean / exact - 1))
        print(angle, np.round(off, 3))
        assert off[0].max() < 0.12 < off[1].min()


def given_back_by_a_ball(radius: float, albedos: Array, ior: float, photons: int, rng: np.random.Generator) -> Array:
    """Share of the uniform light entering a ball, of a radius in mean free paths, that leaves it after an event.

    Of media of albedos (k,), in which photons go the same ways.
    """
    outside = np.sqrt(rng.random(photons))
    outside = outside[rng.random(photons) > optics.fresnel_dielectric(outside, ior)]
    cosine, count = optics.refracted_cosine(outside, ior), len(outside)
    way = np.stack([np.sqrt(1 - cosine**2), np.zeros(count), -cosine], axis=1)
    place, scattered, left = np.tile([0.0, 0.0, radius], (count, 1)), np.zeros(count, bool), np.zeros(len(albedos))
    weight = np.ones((count, len(albedos)))
    while len(way):
        ahead = (place * way).sum(axis=1)
        end = np.sqrt(np.maximum(ahead**2 - (place**2).sum(axis=1) + radius**2, 0.0)) - ahead
        path = rng.exponential(size=len(way))
        out = path >= end
        place = place + np.minimum(path, end)[:, None] * way
        normal = place / radius
        along = np.clip((way * normal).sum(axis=1), 0.0, 1.0)
        mirrored = optics.fresnel_dielectric(along, 1 / ior)
        left += (1 - mirrored[out & scattered]) @ weight[out & scattered]
        weight = weight * np.where(out[:, None], mirrored[:, None], albedos)
        turned = rng.normal(size=way.shape)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        way = np.where(out[:, None], way - 2 * along[:, None] * normal, turned)
        live = weight.max(axis=1) > 5e-3
        way, place, weight, scattered = way[live], place[live], weight[live], (scattered | ~out)[live]
    return np.asarray(left / count)


def test_small_balls_give_back_more_than_half_spaces(rng: np.random.Generator) -> None:
    """Balls of two mean free paths in radius. Measured: 1 to 4 % less than photons; 4 to 9 % without."""
    albedos, index = np.array([0.4, 0.6, 0.8]), 1.6
    medium = tl.Medium(absorption=2 * (1 - albedos), scattering=2 * albedos, ior=index)
    found = diffuse_interface(index).exit_share * lit(ball_grid(20), medium).fluence.mean(axis=0)
    exact = given_back_by_a_ball(2.0, albedos, index, 30000, rng)
    print(found / exact - 1)
    # Photons err by 1 %.
    np.testing.assert_allclose(found, exact, rtol=0.05)


def fluence_at(field: DiffusionField) -> Array:
    """Fluence in the cells next to the surface of the ball, by their height from bottom to top."""
    points = Sphere().tessellate(24).vertices
    fluence = field.at_surface(field.fluence[..., :1], points, points)[:, 0]
    zone = np.minimum((3 * (points[:, 1] + 1)).astype(int), 5)
    return np.asarray(np.bincount(zone, fluence) / np.bincount(zone), np.float64)


def test_bright_parts_of_the_environment_enter_as_lamps_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disc of 17 degrees overhead, as the sun there; as uniform light it goes less deep. Measured: .003, .05, .30."""
    texels = np.zeros((64, 128, 3), np.float32)
    texels[:3] = 1.0
    medium = tl.Medium(absorption=0.15, scattering=2.85, ior=1.3)
    body = tl.Object(BALL, medium)

    def zones(environment: tl.Environment, *lights: tl.DirectionalLight) -> Array:
        solver = DiffusingBody(lit_body(body, None, Diffusion(12).cell_size(body)), medium, 0.0)
        found = fluence_at(solver.field(tl.Scene([body], CAMERA, lights, environment), 0))
        return found / found.mean()

    sun = zones(BLACK, tl.DirectionalLight((0, -1, 0), (1, 1, 1)))
    directed = zones(tl.Environment.image(texels))
    monkeypatch.setattr(entering, "SUN", 1e9)
    parts = zones(tl.Environment.image(texels))

    def as_uniform(*given: Any) -> tuple[Array, EnteringRays]:
        least, rays = sky_light(*given)
        np.add.at(least, rays.samples, rays.entering)
        return least, joined_rays([])

    monkeypatch.setattr(field, "sky_light", as_uniform)
    uniform = zones(tl.Environment.image(texels))
    off = [float(np.abs(found - sun).max()) for found in (directed, parts, uniform)]
    # Rays of environments are not shifted along the surface.
    assert max(off[:2]) < 0.07 < 0.1 < off[2], off


def test_constant_environments_have_no_rays_and_others_keep_their_flux() -> None:
    """The least radiance of all directions enters as uniform light; the rest as two rays at each sample.

    Flux, and the sums of it times the cosine and its square, are those of all directions.
    """
    body = tl.Object(BALL, medium := tl.Medium(scattering=3.0))
    geometry = lit_body(body, None, Diffusion(12).cell_size(body))
    solver, found, sky = DiffusingBody(geometry, medium, 0.0), {}, geometry.shape.sky
    received, normals = geometry.entrance(1.0, 0.0).received, geometry.grid.normals
    for top in (1.0, 3.0):
        parts = environment_parts(tl.Environment.gradient((1, 1, 1), (top, top, 1)), sky.directions)
        found[top] = uniform, rays = solver._from_sky(parts, [])
        means = parts / nearest_parts(sky.directions)[1][:, None]
        for power in (0, 1, 2):
            every = received * np.maximum(normals @ sky.directions.T, 0.0) ** power
            cosine = -(rays.directions * normals[rays.samples]).sum(axis=1, keepdims=True)
            # Of the uniform part all directions count.
            sums = uniform * (every.sum(axis=1) / received.sum(axis=1))[:, None]
            np.add.at(sums, rays.samples, rays.entering * cosine**power)
            np.testing.assert_allclose(sums.sum(axis=1), (every @ means).sum(axis=1), rtol=1e-4)
    assert not len(found[1.0][1].samples)
    rays = found[3.0][1]
    assert len(rays.samples) == 2 * len(geometry.grid.points)
    assert not rays.entering[:, 2].any()


def test_bodies_on_the_way_absorb_light_of_the_environment() -> None:
    """Beer's law for the mean way through a lid over all of the sky; media that scatter alone take nothing."""
    ball = tl.Object(BALL, tl.Medium(scattering=5.0, ior=1.5))
    geometry = lit_body(ball, None, Diffusion(10).cell_size(ball))
    free, lidded, white = (
        DiffusingBody(geometry, ball.medium, 0.0)
        .field(tl.Scene([ball, *lids], CAMERA, (), tl.Environment.gradient((0, 0, 0), (1, 1, 1))), 0)
        .entering
        for lids in (
            (),
            (tl.Object(Box((-90, 1.5, -90), (90, 2.0, 90)).tessellate(), tl.Medium(absorption=(0.0, 1.0, 4.0))),),
            (tl.Object(Box((-90, 1.5, -90), (90, 2.0, 90)).tessellate(), tl.Medium(scattering=9.0)),),
        )
    )
    np.testing.assert_array_equal(white, free)
    np.testing.assert_array_equal(lidded[..., 0], free[..., 0])
    top = np.unravel_index(free[..., 0].argmax(), free.shape[:4])
    cosine, weight = np.polynomial.legendre.leggauss(64)
    cosine = 0.5 * (cosine + 1)
    sky = weight * cosine * (1 - optics.fresnel_dielectric(cosine, 1.5)) * (0.5 + 0.5 * cosine)
    for channel, absorption in ((1, 1.0), (2, 4.0)):
        share = float((sky * optics.transmittance(0.5 * absorption / cosine)).sum() / sky.sum())
        assert lidded[(*top, channel)] / free[(*top, channel)] == pytest.approx(share, rel=0.05)


def test_nothing_of_the_environment_passes_what_is_black() -> None:
    """Next to the edges of a box as well, where samples stand for those of other sides."""
    box, lid = Box().tessellate(), Sphere(radius=2.0).tessellate(8)
    body, black = tl.Object(box, tl.Medium(scattering=5.0)), tl.Object(lid, tl.Medium(absorption=1e9))
    scene, geometry = tl.Scene([body, black], CAMERA), lit_body(body, None, Diffusion(8).cell_size(body))
    assert body.medium is not None
    assert DiffusingBody(geometry, body.medium, 0.0).field(scene, 0).entering.max() < 1e-9
    keys = {
        diffusion_key(plan(replace(scene, objects=[body, lid]))) for lid in (black, replace(black, sheet_thickness=0.1))
    }
    assert len(keys) == 2  # sheets take nothing on the way


def test_opaque_objects_shadow_a_directional_light() -> None:
    """Below a plate nothing enters, beside it what Fresnel lets through; and the side away from the light is dark."""
    ball, light = tl.Object(BALL, tl.Medium(scattering=5.0, ior=1.5)), tl.DirectionalLight((0, -1, 0), (2, 2, 2))
    plate = tl.Object(Box((-0.5, 2, -3), (3, 2.1, 3)).tessellate(), None)
    grid = ball_grid(16)
    free, shadowed = (
        entering_of(
            grid, from_light(grid, Occluders(ball, opaque_surfaces(opaque)), light, 1.5, diffuse_interface(1.5))
        )
        for opaque in ((), (plate,))
    )
    beside = grid.points[:, 0] < -0.5
    np.testing.assert_array_equal(shadowed[beside], free[beside])
    assert not shadowed[~beside].any()
    assert not free[grid.points[:, 1] < 0].any()
    cosine = np.maximum(grid.normals[:, 1], 0.0)
    # What a disc of 1 m^2 pi receives, less what is mirrored: 4 % at the middle, more at its edge.
    received = 2 * math.pi * float(np.mean(free[:, 0] / 2)) * 2
    assert received == pytest.approx(math.pi * diffuse_interface(1.5).entering, rel=0.01)
    assert (free[:, 0] <= 2 * cosine + 1e-12).all()


def test_uniform_light_enters_everywhere_alike() -> None:
    found = seen_field(tl.Object(BALL, tl.Medium(scattering=5.0, ior=1.5)), environment=WHITE)
    entering = found.at_surface(found.entering, BALL.vertices, BALL.vertices)
    np.testing.assert_allclose(entering, math.pi * diffuse_interface(1.5).entering, rtol=1e-5)


def test_a_lamp_just_outside_is_not_inside() -> None:
    """In a cell that the surface crosses: it lights the surface, and makes no light in the body of itself."""
    body = tl.Object(BALL, tl.Medium(absorption=1.0, scattering=20.0, ior=1.5))
    step = Diffusion(16).cell_size(body)
    above, below = (
        seen_field(body, tl.PointLight((0, 1 + side * 0.2 * step, 0), (1, 1, 1))).entering.max() for side in (1, -1)
    )
    assert above > 1
    assert below == 0


@pytest.mark.parametrize("height", [1e-7, 1e-3, 0.03, 0.3])
def test_all_light_of_a_lamp_however_near_falls_onto_the_face_below_it(height: float) -> None:
    """Intensity times the solid angle of the face; samples are 0.04 from each other, and so is what is left of it."""
    mesh = Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
    grid, casters = grid_of(mesh, 24), Occluders(tl.Object(mesh, tl.Medium(scattering=1.0)))
    for x, z in ((0.0, 0.0), (0.013, -0.11), (0.1, 0.071)):
        rays = from_light(grid, casters, tl.PointLight((x, 0.5 + height, z), (1, 1, 1)), 1.5, diffuse_interface(1.5))
        flux = float((rays.entering + rays.mirrored)[:, 0].sum() * grid.area)
        corners = [(0.5 + one * x, 0.5 + other * z) for one in (1, -1) for other in (1, -1)]
        angle = sum(math.atan(a * b / (height * math.hypot(a, b, height))) for a, b in corners)
        assert flux == pytest.approx(angle, rel=0.1)


@pytest.mark.parametrize("inside", [False, True])
def test_other_bodies_dim_lights_on_their_way_in(inside: bool) -> None:
    """Behind a slab, or in the middle of a block, the light of a sun is less by its transmittance, and so is all."""
    ball = tl.Object(Sphere(radius=0.5).tessellate(16), tl.scattering_medium((0.8, 0.6, 0.4), 0.05))
    absorption = np.array([0.2, 1.0, 3.0])
    box = tl.Object(
        Box((-2, -2, -2 if inside else 1), (2, 2, 2 if inside else 1.3)).tessellate(), tl.Medium(absorption)
    )
    sun = tl.DirectionalLight((0, 0, -1), (2, 2, 2))
    assert ball.medium is not None
    lit_ball = DiffusingBody(lit_body(ball, None, Diffusion(12).cell_size(ball)), ball.medium, 0.0)

    def light(objects: list[tl.Object]) -> Array:
        field = lit_ball.field(tl.Scene(objects, CAMERA, [sun], BLACK), 0)
        return field.at_surface(field.fluence, ball.mesh.vertices, ball.mesh.vertices)

    alone, dimmed = light([ball]), light([ball, box])
    seen = alone > 1e-3 * alone.max()
    if inside:
        # Each point has another way through the block: from 1.5 m, above, to 2 m, at the rim.
        share = (dimmed / np.maximum(alone, 1e-12))[seen.all(axis=-1)]
        assert (share <= np.exp(-1.5 * absorption) * 1.01).all()
        assert (share >= np.exp(-2.0 * absorption) * 0.99).all()
    else:
        np.testing.assert_allclose(dimmed[seen], (alone * np.exp(-0.3 * absorption))[seen], rtol=1e-5)


# Light that is scattered ahead


def test_a_blurred_environment_has_the_moments_of_its_depth() -> None:
    """Over those of order 0, which are as of order 1; order 2 decays as Goudsmit and Saunderson have it."""
    directions, weights = texel_directions(32, 64), row_solid_angles(32, 64)[:, None]
    bright = (directions[..., 1] > 0.9)[..., None] * np.array([8.0, 2.0, 1.0])
    behind = behind_body(tl.Environment.image(bright + 0.1), tl.Medium(scattering=1.0, anisotropy=0.8), 1.0)
    assert behind is not None
    second = weights * (1.5 * directions[..., 1] ** 2 - 0.5)
    own = np.einsum("yx,yxc->c", second, bright)
    for depth in (0.5, 4.0):
        found = behind.at(directions.reshape(-1, 3), np.full((32 * 64, 3), depth)).reshape(32, 64, 3)
        total = (weights[..., None] * (bright + 0.1)).sum(axis=(0, 1))
        np.testing.assert_allclose((weights[..., None] * found).sum(axis=(0, 1)), total, rtol=0.01)
        ratio = (np.exp(-(1 - 0.8**2) * depth) - np.exp(-depth)) / (np.exp(-0.2 * depth) - np.exp(-depth))
        np.testing.assert_allclose(np.einsum("yx,yxc->c", second, found), ratio * own, rtol=0.02)


@pytest.mark.parametrize("passed", [1.0, 0.6, 0.0])
def test_haze_is_mirrored_until_it_leaves(passed: float) -> None:
    """The closed form against its sum, mirror by mirror; nothing is lost where nothing is absorbed."""
    far, near = in_scattered_shares(0.6, passed)
    inside, out = 1.0, [0.0, 0.0]
    for bounce in range(1, 200):
        out[bounce % 2] += inside * passed * 0.4
        inside *= passed * 0.6
    np.testing.assert_allclose((far, near), out, rtol=1e-12)
    if passed == 1.0:
        assert far + near == pytest.approx(1.0, abs=1e-12)


def test_haze_is_mirrored_less_than_diffuse_light() -> None:
    """By the mean cosine c of what is scattered by Henyey and Greenstein on its way.

    Of that, similarity takes the share 1 - c for isotropic, which interfaces mirror as they do diffuse light, and c for
    going ahead: r - (r - m(c)) / c of which is mirrored, if they mirror m(c) of all.
    """
    interface = diffuse_interface(1.5)
    inside, around = (np.arange(400) + 0.5) / 400, np.cos((np.arange(64) + 0.5) / 64 * np.pi)
    mirror, r = optics.fresnel_dielectric(inside, 1 / 1.5), interface.reflected
    off = []
    for mu in (0.3, 0.8, 0.87, 0.95, 1.0):
        turn = mu * inside[:, None] + math.sqrt(1 - mu * mu) * np.sqrt(1 - inside**2)[:, None] * around
        for scattered in (0.6, 2.0, 5.0, 20.0):
            c = (math.exp(-0.1 * scattered) - math.exp(-scattered)) / (1 - math.exp(-scattered))
            flux = ((1 - c * c) / (1 + c * c - 2 * c * turn) ** 1.5).mean(axis=-1) * inside
            exact = r - (r - float(flux @ mirror / flux.sum())) / c
            found = ahead_mirrored(mu, 1.5, r, interface.reflected_flux, 0.9 * scattered, 0.9)
            off.append(float(found) - exact)
    assert np.abs(off).mean() < 0.03
    assert np.abs(off).max() < 0.1
    assert ahead_mirrored(1.0, 1.0, 0.0, 0.0, 1.0, 0.9) == pytest.approx(0.0, abs=1e-12), "no interface mirrors nothing"
