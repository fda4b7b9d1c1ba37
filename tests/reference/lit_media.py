"""Media lit by lamps, and what they scatter once, in closed form."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad

from tests.solids import Box, Solid
from translucent.formulas.phase import henyey_greenstein
from translucent.media.density import Density
from translucent.media.medium import Medium
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PositionalLight
from translucent.scene.scene import Light, Object, Overlap, Scene

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
    ends = [start, *sorted(t for t in kinks if start < t < end), end]
    return sum(quad(function, a, b, epsabs=0, epsrel=1e-11, limit=200)[0] for a, b in itertools.pairwise(ends))


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
        point = origin + t[:, None] * direction
        source = np.asarray(light.position) if isinstance(light, PositionalLight) else point - 1e3 * light.direction
        way = point - source
        distance = np.linalg.norm(way, axis=1)
        travel = way / distance[:, None]
        if isinstance(light, PositionalLight):
            strength = light.intensity_along(travel) / distance[:, None] ** 2
        else:
            strength = np.asarray(light.irradiance)
        chord = solid.chord(source, travel) - solid.chord(point, travel)
        chord = chord + solid.chord(origin, direction) - solid.chord(point, direction)
        phase = henyey_greenstein(-travel @ direction, medium.anisotropy)
        values = medium.scattering * phase[:, None] * strength * np.exp(-chord[:, None] * medium.extinction)
        total += np.tile(weights * 0.5 * width, 8192) @ values
    return total


def middle(of: Scene, **options: Any) -> Array:
    """(3,): what one pixel in the middle sees; it is valid."""
    frame = render(of, (1, 1), **options)
    assert frame.valid.all()
    return np.asarray(frame.radiance[0, 0])
