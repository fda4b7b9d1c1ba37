"""Shadows of environments by some directions, against light from everywhere in float64."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from translucent import reference
from translucent.arrays import Array
from translucent.bench.record import SkyRow
from translucent.bench.shadows.scenes import WINE
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.reference.light_paths import LightPaths
from translucent.reference.sheets import sheet_thicknesses
from translucent.reference.surface_light import SurfaceLight
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene

#: Environments: from all sides alike, from above, and from a few lamps.
ENVIRONMENTS = {
    "white": Environment.constant((1.0, 1.0, 1.0)),
    "sky": Environment.gradient((0.2, 0.2, 0.2), (1.0, 1.0, 1.2)),
    "studio": Environment.studio(),
}

#: Looks at the environment along each side of a cell of the truth, whose mean is what comes from there.
_LOOKS = 4


@dataclass(frozen=True)
class SkyEffort:
    """Effort: the environments, numbers of directions, picture, and strata along each side of half of the truth."""

    environments: tuple[str, ...]
    directions: tuple[int, ...]
    size: tuple[int, int]
    strata: int


FULL = SkyEffort(tuple(ENVIRONMENTS), (8, 16, 32, 64, 128), (40, 30), 36)
QUICK = SkyEffort(("sky",), (8, 32), (24, 18), 12)


def scene() -> Scene:
    """A ball of wine, a stone and a block over a floor, which is the last object."""
    corners = [(-6.0, -1.0, -6.0), (6.0, -1.0, -6.0), (6.0, -1.0, 6.0), (-6.0, -1.0, 6.0)]
    floor = Mesh(np.array(corners), np.array([(0, 2, 1), (0, 3, 2)], dtype=np.int32), name="floor")
    beside = np.eye(4)
    beside[:3, 3] = 1.6, -0.3, 0.4
    objects = [
        Object(Sphere().tessellate(32), WINE),
        Object(Sphere(radius=0.5).tessellate(32), None, beside),
        Object(Box((-2.0, -1.0, -0.5), (-1.4, 0.4, 0.5)).tessellate()),
        Object(floor, color=(1.0, 1.0, 1.0)),
    ]
    return Scene(objects, Camera.look_at((0.0, 3.5, 7.0), (0.0, -0.3, 0.0), fov_y=30.0))


def measure_sky(renderer: Renderer, effort: SkyEffort) -> Iterator[SkyRow]:
    """Measure all environments with all numbers of directions."""
    base, size = scene(), effort.size
    covered = renderer.render(base, size).coverage
    _, nearest = reference.opaque_counts(base, size)
    floor = ~covered & (nearest == len(base.objects) - 1)
    halves = [_truth(base, size, floor, effort, seed) for seed in range(2)]
    for name in effort.environments:
        lit = replace(base, environment=ENVIRONMENTS[name])
        bright = np.asarray(renderer.render(lit, size).radiance, np.float64)[floor]
        a, b = (half[name] for half in halves)
        for count in effort.directions:
            began = time.perf_counter()
            frame = renderer.render(replace(lit, environment_shadows=count), size)
            seconds = time.perf_counter() - began
            share = np.asarray(frame.radiance, np.float64)[floor] / bright
            # The noise of the halves is not correlated: their product has none.
            off = float(np.sqrt(max(((share - a) * (share - b)).mean(), 0.0)) / (0.5 * (a + b)).mean())
            yield SkyRow(name, count, off, seconds)


def _truth(base: Scene, size: tuple[int, int], floor: Array, effort: SkyEffort, seed: int) -> dict[str, Array]:
    """Share (k, 3) of the light of each environment that reaches the points of the floor, by rays to random points of
    cells that get equal shares of the light of a uniform one.
    """
    origins, ways = (np.broadcast_to(part, (*size[::-1], 3))[floor] for part in base.camera.rays(size))
    points = origins + ((base.objects[-1].bounds[0, 1] - origins[:, 1]) / ways[:, 1])[:, None] * ways
    light = SurfaceLight(LightPaths(base, sheet_thicknesses(base)))
    rng, n = np.random.default_rng(seed), effort.strata
    cells = _means(n)
    left = {name: np.zeros(points.shape) for name in effort.environments}
    for number in range(n * n):
        place = (np.array(divmod(number, n)) + rng.random((len(points), 2))) / n
        towards = _cosine(place)
        passed = light.passed(points - base.camera.eye, -towards, np.full(len(points), np.inf))
        for name, sums in left.items():
            sums += cells[name][number] * passed
    return {name: sums / cells[name].sum(axis=0) for name, sums in left.items()}


def _means(n: int) -> dict[str, Array]:
    """Mean radiance (n * n, 3) of each environment in the cells."""
    looks = (np.arange(n * _LOOKS) + 0.5) / (n * _LOOKS)
    towards = _cosine(np.stack(np.meshgrid(looks, looks, indexing="ij"), axis=-1).reshape(-1, 2))
    found = {}
    for name, environment in ENVIRONMENTS.items():
        radiance = environment.radiance(towards, np.zeros((len(towards), 2)))
        found[name] = radiance.reshape(n, _LOOKS, n, _LOOKS, 3).mean(axis=(1, 3)).reshape(n * n, 3)
    return found


def _cosine(place: Array) -> Array:
    """Directions (k, 3) upwards of places (k, 2) in the unit square, by the cosine."""
    across, turn = np.sqrt(place[:, 0]), 2.0 * np.pi * place[:, 1]
    return np.stack([across * np.cos(turn), np.sqrt(1.0 - place[:, 0]), across * np.sin(turn)], axis=-1)
