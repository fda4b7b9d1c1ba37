"""Drawings that are timed round robin: frames prepared once, drawn again and again, and read at the end.

The order is A B C A B C, and the floor before and after each: what slows the machine down for longer than a drawing
slows both, and their quotient stays. Medians and quartiles are over rounds, so that single hiccups do not
count either. Slow drawings leave the rounds early, once they have had their part of the time; those whose rounds
differ much stay longer. What takes less than clocks resolve is drawn several times for one sample.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, TypeVar, cast

import numpy as np
import numpy.typing as npt

from translucent.bench.record import Ratio, TimeStatistics
from translucent.frames.frame import Frame
from translucent.gpu.diffusion import DiffusionCache
from translucent.gpu.job import FrameJob
from translucent.gpu.pass_costs import PassTimer
from translucent.gpu.passes import PASSES, Pass
from translucent.gpu.passes.shortcuts import DepthOnlyPass, Shortcut
from translucent.gpu.resources import Resources
from translucent.gpu.targets import Targets
from translucent.planning.methods import SignedDepth
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import Diffusion
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

Size = tuple[int, int]

Made = TypeVar("Made")

#: Passes of a plan that shade the thickness of a shortcut, including passes that find and shade an interface.
_AFTER_SHORTCUTS = (PassName.INTERFACES, PassName.TRANSMITTANCE, PassName.SURFACES)

#: Least rounds of the slowest drawing, and most rounds of the fastest.
FEWEST, MOST = 3, 60

#: A drawing that is called long needs no more rounds than this, and less from `LONGEST` seconds on: its own noise
#: averages out within it.
FEWEST_LONG = 2
FEWEST_LONGEST, LONGEST = 1, 2.0

#: A drawing whose rounds differ much gets so many at least, while it and its floors have taken fewer seconds: among
#: three rounds, one hiccup in a floor and one in a drawing are most.
FEWEST_UNSURE, CHEAP = 9, 0.1

#: Seconds of a sample, below which a drawing is repeated in it, and the largest number of repetitions.
SHORTEST, MOST_REPEATED = 4e-3, 16

#: Standard error of the median ratio, as a fraction of it, from which on more rounds are requested.
UNSURE = 0.03

#: Draws of the floor on each side of a sample take this fraction of the time of the sample, up to `MOST_FLOORS` draws.
FLOOR_SHARE, MOST_FLOORS = 0.3, 10


class Sample(NamedTuple):
    """Sample: seconds of one drawing.

    Attributes
    ----------
    wall, frame : float
        By the clock: until the passes that find thickness are done, and until all are.
    gpu : float or None
        Of those passes, by the GPU's timer.
    part, whole : float
        The same two, by the clock that drawings are compared by: see `translucent.bench.drawing.BenchContext`.
    """

    wall: float
    frame: float
    gpu: float | None
    part: float
    whole: float


@dataclass(frozen=True)
class Effort:
    """Effort of a measurement.

    Attributes
    ----------
    case_seconds, step_seconds : float
        Of timing, for each case and for each step of a scaling axis.
    compared : float
        Width and height of the frames that are compared with the reference, as a fraction of those of the case.
    patience, long : float
        As in `translucent.bench.drawing.interleaved`.
    """

    case_seconds: float
    step_seconds: float
    compared: float
    patience: float = 1.0
    long: float = 0.3


FULL = Effort(12.0, 2.5, 1.0, patience=3.0)
QUICK = Effort(0.6, 0.15, 0.4, long=0.1)


class BenchContext:
    """Resources that all measurements of one run share: renderers, compiled passes, uploaded meshes, timers, effort.

    Parameters
    ----------
    renderer : Renderer
        With OpenGL.
    cpu : Renderer, optional
        Of the backend ``cpu``, where it works.
    size : (width, height)
        Of the timed frames.
    effort : Effort

    Attributes
    ----------
    clock : callable
        By which drawings are compared. Where the CPU draws, it is the processor time of all threads: the work that a
        drawing is, whatever else the machine does meanwhile.
    doing : callable
        Hears what is done for the scene that is measured: ``"method 3 of 12"``.
    """

    def __init__(
        self, renderer: Renderer, cpu: Renderer | None = None, size: Size = (256, 256), effort: Effort = QUICK
    ) -> None:
        self.renderer, self.cpu, self.size, self.effort = renderer, cpu, size, effort
        self.gl = renderer.gpu.context.gl
        self.resources = Resources(self.gl)
        self.timer = PassTimer(self.gl)
        self.software = "software" in renderer.provenance["renderer"]
        self.clock = time.process_time if self.software else time.perf_counter
        self.doing: Callable[[str], None] = lambda _: None
        self._own: dict[Callable[[Any], Any], Any] = {}
        self._light: dict[Diffusion, DiffusionCache] = {}

    def step(self, name: PassName) -> Pass:
        """The renderer's pass with this name in plans, so that no program is compiled twice."""
        return self.renderer.gpu.step(PASSES[name])

    def own(self, kind: Callable[[Any], Made]) -> Made:
        """Object outside plans, such as the pass of a shortcut, created once per context and cached."""
        if kind not in self._own:
            self._own[kind] = kind(self.gl)
        return cast("Made", self._own[kind])

    def light(self, diffusion: Diffusion) -> DiffusionCache:
        """Diffusion of one resolution, solved once for all drawings of a scene."""
        if diffusion not in self._light:
            self._light[diffusion] = DiffusionCache(self.gl)
        return self._light[diffusion]

    def forget_light(self) -> None:
        """Free the diffusion of a scene."""
        for light in self._light.values():
            light.release()
        self._light.clear()

    def timed(self, geometry: Callable[[], None], shading: Callable[[], None] = lambda: None) -> Sample:
        """Draw the passes that find thickness, then the rest of the frame; each until the device has finished."""
        self.timer.begin_frame()
        self.gl.finish()
        began, work = time.perf_counter(), self.clock()
        geometry()
        self.gl.finish()
        wall, part = time.perf_counter() - began, self.clock() - work
        shading()
        self.gl.finish()
        frame, whole = time.perf_counter() - began, self.clock() - work
        return Sample(wall, frame, sum(self.timer.seconds().values()), part, whole)

    def release(self) -> None:
        """Free all resources."""
        self.forget_light()
        self.resources.release()
        self._own.clear()


