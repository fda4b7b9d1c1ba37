"""Photons in float64: what a ball throws on the ground in closed form, a mirror, and what counts as a caustic."""

from __future__ import annotations

import numpy as np
import pytest

from tests.ball_light import ball_light, flux_within, fresnel
from translucent.errors import InputError
from translucent.formulas.interface import slab_reflectance
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.medium import Medium
from translucent.reference import photon_irradiance, trace_photons
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.surface import Surface

CAMERA = Camera.look_at((0, 5, 9), (0, 0, 0))
GROUND = Object(Mesh(np.array([(-60, 0, -60), (60, 0, -60), (60, 0, 60), (-60, 0, 60)]), [(0, 2, 1), (0, 3, 2)]))
SUN = DirectionalLight((0, -1, 0), 1.0)
SEGMENTS, PHOTONS = 48, 20_000
BALL = Sphere().tessellate(SEGMENTS)
RADII = (0.3, 0.6, 1.2, 3.0)


def above(height: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[1, 3] = height
    return matrix


def scene(medium: Medium, light: Light = SUN, height: float = 2.0, surface: Surface | None = None) -> Scene:
    return Scene([Object(BALL, medium, above(height), surface=surface), GROUND], CAMERA, [light])


def test_the_closed_form_has_the_paraxial_focus() -> None:
    """A ball of index n brings rays near the axis to a focus n / (2 (n - 1)) radii from its center."""
    flux, distance = ball_light(3.0, 1.5)
    passing = slice(len(flux) // 14, 2 * len(flux) // 14)  # what is mirrored inside has lines of focus on the axis
    irradiance = flux_within(flux[passing], distance[passing], 0.02)[0] / (np.pi * 0.02**2)
    assert irradiance == pytest.approx((1.0 - fresnel(np.array(1.0), 1.5)) ** 2 / (1.0 - 3.0 / 1.5) ** 2, rel=5e-3)
    assert flux.sum() == pytest.approx(np.pi, rel=1e-4)  # what stays inside longer is next to nothing


@pytest.mark.parametrize(("light", "lamp", "absorption"), [(SUN, None, 0.0), (PointLight((0, 5, 0), 1.0), 3.0, 0.4)])
def test_a_ball_throws_what_its_rays_carry(light: Light, lamp: float | None, absorption: float) -> None:
    """In all, and within circles around the focus."""
    scene_of = scene(Medium(absorption, ior=1.5), light)
    landed = trace_photons(scene_of, PHOTONS, seed=3)
    points = landed.points + CAMERA.eye
    found = flux_within(landed.power[:, 0], np.hypot(points[:, 0], points[:, 2]), RADII)
    flux, distance = ball_light(2.0, 1.5, lamp=lamp, absorption=absorption)
    truth = flux_within(flux, distance, RADII)
    # Four standard errors of as many photons as are within, and what the facets of the ball cut off its disc.
    noise = 4.0 * np.sqrt(truth / flux.sum() / PHOTONS)
    assert (np.abs(found - truth) / flux.sum() < noise + (np.pi / SEGMENTS) ** 2).all()
    assert np.ptp(landed.power, axis=1).max() == 0.0
    assert np.abs(points[:, 1]).max() < 1e-9
    np.testing.assert_array_equal(landed.objects, 1)


def test_a_mirror_of_glass_turns_a_beam_aside() -> None:
    """The share that Fresnel and both sides of a sheet mirror; what passes goes straight, and is left out."""
    sheet = Object(_quad(), Medium(100.0, ior=1.5), above(3.0), sheet_thickness=1e-3)
    landed = trace_photons(Scene([sheet, GROUND], CAMERA, [DirectionalLight((1, 0, 0), 2.0)]), PHOTONS)
    share = slab_reflectance(fresnel(np.sqrt(0.5), 1.5), 0.1 / np.sqrt(1.0 - 0.5 / 1.5**2))
    assert landed.power.sum(axis=0) == pytest.approx(2.0 * np.sqrt(2.0) * 2.0 * share, rel=4.0 / np.sqrt(PHOTONS * 0.1))
    points = landed.points + CAMERA.eye
    assert np.abs(points[:, 0]).max() < np.sqrt(0.5) + 1e-9
    matched = Scene([Object(BALL, Medium(0.2), above(2.0)), GROUND], CAMERA, [SUN])
    assert len(trace_photons(matched, 100).points) == 0


def test_colors_go_ways_of_their_own() -> None:
    """Blue is bent more, so that its focus is nearer to the ball; where all media scatter all light, none lands."""
    dispersive = scene(Medium(ior=1.6), surface=Surface(dispersion=1.0))
    landed = trace_photons(dispersive, 2000)
    assert (np.count_nonzero(landed.power, axis=1) == 1).all()
    points = landed.points + CAMERA.eye
    spread = [np.median(np.hypot(points[own, 0], points[own, 2])) for own in (landed.power > 0).T]
    assert spread[0] < spread[1] < spread[2]
    milk = trace_photons(scene(Medium(scattering=1e3, ior=1.5)), 500)
    mirrored = flux_within(*ball_light(2.0, 1.5, absorption=1e3), 60.0)
    assert milk.power[:, 0].sum() == pytest.approx(mirrored[0], abs=4.0 * np.pi * np.sqrt(0.1 / 500))


def test_a_picture_holds_the_power_that_it_shows() -> None:
    """From above through the ball, in a parallel and in a perspective view: pixels times their area on the ground."""
    one = scene(Medium(ior=1.5))
    landed = trace_photons(one, 2000)
    for camera in (
        Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), height=2.0),
        Camera.look_at((0, 9, 0), (0, 0, 0), (0, 0, 1), fov_y=12.0),
    ):
        moved = Scene(one.objects, camera, one.lights)
        shifted = type(landed)(landed.points + CAMERA.eye - camera.eye, landed.normals, landed.power, landed.objects)
        picture = photon_irradiance(moved, (40, 20), shifted)
        half_width, half_height = np.array(camera.half_extent((40, 20))) * (9.0 if camera.fov_y else 1.0)
        points = landed.points + CAMERA.eye
        inside = (np.abs(points[:, 0]) < half_width) & (np.abs(points[:, 2]) < half_height)
        assert 0.1 < inside.mean() < 0.9
        area = 4.0 * half_width * half_height / 800
        assert picture.sum() * area == pytest.approx(landed.power[inside].sum(), rel=1e-9)
    beneath = Scene(one.objects, Camera.look_at((0, -9, 0), (0, 0, 0), (0, 0, 1)), one.lights)
    assert not photon_irradiance(
        beneath,
        (8, 8),
        type(landed)(landed.points + CAMERA.eye + (0, 9, 0), landed.normals, landed.power, landed.objects),
    ).any()


def test_what_no_photon_can_follow_is_refused() -> None:
    with pytest.raises(
        InputError, match="0 photons; the number of photons must be above 0; use a value such as 100_000"
    ):
        trace_photons(scene(Medium(ior=1.5)), 0)
    ball = Mesh(BALL.vertices, BALL.faces[1:], name="sphere")
    open_scene = Scene([Object(ball, Medium(ior=1.5)), GROUND], CAMERA, [SUN])
    with pytest.raises(
        InputError,
        match="photons through 'sphere'; the mesh is not closed; close the mesh, or declare it a thin-walled sheet",
    ):
        trace_photons(open_scene)


def _quad() -> Mesh:
    """A square with sides of 2, of a wall turned by 45 degrees that mirrors a beam along +x down."""
    half = np.sqrt(0.5)
    corners = [(-half, half, -1), (half, -half, -1), (half, -half, 1), (-half, half, 1)]
    return Mesh(np.array(corners), [(0, 1, 2), (0, 2, 3)])
