"""Caustics in media against random paths of light: fog, wax and milk below a ball of glass in a wide sun.

No path finds a lamp behind glass: the truth has a disc of the environment 24 degrees wide, and the picture under test
lamps spread over it. Errors count where the light and the shadow of the ball fall.
"""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from translucent import reference
from translucent.arrays import Array
from translucent.bench.measure import one_line
from translucent.bench.record import CausticMediumCase, CausticRow, ReportPicture
from translucent.bench.shadows.pictures import png_of
from translucent.errors import TranslucentWarning
from translucent.formulas.color import linear_to_srgb
from translucent.geometry.solids import Box, Sphere
from translucent.media.medium import Medium
from translucent.planning.caustics import Caustics
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.environment_map import row_solid_angles, texel_directions
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Scene

#: Rows of the map with the sun, half of its width, lamps that stand for it and how many at once, and its irradiance.
MAP_HEIGHT, RADIUS, LAMPS, AT_ONCE, IRRADIANCE = 128, np.radians(12.0), 32, 8, 3.0

#: Width and height of the pictures, and of how many pixels each of theirs is shown.
SIZE, SHOWN = (24, 24), 8

GLASS = Object(Sphere().tessellate(48), Medium(ior=1.5), priority=1)
NIGHT = Environment.constant((0.0, 0.0, 0.0))


@dataclass(frozen=True)
class MediumScene:
    """Scene without lights.

    Attributes
    ----------
    name, title, why : str
        As of `CausticMediumCase`.
    make : callable
        Makes it, always the same.
    paths : int
        Of each pixel of each half of the truth.
    counted : tuple of two slices
        Rows and columns that errors are of.
    """

    name: str
    title: str
    why: str
    make: Callable[[], Scene]
    paths: int
    counted: tuple[slice, slice]


def fog() -> Scene:
    """A ball in thin fog."""
    box = Object(Box((-2.0, -3.5, -1.5), (2.0, 1.5, 1.5)).tessellate(), Medium(absorption=0.02, scattering=0.2))
    return Scene([box, GLASS], Camera.look_at((0, -1, 12), (0, -1, 0), fov_y=24.0), [], NIGHT, "priority")


def wax() -> Scene:
    """A ball above a block of wax."""
    return _above(Medium(absorption=0.1, scattering=8.0, ior=1.4))


def milk() -> Scene:
    """A ball above milk, which scatters ahead."""
    return _above(Medium(absorption=(0.02, 0.05, 0.2), scattering=20.0, anisotropy=0.6, ior=1.34))


def _above(medium: Medium) -> Scene:
    block = Object(Box((-2.2, -2.5, -2.2), (2.2, -1.3, 2.2)).tessellate(), medium)
    return Scene([block, GLASS], Camera.look_at((0, 6, 5), (0, -1.3, 0), fov_y=38.0), [], NIGHT, "priority")


_BELOW = slice(9, 20), slice(4, 20)
SCENES = (
    MediumScene(
        "fog", "Thin fog", "a bright cone behind the ball, and its shadow", fog, 3072, (slice(14, 23), slice(5, 19))
    ),
    MediumScene("wax", "Block of wax", "what falls on it spreads inside", wax, 192, _BELOW),
    MediumScene("milk", "Milk", "the same, in a medium that scatters ahead and absorbs blue", milk, 256, _BELOW),
)


@dataclass(frozen=True)
class MediumEffort:
    """Effort: share of the paths of the truth, and number of photons."""

    share: float
    photons: int


FULL = MediumEffort(1.0, 400_000)


def measure_medium(renderer: Renderer, told: MediumScene, effort: MediumEffort) -> CausticMediumCase:
    """Measure one scene, with photons and without; one that fails has a reason."""
    paths = max(int(effort.share * told.paths), 2)
    blank = CausticMediumCase(told.name, told.title, told.why, paths)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)
            return _measured(renderer, told, effort, blank)
    except Exception as error:  # noqa: BLE001 - a scene that breaks something leaves the others alone
        return dataclasses.replace(blank, failure=one_line(error))


def _measured(
    renderer: Renderer, told: MediumScene, effort: MediumEffort, blank: CausticMediumCase
) -> CausticMediumCase:
    scene, began = told.make(), time.perf_counter()
    halves = [_truth(scene, blank.truth_paths, seed) for seed in (1, 2)]
    taken = time.perf_counter() - began
    one, other = (half[told.counted] for half in halves)
    mean = 0.5 * float((one + other).mean())
    noise = float((one - other).std()) / 2.0 / np.sqrt(one.size) / mean
    rows, shown = [], []
    for photons in (0, effort.photons):
        began = time.perf_counter()
        shown.append(_shown(renderer, scene, Caustics(photons) if photons else None))
        found = shown[-1][told.counted]
        seconds = time.perf_counter() - began
        squares = ((found - one) * (found - other)).mean(axis=-1)
        spread = 2.0 * float(squares.std()) / np.sqrt(squares.size)
        error, most = (np.sqrt(max(float(squares.mean()) + more, 0.0)) / mean for more in (0.0, spread))
        rows.append(CausticRow(photons, float(found.mean()) / mean - 1.0, float(error), float(most), seconds))
    white = float(np.quantile(0.5 * (halves[0] + halves[1]), 0.98))
    pictures = (
        ReportPicture("reference", _png(0.5 * (halves[0] + halves[1]) / white)),
        ReportPicture("without photons", _png(shown[0] / white)),
        ReportPicture(f"{effort.photons:,} photons", _png(shown[1] / white)),
    )
    return dataclasses.replace(blank, reference_seconds=taken, noise=noise, rows=tuple(rows), pictures=pictures)


def _truth(scene: Scene, paths: int, seed: int) -> Array:
    """Radiance (h, w, 3) by random paths."""
    up = texel_directions(MAP_HEIGHT, 2 * MAP_HEIGHT)[..., 1] > np.cos(RADIUS)
    angles = np.broadcast_to(row_solid_angles(MAP_HEIGHT, 2 * MAP_HEIGHT)[:, None], up.shape)
    sun = np.where(up, IRRADIANCE / angles[up].sum(), 0.0)[..., None] * np.ones(3, np.float32)
    lit = replace(scene, environment=Environment.image(sun.astype(np.float32)))
    return np.asarray(reference.path_trace(lit, SIZE, paths=paths, seed=seed)[0].radiance, np.float64)


def _shown(renderer: Renderer, scene: Scene, caustics: Caustics | None) -> Array:
    """Radiance (h, w, 3) with lamps, some at a time."""
    number = np.arange(LAMPS)
    fall = (number + 0.5) / LAMPS * (1.0 - np.cos(RADIUS))
    turn, across = np.pi * (1.0 + np.sqrt(5.0)) * number, np.sqrt(fall * (2.0 - fall))
    ways = -np.stack([across * np.cos(turn), 1.0 - fall, across * np.sin(turn)], axis=1)
    total = np.zeros((*SIZE[::-1], 3))
    for first in range(0, LAMPS, AT_ONCE):
        lights = [DirectionalLight(way, IRRADIANCE / LAMPS) for way in ways[first : first + AT_ONCE]]
        total += renderer.render(replace(scene, lights=lights), SIZE, samples=4, caustics=caustics).radiance
    return total


def _png(light: Array) -> str:
    shown = np.rint(255.0 * linear_to_srgb(np.clip(light, 0.0, 1.0))).astype(np.uint8)
    return png_of(
        np.asarray(Image.fromarray(shown).resize((SHOWN * SIZE[0], SHOWN * SIZE[1]), Image.Resampling.NEAREST))
    )