class Drawing(Protocol):
    """Frame that can be drawn again and again.

    Attributes
    ----------
    solve_seconds : float or None
        Seconds of the diffusion solve, which is done once; None without diffusion.
    """

    solve_seconds: float | None

    def draw(self) -> Sample:
        """Draw the frame, and return its times."""

    def read(self) -> Frame:
        """Read the frame of the last drawing."""

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers."""

    def release(self) -> None:
        """Free its resources."""


class PlanDrawing:
    """Drawing of a plan, pass by pass as the renderer runs it, into shared targets."""

    def __init__(self, bench: BenchContext, plan: RenderPlan, targets: Targets) -> None:
        self._bench = bench
        self._geometry = [spec for spec in plan.passes if spec.geometry_passes]
        self._shading = [spec for spec in plan.passes if not spec.geometry_passes]
        resources = copy.copy(bench.resources)
        self.solve_seconds: float | None = None
        if plan.diffuses:
            resources.diffusion = bench.light(plan.diffusion)
            began = time.perf_counter()
            resources.diffusion.solve(plan)
            self.solve_seconds = time.perf_counter() - began
        self._job = FrameJob(bench.gl, plan, targets, resources, compact=self._compact)

    _compact = True

    def draw(self) -> Sample:
        """Draw the plan, with new random paths."""
        self._job.paths_traced = 0

        def geometry() -> None:
            self._job.place((0.0, 0.0))
            for spec in self._geometry:
                with self._bench.timer.measure(f"geometry/{spec.name}"):
                    self._bench.step(spec.name).run(self._job, spec)

        return self._bench.timed(geometry, self._shade)

    def _shade(self) -> None:
        for spec in self._shading:
            self._bench.step(spec.name).run(self._job, spec)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        return self._bench.renderer.gpu.read(self._job)

    @property
    def bytes_per_pixel(self) -> int | None:
        """Bytes per pixel of all targets and buffers of this size."""
        width, height = self._job.targets.size
        lights = self._job.resources.light_lists.size // (width * height) if self._job.features.scatters else 0
        return self._job.targets.bytes_per_pixel() + lights

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


class ShortcutDrawing(PlanDrawing):
    """Drawing of a shortcut: it replaces the passes that find thickness, with the shading of signed depth."""

    _compact = False

    def __init__(
        self, bench: BenchContext, scene: Scene, targets: Targets, plan: RenderPlan, shortcut: Shortcut
    ) -> None:
        after = tuple(spec for spec in plan.passes if spec.name in _AFTER_SHORTCUTS)
        short = RenderPlan(scene, SignedDepth(), after, plan.spectral, interfaces=plan.interfaces)
        super().__init__(bench, short, targets)
        self._shading, self._shortcut = list(after), shortcut

    def draw(self) -> Sample:
        """Draw the shortcut."""

        def geometry() -> None:
            self._job.place((0.0, 0.0), with_depth=self._shortcut.with_depth)
            self._job.accumulator()
            with self._bench.timer.measure("shortcut"):
                self._shortcut.run(self._job)

        def shading() -> None:
            self._shortcut.hand_over(self._job)
            self._shade()

        return self._bench.timed(geometry, shading)


class FrameDrawing:
    """Drawing by a function that returns a frame, timed as a whole: without OpenGL, or of an engine."""

    bytes_per_pixel = None
    solve_seconds: float | None = None

    def __init__(self, bench: BenchContext, make: Callable[[], Frame]) -> None:
        self._clock, self._make = bench.clock, make
        self._frame: Frame | None = None

    def draw(self) -> Sample:
        """Draw the frame."""
        began, work = time.perf_counter(), self._clock()
        self._frame = self._make()
        seconds, spent = time.perf_counter() - began, self._clock() - work
        return Sample(seconds, seconds, None, spent, spent)

    def read(self) -> Frame:
        """Read the frame of the last drawing."""
        assert self._frame is not None, "drawn before"
        return self._frame

    def release(self) -> None:
        """Nothing to free: renderers are shared."""


class FloorDrawing:
    """Translucent objects drawn into a depth buffer alone, the least cost of any rasterized method.

    Opaque objects are staging, which every method draws before and which is in all costs: it is in the floor, too.
    """

    def __init__(self, bench: BenchContext, scene: Scene, targets: Targets) -> None:
        self._bodies = tuple(i for i, item in enumerate(scene.objects) if item.medium is not None)
        opaque = tuple(i for i, item in enumerate(scene.objects) if item.medium is None)
        self._staging = (PassSpec(PassName.OPAQUE, "staging", opaque, 1),) if opaque else ()
        self._bench = bench
        self._job = FrameJob(bench.gl, RenderPlan(scene, SignedDepth(), self._staging), targets, bench.resources)
        self._pass = bench.own(DepthOnlyPass)

    def draw(self) -> Sample:
        """Draw the floor."""

        def geometry() -> None:
            for spec in self._staging:
                self._job.place((0.0, 0.0))
                with self._bench.timer.measure("staging"):
                    self._bench.step(spec.name).run(self._job, spec)
            self._job.place((0.0, 0.0), with_depth=True)
            self._bench.gl.viewport = (0, 0, *self._job.targets.size)
            with self._bench.timer.measure("depth_only"):
                self._pass.run(self._job, self._bodies)

        return self._bench.timed(geometry)

    def release(self) -> None:
        """Free the uniform buffers."""
        self._job.release()


def timed_beside_floor(
    bench: BenchContext,
    scene: Scene,
    size: Size,
    makers: Mapping[str, Callable[[Targets], Drawing]],
    seconds: float,
    finished: Callable[[str, Drawing], None] = lambda *_: None,
) -> tuple[dict[str, Samples], dict[str, Exception]]:
    """Make drawings of a scene and measure them round robin.

    Parameters
    ----------
    bench : BenchContext
    scene : Scene
        Of the floor.
    size : (width, height)
    makers : mapping of str to callable
        Make the drawings, into targets.
    seconds : float
        In all.
    finished : callable
        Called with each drawing that has been measured.

    Returns
    -------
    samples, failures : dict
        By the names of drawings that work, and of drawings that fail.
    """
    targets = Targets(bench.gl, size)
    floor = FloorDrawing(bench, scene, targets)
    drawings: dict[str, Drawing] = {}
    failures: dict[str, Exception] = {}
    try:
        for name, make in makers.items():
            try:
                drawings[name] = make(targets)
            except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
                failures[name] = error
        draws = {name: drawing.draw for name, drawing in drawings.items()}
        patience, long = bench.effort.patience, bench.effort.long
        found = interleaved(floor.draw, draws, seconds, failures.__setitem__, patience, long)
        for name in found:
            finished(name, drawings[name])
        return found, failures
    finally:
        for drawing in drawings.values():
            drawing.release()
        floor.release()
        targets.release()


@dataclass
class Samples:
    """Samples of one drawing over the rounds.

    Attributes
    ----------
    drawn, floors : list of Sample
        Of the drawing, and of the floor around each.
    times, floor_times : int
        How often the drawing, and the floor, are drawn for a sample.
    """

    drawn: list[Sample] = field(default_factory=list)
    floors: list[Sample] = field(default_factory=list)
    times: int = 1
    floor_times: int = 1

    @property
    def spent(self) -> float:
        """Total time in seconds so far."""
        floors = self.floor_times * sum(one.wall for one in self.floors)
        return self.times * sum(one.frame for one in self.drawn) + floors

    @property
    def of_whole_frames(self) -> Samples:
        """Samples of whole frames, for cases without passes that find thickness; the GPU's timer had only these."""
        return replace(self, drawn=[Sample(one.frame, one.frame, None, one.whole, one.whole) for one in self.drawn])

    def timing(self, name: str) -> TimeStatistics | None:
        """Statistics of one of the times of samples."""
        return timing([value for one in self.drawn if (value := getattr(one, name)) is not None])

    def ratio(self, name: str) -> Ratio | None:
        """Statistics of the ratio of one of the times of samples to that of the floor."""
        return ratio([getattr(one, name) for one in self.drawn], [one.part for one in self.floors])


