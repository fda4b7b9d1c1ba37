"""A whole report: all experiments, with finished scenes kept on the way, and its provenance."""

from __future__ import annotations

import dataclasses
import os
import platform
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, get_args

from translucent.bench.cases import CASES, Case
from translucent.bench.caustics import CAUSTIC_SCENES, GroundCaustics, MediumCaustics, SkyShadows
from translucent.bench.contenders import check_names
from translucent.bench.drawing import FULL, QUICK, BenchContext, Effort, Size
from translucent.bench.experiment import Experiment
from translucent.bench.hard_light import HardCases
from translucent.bench.methods import CostScaling, MethodComparison
from translucent.bench.record import Part, Provenance, Renewal, Report
from translucent.bench.shadows import SHADOW_SCENES, ShadowMapComparison
from translucent.bench.slabs import SlabComparison
from translucent.errors import RenderError
from translucent.renderer import Renderer
from translucent.scene.camera import check_size

#: Size of the timed frames.
FULL_SIZE: Size = (512, 512)
QUICK_SIZE: Size = (256, 256)

#: Packages on which results and times depend.
PACKAGES = ("numpy", "moderngl", "scipy", "trimesh", "embreex")

#: Seed of all random numbers: those of ray marching, which every frame starts anew.
SEED = 0

#: Callback with what is being measured, the number of steps done, and their total.
Progress = Callable[[str, int, int], None]


def experiments(quick: bool, extra: Sequence[Case] = (), methods: Sequence[str] = ()) -> tuple[Experiment[Any], ...]:
    """All experiments of a report, in order; shorter ones if `quick`."""
    if not quick:
        return (
            MethodComparison((*extra, *CASES), methods),
            CostScaling(),
            SlabComparison(),
            ShadowMapComparison(),
            SkyShadows(),
            GroundCaustics(),
            MediumCaustics(),
            HardCases(),
        )
    slabs = SlabComparison()
    return (
        MethodComparison((*extra, *(case for case in CASES if case.quick)), methods, quick=True),
        CostScaling(quick=True),
        dataclasses.replace(slabs, albedos=slabs.albedos[::2], anisotropies=slabs.anisotropies[:1]),
        ShadowMapComparison(
            [one for one in SHADOW_SCENES if one.quick], (512, 1024), texels=128, pixels=128, seconds=0.1
        ),
        SkyShadows(environments=("sky",), directions=(8, 32), size=(24, 18), strata=12),
        GroundCaustics([one for one in CAUSTIC_SCENES if one.quick], (62_500,), 10_000, (80, 60)),
        MediumCaustics(()),  # their truths take minutes
        HardCases(),
    )


