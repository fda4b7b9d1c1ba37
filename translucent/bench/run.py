"""A whole report: cases, scaling and hard cases, with what is done kept on the way."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import get_args

from translucent.bench.cases import CASES, Case, Size
from translucent.bench.claims import METHOD_CLAIMS, SCATTERING_CLAIMS, SHADOW_CLAIMS, SLAB_CLAIMS, hard_claim
from translucent.bench.contenders import check_names, contenders
from translucent.bench.drawing import Studio
from translucent.bench.hard.measure import CASES as HARD_CASES
from translucent.bench.hard.measure import measure_hard_cases
from translucent.bench.machine import provenance
from translucent.bench.measure import CaseRun
from translucent.bench.record import Part, Renewal, Report
from translucent.bench.scaling import ScalingRun
from translucent.bench.scattering.slabs import measure_slabs
from translucent.bench.shadows.part import ShadowsRun
from translucent.bench.timing import STEADY, Pace
from translucent.errors import RenderError
from translucent.renderer import Renderer
from translucent.scene.camera import check_size

#: Size of the timed frames.
FULL_SIZE: Size = (512, 512)
QUICK_SIZE: Size = (256, 256)


@dataclasses.dataclass(frozen=True)
class Effort:
    """Effort of a measurement.

    Attributes
    ----------
    case_seconds, step_seconds : float
        Of timing, for each case and for each step of a scaling axis.
    compared : float
        Width and height of the frames that are held against the reference, as a share of what the case wants.
    pace : Pace
        Of timing.
    """

    case_seconds: float
    step_seconds: float
    compared: float
    pace: Pace = STEADY


FULL = Effort(12.0, 2.5, 1.0, Pace(patience=3.0))
QUICK = Effort(0.6, 0.15, 0.4, Pace(long=0.1))

#: Everything that a report claims, judged by its numbers.
CLAIMS = (
    *(*METHOD_CLAIMS, *SCATTERING_CLAIMS, *SLAB_CLAIMS, *SHADOW_CLAIMS),
    hard_claim([case.id for case in HARD_CASES]),
)

#: Callback with what is being measured, the number of steps done, and their total.
Progress = Callable[[str, int, int], None]


def measure_all(
    extra: Sequence[Case] = (),
    *,
    size: Size | None = None,
    methods: Sequence[str] = (),
    quick: bool = False,
    backend: str | None = None,
    effort: Effort | None = None,
    only: Sequence[Part] = (),
    base: Report | None = None,
    command: str = "tl.bench.measure_all(...)",
    progress: Progress = lambda *_: None,
    keep: Callable[[Report], None] = lambda _: None,
) -> Report:
    """Measure everything, on the cases of the toolkit and on others.

    Parameters
    ----------
    extra : sequence of Case
        Scenes to measure on, before those of the toolkit.
    size : (width, height), optional
        Of the timed frames, in pixels; default 512 x 512, with `quick` 256 x 256.
    methods : sequence of str
        Names or families of what to measure, ``"SignedDepth"`` or ``"signed-depth"``; default: all.
    quick : bool
        Fewer cases, methods and repetitions: a minute instead of half an hour.
    backend : str, optional
        Of the renderer; default: what works here.
    effort : Effort, optional
        How long to measure; default: `QUICK` or `FULL`.
    only : sequence of {"scenes", "scaling", "slabs", "shadows", "hard-cases"}
        Parts to measure; default: all.
    base : Report, optional
        What else there is, measured before: these parts are renewed in it, and the report tells so.
    command : str
        What the record says has made it.
    progress : callable
        Hears what is being measured.
    keep : callable
        Gets the unfinished report whenever a part is done.

    Returns
    -------
    Report
        Unfinished (``complete`` False) after a `KeyboardInterrupt`: with all that had been measured before.

    Raises
    ------
    InputError
        If the size, a method or the backend is not one.
    RenderError
        If there is no OpenGL to measure.
    """
    size = check_size(size or (QUICK_SIZE if quick else FULL_SIZE))
    check_names(methods)
    effort = effort or (QUICK if quick else FULL)
    with ExitStack() as stack:
        renderer = stack.enter_context(Renderer(backend))
        if renderer.provenance["backend"] == "cpu":
            raise RenderError("measuring", "there is no OpenGL here", "see 'translucent doctor'")
        cpu = _cpu_renderer(stack)
        stack.enter_context(renderer.gpu.context.current())
        studio = Studio(renderer)
        stack.callback(studio.release)
        made = provenance(renderer, command, quick=quick)
        parts = tuple(part for part in get_args(Part) if part in only or not only)
        report = Report(made) if base is None else dataclasses.replace(base.without(parts), complete=False)
        begin = time.perf_counter()

        def stamped(report: Report, *, complete: bool) -> Report:
            seconds = time.perf_counter() - begin
            if base is None:
                return dataclasses.replace(report, seconds=seconds, complete=complete)
            renewals = (*base.without(parts).renewals, Renewal(parts, made, seconds))
            return dataclasses.replace(report, renewals=renewals, complete=complete and base.complete)

        try:
            cases = [*extra, *(case for case in CASES if case.quick or not quick)] if "scenes" in parts else []
            for report in _measured(report, studio, cpu, cases, parts, size, methods, quick, effort, progress):  # noqa: B020
                report = stamped(report, complete=False)
                keep(report)
        except KeyboardInterrupt:
            return report
        report = stamped(report, complete=True)
    keep(report)
    return report


def _measured(
    report: Report,
    studio: Studio,
    cpu: Renderer | None,
    cases: Sequence[Case],
    wanted: Sequence[Part],
    size: Size,
    methods: Sequence[str],
    quick: bool,
    effort: Effort,
    progress: Progress,
) -> Iterator[Report]:
    """The report after each step of it."""
    scaling, shadows = ScalingRun(studio, effort.step_seconds, quick, effort.pace), ShadowsRun(studio, quick)
    steps = {
        "scaling": sum(len(ladder.steps) for ladder in scaling.ladders()),
        "slabs": 1,
        "shadows": len(shadows.steps()),
        "hard-cases": len(HARD_CASES),
    }
    total, done = len(cases) + sum(steps[part] for part in wanted if part in steps), 0

    def told(what: str) -> None:
        nonlocal done
        progress(what, done, total)
        done += 1

    for case in cases:
        told(f"case {case.name}")
        chosen = contenders(case.effect, quick=quick, brief=case.brief, only=methods)
        run = CaseRun(studio, cpu, case, size, effort.case_seconds, effort.compared, effort.pace)
        report = judged(dataclasses.replace(report, cases=(*report.cases, run.measure(chosen))))
        studio.renderer.gpu.context.drain()
        yield report
    if "scaling" in wanted:
        for name, series in scaling.steps():
            told(f"scaling, {name}")
            report = dataclasses.replace(report, scaling=series)
            studio.renderer.gpu.context.drain()
            yield report
    if "slabs" in wanted:
        told("slabs")
        report = dataclasses.replace(report, slabs=measure_slabs(quick=quick))
        yield report
    if "shadows" in wanted:
        for what, measure in shadows.steps().items():
            told(what)
            report = judged(dataclasses.replace(report, shadows=measure(report.shadows)))
            studio.renderer.gpu.context.drain()
            yield report
    if "hard-cases" in wanted:
        for found in measure_hard_cases(studio.renderer):
            told(f"hard case {found.id}")
            report = dataclasses.replace(report, hard_cases=(*report.hard_cases, found))
    yield judged(report)


def judged(report: Report) -> Report:
    """The report with what its numbers say of the claims."""
    return dataclasses.replace(report, claims=tuple(judge(report) for judge in CLAIMS))


def _cpu_renderer(stack: ExitStack) -> Renderer | None:
    """Renderer without OpenGL, if Embree can be loaded."""
    try:
        return stack.enter_context(Renderer("cpu"))
    except RenderError:
        return None