def interleaved(
    floor: Callable[[], Sample],
    drawings: Mapping[str, Callable[[], Sample]],
    seconds: float,
    failed: Callable[[str, Exception], None],
    patience: float = 1.0,
    long: float = 0.3,
) -> dict[str, Samples]:
    """Measure all drawings round robin, for about as many seconds; each gets an equal part, and at least a few rounds.

    Parameters
    ----------
    floor : callable
        Draws the floor.
    drawings : mapping of str to callable
    seconds : float
        In all.
    failed : callable
        Called with the name and the error of a drawing that raises, which is left out of the other rounds.
    patience : float
        How many times its part a drawing is timed at most while its ratio to the floor is `UNSURE`.
    long : float
        Seconds of a drawing from which on `FEWEST_LONG` rounds do.
    """
    warming = seconds / 8 / max(len(drawings), 1)
    warmed = {name: draw for name, draw in drawings.items() if _warm_up(name, draw, warming, failed)}
    for _ in range(5):
        floor()
    base, repeated = _Repeated(floor), {name: _Repeated(draw) for name, draw in warmed.items()}
    found = {name: Samples() for name in warmed}
    budget = 0.85 * seconds / max(len(warmed), 1)
    typical = float(np.median([base.sample().wall for _ in range(5)]))
    while running := [name for name in warmed if not _enough(found[name], budget, patience, long)]:
        before = _floor(base, typical, 0.0)
        for name in running:
            try:
                sample = repeated[name].sample()
            except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row, and the others go on
                failed(name, error)
                del warmed[name], found[name]
                continue
            after = _floor(base, typical, sample.wall * repeated[name].times / base.times)
            found[name].times, found[name].floor_times = repeated[name].times, base.times
            found[name].drawn.append(sample)
            found[name].floors.append(_middle([before, after], np.mean))
            before = after
    return found


