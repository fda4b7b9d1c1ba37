"""Caustics on a ground by photons on the GPU, against those of the float64 reference."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from translucent import reference
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.bench.measure import one_line
from translucent.bench.record import CausticCase, CausticRow, ReportPicture
from translucent.bench.shadows.pictures import png_of
from translucent.formulas.color import linear_to_srgb
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.mesh_files import load_mesh
from translucent.planning.caustics import Caustics
from translucent.planning.passes import PassName
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene

_QUAD = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], dtype=np.float64)
_COLOR = 0.7
GROUND = Object(Mesh(0.5 * _QUAD, np.array([(0, 2, 1), (0, 3, 2)], dtype=np.int32), name="ground"), color=[_COLOR] * 3)
DUSK = Environment.gradient((0.02, 0.02, 0.025), (0.05, 0.05, 0.06))


def ball() -> Scene:
    """A ball of glass in the sun, at rest on the ground."""
    mesh = load_mesh(mesh_path("sphere"))
    radius = 0.04 / (0.5 * float(np.ptp(mesh.vertices[:, 1])))
    matrix = np.diag([radius, radius, radius, 1.0])
    matrix[:3, 3] = np.array((0.0, 0.0401, 0.0)) - radius * mesh.center
    camera = Camera.look_at((0.05, 0.28, 0.42), (0.02, 0.02, 0.0), fov_y=32.0)
    return Scene(
        [Object(mesh, Medium(ior=1.5), matrix), GROUND], camera, [DirectionalLight((0.4, -1, -0.2), 1.0)], DUSK
    )


def goblet() -> Scene:
    """A crystal goblet with wine beside a lamp."""
    glass, wine = (load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    above = np.eye(4)
    above[1, 3] = 1e-4 - float(glass.bounds[0][1])
    red = Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    bodies = [Object(glass, preset("crystal").medium, above, priority=1), Object(wine, red, above)]
    camera = Camera.look_at((0.0, 0.34, 0.62), (0.06, 0.06, 0.0), fov_y=30.0)
    return Scene([*bodies, GROUND], camera, [PointLight((-0.5, 0.6, -0.15), 1.2)], DUSK, "priority")


@dataclass(frozen=True)
class CausticScene:
    """Scene with a caustic on its ground; fields as of `CausticCase`, and whether ``--quick`` has it."""

    name: str
    title: str
    why: str
    make: Callable[[], Scene]
    quick: bool = False


SCENES = (
    CausticScene(
        "glass ball", "Ball of glass, sun", "light that a ball gathers, and what its surface mirrors", ball, True
    ),
    CausticScene(
        "goblet", "Wine in a crystal goblet, lamp", "three media, curved both ways, and a foot on the ground", goblet
    ),
)


@dataclass(frozen=True)
class CausticEffort:
    """Effort: numbers of photons, those of each half of the truth, and the size of the picture."""

    photons: tuple[int, ...]
    truth: int
    size: tuple[int, int]


FULL = CausticEffort((62_500, 250_000, 1_000_000), 400_000, (240, 180))
QUICK = CausticEffort((62_500,), 10_000, (80, 60))


def measure_caustic(renderer: Renderer, told: CausticScene, effort: CausticEffort) -> CausticCase:
    """Measure one scene; one that fails has a reason."""
    blank = CausticCase(told.name, told.title, told.why, effort.truth)
    try:
        return _measured(renderer, told.make(), effort, blank)
    except Exception as error:  # noqa: BLE001 - a scene that breaks something leaves the others alone
        return dataclasses.replace(blank, failure=one_line(error))


def _measured(renderer: Renderer, scene: Scene, effort: CausticEffort, blank: CausticCase) -> CausticCase:
    size, began = effort.size, time.perf_counter()
    halves = [
        reference.photon_irradiance(scene, size, reference.trace_photons(scene, effort.truth, seed))
        for seed in range(2)
    ]
    taken = time.perf_counter() - began
    one, other = (float((half * _areas(scene, size)).sum()) for half in halves)
    power, low, high = 0.5 * (one + other), *(_blurred(half) for half in halves)
    truth = 0.5 * (low + high)
    _irradiance(renderer, scene, size, Caustics(1000))  # compiles, and builds hierarchies
    rows = []
    for count in effort.photons:
        began = time.perf_counter()
        found, frame = _irradiance(renderer, scene, size, Caustics(count))
        seconds = time.perf_counter() - began
        shown = _blurred(found)
        off = float((found * _areas(scene, size)).sum() / power - 1.0)
        rows.append(CausticRow(count, off, *_nrmse(shown, low, high), seconds))
    white = float(np.quantile(truth, 0.995))
    pictures = (
        ReportPicture("the picture", png_of(frame.to_srgb8())),
        ReportPicture("reference", _png(truth / white)),
        ReportPicture(f"{effort.photons[-1]:,} photons", _png(shown / white)),
    )
    noise = 0.5 * abs(one - other) / power
    return dataclasses.replace(blank, reference_seconds=taken, power_noise=noise, rows=tuple(rows), pictures=pictures)


def _irradiance(renderer: Renderer, scene: Scene, size: tuple[int, int], caustics: Caustics) -> tuple[Array, Frame]:
    """(h, w, 3) of photons on the ground, as the picture shows it, and the picture."""
    gpu, plan = renderer.gpu, renderer.plan(scene, caustics=caustics)
    radiance = []
    with gpu.context.current():
        job = gpu.prepare(scene, size, plan)
        try:
            for leave_out in ((PassName.CAUSTICS,), ()):
                gpu.run(job, leave_out=leave_out)
                data = job.targets.opaque().read(components=4, attachment=1, dtype="f4")
                radiance.append(np.frombuffer(data, np.float32).reshape(*size[::-1], 4)[::-1, :, :3].astype(np.float64))
            frame = gpu.read(job)
        finally:
            job.release()
    return (radiance[1] - radiance[0]) * np.pi / _COLOR, frame


def _nrmse(shown: Array, low: Array, high: Array) -> tuple[float, float]:
    """Error of irradiance as a share of its mean, by two truths whose noise is not correlated; and at most."""
    squares, mean = ((shown - low) * (shown - high)).mean(axis=-1), float(0.5 * (low + high).mean())
    # Blurred pixels are worth about a quarter of as many.
    spread = 2.0 * float(squares.std()) / np.sqrt(0.25 * squares.size)
    found, most = (np.sqrt(max(float(squares.mean()) + more, 0.0)) / mean for more in (0.0, spread))
    return float(found), float(most)


def _areas(scene: Scene, size: tuple[int, int]) -> Array:
    """(h, w, 1): of the ground in each pixel, in square metres."""
    origins, directions = scene.camera.rays(size)
    points = origins[..., 1:2] / -directions[..., 1:2] * directions
    half_width, half_height = scene.camera.half_extent(size)
    ahead = points @ scene.camera.forward
    pixel = 4.0 * half_width * half_height / (size[0] * size[1])
    return np.where(directions[..., 1] < 0, pixel * np.abs(ahead) ** 3 / np.abs(points[..., 1]), 0.0)[..., None]


def _blurred(picture: Array) -> Array:
    """Over a pixel: a tent of two."""
    for axis in (0, 1):
        low, high = (np.roll(picture, by, axis) for by in (-1, 1))
        picture = 0.5 * picture + 0.25 * (low + high)
    return picture


def _png(light: Array) -> str:
    return png_of(np.rint(255.0 * linear_to_srgb(np.clip(light, 0.0, 1.0))).astype(np.uint8))
