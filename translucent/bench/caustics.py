"""Shadows of environments by some directions, and caustics by photons on grounds and in media.

Each truth is two independent estimates, by photons or random paths of the reference; errors are free of their noise.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from translucent import reference
from translucent.arrays import Array, Mask
from translucent.bench.claims import CAUSTIC_CLAIMS, MEDIUM_CLAIMS, SKY_CLAIMS, Judge
from translucent.bench.drawing import BenchContext, Size
from translucent.bench.experiment import Experiment, Whole, one_line
from translucent.bench.record import CausticCase, CausticMediumCase, CausticRow, Part, Report, SkyRow
from translucent.bench.shadows import QUAD, QUAD_FACES, WINE, LightScene
from translucent.bench.shapes import placed, toolkit
from translucent.bench.truth import noise_free_square, picture_of
from translucent.formulas.color import linear_to_srgb
from translucent.frames.frame import Frame
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.planning.caustics import Caustics
from translucent.planning.passes import PassName
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.surfaces import sheet_thicknesses
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.environment_map import row_solid_angles, texel_directions
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene

#: Environments: from all sides alike, from above, and from a few soft boxes.
ENVIRONMENTS = {
    "white": Environment.constant((1.0, 1.0, 1.0)),
    "sky": Environment.gradient((0.2, 0.2, 0.2), (1.0, 1.0, 1.2)),
    "studio": Environment.studio(),
}

#: Samples of the environment along each side of a cell of the truth, whose mean is the light from there.
_LOOKS = 4

#: Color of the ground of caustics.
_COLOR = 0.7
GROUND = Object(Mesh(0.5 * QUAD, QUAD_FACES, name="ground"), color=[_COLOR] * 3)
DUSK = Environment.gradient((0.02, 0.02, 0.025), (0.05, 0.05, 0.06))

#: Sun of caustics in media: rows of its map, half of its width, lights in place of it and how many at once, and its
#: irradiance. No path finds a directional light behind glass: the truth has a disc of the environment, the picture
#: lights over it.
MAP_HEIGHT, RADIUS, LIGHTS, AT_ONCE, IRRADIANCE = 128, np.radians(12.0), 32, 8, 3.0

#: Width and height of the pictures in media, and of the squares that show their pixels.
SIZE, ENLARGED = (24, 24), 8

GLASS = Object(Sphere().tessellate(48), Medium(ior=1.5), priority=1)
NIGHT = Environment.constant((0.0, 0.0, 0.0))


@dataclass(frozen=True)
class SkyShadows(Experiment[Whole]):
    """Shadows of environments approximated by some directions, against stratified random directions.

    Parameters
    ----------
    environments : sequence of str
        Of `ENVIRONMENTS`.
    directions : sequence of int
    size : (width, height)
    strata : int
        Cells along each side of half of the truth.
    """

    part: ClassVar[Part] = "shadows"
    label: ClassVar[str] = "shadows of environments"
    into: ClassVar[str] = "shadows.sky"
    claims: ClassVar[tuple[Judge, ...]] = SKY_CLAIMS

    environments: Sequence[str] = tuple(ENVIRONMENTS)
    directions: Sequence[int] = (8, 16, 32, 64, 128)
    size: Size = (40, 30)
    strata: int = 36

    shown: Sequence[Whole] = (Whole(),)

    def added(self, report: Report, record: tuple[SkyRow, ...] | str) -> Report:
        """Report with these rows added, or with the reason why there are none."""
        if not isinstance(record, str):
            return report.plus(self.into, record)
        return dataclasses.replace(report, shadows=dataclasses.replace(report.shadows, sky_failure=record))

    def measure(self, bench: BenchContext, scene: Whole) -> tuple[SkyRow, ...] | str:
        """Measure shadows of each environment by each number of directions."""
        try:
            return self.rows(bench.renderer)
        except Exception as error:  # noqa: BLE001 - the rest of the report goes on
            return one_line(error)

    def rows(self, renderer: Renderer) -> tuple[SkyRow, ...]:
        """Measure with a renderer."""
        base, found = sky_scene(), []
        _, nearest = reference.opaque_counts(base, self.size)
        floor = ~renderer.render(base, self.size).coverage & (nearest == len(base.objects) - 1)
        halves = [self._truth(base, floor, seed) for seed in range(2)]
        for name in self.environments:
            lit = dataclasses.replace(base, environment=ENVIRONMENTS[name])
            bright = np.asarray(renderer.render(lit, self.size).radiance, np.float64)[floor]
            a, b = (half[name] for half in halves)
            for count in self.directions:
                began = time.perf_counter()
                frame = renderer.render(dataclasses.replace(lit, environment_shadows=count), self.size)
                seconds = time.perf_counter() - began
                square, _ = noise_free_square(np.asarray(frame.radiance, np.float64)[floor] / bright, a, b)
                error = math.sqrt(max(square, 0.0)) / float((0.5 * (a + b)).mean())
                found.append(SkyRow(name, count, error, seconds))
        return tuple(found)

    def _truth(self, base: Scene, floor: Mask, seed: int) -> dict[str, Array]:
        """Fraction (k, 3) of the light of each environment that reaches points of the floor, by stratified rays."""
        origins, directions = (np.broadcast_to(part, (*floor.shape, 3))[floor] for part in base.camera.rays(self.size))
        height = base.objects[-1].bounds[0, 1]
        points = origins + ((height - origins[:, 1]) / directions[:, 1])[:, None] * directions
        light = SurfaceLight(LightPaths(base, sheet_thicknesses(base)))
        rng, n = np.random.default_rng(seed), self.strata
        cells = {name: _cell_means(ENVIRONMENTS[name], n) for name in self.environments}
        left = {name: np.zeros(points.shape) for name in self.environments}
        for number in range(n * n):
            towards = _cosine((np.array(divmod(number, n)) + rng.random((len(points), 2))) / n)
            passed = light.passed(points - base.camera.eye, -towards, np.full(len(points), np.inf))
            for name, sums in left.items():
                sums += cells[name][number] * passed
        return {name: sums / cells[name].sum(axis=0) for name, sums in left.items()}


def sky_scene() -> Scene:
    """A ball of wine, a stone and a block over a floor, which is the last object."""
    corners = [(-6.0, -1.0, -6.0), (6.0, -1.0, -6.0), (6.0, -1.0, 6.0), (-6.0, -1.0, 6.0)]
    objects = [
        Object(Sphere().tessellate(32), WINE),
        placed(Sphere(radius=0.5).tessellate(32), None, (1.6, -0.3, 0.4)),
        Object(Box((-2.0, -1.0, -0.5), (-1.4, 0.4, 0.5)).tessellate()),
        Object(Mesh(np.array(corners), QUAD_FACES, name="floor"), color=(1.0, 1.0, 1.0)),
    ]
    return Scene(objects, Camera.look_at((0.0, 3.5, 7.0), (0.0, -0.3, 0.0), fov_y=30.0))


def _cell_means(environment: Environment, n: int) -> Array:
    """Mean radiance (n * n, 3) of an environment in n x n cells."""
    looks = (np.arange(n * _LOOKS) + 0.5) / (n * _LOOKS)
    towards = _cosine(np.stack(np.meshgrid(looks, looks, indexing="ij"), axis=-1).reshape(-1, 2))
    radiance = environment.radiance(towards, np.zeros((len(towards), 2)))
    return np.asarray(radiance.reshape(n, _LOOKS, n, _LOOKS, 3).mean(axis=(1, 3)).reshape(n * n, 3))


def _cosine(place: Array) -> Array:
    """Directions (k, 3) upwards of points (k, 2) in the unit square, by the cosine."""
    across, turn = np.sqrt(place[:, 0]), 2.0 * np.pi * place[:, 1]
    return np.stack([across * np.cos(turn), np.sqrt(1.0 - place[:, 0]), across * np.sin(turn)], axis=-1)


def glass_ball() -> Scene:
    """A ball of glass in the sun, at rest on the ground."""
    mesh = toolkit("sphere")
    radius = 0.04 / (0.5 * float(np.ptp(mesh.vertices[:, 1])))
    matrix = np.diag([radius, radius, radius, 1.0])
    matrix[:3, 3] = np.array((0.0, 0.0401, 0.0)) - radius * mesh.center
    camera = Camera.look_at((0.05, 0.28, 0.42), (0.02, 0.02, 0.0), fov_y=32.0)
    sun = DirectionalLight((0.4, -1, -0.2), 1.0)
    return Scene([Object(mesh, Medium(ior=1.5), matrix), GROUND], camera, [sun], DUSK)


def goblet() -> Scene:
    """A crystal goblet with wine beside a point light."""
    glass, red = toolkit("goblet"), Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    above = (0.0, 1e-4 - float(glass.bounds[0][1]), 0.0)
    bodies = [placed(glass, preset("crystal").medium, above, priority=1), placed(toolkit("wine"), red, above)]
    camera = Camera.look_at((0.0, 0.34, 0.62), (0.06, 0.06, 0.0), fov_y=30.0)
    return Scene([*bodies, GROUND], camera, [PointLight((-0.5, 0.6, -0.15), 1.2)], DUSK, "priority")


CAUSTIC_SCENES = (
    LightScene(
        "glass ball",
        "Ball of glass, sun",
        "light that a ball gathers, and what its surface mirrors",
        glass_ball,
        quick=True,
    ),
    LightScene(
        "goblet",
        "Wine in a crystal goblet, point light",
        "three media, curved both ways, and a foot on the ground",
        goblet,
    ),
)


@dataclass
class CausticTruth:
    """Two estimates of the light of a scene, with independent noise.

    Attributes
    ----------
    scene : Scene
    halves : two (h, w, 3) arrays
        Irradiance on the ground, blurred by a pixel, or radiance.
    seconds : float
        Time of both.
    powers : two floats
        Of the light on the ground.
    shown : list of (h, w, 3) arrays
        Light of each row, as in the halves.
    frame : Frame, optional
        Picture of the last row.
    where : two slices
        Rows and columns that errors are of.
    """

    scene: Scene
    halves: tuple[Array, Array]
    seconds: float
    powers: tuple[float, float] = (0.0, 0.0)
    shown: list[Array] = field(default_factory=list)
    frame: Frame | None = None
    where: tuple[slice, slice] = (slice(None), slice(None))

    @property
    def mean(self) -> Array:
        """Mean of both estimates."""
        return 0.5 * (self.halves[0] + self.halves[1])

    def errors(self, found: Array, worth: float = 1.0) -> tuple[float, float]:
        """RMS error over the mean, and its upper bound by two standard errors; a fraction `worth` is independent."""
        one, other = (half[self.where] for half in self.halves)
        square, uncertainty = noise_free_square(found[self.where], one, other)
        bounds = square, square + 2.0 * uncertainty * worth**-0.5
        nrmse, most = (math.sqrt(max(bound, 0.0)) / float(self.mean[self.where].mean()) for bound in bounds)
        return nrmse, most


@dataclass(frozen=True)
class GroundCaustics(Experiment[LightScene]):
    """Caustics on a ground by photons on the GPU, against those of the float64 reference.

    Parameters
    ----------
    shown : sequence of LightScene
    photons : sequence of int
    truth_photons : int
        Of each half of the truth.
    size : (width, height)
    """

    part: ClassVar[Part] = "shadows"
    label: ClassVar[str] = "caustic, "
    into: ClassVar[str] = "shadows.caustics"
    claims: ClassVar[tuple[Judge, ...]] = CAUSTIC_CLAIMS

    shown: Sequence[LightScene] = CAUSTIC_SCENES
    photons: Sequence[int] = (62_500, 250_000, 1_000_000)
    truth_photons: int = 400_000
    size: Size = (240, 180)

    def blank(self, bench: BenchContext, scene: LightScene) -> CausticCase:
        """Record of a scene without numbers."""
        return CausticCase(scene.name, scene.title, scene.why, self.truth_photons)

    def truth(self, bench: BenchContext, scene: LightScene) -> CausticTruth:
        """Irradiance by photons of the reference."""
        made, began = scene.make(), time.perf_counter()
        halves = [
            reference.photon_irradiance(made, self.size, reference.trace_photons(made, self.truth_photons, seed))
            for seed in range(2)
        ]
        seconds = time.perf_counter() - began
        one, other = (self._power(made, half) for half in halves)
        self._irradiance(bench.renderer, made, Caustics(1000))  # compiles, and builds hierarchies
        return CausticTruth(made, (_blurred(halves[0]), _blurred(halves[1])), seconds, (one, other))

    def contenders(self, truth: CausticTruth) -> Sequence[int]:
        """Numbers of photons."""
        return self.photons

    def row(self, bench: BenchContext, truth: CausticTruth, photons: int) -> CausticRow:
        """Errors with a number of photons."""
        began = time.perf_counter()
        found, truth.frame = self._irradiance(bench.renderer, truth.scene, Caustics(photons))
        seconds = time.perf_counter() - began
        truth.shown.append(_blurred(found))
        power = self._power(truth.scene, found) / (0.5 * sum(truth.powers)) - 1.0
        # Blurred pixels are worth about a quarter of as many.
        return CausticRow(photons, power, *truth.errors(truth.shown[-1], 0.25), seconds)

    def record(
        self, bench: BenchContext, blank: CausticCase, truth: CausticTruth, rows: Sequence[CausticRow]
    ) -> CausticCase:
        """Record of a scene: its picture, and irradiance."""
        white = float(np.quantile(truth.mean, 0.995))
        assert truth.frame is not None
        pictures = (
            picture_of("the picture", truth.frame.to_srgb8()),
            picture_of("reference", _screen(truth.mean / white)),
            picture_of(f"{rows[-1].photons:,} photons", _screen(truth.shown[-1] / white)),
        )
        one, other = truth.powers
        noise = abs(one - other) / (one + other)
        return dataclasses.replace(
            blank, reference_seconds=truth.seconds, power_noise=noise, rows=tuple(rows), pictures=pictures
        )

    def _irradiance(self, renderer: Renderer, scene: Scene, caustics: Caustics) -> tuple[Array, Frame]:
        """Irradiance (h, w, 3) by photons, from pictures with and without them, and the picture."""
        gpu, plan, (width, height) = renderer.gpu, renderer.plan(scene, caustics=caustics), self.size
        radiance = []
        with gpu.context.current():
            job = gpu.prepare(plan, self.size)
            try:
                for leave_out in ((PassName.CAUSTICS,), ()):
                    gpu.run(job, leave_out=leave_out)
                    data = np.frombuffer(job.targets["opaque"].read(components=4, attachment=1, dtype="f4"), np.float32)
                    radiance.append(data.reshape(height, width, 4)[::-1, :, :3].astype(np.float64))
                frame = gpu.read(job)
            finally:
                job.release()
        return (radiance[1] - radiance[0]) * np.pi / _COLOR, frame

    def _power(self, scene: Scene, irradiance: Array) -> float:
        """Power of irradiance on the ground, by the areas of it in each pixel."""
        origins, directions = scene.camera.rays(self.size)
        points = origins[..., 1:2] / -directions[..., 1:2] * directions
        half_width, half_height = scene.camera.half_extent(self.size)
        ahead = points @ scene.camera.forward
        pixel = 4.0 * half_width * half_height / (self.size[0] * self.size[1])
        areas = np.where(directions[..., 1] < 0, pixel * np.abs(ahead) ** 3 / np.abs(points[..., 1]), 0.0)
        return float((irradiance * areas[..., None]).sum())


def _blurred(picture: Array) -> Array:
    """Blur with a tent filter two pixels wide."""
    for axis in (0, 1):
        low, high = (np.roll(picture, by, axis) for by in (-1, 1))
        picture = 0.5 * picture + 0.25 * (low + high)
    return picture


def _screen(light: Array) -> npt.NDArray[np.uint8]:
    """Linear light (h, w, 3) from 0 to 1 as 8-bit sRGB."""
    return np.rint(255.0 * linear_to_srgb(np.clip(light, 0.0, 1.0))).astype(np.uint8)


def fog() -> Scene:
    """A ball in thin fog."""
    box = Object(Box((-2.0, -3.5, -1.5), (2.0, 1.5, 1.5)).tessellate(), Medium(absorption=0.02, scattering=0.2))
    return Scene([box, GLASS], Camera.look_at((0, -1, 12), (0, -1, 0), fov_y=24.0), [], NIGHT, "priority")


def _above(medium: Medium) -> Scene:
    block = Object(Box((-2.2, -2.5, -2.2), (2.2, -1.3, 2.2)).tessellate(), medium)
    return Scene([block, GLASS], Camera.look_at((0, 6, 5), (0, -1.3, 0), fov_y=38.0), [], NIGHT, "priority")


def wax() -> Scene:
    """A ball above a block of wax."""
    return _above(Medium(absorption=0.1, scattering=8.0, ior=1.4))


def milk() -> Scene:
    """A ball above milk, which scatters ahead."""
    return _above(Medium(absorption=(0.02, 0.05, 0.2), scattering=20.0, anisotropy=0.6, ior=1.34))


@dataclass(frozen=True)
class MediumScene(LightScene):
    """Scene of a caustic in a medium, the number of paths of its truth, and the measured part of the picture."""

    paths: int = 192
    counted: tuple[slice, slice] = (slice(9, 20), slice(4, 20))


MEDIUM_SCENES = (
    MediumScene(
        "fog",
        "Thin fog",
        "a bright cone behind the ball, and its shadow",
        fog,
        paths=3072,
        counted=(slice(14, 23), slice(5, 19)),
    ),
    MediumScene("wax", "Block of wax", "what falls on it spreads inside", wax),
    MediumScene("milk", "Milk", "the same, in a medium that scatters ahead and absorbs blue", milk, paths=256),
)


@dataclass(frozen=True)
class MediumCaustics(Experiment[MediumScene]):
    """Caustics in fog, wax and milk below a ball of glass in a wide sun, with photons and without.

    Parameters
    ----------
    shown : sequence of MediumScene
    paths : float
        Fraction of the paths of the truth.
    photons : int
    """

    part: ClassVar[Part] = "shadows"
    label: ClassVar[str] = "caustic in a medium, "
    into: ClassVar[str] = "shadows.media"
    claims: ClassVar[tuple[Judge, ...]] = MEDIUM_CLAIMS

    shown: Sequence[MediumScene] = MEDIUM_SCENES
    paths: float = 1.0
    photons: int = 400_000

    def blank(self, bench: BenchContext, scene: MediumScene) -> CausticMediumCase:
        """Record of a scene without numbers."""
        return CausticMediumCase(scene.name, scene.title, scene.why, max(int(self.paths * scene.paths), 2))

    def truth(self, bench: BenchContext, scene: MediumScene) -> CausticTruth:
        """Radiance by random paths, which find a disc of the environment."""
        up = texel_directions(MAP_HEIGHT, 2 * MAP_HEIGHT)[..., 1] > np.cos(RADIUS)
        angles = np.broadcast_to(row_solid_angles(MAP_HEIGHT, 2 * MAP_HEIGHT)[:, None], up.shape)
        sun = np.where(up, IRRADIANCE / angles[up].sum(), 0.0)[..., None] * np.ones(3, np.float32)
        made = scene.make()
        lit = dataclasses.replace(made, environment=Environment.image(sun.astype(np.float32)))
        paths, began = self.blank(bench, scene).truth_paths, time.perf_counter()
        one, other = (
            np.asarray(reference.path_trace(lit, SIZE, paths=paths, seed=seed)[0].radiance, np.float64)
            for seed in (1, 2)
        )
        return CausticTruth(made, (one, other), time.perf_counter() - began, where=scene.counted)

    def contenders(self, truth: CausticTruth) -> Sequence[int]:
        """Without photons, and with them."""
        return 0, self.photons

    def row(self, bench: BenchContext, truth: CausticTruth, photons: int) -> CausticRow:
        """Errors with a number of photons; lights over the disc of the sun are drawn a few at a time."""
        caustics = Caustics(photons) if photons else None
        number = np.arange(LIGHTS)
        fall = (number + 0.5) / LIGHTS * (1.0 - np.cos(RADIUS))
        turn, across = np.pi * (1.0 + np.sqrt(5.0)) * number, np.sqrt(fall * (2.0 - fall))
        directions = -np.stack([across * np.cos(turn), 1.0 - fall, across * np.sin(turn)], axis=1)
        began, total = time.perf_counter(), np.zeros((*SIZE[::-1], 3))
        for first in range(0, LIGHTS, AT_ONCE):
            lights = [DirectionalLight(one, IRRADIANCE / LIGHTS) for one in directions[first : first + AT_ONCE]]
            lit = dataclasses.replace(truth.scene, lights=lights)
            total += bench.renderer.render(lit, SIZE, samples=4, caustics=caustics).radiance
        seconds = time.perf_counter() - began
        truth.shown.append(total)
        power = float(total[truth.where].mean()) / float(truth.mean[truth.where].mean()) - 1.0
        return CausticRow(photons, power, *truth.errors(total), seconds)

    def record(
        self, bench: BenchContext, blank: CausticMediumCase, truth: CausticTruth, rows: Sequence[CausticRow]
    ) -> CausticMediumCase:
        """Record of a scene."""
        white = float(np.quantile(truth.mean, 0.98))
        names = ("reference", "without photons", f"{self.photons:,} photons")
        lights = (truth.mean, *truth.shown)
        pictures = tuple(
            picture_of(name, _screen(light / white).repeat(ENLARGED, 0).repeat(ENLARGED, 1))
            for name, light in zip(names, lights, strict=True)
        )
        one, other = (half[truth.where] for half in truth.halves)
        noise = float((one - other).std()) / 2.0 / math.sqrt(one.size) / float(0.5 * (one + other).mean())
        return dataclasses.replace(
            blank, reference_seconds=truth.seconds, noise=noise, rows=tuple(rows), pictures=pictures
        )