def _warm_up(name: str, draw: Callable[[], Sample], seconds: float, failed: Callable[[str, Exception], None]) -> bool:
    """Warm up for some seconds, with at least one draw: shaders compile, buffers grow, caches fill."""
    begin = time.perf_counter()
    try:
        draw()
        while time.perf_counter() - begin < seconds:
            draw()
    except Exception as error:  # noqa: BLE001 - as above
        failed(name, error)
        return False
    return True


def _floor(floor: _Repeated, typical: float, beside: float) -> Sample:
    """Medians of a few draws of the floor; the longer the sample beside it, the more draws."""
    count = int(np.clip(round(FLOOR_SHARE * beside / typical), 1, MOST_FLOORS))
    return _middle([floor.sample() for _ in range(count)], np.median)


class _Repeated:
    """Drawing that is repeated within a sample until clocks can resolve it.

    Attributes
    ----------
    times : int
    """

    def __init__(self, draw: Callable[[], Sample]) -> None:
        self._draw, self.times = draw, 0

    def sample(self) -> Sample:
        """Draw several times, and return the means of the times; the first sample decides how often."""
        samples = [self._draw()]
        if not self.times:
            self.times = math.ceil(min(SHORTEST / max(samples[0].frame, SHORTEST / MOST_REPEATED), MOST_REPEATED))
        samples += [self._draw() for _ in range(self.times - 1)]
        return _middle(samples, np.mean)