@dataclass(frozen=True)
class ReportRequest:
    """Request for a report: scenes, methods and parts to measure, and the effort.

    Attributes
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
    """

    extra: Sequence[Case] = ()
    size: Size | None = None
    methods: Sequence[str] = ()
    quick: bool = False
    backend: str | None = None
    effort: Effort | None = None
    only: Sequence[Part] = ()

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts to measure, in the order of the report."""
        return tuple(part for part in get_args(Part) if part in self.only or not self.only)


def measure_all(
    request: ReportRequest,
    *,
    base: Report | None = None,
    limit: float | None = None,
    command: str = "tl.bench.measure_all(...)",
    progress: Progress = lambda *_: None,
    keep: Callable[[Report], None] = lambda _: None,
) -> Report:
    """Measure what is requested.

    Parameters
    ----------
    request : ReportRequest
    base : Report, optional
        What else there is, measured before: these parts are renewed in it, as the report notes.
    limit : float, optional
        Seconds after which measuring ends as by a `KeyboardInterrupt`; on Windows, and outside the main thread, once
        the scene that is measured is done.
    command : str
        What the record says has made it.
    progress : callable
        Hears what is being measured.
    keep : callable
        Gets the unfinished report whenever a scene is done.

    Returns
    -------
    Report
        Unfinished (``complete`` False) after a `KeyboardInterrupt`: with all that had been measured before, and the
        names of what had not.

    Raises
    ------
    InputError
        If the size, a method or the backend is not one.
    RenderError
        If there is no OpenGL to measure.
    """
    size = check_size(request.size or (QUICK_SIZE if request.quick else FULL_SIZE))
    check_names(request.methods)
    parts, effort = request.parts, request.effort or (QUICK if request.quick else FULL)
    with opened(request.backend, size, effort) as bench:
        made = provenance(bench.renderer, command, quick=request.quick)
        every = experiments(request.quick, request.extra, request.methods)
        begin = time.perf_counter()

        def stamped(found: Report, *, complete: bool) -> Report:
            seconds = time.perf_counter() - begin
            if base is None:
                return dataclasses.replace(found, seconds=seconds, complete=complete)
            renewals = (*base.without(parts).renewals, Renewal(parts, made, seconds))
            return dataclasses.replace(found, renewals=renewals, complete=complete and base.complete)

        names = [name for name, _, _ in _steps(bench, every, parts)]
        report = Report(made) if base is None else base.without(parts)
        others = tuple(name for name in report.unmeasured if name not in names)
        report = stamped(dataclasses.replace(report, unmeasured=(*others, *names)), complete=False)
        try:
            with _alarm(limit):
                for number, found in enumerate(measured(bench, every, parts, report, progress), 1):
                    left = (*others, *names[number:])
                    report = stamped(dataclasses.replace(found, unmeasured=left), complete=False)
                    keep(report)
                    if limit is not None and time.perf_counter() - begin >= limit and number < len(names):
                        raise KeyboardInterrupt
        except KeyboardInterrupt:
            return report
        report = stamped(report, complete=True)
    keep(report)
    return report


@contextmanager
def opened(backend: str | None, size: Size, effort: Effort) -> Iterator[BenchContext]:
    """Open the renderers that measurements need.

    Raises
    ------
    RenderError
        If there is no OpenGL to measure.
    """
    with ExitStack() as stack:
        renderer = stack.enter_context(Renderer(backend))
        if renderer.provenance["backend"] == "cpu":
            raise RenderError(
                "measuring", "no OpenGL is available on this machine", "run 'translucent doctor' to find out why"
            )
        try:
            cpu = stack.enter_context(Renderer("cpu"))
        except RenderError:  # Embree cannot be loaded
            cpu = None
        stack.enter_context(renderer.gpu.context.current())
        bench = BenchContext(renderer, cpu, size, effort)
        stack.callback(bench.release)
        yield bench


def measured(
    bench: BenchContext,
    every: Sequence[Experiment[Any]],
    parts: Sequence[Part],
    report: Report,
    progress: Progress = lambda *_: None,
) -> Iterator[Report]:
    """Measure the experiments of some parts, and yield the report after each scene."""
    steps = _steps(bench, every, parts)
    for done, (name, experiment, scene) in enumerate(steps):
        progress(name, done, len(steps))
        bench.doing = lambda doing, name=name, done=done: progress(f"{name}, {doing}", done, len(steps))  # type: ignore[misc]
        report = experiment.added(report, experiment.measure(bench, scene))
        claims = tuple(judge(report) for one in every for judge in one.claims)
        report = dataclasses.replace(report, claims=claims)
        bench.renderer.gpu.context.drain()
        yield report


def _steps(
    bench: BenchContext, every: Sequence[Experiment[Any]], parts: Sequence[Part]
) -> list[tuple[str, Experiment[Any], Any]]:
    """Name, experiment and scene of each step of these parts."""
    requested = [(one, scene) for one in every if one.part in parts for scene in one.scenes(bench)]
    return [(f"{one.label}{scene.name}", one, scene) for one, scene in requested]


@contextmanager
def _alarm(seconds: float | None) -> Iterator[None]:
    """Raise `KeyboardInterrupt` within, after some seconds, where the system can."""
    if sys.platform == "win32" or seconds is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def provenance(renderer: Renderer, command: str, *, quick: bool) -> Provenance:
    """Provenance of a report that is begun now."""
    found = renderer.provenance
    commit, dirty = _commit(Path(__file__).parents[2])
    return Provenance(
        command=command,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        platform=platform.platform(),
        processor=processor_name(),
        processors=os.cpu_count() or 1,
        backend=found["backend"],
        renderer=found["renderer"],
        driver=found["driver"],
        software="software" in found["renderer"],
        versions={"translucent": found["translucent"], "python": found["python"], **_versions()},
        commit=commit,
        dirty=dirty,
        seed=SEED,
        quick=quick,
    )


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def processor_name() -> str:
    """Name of the CPU, from Linux, or from Python elsewhere."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _commit(root: Path) -> tuple[str | None, bool | None]:
    """Commit of a checkout, and whether tracked files have changed since; None without one."""
    if not (root / ".git").exists():
        return None, None

    def git(*arguments: str) -> str:
        command = ["git", *arguments]
        return subprocess.run(command, cwd=root, capture_output=True, text=True, check=True, timeout=30).stdout.strip()

    try:
        return git("rev-parse", "HEAD"), bool(git("status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return None, None
