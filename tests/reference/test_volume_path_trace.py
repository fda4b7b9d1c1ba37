"""Monte Carlo path tracing: furnaces, single scattering, and directions by the phase function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from translucent.errors import InputError
from translucent.formulas.phase import HenyeyGreenstein
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Torus
from translucent.media.density import Density, DensityGrid, LinearDensity
from translucent.media.medium import Medium
from translucent.reference import path_trace, render
from translucent.reference.volume import henyey_greenstein_cosine, scattered_directions
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.surface import Surface

Array = npt.NDArray[np.float64]
CAMERA = Camera.look_at((0.4, 0.5, 3.0), (0, 0, 0), fov_y=25)
DARK = Environment.constant((0, 0, 0))
BOX = Box((-0.6, -0.5, -0.7), (0.5, 0.6, 0.4)).tessellate()
RING = Torus().tessellate(12)
SUN = DirectionalLight((0.3, -0.8, -0.5), 3.0)
LAMP = PointLight((1.5, 0.7, 1.0), 5.0)
GRID = DensityGrid(np.random.default_rng(1).random((3, 2, 4)) * 2)


def scores(found: Array, error: Array, truth: npt.ArrayLike) -> Array:
    """Deviations in standard errors, where there is any spread; elsewhere there is no deviation."""
    still = error < 1e-12
    np.testing.assert_allclose(found[still], np.broadcast_to(truth, found.shape)[still], atol=1e-12)
    return np.asarray(((found - truth) / np.where(still, 1.0, error))[~still])


def assert_normal(z: Array, independent: int) -> None:
    """As many `independent` normal numbers would be, to four standard errors of their mean and spread."""
    print(f"mean {z.mean():.3f}, spread {z.std():.3f}, largest {np.abs(z).max():.2f} of {z.size}")
    assert abs(z.mean()) < 4 / np.sqrt(independent)
    assert abs(z.std() - 1) < 4 / np.sqrt(2 * independent)


@pytest.mark.parametrize("density", [None, LinearDensity(0, 0.0, 2.0), GRID], ids=["plain", "linear", "grid"])
@pytest.mark.parametrize("g", [0.0, 0.8, -0.5])
def test_white_furnace(density: Density | None, g: float) -> None:
    """A body that only scatters is invisible in uniform light: every path brings the same home."""
    white = Medium(scattering=(4.0, 4.0, 8.0), anisotropy=g)
    scene = Scene([Object(RING, white, density=density)], CAMERA, environment=Environment.constant((1, 0.5, 0.2)))
    frame, error = path_trace(scene, (8, 6), paths=16)
    np.testing.assert_allclose(frame.radiance, np.broadcast_to((1, 0.5, 0.2), (6, 8, 3)), rtol=1e-12)
    # The weights that paths carry after Russian roulette are all the same, too.
    assert error.max() < 1e-12
    assert frame.coverage.any()


@pytest.mark.parametrize("density", [None, LinearDensity(0, 0.0, 2.0), GRID], ids=["plain", "linear", "grid"])
def test_a_furnace_as_hot_as_its_walls(density: Density | None) -> None:
    """Kirchhoff: what absorbs and emits q = sigma_a L in light L is as invisible; only faint paths end by chance."""
    absorption = np.array([0.5, 2.0, 4.0])
    hot = Medium(absorption, scattering=(3.0, 2.0, 1.0), emission=absorption * (1, 0.5, 0.2), anisotropy=0.4)
    scene = Scene([Object(BOX, hot, density=density)], CAMERA, environment=Environment.constant((1, 0.5, 0.2)))
    frame, error = path_trace(scene, (12, 9), paths=300)
    assert (frame.transmittance.max(axis=-1) < 0.7).sum() > 30
    truth = np.broadcast_to((1, 0.5, 0.2), frame.radiance.shape)
    np.testing.assert_allclose(frame.radiance, truth, rtol=5e-3)
    assert (np.abs(frame.radiance - truth) <= 6.0 * error + 1e-9).all()


@pytest.mark.parametrize("density", [None, GRID], ids=["plain", "grid"])
def test_what_emits_without_absorbing(density: Density | None) -> None:
    """Nothing is met on the way, yet light is found: the integral of the emission, without noise."""
    scene = Scene([Object(BOX, Medium(emission=(1.0, 2.0, 3.0)), density=density)], CAMERA, environment=DARK)
    frame, _ = path_trace(scene, (8, 6), paths=4)
    np.testing.assert_allclose(frame.radiance, render(scene, (8, 6)).radiance, rtol=1e-9)


@pytest.mark.parametrize(("light", "density"), [(SUN, GRID), (LAMP, None)], ids=["sun, grid", "lamp, plain"])
def test_one_event_is_single_scattering(light: Light, density: Density | None) -> None:
    """Against the adaptive integrals of `render`, with a shadow, and two media that scatter in their own ways."""
    media = Medium((0.5, 1, 2), (2, 3, 4), anisotropy=0.6), Medium((1, 0.1, 0.5), (1, 1, 0.3), anisotropy=-0.3)
    roof = Object(Box((-0.1, 0.9, -0.5), (0.3, 1.0, 0.1)).tessellate(), color=(0, 0, 0))
    objects = [Object(BOX, media[0], density=density), Object(RING, media[1]), roof]
    scene = Scene(objects, CAMERA, [light], DARK)
    truth = render(scene, (8, 6), tolerance=1e-4)
    frame, error = path_trace(scene, (8, 6), paths=100, max_events=1)
    seen = (truth.radiance.min(axis=-1) > 0) & (truth.transmittance.max(axis=-1) < 0.7)
    assert seen.sum() > 15
    assert_normal(scores(frame.radiance[seen], error[seen], truth.radiance[seen]), 3 * int(seen.sum()))
    for name in ("transmittance", "optical_depth", "thickness", "coverage", "valid"):
        np.testing.assert_array_equal(getattr(frame, name), getattr(truth, name))


def test_more_events_bring_more_light() -> None:
    """The light that single scattering leaves out can be told: here more than half."""
    scene = Scene([Object(BOX, Medium(scattering=5.0))], CAMERA, [SUN], DARK)
    found = [path_trace(scene, (4, 3), paths=200, max_events=most)[0].radiance.mean() for most in (0, 1, 2, None)]
    assert found[0] == 0
    assert found[1] < found[2] < found[3]
    assert found[1] < 0.5 * found[3]


def test_without_events_it_is_what_is_seen_through() -> None:
    """A backdrop of squares is where it is, and an opaque object shines as it does elsewhere."""
    shining = Surface(color=(0, 0, 0), emissive=(0.2, 0.6, 0.9))
    rock = Object(Box((-0.2, -0.3, -2.0), (0.4, 0.3, -1.5)).tessellate(), surface=shining)
    scene = Scene([Object(BOX, Medium((0.5, 1, 2))), rock], CAMERA, [SUN], Environment.checkerboard("red", "white"))
    frame, _ = path_trace(scene, (8, 6), paths=4)
    np.testing.assert_allclose(frame.radiance, render(scene, (8, 6)).radiance, rtol=1e-9)


def test_a_backdrop_lights_like_its_mean() -> None:
    white = Medium(scattering=20.0)
    environment = Environment.checkerboard((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    scene = Scene([Object(BOX, white)], Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=10), environment=environment)
    frame, _ = path_trace(scene, (2, 2), paths=16)
    np.testing.assert_allclose(frame.radiance, np.broadcast_to((0.5, 0.5, 0.0), (2, 2, 3)), rtol=1e-12)


def test_seeds() -> None:
    scene = Scene([Object(BOX, Medium(1.0, 2.0))], CAMERA, [SUN])
    first, again, other = (path_trace(scene, (3, 2), paths=4, seed=seed)[0].radiance for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_refusals() -> None:
    opened = Mesh(BOX.vertices, BOX.faces[1:])
    medium = Medium(1.0, 1.0)
    scene = Scene([Object(BOX, medium)], CAMERA)
    cases: list[tuple[Callable[[], Any], str]] = [
        (lambda: path_trace(scene, (2, 2), paths=1), "path tracing with 1 paths"),
        (lambda: path_trace(scene, (2, 2), max_events=-1), "max_events -1; the number of events must be 0 or above"),
        (lambda: path_trace(scene, (2, 0)), "size"),
        (
            lambda: path_trace(Scene([Object(BOX, Medium(0.0, 1e9))], CAMERA), (2, 2)),
            "optical depth of .* with max_events",
        ),
        (lambda: path_trace(Scene([Object(opened, medium)], CAMERA), (2, 2)), "not closed"),
        (
            lambda: path_trace(Scene([Object(BOX, medium, sheet_thickness=1e-3)], CAMERA), (2, 2)),
            "the sheet scatters light",
        ),
    ]
    for call, message in cases:
        with pytest.raises(InputError, match=message):
            call()


# The phase function


@pytest.mark.parametrize("g", [-0.999, -0.75, -0.3, 0.0, 1e-9, 0.5, 0.75, 0.999])
def test_cosines_follow_the_phase_function(g: float) -> None:
    """Below each lies the share of light that the phase function sends there; their mean is g."""
    u = np.linspace(0, 1, 33)
    cosine = henyey_greenstein_cosine(u, g)
    if abs(g) > 1e-3:
        # Its integral from -1 in closed form, from the differences that do not cancel.
        base = (1 - abs(g)) ** 2 + 2 * abs(g) * (1 - np.sign(g) * cosine)
        share = (1 - g * g) / (2 * g) * (1 / np.sqrt(base) - 1 / (1 + g))
    else:
        share = (1 + cosine) / 2
    np.testing.assert_allclose(share, u, atol=1e-8)
    fine = henyey_greenstein_cosine((np.arange(100000) + 0.5) / 100000, g)
    assert fine.mean() == pytest.approx(g, abs=1e-6)


@pytest.mark.parametrize("g", [-0.75, 0.0, 0.9])
def test_random_directions(g: float, rng: np.random.Generator) -> None:
    """Unit vectors, with a mean cosine of g to where light went, and none of the directions across preferred."""
    forward = rng.normal(size=(6, 3))
    forward[:3], forward[3] = np.eye(3), (0, 0, -1)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    for axis in forward:
        found = scattered_directions(np.tile(axis, (20000, 1)), (HenyeyGreenstein(g),), np.zeros(20000, int), rng)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-14)
        # The spread of a component of a unit vector is at most 1.
        np.testing.assert_allclose(found.mean(axis=0), g * axis, atol=4 / np.sqrt(20000))
        across = found - (found @ axis)[:, None] * axis
        expected = 0.5 * (1 - ((found @ axis) ** 2).mean()) * (np.eye(3) - np.outer(axis, axis))
        np.testing.assert_allclose(across.T @ across / 20000, expected, atol=4 / np.sqrt(20000))
