"""Measurement of a case: every contender drawn, timed and compared with the reference."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

from translucent.bench.cases import Case
from translucent.bench.contenders import Contender
from translucent.bench.drawing import Drawing, Floor, Size, Studio
from translucent.bench.fitting import fitted
from translucent.bench.judgement import mark_frontier
from translucent.bench.promise import promise_of
from translucent.bench.record import CaseRecord, ErrorStatistics, MethodRow, Quantity
from translucent.bench.staging import drawing, plan_of, seen_by
from translucent.bench.timing import STEADY, Pace, Samples, interleaved, ratio, timing
from translucent.bench.truth import Truth
from translucent.errors import InputError, TranslucentError, TranslucentWarning
from translucent.frames.frame import Frame
from translucent.gpu.targets import Targets
from translucent.planning.render_plan import RenderPlan
from translucent.planning.scattering import SingleScattering
from translucent.renderer import Renderer
from translucent.scene.scene import Scene

#: Samples of each pixel of the pictures that tell what more of them gain on interfaces.
SAMPLES = 16

#: Quantity by which the methods of a case are ranked.
QUANTITY: dict[str, Quantity] = {
    "absorption": "thickness",
    "sheet": "thickness",
    "emission": "radiance",
    "scattering": "radiance",
    "density": "radiance",
    "interfaces": "radiance",
    "multiple scattering": "radiance",
}


@dataclass
class _Entry:
    """Contender under measurement."""

    contender: Contender
    row: MethodRow
    scene: Scene
    assumed: float = 0.0
    drawn: Drawing | None = None
    frame: Frame | None = None


@dataclass
class CaseRun:
    """Measurement of one case.

    Parameters
    ----------
    studio : Studio
    cpu : Renderer, optional
        Of the backend ``cpu``, where it works.
    case : Case
    size : (width, height)
        Of the timed frames.
    seconds : float
        For timing.
    compared : float
        Width and height of the frames that are held against the reference, as a share of what the case wants.
    pace : Pace
        Of timing.
    """

    studio: Studio
    cpu: Renderer | None
    case: Case
    size: Size
    seconds: float
    compared: float = 1.0
    pace: Pace = STEADY
    _entries: list[_Entry] = field(default_factory=list)

    def measure(self, contenders: Sequence[Contender]) -> CaseRecord:
        """Measure all rows and pictures of the case. What fails is a row with its reason; the rest goes on."""
        case = self.case
        self.size = self.size[0] // case.shrink or 1, self.size[1] // case.shrink or 1
        blank = CaseRecord(case.name, case.title, case.why, QUANTITY[case.effect], size=self.size)
        try:
            scene = case.scene(self.size)
            small = scaled(self.size, round(case.compared * self.compared))
            truth = self._truth(scene, small)
            small = truth.frame.size
        except Exception as error:  # noqa: BLE001 - a scene that cannot be traced leaves the other cases alone
            return dataclasses.replace(blank, failure=one_line(error))
        blank = _described(blank, scene, truth, small)
        if not blank.compared_pixels:
            return dataclasses.replace(blank, failure=_untrusted(scene))
        pictures = [truth.picture("reference", truth.frame, blank.quantity)]
        for contender in contenders:
            entry = self._compared(contender, scene, truth, small, blank)
            if entry.frame is not None and case.effect in contender.pictured:
                pictures.append(truth.picture(contender.name, entry.frame, blank.quantity))
            entry.frame = None
            self._entries.append(entry)
        rows = mark_frontier(self._timed(scene), blank.quantity)
        self.studio.forget_light()
        return dataclasses.replace(blank, rows=rows, pictures=tuple(pictures))

    def _truth(self, scene: Scene, size: Size) -> Truth:
        case = self.case
        if case.stored:
            return Truth.stored(case.name, scene)
        trace = Truth.over_pixels if case.effect == "interfaces" else Truth.of
        return trace(scene, size, case.tolerance)

    def _compared(self, contender: Contender, scene: Scene, truth: Truth, size: Size, case: CaseRecord) -> _Entry:
        """Draw the contender once, small, and compare it with the reference."""
        seen = seen_by(contender, scene)
        row = MethodRow(contender.name, contender.family, _parameters(contender), contender.kind, "", False)
        entry = _Entry(contender, row, seen)
        if (refusal := contender.refusal(scene)) is not None:
            entry.row = dataclasses.replace(row, refusal=refusal)
            return entry
        targets = Targets(self.studio.gl, size)
        try:
            plan = plan_of(self.studio, contender, seen, self.cpu)
            entry.contender, entry.assumed = fitted(self.studio, contender, seen, truth.frame, size)
            plan = plan_of(self.studio, entry.contender, seen, self.cpu)
            row = dataclasses.replace(row, parameters=_parameters(entry.contender, plan, entry.assumed))
            drawn = drawing(self.studio, entry.contender, seen, plan, targets, entry.assumed, self.cpu)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", TranslucentWarning)  # rows tell what pixels are not valid
                    drawn.draw()
                    entry.frame = drawn.read()
                entry.row = _against(row, entry, drawn, truth, case, plan)
                if self.case.effect == "interfaces" and contender.samplable:
                    entry.row = dataclasses.replace(entry.row, sampled=self._sampled(contender, seen, truth, size))
            finally:
                drawn.release()
        except InputError as error:  # the planner's answer
            entry.row = dataclasses.replace(row, refusal=one_line(error))
        except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
            entry.row = dataclasses.replace(row, failure=one_line(error))
        finally:
            targets.release()
        return entry

    def _sampled(self, contender: Contender, scene: Scene, truth: Truth, size: Size) -> ErrorStatistics | None:
        """Errors in radiance with `SAMPLES` samples of each pixel."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)
            if contender.technique == "cpu":
                assert self.cpu is not None, "it has drawn before"
                frame = self.cpu.render(scene, size, samples=SAMPLES, scattering=SingleScattering())
            else:
                renderer = self.studio.renderer
                frame = renderer.render(scene, size, samples=SAMPLES, interfaces=contender.interfaces)
        found = truth.errors(frame, "radiance")
        return None if found is None else found[0]

    def _timed(self, scene: Scene) -> list[MethodRow]:
        """The rows with their times, the floor first."""
        studio = self.studio
        targets = Targets(studio.gl, self.size)
        floor = Floor(studio, scene, targets)
        ready = [entry for entry in self._entries if entry.row.failure is None and entry.row.refusal is None]
        failures: dict[str, Exception] = {}
        try:
            drawings: dict[str, Callable[[], Any]] = {}
            for entry in ready:
                try:
                    plan = plan_of(studio, entry.contender, entry.scene, self.cpu)
                    entry.drawn = drawing(studio, entry.contender, entry.scene, plan, targets, entry.assumed, self.cpu)
                    drawings[entry.row.method] = entry.drawn.draw
                except Exception as error:  # noqa: BLE001 - whatever it is belongs in the row
                    failures[entry.row.method] = error
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TranslucentWarning)
                found = interleaved(
                    floor.draw,
                    drawings,
                    self.seconds,
                    lambda name, error: failures.update({name: error}),
                    self.pace,
                )
                for entry in ready:
                    if entry.contender.method.peels and entry.row.method in found:
                        entry.row = _peeled(entry)
        finally:
            for entry in ready:
                if entry.drawn is not None:
                    entry.drawn.release()
            floor.release()
            targets.release()
        if self.case.effect in ("interfaces", "multiple scattering"):
            found = {name: one.of_whole_frames for name, one in found.items()}
        rows = [
            _with_times(entry.row, found.get(entry.row.method), failures, peeled=entry.contender.method.peels)
            for entry in self._entries
        ]
        return [_floor_row(list(found.values())), *rows]


