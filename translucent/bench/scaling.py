"""Scaling of cost with triangles, pixels, layers and media."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from translucent.bench.contenders import CONTENDERS
from translucent.bench.drawing import (
    BenchContext,
    Drawing,
    PlanDrawing,
    Samples,
    Size,
    floor_times,
    timed_beside_floor,
)
from translucent.bench.experiment import Experiment, one_line
from translucent.bench.record import Part, Report, ScalePoint, Series
from translucent.bench.shapes import lying_torus, placed, plates
from translucent.errors import TranslucentError
from translucent.geometry.solids import Sphere
from translucent.gpu.targets import Targets
from translucent.media.medium import Medium
from translucent.planning.bodies import MAX_SLOTS
from translucent.planning.methods import DepthPeeling, FragmentLists, KBuffer, Method, SignedDepth
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import framing, showcase

Axis = Literal["triangles", "pixels", "layers", "media"]

#: Contenders along all axes, by family.
METHODS: dict[str, Method] = {
    "SignedDepth": SignedDepth(),
    "FragmentLists": FragmentLists(),
    "KBuffer": KBuffer(k=8),
    "DepthPeeling": DepthPeeling(max_layers=MAX_LAYERS),
}

#: Frames that a GPU shows on screens: 1080p and 4K.
SCREENS: tuple[Size, ...] = ((1920, 1080), (3840, 2160))

#: Number of the last step of each axis in a quick run, beside the first.
_LAST = {"triangles": 2, "pixels": 1, "layers": 3, "media": 4}


@dataclass(frozen=True)
class ScalingStep:
    """Scene of one value x along an axis; `fixed` says in words what stays the same along it."""

    axis: Axis
    fixed: str
    x: int
    make: Callable[[], tuple[Scene, Size]]

    @property
    def name(self) -> str:
        """Axis and value."""
        return f"{self.axis} {self.x}"


@dataclass(frozen=True)
class CostScaling(Experiment[ScalingStep]):
    """Times of methods, by their families, along four axes; `quick`: two steps of each, none of the longest."""

    part: ClassVar[Part] = "scaling"
    label: ClassVar[str] = "scaling, "
    into: ClassVar[str] = "scaling"

    quick: bool = False
    methods: Mapping[str, Method] = field(default_factory=METHODS.copy)

    def scenes(self, bench: BenchContext) -> Sequence[ScalingStep]:
        """Steps on this machine."""
        found = []
        for axis, (fixed, steps) in _axes(bench.software).items():
            every = list(steps)
            for x in (every[0], every[_LAST[axis]]) if self.quick else every:
                found.append(ScalingStep(axis, fixed, x, steps[x]))
        return found

    def added(self, report: Report, record: Sequence[Series]) -> Report:
        """The report with a point more in each series."""
        series = {(one.axis, one.method): one for one in report.scaling}
        for new in record:
            old = series.get((new.axis, new.method), dataclasses.replace(new, points=()))
            series[new.axis, new.method] = dataclasses.replace(old, points=(*old.points, *new.points))
        return dataclasses.replace(report, scaling=tuple(series.values()))

    def measure(self, bench: BenchContext, step: ScalingStep) -> list[Series]:
        """Series of one point each, the floor first."""
        found: dict[str, Samples] = {}
        try:
            scene, size = step.make()

            def maker(method: Method) -> Callable[[Targets], Drawing]:
                return lambda targets: PlanDrawing(bench, bench.renderer.plan(scene, method), targets)

            makers = {name: maker(method) for name, method in self.methods.items()}
            found, failures = timed_beside_floor(bench, scene, size, makers, bench.effort.step_seconds)
        except Exception as error:  # noqa: BLE001 - a step that cannot be measured leaves the others alone
            failures = dict.fromkeys(self.methods, error)
        points = {"depth only": _point(step.x, floor_times(found))}
        for name in self.methods:
            if (samples := found.get(name)) is not None:
                points[name] = _point(step.x, samples)
            elif isinstance(failures[name], TranslucentError):  # said on purpose: no room for so many surfaces
                points[name] = ScalePoint(step.x, refusal=one_line(failures[name]))
            else:
                points[name] = ScalePoint(step.x, failure=one_line(failures[name]))
        # As in the rows of cases.
        rows = [one for one in reversed(CONTENDERS) if one.kind == "method"]
        labels = {family: row.name for family, method in self.methods.items() for row in rows if row.method == method}
        return [Series(step.axis, labels.get(name, name), name, step.fixed, (at,)) for name, at in points.items()]


def _point(x: int, samples: Samples) -> ScalePoint:
    return ScalePoint(x, samples.timing("wall"), samples.ratio("part"))


def _axes(software: bool) -> dict[Axis, tuple[str, Mapping[int, Callable[[], tuple[Scene, Size]]]]]:
    """For each axis, what stays the same along it, and its scenes by their values."""
    small, torus = (512, 512), 316
    pixels = [(n, n) for n in (256, 512, 1024, 2048)] + ([] if software else list(SCREENS))
    return {
        "triangles": ("a torus at 512 x 512", {2 * (n // 2) * n: _torus(n, small) for n in (32, 100, 316, 1000)}),
        "pixels": (
            "a torus of 100,000 triangles",
            {width * height: _torus(torus, (width, height)) for width, height in sorted(pixels, key=np.prod)},
        ),
        "layers": (
            "plates over the whole picture, 256 x 256",
            {n: _plates(n) for n in (2, 4, 8, 16, 32, 64, 100)},
        ),
        "media": ("16 spheres at 512 x 512", {n: _media(n, small) for n in (1, 2, 4, 8, MAX_SLOTS)}),
    }


def _torus(segments: int, size: Size) -> Callable[[], tuple[Scene, Size]]:
    return lambda: (showcase(lying_torus(segments), size=size, stage="none"), size)


def _plates(layers: int) -> Callable[[], tuple[Scene, Size]]:
    def make() -> tuple[Scene, Size]:
        camera = Camera.orthographic((0, 0, 2), (0, 0, 0), height=1.0)
        body = Object(plates(layers), Medium.from_color((0.5, 0.7, 0.9), 1.0))
        return Scene([body], camera, environment=Environment.constant((1, 1, 1))), (256, 256)

    return make


def _media(count: int, size: Size) -> Callable[[], tuple[Scene, Size]]:
    """Scene of 16 balls of a number of media."""

    def make() -> tuple[Scene, Size]:
        ball = Sphere(radius=0.6).tessellate(80)
        media = [Medium(absorption=np.roll((0.2, 0.5, 1.0), i) * (1 + i / count)) for i in range(count)]
        grid = [(i % 4, i // 4, 0.3 * (i % 3)) for i in range(MAX_SLOTS)]
        objects = [placed(ball, media[i % count], place) for i, place in enumerate(grid)]
        return Scene(objects, framing(objects, size)), size

    return make
