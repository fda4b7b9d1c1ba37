"""Scaling of cost with triangles, pixels, layers and media."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from translucent.bench.contenders import CONTENDERS
from translucent.bench.drawing import Floor, Planned, Size, Studio, is_software
from translucent.bench.measure import one_line
from translucent.bench.record import ScalePoint, Series
from translucent.bench.shapes import lying_torus, plates
from translucent.bench.timing import STEADY, Pace, Samples, interleaved, ratio, timing
from translucent.errors import TranslucentError
from translucent.geometry.solids import Sphere
from translucent.gpu.targets import Targets
from translucent.media.medium import Medium
from translucent.planning.methods import DepthPeeling, FragmentLists, KBuffer, Method, SignedDepth
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.slots import MAX_SLOTS
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


@dataclass(frozen=True)
class Ladder:
    """Ladder: the scenes along one axis.

    Attributes
    ----------
    axis : str
    fixed : str
        What stays the same.
    steps : mapping of int to callable
        For each x, what makes the scene and its size.
    """

    axis: Axis
    fixed: str
    steps: Mapping[int, Callable[[], tuple[Scene, Size]]]


@dataclass
class ScalingRun:
    """Measurement of all ladders, a step at a time.

    Parameters
    ----------
    studio : Studio
    seconds : float
        For each step.
    quick : bool
        Two steps of each ladder, none of the longest.
    pace : Pace
        Of timing.
    """

    studio: Studio
    seconds: float
    quick: bool
    pace: Pace = STEADY
    _points: dict[tuple[Axis, str], list[ScalePoint]] = field(default_factory=dict)

    def ladders(self) -> list[Ladder]:
        """Ladders to be measured on this machine."""
        ladders = _ladders(is_software(self.studio.renderer))
        return [_thinned(ladder) for ladder in ladders] if self.quick else ladders

    def steps(self) -> Iterator[tuple[str, tuple[Series, ...]]]:
        """Measure step by step: after each, its name and all series so far."""
        ladders = self.ladders()
        for ladder in ladders:
            for x, make in ladder.steps.items():
                self._measure(ladder, x, make)
                yield f"{ladder.axis} {x}", self._series(ladders)

    def _measure(self, ladder: Ladder, x: int, make: Callable[[], tuple[Scene, Size]]) -> None:
        failures: dict[str, Exception] = {}
        found: dict[str, Samples] = {}
        try:
            scene, size = make()
            found = self._timed(scene, size, failures)
        except Exception as error:  # noqa: BLE001 - a step that cannot be measured leaves the others alone
            failures = dict.fromkeys(METHODS, error)
        floor = [seconds for samples in found.values() for seconds in samples.floor_wall]
        points = {"depth only": ScalePoint(x, timing(floor), ratio(floor, floor))}
        for name in METHODS:
            samples = found.get(name)
            if samples is not None:
                points[name] = ScalePoint(x, timing(samples.wall), ratio(samples.part, samples.floor))
            elif isinstance(failures[name], TranslucentError):  # said on purpose: no room for so many surfaces
                points[name] = ScalePoint(x, refusal=one_line(failures[name]))
            else:
                points[name] = ScalePoint(x, failure=one_line(failures[name]))
        for name, point in points.items():
            self._points.setdefault((ladder.axis, name), []).append(point)

    def _timed(self, scene: Scene, size: Size, failures: dict[str, Exception]) -> dict[str, Samples]:
        targets = Targets(self.studio.gl, size)
        floor = Floor(self.studio, scene, targets)
        drawings: dict[str, Planned] = {}
        try:
            for name, method in METHODS.items():
                try:
                    plan = self.studio.renderer.plan(scene, method)
                    drawings[name] = Planned(self.studio, scene, targets, plan)
                except Exception as error:  # noqa: BLE001 - the other methods go on
                    failures[name] = error
            return interleaved(
                floor.draw,
                {name: drawn.draw for name, drawn in drawings.items()},
                self.seconds,
                lambda name, error: failures.update({name: error}),
                self.pace,
            )
        finally:
            for drawn in drawings.values():
                drawn.release()
            floor.release()
            targets.release()

    def _series(self, ladders: list[Ladder]) -> tuple[Series, ...]:
        fixed = {ladder.axis: ladder.fixed for ladder in ladders}
        return tuple(
            Series(axis, name if name == "depth only" else _label(METHODS[name]), name, fixed[axis], tuple(points))
            for (axis, name), points in self._points.items()
        )


def _label(method: Method) -> str:
    """Label of the method, as in its row."""
    return next((row.name for row in CONTENDERS if row.method == method), type(method).__name__)


def _ladders(software: bool) -> list[Ladder]:
    small, torus = (512, 512), 316
    pixels = [(n, n) for n in (256, 512, 1024, 2048)] + ([] if software else list(SCREENS))
    return [
        Ladder(
            "triangles",
            "a torus at 512 x 512",
            {2 * (n // 2) * n: _torus(n, small) for n in (32, 100, 316, 1000)},
        ),
        Ladder(
            "pixels",
            "a torus of 100,000 triangles",
            {width * height: _torus(torus, (width, height)) for width, height in sorted(pixels, key=np.prod)},
        ),
        Ladder(
            "layers", "plates over the whole picture, 256 x 256", {n: _plates(n) for n in (2, 4, 8, 16, 32, 64, 100)}
        ),
        Ladder("media", "16 spheres at 512 x 512", {n: _media(n, small) for n in (1, 2, 4, 8, MAX_SLOTS)}),
    ]


def _thinned(ladder: Ladder) -> Ladder:
    steps = list(ladder.steps)
    last = {"triangles": 2, "pixels": 1, "layers": 3, "media": 4}[ladder.axis]
    return dataclasses.replace(ladder, steps={x: ladder.steps[x] for x in (steps[0], steps[last])})


def _torus(segments: int, size: Size) -> Callable[[], tuple[Scene, Size]]:
    return lambda: (showcase(lying_torus(segments), size=size, stage="none"), size)


def _plates(layers: int) -> Callable[[], tuple[Scene, Size]]:
    size = (256, 256)

    def make() -> tuple[Scene, Size]:
        camera = Camera.orthographic((0, 0, 2), (0, 0, 0), height=1.0)
        body = Object(plates(layers), Medium.from_color((0.5, 0.7, 0.9), 1.0))
        return Scene([body], camera, environment=Environment.constant((1, 1, 1))), size

    return make


def _media(count: int, size: Size) -> Callable[[], tuple[Scene, Size]]:
    """Scene of 16 balls with as many media as asked for."""

    def make() -> tuple[Scene, Size]:
        ball = Sphere(radius=0.6).tessellate(80)
        media = [Medium(absorption=np.roll((0.2, 0.5, 1.0), i) * (1 + i / count)) for i in range(count)]
        objects = []
        for i in range(MAX_SLOTS):
            matrix = np.eye(4)
            matrix[:3, 3] = (i % 4, i // 4, 0.3 * (i % 3))
            objects.append(Object(ball, media[i % count], matrix))
        return Scene(objects, framing(objects, size)), size

    return make
