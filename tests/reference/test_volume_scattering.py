"""Light scattered once: closed forms, integrals by another hand, and lights in every place."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad

from translucent import optics
from translucent.camera import Camera
from translucent.density import Density, DensityGrid, ExponentialDensity, LinearDensity
from translucent.environment import Environment
from translucent.errors import InputError
from translucent.lights import DirectionalLight, PointLight
from translucent.medium import Medium
from translucent.mesh import Mesh
from translucent.reference import render
from translucent.scene import Light, Object, Overlap, Scene
from translucent.solids import Box, Solid, Sphere, SphericalShell, TwoSpheres
from translucent.thickness import ThinLayer

Array = npt.NDArray[np.float64]
DARK = Environment.constant((0, 0, 0))
MEDIUM = Medium(absorption=(0.5, 1.0, 2.0), scattering=(1.0, 2.0, 3.0), anisotropy=0.3)
SLAB = Box((-50, -50, -1), (50, 50, 0))
EYE = np.array([0.3, 0.2, 3.0])
CAMERA = Camera.look_at(tuple(EYE), (0.1, 0.0, -0.5), fov_y=10)
SUN = DirectionalLight((0.3, 0.2, -1.0), 2.0)


def scene(*objects: Object, lights: list[Light], camera: Camera = CAMERA, overlap: Overlap = "add") -> Scene:
    return Scene(objects, camera, lights, DARK, overlap)


def slab(light: Light, medium: Medium = MEDIUM, density: Density | None = None) -> Scene:
    return scene(Object(SLAB.tessellate(), medium, density=density), lights=[light])


def middle_ray(camera: Camera = CAMERA) -> tuple[Array, Array]:
    origins, directions = camera.rays((1, 1))
    return origins[0, 0], directions[0, 0]


def integral(function: Callable[[float], float], start: float, end: float, *kinks: float) -> float:
    """To nearly all digits, on parts between kinks."""
    places = [start, *sorted(t for t in kinks if start < t < end), end]
    return sum(quad(function, a, b, epsabs=0, epsrel=1e-11, limit=200)[0] for a, b in itertools.pairwise(places))


def single_scatter(
    solid: Solid, medium: Medium, light: Light, origin: Array, direction: Array, *spans: tuple[float, float]
) -> Array:
    """(3,): by chords of a solid in closed form, on the parts of a ray that are in it.

    Four points of Gauss and Legendre in each of 8192 panels: kinks of the light path cost less than 1e-8.
    """
    points, weights = np.polynomial.legendre.leggauss(4)
    total = np.zeros(3)
    for start, end in spans:
        width = (end - start) / 8192
        t = (start + width * (np.arange(8192)[:, None] + 0.5 + 0.5 * points)).ravel()
        place = origin + t[:, None] * direction
        source = np.asarray(light.position) if isinstance(light, PointLight) else place - 1e3 * light.direction
        way = place - source
        distance = np.linalg.norm(way, axis=1)
        travel = way / distance[:, None]
        strength = light.intensity / distance[:, None] ** 2 if isinstance(light, PointLight) else light.irradiance
        chord = solid.chord(source, travel) - solid.chord(place, travel)
        chord = chord + solid.chord(origin, direction) - solid.chord(place, direction)
        phase = optics.henyey_greenstein(-travel @ direction, medium.anisotropy)
        values = medium.scattering * phase[:, None] * strength * np.exp(-chord[:, None] * medium.extinction)
        total += np.tile(weights * 0.5 * width, 8192) @ values
    return total


def middle(of: Scene, **options: Any) -> Array:
    """(3,): what one pixel in the middle sees; it is valid."""
    frame = render(of, (1, 1), **options)
    assert frame.valid.all()
    return np.asarray(frame.radiance[0, 0])


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
    source = medium.scattering * optics.henyey_greenstein(-travel @ ray, g) * [1, 2, 3] * np.exp(-start)
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
    with pytest.raises(InputError, match=r"^tolerance .*not in 1e-12 to 1"):
        render(slab(SUN), (1, 1), tolerance=tolerance)


@pytest.mark.parametrize("depth", [1e-9, 1e-3, 40.0, 1e4, 1e8])
def test_any_depth(depth: float) -> None:
    """Of a deep slab only the skin is seen, of a thin one all of it; both to all digits."""
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


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize(
    "light",
    [DirectionalLight((1.0, -0.4, -0.2), 3.0), PointLight((-1.2, 0.9, 0.8), 5.0), PointLight((0.5, 0.1, 0.1), 1.0)],
    ids=["sun", "lamp", "lamp inside"],
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
    """Where a ray enters a box and leaves it."""
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


# Varying density


PROFILES: dict[str, Density] = {
    "linear": LinearDensity(2, 0.2, 2.0),
    "exponential": ExponentialDensity(2, 0.1, 3.0),
    "sideways": LinearDensity(0, 0.5, 1.5),
}


@pytest.mark.parametrize("name", PROFILES)
def test_a_slab_of_varying_density(name: str) -> None:
    """Depths by quadrature of the density, radiance by quadrature of the depths."""
    density = PROFILES[name]
    origin, direction = middle_ray()
    travel = np.asarray(SUN.direction)
    start, end = 3 / -direction[2], 4 / -direction[2]

    def place(point: Array) -> Array:
        return (point - SLAB.low) / (np.asarray(SLAB.high) - SLAB.low)

    def mass(a: Array, b: Array) -> float:
        return float(np.linalg.norm(b - a)) * integral(lambda s: float(density.at(place(a + s * (b - a)))), 0, 1)

    def integrand(t: float, channel: int) -> float:
        point = origin + t * direction
        depth = mass(origin + start * direction, point) + mass(point + travel * point[2] / -travel[2], point)
        return float(density.at(place(point))) * np.exp(-MEDIUM.extinction[channel] * depth)

    phase = optics.henyey_greenstein(-travel @ direction, MEDIUM.anisotropy)
    integrals = [integral(lambda t, c=c: integrand(t, c), start, end) for c in range(3)]
    frame = render(slab(SUN, MEDIUM, density), (1, 1))
    expected = np.asarray(MEDIUM.scattering) * phase * 2.0 * integrals
    np.testing.assert_allclose(frame.radiance[0, 0], expected, rtol=1e-7)
    depth = MEDIUM.extinction * mass(origin + start * direction, origin + end * direction)
    np.testing.assert_allclose(frame.optical_depth[0, 0], depth, rtol=1e-12)


def test_closed_forms_of_absorption_and_emission() -> None:
    """Max 1995, section 4: depth by the mean density; q / sigma_t (1 - T) wherever the density is."""
    medium = Medium(absorption=(1.0, 2.0, 3.0), emission=(4.0, 1.0, 0.5))
    _, ray = middle_ray()
    length = 1 / -ray[2]
    for density, mean in ((LinearDensity(2, 0.0, 2.0), 1.0), (ExponentialDensity(2, 1.0, np.e), np.e - 1.0)):
        frame = render(scene(Object(SLAB.tessellate(), medium, density=density), lights=[]), (1, 1))
        depth = medium.extinction * mean * length
        np.testing.assert_allclose(frame.optical_depth[0, 0], depth, rtol=1e-13)
        expected = np.asarray(medium.emission) / medium.extinction * -np.expm1(-depth)
        np.testing.assert_allclose(frame.radiance[0, 0], expected, rtol=1e-13)


def test_one_voxel_is_a_homogeneous_medium() -> None:
    lamp = PointLight((0.5, 0.1, -2.0), 2.0)
    plain = Medium(0.7 * np.asarray(MEDIUM.absorption), 0.7 * np.asarray(MEDIUM.scattering), anisotropy=0.3)
    np.testing.assert_allclose(
        middle(slab(lamp, MEDIUM, DensityGrid([[[0.7]]]))), middle(slab(lamp, plain)), rtol=1e-12
    )


def test_a_grid_of_zeros_is_empty() -> None:
    frame = render(slab(SUN, replace(MEDIUM, emission=1.0), DensityGrid(np.zeros((2, 2, 2)))), (1, 1))
    assert (frame.radiance == 0).all()
    assert (frame.transmittance == 1).all()
    assert frame.valid.all()


def test_densities_turn_and_stretch_with_their_body(rng: np.random.Generator) -> None:
    grid = DensityGrid(rng.random((3, 2, 4)))
    box = Box((0, 0, 0), (1, 2, 3)).tessellate()
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]) @ np.diag([2.0, -0.5, 1.0])
    matrix[:3, 3] = (-1.0, 0.5, -1.0)
    moved = Mesh(box.vertices @ matrix[:3, :3].T + matrix[:3, 3], box.faces[:, ::-1])
    turned = DensityGrid(np.asarray(grid.values)[:, ::-1].transpose(2, 0, 1))
    camera = Camera.look_at((3.0, 2.0, 4.0), (0.5, 1.0, -0.5))
    a = render(scene(Object(box, MEDIUM, matrix, density=grid), lights=[SUN], camera=camera), (6, 5))
    b = render(scene(Object(moved, MEDIUM, density=turned), lights=[SUN], camera=camera), (6, 5))
    assert a.coverage.any()
    np.testing.assert_allclose(a.optical_depth, b.optical_depth, atol=1e-12)
    np.testing.assert_allclose(a.radiance, b.radiance, rtol=1e-5)


def test_emission_of_mixtures() -> None:
    """One medium rises while the other falls: no closed form."""
    hot = Medium(absorption=(1.0, 2.0, 3.0), emission=(4.0, 1.0, 0.5))
    cold = Medium(absorption=(3.0, 1.0, 0.0))
    objects = [
        Object(SLAB.tessellate(), hot, density=LinearDensity(2, 0.0, 2.0)),
        Object(SLAB.tessellate(), cold, density=ExponentialDensity(2, 3.0, 0.1)),
    ]
    _, ray = middle_ray()
    length = 1 / -ray[2]

    def emitted(s: float, channel: int) -> float:
        """At a share of the way, from the upper side."""
        rising, falling = 2 * (1 - s), 3.0 * (0.1 / 3.0) ** (1 - s)
        # The integrals of both from 0 to s.
        masses = 2 * s - s * s, 0.1 * np.expm1(np.log(30) * s) / np.log(30)
        assert falling == pytest.approx(0.1 * 30**s)
        depth = hot.extinction[channel] * masses[0] + cold.extinction[channel] * masses[1]
        return float(rising * np.asarray(hot.emission)[channel] * length * np.exp(-depth * length))

    expected = [integral(lambda s, c=c: emitted(s, c), 0, 1) for c in range(3)]
    np.testing.assert_allclose(middle(scene(*objects, lights=[])), expected, rtol=1e-11)


@pytest.mark.parametrize("camera", ["inside", "orthographic"])
def test_other_views(camera: str) -> None:
    """From inside the slab, and with parallel rays."""
    views = {
        "inside": Camera.look_at((0.3, 0.2, -0.25), (0.1, 0.0, -0.9), fov_y=10),
        "orthographic": Camera.orthographic(tuple(EYE), (0.1, 0.0, -0.5), height=0.5),
    }
    of = replace(slab(lamp := PointLight((0.5, 0.1, -2.0), 2.0)), camera=views[camera])
    origin, direction = middle_ray(views[camera])
    span = max(-origin[2] / direction[2], 0.0), (-1 - origin[2]) / direction[2]
    np.testing.assert_allclose(middle(of), single_scatter(SLAB, MEDIUM, lamp, origin, direction, span), rtol=1e-6)


# Several bodies


def layers(light: DirectionalLight, *found: tuple[float, float, list[Medium]]) -> Array:
    """(3,): of layers from z = low to high, the highest first, each filled with a mixture."""
    _, ray = middle_ray()
    travel = np.asarray(light.direction)
    total, above, slope = np.zeros(3), np.zeros(3), 1 / -ray[2] + 1 / -travel[2]
    for low, high, media in found:
        extinction = np.sum([medium.extinction for medium in media], axis=0)
        scattering = sum(
            np.asarray(m.scattering) * optics.henyey_greenstein(-travel @ ray, m.anisotropy) for m in media
        )
        # In metres of height, of which the ray is longer.
        own = optics.emitted_radiance(scattering * light.irradiance / -ray[2], extinction * slope, high - low)
        total += np.exp(-above) * own
        above += extinction * slope * (high - low)
    return total


RED, BLUE = MEDIUM, Medium(absorption=(2.0, 0.5, 0.1), scattering=(0.3, 0.6, 0.9), anisotropy=-0.5)
POLICIES: dict[Overlap, list[Medium]] = {"add": [RED, BLUE], "union": [RED, BLUE], "priority": [BLUE]}


@pytest.mark.parametrize("overlap", POLICIES)
def test_overlapping_bodies(overlap: Overlap) -> None:
    """The lower half of one is the upper half of the other; each scatters by its own phase function."""
    upper, lower = Box((-50, -50, -1), (50, 50, 0)), Box((-40, -40, -1.5), (40, 40, -0.5))
    objects = Object(upper.tessellate(), RED, priority=1), Object(lower.tessellate(), BLUE, priority=2)
    expected = layers(SUN, (-0.5, 0.0, [RED]), (-1.0, -0.5, POLICIES[overlap]), (-1.5, -1.0, [BLUE]))
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN], overlap=overlap)), expected, rtol=1e-6)


@pytest.mark.parametrize(("overlap", "times"), [("add", 2), ("union", 1)])
def test_bodies_of_one_medium(overlap: Overlap, times: int) -> None:
    objects = [Object(SLAB.tessellate(), medium) for medium in (RED, replace(RED, ior=1.3))]
    expected = layers(SUN, (-1.0, 0.0, [RED] * times))
    found = middle(scene(*objects, lights=[SUN], overlap=overlap), refraction=False)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_union_tells_media_apart_that_only_scatter_differently() -> None:
    other = Medium(absorption=MEDIUM.extinction)
    objects = [Object(SLAB.tessellate(), medium) for medium in (MEDIUM, other)]
    expected = layers(SUN, (-1.0, 0.0, [MEDIUM, other]))
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN], overlap="union")), expected, rtol=1e-6)


def test_union_counts_varied_bodies_each() -> None:
    """A density is a body's own: what it scales is no medium that another brings, too."""
    lean = DensityGrid([[[0.5]]])
    objects = [Object(SLAB.tessellate(), MEDIUM, density=density) for density in (lean, lean, None)]
    found = middle(scene(*objects, lights=[SUN], overlap="union"))
    np.testing.assert_allclose(found, layers(SUN, (-1.0, 0.0, [MEDIUM, MEDIUM])), rtol=1e-6)


