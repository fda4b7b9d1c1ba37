"""Methods and shortcuts on scenes, drawn, compared with the reference, timed round robin, and their cost growth."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from translucent.bench.cases import CASES, Case
from translucent.bench.claims import METHOD_CLAIMS, SCATTERING_CLAIMS, Judge
from translucent.bench.contenders import CONTENDERS, Contender, Drawn, contenders, drawn_once
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
from translucent.bench.judgement import mark_frontier
from translucent.bench.record import CaseRecord, MethodRow, Part, Quantity, Report, ScalePoint, Series
from translucent.bench.shapes import lying_torus, placed, plates
from translucent.bench.truth import CaseTruth, StoredTruth, stored_truth
from translucent.errors import InputError, TranslucentError
from translucent.frames.frame import Frame
from translucent.geometry.solids import Sphere
from translucent.gpu.targets import Targets
from translucent.media.medium import Medium
from translucent.planning.bodies import MAX_SLOTS
from translucent.planning.methods import DepthPeeling, FragmentLists, KBuffer, Method, SignedDepth
from translucent.planning.methods.depth_peeling import MAX_LAYERS
from translucent.planning.render_plan import RenderPlan
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import framing, showcase

#: Samples of each pixel of the pictures that show the gain of more samples on interfaces.
SAMPLES = 16

#: Effects of scenes whose methods are ranked by thickness, and effects without passes that find thickness alone.
_BY_THICKNESS = ("absorption", "sheet")
_WHOLE_FRAMES = ("interfaces", "multiple scattering", "all light")


@dataclass
class MeasuredScene:
    """Scene of a case with its truth, and its record without rows."""

    case: Case
    scene: Scene
    truth: CaseTruth
    record: CaseRecord


@dataclass
class Trial:
    """Contender under measurement: its row so far, the scene as it draws it, and its frame where that is shown."""

    contender: Contender
    scene: Scene
    row: MethodRow
    frame: Frame | None = None


@dataclass(frozen=True)
class MethodComparison(Experiment[Case]):
    """All methods that fit the effect of each scene, and the shortcuts of other renderers.

    Parameters
    ----------
    shown : sequence of Case
    methods : sequence of str
        Names or families of contenders; default: all.
    quick : bool
        Fewer contenders.
    chosen : sequence of Contender
        These alone, on all scenes.
    """

    part: ClassVar[Part] = "scenes"
    label: ClassVar[str] = "case "
    into: ClassVar[str] = "cases"
    claims: ClassVar[tuple[Judge, ...]] = (*METHOD_CLAIMS, *SCATTERING_CLAIMS)

    shown: Sequence[Case] = CASES
    methods: Sequence[str] = ()
    quick: bool = False
    chosen: Sequence[Contender] = ()

    def blank(self, bench: BenchContext, case: Case) -> CaseRecord:
        """Record of a case without numbers."""
        quantity: Quantity = "thickness" if case.effect in _BY_THICKNESS else "radiance"
        size = bench.size[0] // case.shrink or 1, bench.size[1] // case.shrink or 1
        return CaseRecord(case.name, case.title, case.why, quantity, size=size)

    def truth(self, bench: BenchContext, case: Case) -> MeasuredScene:
        """Trace the truth of a case, or take the stored one."""
        blank = self.blank(bench, case)
        size, scene = blank.size, case.scene(blank.size)
        part = min(1.0, round(case.compared * bench.effort.compared) / max(size))
        small = max(1, round(size[0] * part)), max(1, round(size[1] * part))
        if case.paths:
            found = stored_truth(case.name, scene) if case.stored else StoredTruth.traced(scene, small, case.paths)
            truth = CaseTruth.of_paths(scene, found)
        else:
            trace = CaseTruth.over_pixels if case.effect == "interfaces" else CaseTruth.of
            truth = trace(scene, small, case.tolerance)
        diagnoses = [body.mesh.diagnosis for body in scene.bodies]
        media = [body.medium for body in scene.bodies if body.medium is not None]
        record = dataclasses.replace(
            blank,
            convex=len(diagnoses) == 1 and diagnoses[0].convex,
            closed=all(found.solid for found in diagnoses),
            absorption_only=not any(medium.emits or medium.scatters for medium in media)
            and not any(body.has_interface for body in scene.bodies)
            and all(body.density is None for body in scene.bodies),
            triangles=sum(len(item.mesh.faces) for item in scene.objects),
            bodies=len(scene.bodies),
            layers=truth.layers,
            compared_size=truth.frame.size,
            diagonal=truth.diagonal,
            compared_pixels=int(truth.compared.sum()),
            reference_seconds=truth.seconds,
            truth_noise=truth.noise,
            truth_rays=truth.rays,
            truth_spread=truth.spread if truth.rays > 1 else 0.0,
        )
        return MeasuredScene(case, scene, truth, record)

    def contenders(self, on: MeasuredScene) -> Sequence[Contender]:
        """Contenders that fit the effect of a case; none where there is nothing to compare."""
        case = on.case
        if not on.record.compared_pixels:
            return ()
        return self.chosen or contenders(case.effect, quick=self.quick, brief=case.brief, only=self.methods)

    def row(self, bench: BenchContext, on: MeasuredScene, contender: Contender) -> Trial:
        """Draw the contender once, small, and compare it with the truth."""
        scene = contender.scene(on.scene)
        row = MethodRow(contender.name, contender.family, contender.parameters(None), contender.kind, "", False)
        if (refusal := contender.refusal(on.scene)) is not None:
            return Trial(contender, scene, dataclasses.replace(row, refusal=refusal))
        try:
            contender.plan(bench, scene)
            contender = contender.fitted(bench, scene, on.truth.frame)
            plan = contender.plan(bench, scene)
            row = dataclasses.replace(row, parameters=contender.parameters(plan))
            drawn = drawn_once(bench, contender, scene, plan, on.truth.frame.size)
            row = _compared(row, contender, scene, plan, drawn, on)
            several = contender.shortcut is None and not contender.method.follows_paths  # samples are another picture
            if on.case.effect == "interfaces" and several:
                found = on.truth.errors(contender.sampled(bench, scene, drawn.frame.size, SAMPLES), "radiance")
                row = dataclasses.replace(row, sampled=None if found is None else found[0])
        except InputError as error:  # the planner's answer
            return Trial(contender, scene, dataclasses.replace(row, refusal=one_line(error)))
        except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
            return Trial(contender, scene, dataclasses.replace(row, failure=one_line(error)))
        return Trial(contender, scene, row, drawn.frame if on.case.effect in contender.pictured else None)

    def record(self, bench: BenchContext, blank: Any, on: MeasuredScene, rows: Sequence[Trial]) -> CaseRecord:
        """Record of a case, with the times of all rows, the floor first."""
        if not on.record.compared_pixels:
            return dataclasses.replace(on.record, failure=_untrusted(on.scene))
        quantity = on.record.quantity
        frames = [("reference", on.truth.frame)]
        frames += [(one.row.method, one.frame) for one in rows if one.frame is not None]
        pictures = tuple(on.truth.picture(name, frame, quantity) for name, frame in frames)
        working = {one.row.method: one for one in rows if one.row.failure is None and one.row.refusal is None}

        def maker(one: Trial) -> Callable[[Targets], Drawing]:
            return lambda targets: one.contender.drawing(
                bench, one.scene, one.contender.plan(bench, one.scene), targets
            )

        def finished(name: str, drawing: Drawing) -> None:
            if working[name].contender.method.peels:
                working[name].row = _peeled(working[name].row, drawing)

        makers = {name: maker(one) for name, one in working.items()}
        seconds = bench.effort.case_seconds
        found, failures = timed_beside_floor(bench, on.scene, on.record.size, makers, seconds, finished)
        if on.case.effect in _WHOLE_FRAMES:
            found = {name: one.of_whole_frames for name, one in found.items()}
        timed = [_with_times(one, found.get(one.row.method), failures.get(one.row.method)) for one in rows]
        bench.forget_light()
        marked = mark_frontier([_floor_row(floor_times(found)), *timed], quantity)
        return dataclasses.replace(on.record, rows=marked, pictures=pictures)


def _untrusted(scene: Scene) -> str:
    """Reason why there is nothing to compare."""
    if not any(body.mesh.diagnosis.problems for body in scene.bodies):
        return "no pixel is away from silhouettes; ask for a larger --size"
    problems = ", ".join(f"{body.mesh.name!r}: {'; '.join(body.mesh.diagnosis.problems)}" for body in scene.bodies)
    return f"no pixel of the reference can be trusted; {problems}; close the mesh, or declare it a sheet"


def _compared(
    row: MethodRow, contender: Contender, scene: Scene, plan: RenderPlan, drawn: Drawn, on: MeasuredScene
) -> MethodRow:
    """The row with its promise and errors."""
    frame = drawn.frame
    promise, exact = contender.promise(plan, scene, on.record.quantity)
    found: dict[str, Any] = {}
    for quantity in get_args(Quantity):
        if (errors := on.truth.errors(frame, quantity)) is not None:
            found[quantity], found["invalid"], found["coverage_mismatch"] = errors
    if on.truth.noise is None:
        found["color_difference"] = on.truth.color_difference(frame, on.record.quantity)
    else:  # its noise would be all that is seen
        found["light"] = on.truth.light_errors(frame, drawn.solve_seconds)
    if "invalid" not in found:
        covered = (frame.coverage | on.truth.frame.coverage).sum()
        found["invalid"] = float((~frame.valid).sum() / max(covered, 1))
    return dataclasses.replace(
        row,
        promise=promise,
        exact=exact,
        passes=contender.passes_of(plan),
        layers=_layers(frame),
        bytes_per_pixel=drawn.bytes_per_pixel,
        **found,
    )


def _layers(frame: Frame) -> int | None:
    """Largest number of surfaces on a ray, of methods that put them in order."""
    return None if frame.layers is None or frame.truncated is None else int((frame.layers - frame.truncated).max())


def _peeled(row: MethodRow, drawing: Drawing) -> MethodRow:
    """The row with the layers and passes of the timed frame: few pixels may need most of them."""
    drawing.draw()
    frame = drawing.read()
    layers = _layers(frame)
    assert layers is not None
    assert frame.truncated is not None
    return dataclasses.replace(row, layers=layers, passes=-(-layers // 2) + bool(frame.truncated.any()))


def _with_times(entry: Trial, samples: Samples | None, error: Exception | None) -> MethodRow:
    row = entry.row
    if samples is None:
        if error is None:
            return row
        # It has worked in a smaller frame: what the renderer says on purpose is a limit of this machine.
        if isinstance(error, TranslucentError):
            return dataclasses.replace(row, refusal=one_line(error))
        return dataclasses.replace(row, failure=one_line(error))
    wall = samples.timing("wall")
    peeled = entry.contender.method.peels and wall is not None and row.layers is not None
    return dataclasses.replace(
        row,
        wall=wall,
        gpu=samples.timing("gpu"),
        frame=samples.timing("frame"),
        ratio=samples.ratio("part"),
        frame_ratio=samples.ratio("whole"),
        ms_per_layer=wall.median / row.layers if peeled else None,  # type: ignore[union-attr,operator]
    )


def _floor_row(floor: Samples) -> MethodRow:
    """The floor; its time is over all draws of it beside the others."""
    promise = "the cost of drawing the geometry: no thickness"
    row = MethodRow("depth only", "depth only", "", "floor", promise, False, passes=1)
    if not floor.drawn:
        return dataclasses.replace(row, refusal="nothing else has been timed on this scene")
    return dataclasses.replace(row, wall=floor.timing("wall"), ratio=floor.ratio("part"))


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
        """The report with one more point in each series."""
        series = {(one.axis, one.method): one for one in report.scaling}
        for new in record:
            old = series.get((new.axis, new.method), dataclasses.replace(new, points=()))
            series[new.axis, new.method] = dataclasses.replace(old, points=(*old.points, *new.points))
        return dataclasses.replace(report, scaling=tuple(series.values()))

    def measure(self, bench: BenchContext, step: ScalingStep) -> list[Series]:
        """Times of each method at one step of an axis, as series of one point; the depth-only floor first."""
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
    return ScalePoint(x, wall=samples.timing("wall"), ratio=samples.ratio("part"))


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
