"""Light scattered once: closed forms, integrals by another hand, and lights in every place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.reference.lit_media import (
    CAMERA,
    EYE,
    MEDIUM,
    SLAB,
    SUN,
    Array,
    middle,
    middle_ray,
    scene,
    single_scatter,
    slab,
)
from tests.solids import Box, Solid, Sphere, SphericalShell, TwoSpheres
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.formulas.phase import henyey_greenstein
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Object, Scene

# One slab


@pytest.mark.parametrize("direction", [(0.3, 0.2, -1.0), (0, 0, -1), (0.9, -0.1, -0.1), (0.1, 0.3, 1.0)])
@pytest.mark.parametrize("g", [0.0, 0.7, -0.7])
def test_a_slab_in_the_sun(direction: tuple[float, ...], g: float) -> None:
    """The exponent is linear in the distance on the ray, from the side of the light as well as from behind."""
    medium = replace(MEDIUM, anisotropy=g)
    light = DirectionalLight(direction, (1.0, 2.0, 3.0))
    _, ray = middle_ray()
    travel = np.asarray(light.direction)
    length = 1 / -ray[2]
    # Per metre of the ray; from below the path is longest where the ray begins.
    slope = ray[2] / travel[2]
    start = 0.0 if travel[2] < 0 else medium.extinction / travel[2]
    source = medium.scattering * henyey_greenstein(-travel @ ray, g) * [1, 2, 3] * np.exp(-start)
    expected = optics.emitted_radiance(source, medium.extinction * (1 + slope), length)
    np.testing.assert_allclose(middle(slab(light, medium)), expected, rtol=1e-9)


@pytest.mark.parametrize("g", [0.0, 0.999, -0.999])
@pytest.mark.parametrize(
    "position",
    [(0.2, 0.1, -0.5), (0.3, 0.2, 2.0), (3.0, 0.0, 1.0), (0.5, 0.1, -2.0), (0.14, 0.05, -0.5), (0.1, 0.5, 0.0)],
    ids=["inside", "near the eye", "beside", "behind", "near the ray", "on the surface"],
)
def test_a_slab_by_a_lamp(position: tuple[float, ...], g: float) -> None:
    """Inside, as far as it is seen, the slab is an infinite medium around the lamp."""
    light, medium = PointLight(position, 2.0), replace(MEDIUM, anisotropy=g)
    origin, direction = middle_ray()
    expected = single_scatter(SLAB, medium, light, origin, direction, (3 / -direction[2], 4 / -direction[2]))
    # The chord of the solid rounds at coordinates of 50 m, over a path of 1 m: some 1e-14, times 5 /m.
    np.testing.assert_allclose(middle(slab(light, medium)), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("cones", "rtol"), [((0, 40), 1e-6), ((10, 20), 1e-6), ((5, 5.001), 1e-3), ((0, 0.1), 1e-4), ((40, 90), 1e-6)]
)
@pytest.mark.parametrize(
    "position", [(0.2, 0.1, 0.5), (0.2, 0.1, -0.4), (-1, 0.1, -0.5)], ids=["from above", "inside", "from the side"]
)
def test_a_slab_by_a_spot(position: tuple[float, ...], cones: tuple[float, float], rtol: float) -> None:
    """The rules of quadrature end where the ray enters the cones and leaves them, however thin the beam is."""
    light = SpotLight(position, np.subtract((0.1, 0.0, -0.5), position), 2.0, *cones)
    origin, direction = middle_ray()
    expected = single_scatter(SLAB, MEDIUM, light, origin, direction, (3 / -direction[2], 4 / -direction[2]))
    # The sum to compare with has an error of its own at edges within its panels.
    np.testing.assert_allclose(middle(slab(light, MEDIUM)), expected, rtol=rtol)
    assert expected.min() > 1e-7


def test_the_error_that_is_told() -> None:
    """It is above the true one, and both fall with the tolerance."""
    of = slab(PointLight((0.14, 0.05, -0.5), 2.0), replace(MEDIUM, anisotropy=0.9))
    truth = render(of, (4, 3), tolerance=1e-12).radiance
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-8):
        frame = render(of, (4, 3), tolerance=tolerance)
        told = float(frame.provenance["scattering error"])
        assert (
            (np.abs(frame.radiance - truth).max(axis=-1) / truth.max(axis=-1)).max() <= told * 1.05 <= tolerance * 1.05
        )


@pytest.mark.parametrize("tolerance", [0.0, 1e-13, 2.0, float("nan")])
def test_tolerances_that_cannot_be(tolerance: float) -> None:
    with pytest.raises(InputError, match=r"^tolerance .*the tolerance must lie in 1e-12 to 1"):
        render(slab(SUN), (1, 1), tolerance=tolerance)


@pytest.mark.parametrize("depth", [1e-9, 1e-3, 40.0, 1e4, 1e8])
def test_any_depth(depth: float) -> None:
    """Only the skin is seen of a deep slab, all of a thin one; both to all digits."""
    medium = Medium(absorption=0.25 * depth, scattering=0.75 * depth)
    _, ray = middle_ray()
    light = DirectionalLight((0, 0, -1), 1.0)
    expected = optics.emitted_radiance(0.75 * depth / (4 * np.pi), depth * (1 - ray[2]), 1 / -ray[2])
    np.testing.assert_allclose(middle(slab(light, medium)), expected, rtol=1e-6)


def test_lights_add_up() -> None:
    lamp = PointLight((0.5, 0.1, -2.0), 2.0)
    both = scene(Object(SLAB.tessellate(), MEDIUM), lights=[SUN, lamp])
    np.testing.assert_allclose(middle(both), middle(slab(SUN)) + middle(slab(lamp)), rtol=2e-6)


def test_a_far_lamp_is_a_sun() -> None:
    travel = np.asarray(SUN.direction)
    far = PointLight(-1e8 * travel, 2.0 * 1e16)
    np.testing.assert_allclose(middle(slab(far)), middle(slab(SUN)), rtol=1e-7)


def test_what_else_is_in_the_picture_stays() -> None:
    """Emission, background, transmittance and thickness are those without lights."""
    medium = replace(MEDIUM, emission=(1.0, 2.0, 3.0))
    white = Environment.constant((1, 1, 1))
    lit = Scene([Object(SLAB.tessellate(), medium)], CAMERA, [SUN], white)
    unlit, light = replace(lit, lights=()), slab(SUN, medium)
    a, b = render(lit, (3, 2)), render(unlit, (3, 2))
    for name in ("transmittance", "optical_depth", "thickness", "coverage"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    glow = render(replace(light, lights=()), (3, 2)).radiance
    np.testing.assert_allclose(a.radiance, b.radiance + render(light, (3, 2)).radiance - glow, rtol=1e-12)
    assert "scattering error" not in b.provenance


# Solids


APART = [Sphere((-0.4, 0, 0), 0.3), Sphere((0.4, 0, 0), 0.45)]

#: With the spheres that they are made of, and where the camera looks.
SOLIDS: dict[str, tuple[Solid, list[Sphere], tuple[float, ...]]] = {
    "sphere": (Sphere(), [Sphere()], (0.0, 0.0, 0.0)),
    "shell": (SphericalShell(), [Sphere(), Sphere(radius=SphericalShell().inner)], (0.0, 0.0, 0.0)),
    "two spheres": (TwoSpheres(*APART), APART, (0.3, 0.1, 0.0)),
}


def spans(spheres: list[Sphere], origin: Array, direction: Array) -> list[tuple[float, float]]:
    """Parts of a ray in an odd number of spheres."""
    cuts = []
    for sphere in spheres:
        way = sphere.center - origin
        closest = way @ direction
        square = sphere.radius**2 - way @ way + closest**2
        cuts += [closest - np.sqrt(square), closest + np.sqrt(square)] if square > 0 else []
    cuts = sorted(cuts)
    return list(zip(cuts[::2], cuts[1::2], strict=True))


@pytest.mark.parametrize(
    ("name", "light"),
    list(
        zip(
            SOLIDS,
            [
                DirectionalLight((1.0, -0.4, -0.2), 3.0),
                PointLight((-1.2, 0.9, 0.8), 5.0),
                PointLight((0.5, 0.1, 0.1), 1.0),
            ],
            strict=True,
        )
    ),
    ids=SOLIDS,
)
def test_round_solids_converge(name: str, light: Light) -> None:
    """Meshes are polyhedra: of second order, so with four times the segments the error is 16 times smaller."""
    solid, spheres, target = SOLIDS[name]
    camera = Camera.look_at((0.4, 0.5, 3.0), target, fov_y=12)
    origin = camera.eye
    directions = camera.rays((3, 2))[1].reshape(-1, 3)
    truth = np.array(
        [single_scatter(solid, MEDIUM, light, origin, ray, *spans(spheres, origin, ray)) for ray in directions]
    )
    seen = truth > 0
    assert seen.mean() > 0.6
    errors = []
    for segments in (24, 96):
        frame = render(scene(Object(solid.tessellate(segments), MEDIUM), lights=[light], camera=camera), (3, 2))
        assert frame.valid.all()
        errors.append(np.median(np.abs(frame.radiance.reshape(-1, 3)[seen] / truth[seen] - 1)))
    print(f"{name}: median error {errors[0]:.1e} with 24 segments, {errors[1]:.1e} with 96")
    assert errors[1] < errors[0] / 8
    # The surface is off by the sagitta, on the way in and to the light, at 5 /m in the deepest channel.
    assert errors[1] < 5 * 2 * solid.sagitta(96) / 0.5


def ends(box: Box, origin: Array, direction: Array) -> tuple[float, float]:
    """Distances at which a ray enters a box and leaves it."""
    at = np.sort((np.array([box.low, box.high]) - origin) / direction, axis=0)
    return float(at[0].max()), float(at[1].min())


def test_a_hollow_box_with_kinks_in_the_light_path() -> None:
    """Exact faces: all digits, though the light passes the cavity at an angle."""
    outer, inner = Box((-1, -1, -1), (1, 1, 1)), Box((-0.5, -0.3, -0.4), (0.4, 0.5, 0.6))
    a, b = outer.tessellate(), inner.tessellate()
    mesh = Mesh(np.vstack([a.vertices, b.vertices]), np.vstack([a.faces, b.faces[:, ::-1] + len(a.vertices)]))

    class Hollow(Box):
        def chord(self, origins: Any, directions: Any) -> Array:
            return outer.chord(origins, directions) - inner.chord(origins, directions)

    camera = Camera.look_at((2.0, 1.0, 3.0), (0.05, 0.1, 0.1))
    origin, direction = middle_ray(camera)
    cuts = [t for box in (outer, inner) for t in ends(box, origin, direction)]
    (start, end), (enter, leave) = cuts[:2], cuts[2:]
    for light in (DirectionalLight((0.5, -1.0, -0.3), 3.0), PointLight((0.05, 0.1, 0.15), 2.0)):
        expected = single_scatter(Hollow(), MEDIUM, light, origin, direction, (start, enter), (leave, end))
        found = middle(scene(Object(mesh, MEDIUM), lights=[light], camera=camera))
        np.testing.assert_allclose(found, expected, rtol=2e-6)


# Lights in bad places


def test_a_lamp_on_a_surface_is_one_a_little_off_it() -> None:
    """From both sides, at a corner of faces as well as within one."""
    box = Object(Box((-2, -2, -1), (2, 2, 0)).tessellate(), MEDIUM)
    for position in ((0.1, 0.5, 0.0), (2.0, 2.0, 0.0), (-2.0, 0.3, -0.4)):
        here = middle(scene(box, lights=[PointLight(position, 2.0)]))
        for off in (1e-9, -1e-9):
            near = middle(scene(box, lights=[PointLight(np.asarray(position) + off, 2.0)]))
            np.testing.assert_allclose(near, here, rtol=1e-6)


def test_a_lamp_on_an_opaque_body_shines_outwards() -> None:
    box = Box((-1, -1, -0.9), (1, 1, -0.4))
    bodies = Object(SLAB.tessellate(), MEDIUM), Object(box.tessellate(), color=(0, 0, 0))
    on, above, inside, below = (
        middle(scene(*bodies, lights=[PointLight((0.2, 0.3, z), 2.0)])) for z in (-0.4, -0.4 + 1e-8, -0.6, -0.9)
    )
    assert on.min() > 0
    np.testing.assert_allclose(on, above, rtol=1e-6)
    assert (inside == 0).all()
    assert (below == 0).all()


def test_a_ray_through_a_lamp_is_invalid() -> None:
    """The integral diverges there, and only there."""
    origin, direction = middle_ray()
    frame = render(slab(PointLight(origin + 3.5 * direction, 2.0)), (3, 3))
    expected = np.ones((3, 3), dtype=bool)
    expected[1, 1] = False
    np.testing.assert_array_equal(frame.valid, expected)
    assert np.isfinite(frame.radiance).all()


def test_a_lamp_at_the_eye() -> None:
    """On every ray, and beyond the ends of all segments."""
    light = PointLight(EYE, 2.0)
    origin, direction = middle_ray()
    expected = single_scatter(SLAB, MEDIUM, light, origin, direction, (3 / -direction[2], 4 / -direction[2]))
    np.testing.assert_allclose(middle(slab(light)), expected, rtol=1e-6)


def test_light_through_a_hole_is_invalid() -> None:
    """The view ray meets whole sides, but the light enters where a face is missing."""
    box = Box((-1, -1, -1), (1, 1, 1)).tessellate()
    normals = box.face_normals
    opened = Mesh(box.vertices, box.faces[normals[:, 0] < 0.5])
    camera = Camera.look_at((0.1, 0.2, 6.0), (0.1, 0.2, 0), fov_y=10)
    from_hole, from_above = DirectionalLight((-1.0, 0.1, 0.2), 1.0), DirectionalLight((0.1, -1.0, 0.2), 1.0)
    assert not render(scene(Object(opened, MEDIUM), lights=[from_hole], camera=camera), (3, 3)).valid.any()
    whole = scene(Object(box, MEDIUM), lights=[from_above], camera=camera)
    frame = render(scene(Object(opened, MEDIUM), lights=[from_above], camera=camera), (3, 3))
    assert frame.valid.all()
    np.testing.assert_allclose(frame.radiance, render(whole, (3, 3)).radiance, rtol=1e-9)


def test_far_from_the_origin_and_in_other_units() -> None:
    plain = middle(slab(lamp := PointLight((0.5, 0.1, -2.0), 2.0)))
    shift = np.array([148376.0, 1234.0, -223423.0])
    moved = np.eye(4)
    moved[:3, 3] = shift
    camera = Camera.look_at(tuple(EYE + shift), tuple(np.array([0.1, 0.0, -0.5]) + shift), fov_y=10)
    away = scene(
        Object(SLAB.tessellate(), MEDIUM, moved), lights=[replace(lamp, position=lamp.position + shift)], camera=camera
    )
    np.testing.assert_allclose(middle(away), plain, rtol=1e-8)
    for unit in (1e-6, 1e6):
        camera = Camera.look_at(tuple(EYE * unit), (0.1 * unit, 0.0, -0.5 * unit), fov_y=10)
        medium = Medium(np.divide(MEDIUM.absorption, unit), np.divide(MEDIUM.scattering, unit), anisotropy=0.3)
        light = PointLight(np.asarray(lamp.position) * unit, np.asarray(lamp.intensity) * unit**2)
        body = Object(SLAB.tessellate(), medium, np.diag([unit, unit, unit, 1.0]))
        np.testing.assert_allclose(middle(scene(body, lights=[light], camera=camera)), plain, rtol=1e-6)