def _middle(samples: list[Sample], of: Callable[..., Any]) -> Sample:
    """Sample of the means or medians of all times."""
    known = [[value for value in values if value is not None] for values in zip(*samples, strict=True)]
    return Sample(*(float(of(values)) if values else None for values in known))  # type: ignore[arg-type]


def _enough(samples: Samples, budget: float, patience: float, long: float) -> bool:
    rounds = len(samples.drawn)
    first = samples.drawn[0].frame if rounds else 0.0
    fewest = FEWEST_LONGEST if first > LONGEST else FEWEST_LONG if first > long else FEWEST
    most = MOST * patience
    if rounds >= most or rounds < fewest or samples.spent < budget:
        return rounds >= most
    if rounds < FEWEST_UNSURE and samples.spent < CHEAP and _unsure(samples):
        return False
    return samples.spent >= patience * budget or not _unsure(samples)


def _unsure(samples: Samples) -> bool:
    found = samples.ratio("part")
    return found is not None and found.noise > UNSURE * found.median


def timing(seconds: list[float]) -> TimeStatistics | None:
    """Statistics in milliseconds; None without samples."""
    if not seconds:
        return None
    low, median, high, p95 = np.quantile(np.array(seconds) * 1e3, (0.25, 0.5, 0.75, 0.95))
    return TimeStatistics(float(median), float(p95), float(high - low), len(seconds))


def ratio(seconds: list[float], floor: list[float]) -> Ratio | None:
    """Statistics of the ratios of rounds."""
    if not seconds:
        return None
    quotients: npt.NDArray[np.float64] = np.array(seconds) / np.array(floor)
    low, median, high = np.quantile(quotients, (0.25, 0.5, 0.75))
    # The quartiles of a normal distribution are 1.349 standard deviations apart; the median of n samples has a
    # standard error of sqrt(pi / 2) = 1.253 standard deviations over sqrt(n).
    noise = 1.253 * (high - low) / 1.349 / np.sqrt(len(quotients))
    return Ratio(float(median), float(high - low), float(noise))


def floor_times(found: Mapping[str, Samples]) -> Samples:
    """Samples of the floor itself, over all draws of it beside the others."""
    floors = [one for samples in found.values() for one in samples.floors]
    return Samples(floors, floors)