def scaled(size: Size, longest: int) -> Size:
    """Scale a size so that no side is longer than this."""
    share = min(1.0, longest / max(size))
    return max(1, round(size[0] * share)), max(1, round(size[1] * share))


def one_line(error: Exception) -> str:
    """One line of text for an error, as in rows."""
    text = str(error) if isinstance(error, TranslucentError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())


def _described(blank: CaseRecord, scene: Scene, truth: Truth, small: Size) -> CaseRecord:
    diagnoses = [body.mesh.diagnosis for body in scene.bodies]
    media = [body.medium for body in scene.bodies if body.medium is not None]
    return dataclasses.replace(
        blank,
        convex=len(diagnoses) == 1 and diagnoses[0].convex,
        closed=all(found.solid for found in diagnoses),
        absorption_only=not any(medium.emits or medium.scatters for medium in media)
        and not any(body.has_interface for body in scene.bodies)
        and all(body.density is None for body in scene.bodies),
        triangles=sum(len(item.mesh.faces) for item in scene.objects),
        bodies=len(scene.bodies),
        layers=truth.layers,
        compared_size=small,
        diagonal=truth.diagonal,
        compared_pixels=int(truth.compared.sum()),
        reference_seconds=truth.seconds,
        truth_noise=truth.noise,
        truth_rays=truth.rays,
        truth_spread=truth.spread if truth.rays > 1 else 0.0,
    )