def test_a_body_shades_another() -> None:
    filtered = Box((-50, -50, 5), (50, 50, 6))
    objects = Object(SLAB.tessellate(), RED), Object(filtered.tessellate(), Medium(absorption=(0.1, 0.2, 0.3)))
    path = 1 / -np.asarray(SUN.direction)[2]
    expected = middle(slab(SUN)) * np.exp(-np.array([0.1, 0.2, 0.3]) * path)
    # Above the eye, so the ray does not pass it.
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN])), expected, rtol=1e-9)


def test_a_sheet_shades_a_body() -> None:
    sheet = Box((-50, -50, 5), (50, 50, 6)).tessellate()
    glass = Object(sheet, Medium(absorption=(10.0, 20.0, 30.0)), sheet_thickness=0.01)
    path = 2 * 0.01 / -np.asarray(SUN.direction)[2]
    expected = middle(slab(SUN)) * np.exp(-np.array([10.0, 20.0, 30.0]) * path)
    np.testing.assert_allclose(middle(scene(Object(SLAB.tessellate(), RED), glass, lights=[SUN])), expected, rtol=1e-9)


def test_sheets_scatter_nothing() -> None:
    of = slab(SUN)
    frame = render(of, (1, 1), ThinLayer(1e-3))
    assert (frame.radiance == 0).all()
    assert frame.valid.all()


