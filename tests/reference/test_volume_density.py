"""Density that varies: what it scatters, absorbs and emits, from any view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.lit_media import (
    EYE,
    MEDIUM,
    SLAB,
    SUN,
    Array,
    integral,
    middle,
    middle_ray,
    scene,
    single_scatter,
    slab,
)
from translucent.formulas.phase import henyey_greenstein
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box
from translucent.media.density import Density, DensityGrid, ExponentialDensity, LinearDensity
from translucent.media.medium import Medium
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.lights import PointLight
from translucent.scene.scene import Object

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

    def in_box(point: Array) -> Array:
        return (point - SLAB.low) / (np.asarray(SLAB.high) - SLAB.low)

    def mass(a: Array, b: Array) -> float:
        return float(np.linalg.norm(b - a)) * integral(lambda s: float(density.at(in_box(a + s * (b - a)))), 0, 1)

    def integrand(t: float, channel: int) -> float:
        point = origin + t * direction
        depth = mass(origin + start * direction, point) + mass(point + travel * point[2] / -travel[2], point)
        return float(density.at(in_box(point))) * np.exp(-MEDIUM.extinction[channel] * depth)

    phase = henyey_greenstein(-travel @ direction, MEDIUM.anisotropy)
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