def _untrusted(scene: Scene) -> str:
    """Reason why there is nothing to compare."""
    problems = [f"{body.mesh.name!r}: {'; '.join(body.mesh.diagnosis.problems)}" for body in scene.bodies]
    return (
        f"no pixel of the reference can be trusted; {', '.join(problems)}; close the mesh, or declare it a sheet"
        if any(body.mesh.diagnosis.problems for body in scene.bodies)
        else "no pixel is away from silhouettes; ask for a larger --size"
    )


def _parameters(contender: Contender, plan: RenderPlan | None = None, assumed: float = 0.0) -> str:
    """The configuration as Python writes it, or of shortcuts in words, with that of interfaces behind it."""
    if contender.engine is not None:
        return str(contender.engine)
    method, interfaces = contender.method, contender.interfaces
    if plan is not None:
        interfaces = plan.interfaces
        if contender.interfaces is not None:
            method = plan.method
    found = {
        "constant": "best constant in metres",
        "ball": "best diameter in metres",
        "unmarked": "BackFaceDepth() without its mask",
        "half": "SignedDepth(anchored=True) into float16",
        "cpu": 'Renderer(backend="cpu")',
        "march": f"reference.march with {method}",
        "plan": str(method),
        "engine": "",
    }[contender.technique]
    if contender.scattering is not None:
        return str(contender.scattering)
    if assumed:
        found = f"{assumed:.4g} m, of least squared error"
    return found if interfaces is None else f"{found}, {interfaces}"


def _against(
    row: MethodRow, entry: _Entry, drawn: Drawing, truth: Truth, case: CaseRecord, plan: RenderPlan
) -> MethodRow:
    """The row with what the planner promises and what the frame shows."""
    assert entry.frame is not None
    contender, frame = entry.contender, entry.frame
    promise, exact = promise_of(contender, plan, entry.scene, case.quantity)
    found: dict[str, Any] = {}
    for quantity in get_args(Quantity):
        errors = truth.errors(frame, quantity)
        found[quantity] = None if errors is None else errors[0]
        if errors is not None:
            found["invalid"], found["coverage_mismatch"] = errors[1:]
    if case.truth_noise is None:
        found["color_difference"] = truth.color_difference(frame, case.quantity)
    else:  # its noise would be all that is seen
        found["light"] = truth.light_errors(frame, drawn.solve_seconds)
    if "invalid" not in found:
        covered = (frame.coverage | truth.frame.coverage).sum()
        found["invalid"] = float((~frame.valid).sum() / max(covered, 1))
    layers = None if frame.layers is None or frame.truncated is None else int((frame.layers - frame.truncated).max())
    passes = plan.geometry_passes if contender.technique in ("plan", "half", "unmarked") else 1
    return dataclasses.replace(
        row,
        promise=promise,
        exact=exact,
        passes=passes if contender.kind != "cpu" else None,
        layers=layers,
        bytes_per_pixel=drawn.bytes_per_pixel,
        **found,
    )


def _peeled(entry: _Entry) -> MethodRow:
    """The row with the layers and passes of the timed frame: few pixels may need most of them."""
    assert entry.drawn is not None
    entry.drawn.draw()
    frame = entry.drawn.read()
    assert frame.layers is not None
    assert frame.truncated is not None
    layers = int((frame.layers - frame.truncated).max())
    return dataclasses.replace(entry.row, layers=layers, passes=-(-layers // 2) + bool(frame.truncated.any()))


def _with_times(row: MethodRow, samples: Samples | None, failures: dict[str, Exception], *, peeled: bool) -> MethodRow:
    if samples is None:
        if (error := failures.get(row.method)) is None:
            return row
        # It has worked in a smaller frame: what the renderer says on purpose is a limit of this machine.
        if isinstance(error, TranslucentError):
            return dataclasses.replace(row, refusal=one_line(error))
        return dataclasses.replace(row, failure=one_line(error))
    wall = timing(samples.wall)
    return dataclasses.replace(
        row,
        wall=wall,
        gpu=timing(samples.gpu),
        frame=timing(samples.frame),
        ratio=ratio(samples.part, samples.floor),
        frame_ratio=ratio(samples.whole, samples.floor),
        ms_per_layer=wall.median / row.layers if peeled and wall is not None and row.layers else None,
    )


def _floor_row(found: Sequence[Samples]) -> MethodRow:
    """The floor; its time is over all draws of it beside the others."""
    floor = [seconds for samples in found for seconds in samples.floor_wall]
    row = MethodRow(
        "depth only", "depth only", "", "floor", "the cost of drawing the geometry: no thickness", False, passes=1
    )
    if not floor:
        return dataclasses.replace(row, refusal="nothing else has been timed on this scene")
    return dataclasses.replace(row, wall=timing(floor), ratio=ratio(floor, floor))