def test_an_opaque_object_throws_a_shadow() -> None:
    """Its edge is at x = 0, straight above; the ray passes from the shadow into the light."""
    roof = Object(Box((-60, -60, 5), (0.15, 60, 6)).tessellate())
    sun = DirectionalLight((0, 0, -1), 2.0)
    origin, direction = middle_ray(shadowed := Camera.look_at((-2.0, 0.0, 3.0), (0.15, 0.0, -0.5), fov_y=10))
    edge, end = (0.15 - origin[0]) / direction[0], 4 / -direction[2]
    assert 3 / -direction[2] < edge < end
    start = 3 / -direction[2]

    def integrand(t: float, channel: int) -> float:
        height = -(origin + t * direction)[2]
        return float(np.exp(-MEDIUM.extinction[channel] * (height + t - start)))

    phase = optics.henyey_greenstein(direction[2], MEDIUM.anisotropy)
    integrals = [integral(lambda t, c=c: integrand(t, c), edge, end) for c in range(3)]
    found = middle(scene(Object(SLAB.tessellate(), MEDIUM), roof, lights=[sun], camera=shadowed))
    np.testing.assert_allclose(found, np.asarray(MEDIUM.scattering) * phase * 2.0 * integrals, rtol=2e-6)


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-5])
def test_the_shadow_of_a_pole(width: float) -> None:
    """However narrow, it is not missed: rules of quadrature begin and end at its outline."""
    pole = Object(Box((0.1, -60, 5), (0.1 + width, 60, 6)).tessellate())
    sun = DirectionalLight((0, 0, -1), 2.0)
    camera = Camera.look_at((-2.0, 0.0, 3.0), (0.15, 0.0, -0.5), fov_y=10)
    origin, direction = middle_ray(camera)
    ends = (np.array([0.1, 0.1 + width]) - origin[0]) / direction[0] + 3 / direction[2]
    assert ends.min() > 0
    # From a depth where the ray has gone so far in the slab.
    slope = MEDIUM.extinction * (1 - direction[2])
    phase = optics.henyey_greenstein(direction[2], MEDIUM.anisotropy)
    source = np.asarray(MEDIUM.scattering) * phase * 2.0
    missing = source * np.exp(-slope * ends[0]) * -np.expm1(-slope * (ends[1] - ends[0])) / slope
    plain, found = (
        middle(scene(Object(SLAB.tessellate(), MEDIUM), *more, lights=[sun], camera=camera), tolerance=1e-9)
        for more in ([], [pole])
    )
    np.testing.assert_allclose(plain - found, missing, rtol=1e-3)


def test_an_opaque_object_stops_the_ray() -> None:
    """What is behind it is not seen, and it does not shade itself from above."""
    floor = Object(Box((-60, -60, -0.6), (60, 60, -0.4)).tessellate(), color=(0, 0, 0))
    found = middle(scene(Object(SLAB.tessellate(), MEDIUM), floor, lights=[SUN]))
    np.testing.assert_allclose(found, layers(SUN, (-0.4, 0.0, [MEDIUM])), rtol=1e-9)


# Lights in bad places


def test_a_lamp_on_a_surface_is_one_a_little_off_it() -> None:
    """From both sides, at a corner of faces as well as within one."""
    box = Object(Box((-2, -2, -1), (2, 2, 0)).tessellate(), MEDIUM)
    for place in ((0.1, 0.5, 0.0), (2.0, 2.0, 0.0), (-2.0, 0.3, -0.4)):
        here = middle(scene(box, lights=[PointLight(place, 2.0)]))
        for off in (1e-9, -1e-9):
            near = middle(scene(box, lights=[PointLight(np.asarray(place) + off, 2.0)]))
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
