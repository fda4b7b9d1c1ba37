"""``translucent report``: speed against error of every method, as a page, a table and a record."""

from __future__ import annotations

import dataclasses
import difflib
import io
import json
import shlex
import sys
import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from translucent.commands.console import FILE, echo, is_terminal
from translucent.commands.model import SceneRequest, read_scene, require_translucent
from translucent.commands.options import FileOptions, MediumOptions, read_size
from translucent.commands.verbs import group, option, takes
from translucent.errors import InputError, RenderError, message_of, printable

if TYPE_CHECKING:
    from translucent.bench.judgement import Agreement
    from translucent.bench.record import CaseRecord, Part, Report, ShadowCase
    from translucent.media.medium import Medium


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Options of ``translucent report``."""

    output: Path | None = option(
        names=("-o", "--output"), metavar="DIR", help="Output folder for report.html, .svg, .json and .csv."
    )
    quick: bool = option(
        False,
        help="Measure roughly, in about a minute, with fewer scenes, methods, pixels and repetitions.",
    )
    size: str | None = option(metavar="WxH", help="Size of the timed pictures in pixels.")
    methods: str | None = option(
        metavar="NAME,...", help="Measure only these thickness methods: signed-depth, k-buffer, ray-marched, ..."
    )
    only: str | None = option(
        metavar="PART,...", help="Measure only these parts: scenes, scaling, slabs, shadows, hard-cases."
    )
    source: Path | None = option(
        names=("--from",),
        metavar="JSON",
        help=(
            "Write the report page again from this report.json, without new measurements. With --only, "
            "measure these parts again."
        ),
    )
    limit: float | None = option(
        metavar="SECONDS", help="Stop measuring after this time. The report lists the scenes that are missing."
    )
    compare: Path | None = option(
        metavar="JSON",
        help="Print which methods are slower or less accurate than in this report.json. If any, the exit code is 1.",
    )
    medium: MediumOptions = group(MediumOptions)
    file: FileOptions = group(FileOptions, without=("draft_extensions",))
    backend: str | None = option(
        metavar="B", help="OpenGL platform: egl, window or osmesa. Default: egl, or osmesa if egl does not work."
    )


@click.command(epilog="Example: translucent report model.stl --unit mm -o out/report --quick")
@click.argument("models", nargs=-1, metavar="[MODEL...]")
@takes(ReportOptions)
def report(models: tuple[str, ...], given: ReportOptions, as_json: bool) -> None:
    """Measure the speed and the error of each method.

    The command measures built-in scenes and each MODEL. A MODEL is a file or the name of a built-in mesh. --color
    or --preset fills each MODEL with a medium, and the report states whether the error of each method would be
    visible. Opaque parts are not measured. Ctrl-C stops the measurements, and the report contains the finished
    scenes. Without -o and --compare, all numbers are printed, and no file is written.
    """
    from translucent.bench.judgement import agreement, compare_reports, machines_differ
    from translucent.bench.output import checked_folder, read_report, table, write_outputs

    parts, source, output, filling = _parts(given.only), given.source, given.output, given.medium
    measuring = models or given.quick or given.size or given.methods or given.backend or given.limit is not None
    if source is not None and not parts and (measuring or filling.color or filling.distance or filling.preset):
        raise InputError(
            f"--from {source}",
            "--from measures nothing, so this option has no effect",
            "omit --from to measure, or omit MODEL, its medium and the options of a measurement",
        )
    if models and parts and "scenes" not in parts:
        do = "add the part scenes, or omit MODEL"
        raise InputError(
            f"--only {given.only}", "a MODEL is measured as one of the scenes, so the part 'scenes' is needed", do
        )
    if given.limit is not None and not given.limit > 0.0:
        raise InputError(f"--limit {given.limit:g}", "the time must be above 0", "give seconds, such as 600")
    medium = filling.read()
    if medium is not None and not models:
        requested = "--color" if filling.preset is None else f"--preset {filling.preset}"
        raise InputError(
            requested,
            "the command needs a MODEL for this medium, because the built-in scenes keep their own media",
            "add a MODEL",
        )
    limited = False
    before = None if given.compare is None else read_report(given.compare)
    made = None if source is None else read_report(source)
    with nullcontext() if output is None else checked_folder(output):
        if made is None or parts:
            begin = time.monotonic()
            made = _measured(models, medium, given, parts, made)
            limited = given.limit is not None and time.monotonic() - begin >= given.limit
        files = [] if output is None else write_outputs(made, output)
    changes = None if before is None else compare_reports(before, made)
    agreed = None if before is None else agreement(before, made)
    if before is not None and (difference := machines_differ(before, made)) is not None:
        echo(f"warning: the two reports come from different machines: {difference}", err=True)
    if as_json:
        echo(json.dumps(_summary(made, files, changes, agreed)))
    else:
        _echo(made, files, changes, agreed)
    if output is None and before is None and not as_json:
        echo(table(made))
    if not made.complete and (source is None or parts):
        if not limited:
            raise click.exceptions.Abort
        reported = message_of(f"not measured within {given.limit:g} s: {', '.join(made.unmeasured)}")
        echo(f"warning: {reported}", err=True)
    worse = [change for change in changes or () if change.worse]
    if made.failures:
        raise RenderError(
            f"report: {len(made.failures)} of its measurements failed",
            f"failed: {'; '.join(made.failures)}",
            "see the messages above",
        )
    if worse:
        count = f"{len(worse)} {'thing' if len(worse) == 1 else 'things'} got worse"
        raise RenderError(f"report --compare {given.compare}", count, str(worse[0]))


def _measured(
    models: tuple[str, ...], medium: Medium | None, given: ReportOptions, parts: tuple[Part, ...], base: Report | None
) -> Report:
    """Measure a report with progress on stderr; each finished scene is in ``report.json`` at once."""
    if base is None:
        echo("preparing the report: the first measurement takes the longest", err=True)
    from translucent.bench.cases import model_cases
    from translucent.bench.output import write_report
    from translucent.bench.run import FULL_SIZE, QUICK_SIZE, ReportRequest, measure_all

    pixels = read_size(given.size) if given.size is not None else QUICK_SIZE if given.quick else FULL_SIZE
    requested = SceneRequest(medium=medium, file=given.file, size=pixels)
    scenes = {}
    for model in models:
        echo(f"reading {printable(model)}", err=True)
        scenes[model] = read_scene(model, requested)
        require_translucent(model, scenes[model])

    def keep(part: Report) -> None:
        if given.output is not None:
            write_report(part, given.output / "report.json")

    watched = is_terminal(sys.stderr)
    with click.progressbar(length=1, file=sys.stderr if watched else io.StringIO(), item_show_func=_item_text) as bar:
        reported = 0, -FILE[1]

        def progress(what: str, done: int, steps: int) -> None:
            nonlocal reported
            bar.length = steps
            bar.update(done - bar.pos, what)
            bar.render_progress()  # without a step it would show nothing new
            now = time.monotonic()
            # Nobody watches the bar in a file: lines report each scene, and now and then its steps.
            if not watched and (done >= reported[0] or now - reported[1] >= FILE[1]):
                reported = done + 1, now
                echo(f"measuring {done + 1} of {steps}: {printable(what)}", err=True)

        return measure_all(
            ReportRequest(
                model_cases(scenes),
                pixels,
                [] if given.methods is None else [name.strip() for name in given.methods.split(",")],
                quick=given.quick,
                backend=given.backend,
                only=parts,
            ),
            base=base,
            limit=given.limit,
            command=_command(models, given),
            progress=progress,
            keep=keep,
        )


def _item_text(what: str | None) -> str:
    return printable(what or "")


def _parts(only: str | None) -> tuple[Part, ...]:
    """Parts that ``--only`` names; none: all."""
    from translucent.bench.record import Part

    known = get_args(Part)
    named = [] if only is None else [name.strip() for name in only.split(",")]
    for name in named:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            do = f"did you mean {close[0]}?" if close else f"use one or more of {', '.join(known)}"
            raise InputError(f"--only {only}", f"the report has no part {name!r}", do)
    return tuple(part for part in known if part in named)


def _command(models: tuple[str, ...], given: ReportOptions) -> str:
    """Command line of the user, as far as it states what was measured."""
    medium = given.medium
    options: dict[str, object] = {
        "-o": given.output,
        "--size": given.size,
        "--methods": given.methods,
        "--backend": given.backend,
    }
    options |= {"--only": given.only, "--from": given.source, "--limit": given.limit}
    options |= {"--color": medium.color, "--distance": medium.distance, "--preset": medium.preset}
    options |= {"--unit": given.file.unit, "--height": given.file.height, "--longest": given.file.longest}
    words = ["translucent", "report", *models]
    for name, value in options.items():
        words += [name, str(value)] if value is not None else []
    words += ["--no-clamp"] if medium.clamp is False else []
    return shlex.join([*words, "--quick"] if given.quick else words)


def _summary(made: Report, files: list[Path], changes: Any, agreed: Agreement | None) -> dict[str, Any]:
    """Summary of a report as values that JSON can hold; ``report.json`` has all of it."""
    return {
        "files": [str(path) for path in files],
        "complete": made.complete,
        "unmeasured": list(made.unmeasured),
        "seconds": made.seconds,
        "answers": [_answer(case) for case in made.cases],
        "shadows": {case.name: _shadow(case) for case in made.shadows.cases},
        "hard_cases": {case.id: case.passed for case in made.hard_cases},
        "claims": {claim.text: claim.held for claim in made.claims},
        "failures": list(made.failures),
        "changes": None if changes is None else [dataclasses.asdict(change) for change in changes],
        "agreement": None if agreed is None else dataclasses.asdict(agreed),
    }


def _shadow(case: ShadowCase) -> dict[str, Any]:
    return {
        "p999_error_in_texels": None if case.texels is None else case.texels.p999,
        "order_with_outlines": case.order,
    }


def _answer(case: CaseRecord) -> dict[str, Any]:
    from translucent.bench.judgement import advise, error_of, visibility_words

    advice = advise(case)
    if advice is None or advice.row.ratio is None:
        return {"case": case.name, "method": None}
    return {
        "case": case.name,
        "method": advice.row.method,
        "ratio": advice.row.ratio.median,
        "quantity": case.quantity,
        "rms_error": error_of(advice.row, case.quantity),
        "p999_error": None if (errors := advice.row.errors(case.quantity)) is None else errors.p999,
        "good_enough": advice.good_enough,
        "seen": visibility_words(advice.row) or None,
        "cheaper": None if advice.cheaper is None else advice.cheaper.method,
        "cheaper_seen": None if advice.cheaper is None else visibility_words(advice.cheaper) or None,
    }


def _echo_visibility(answer: dict[str, Any]) -> None:
    """Print whether the difference is visible, in the model's own medium."""
    if answer["seen"]:
        echo(f"  with it, {answer['seen']}")
    if answer["cheaper_seen"]:
        echo(f"  with {answer['cheaper']}, which is faster, {answer['cheaper_seen']}")


def _echo(made: Report, files: list[Path], changes: Any, agreed: Agreement | None) -> None:
    from translucent.bench.record import MODEL_CASE

    echo(f"{made.provenance.renderer}, {made.provenance.driver}; {made.seconds:.0f} s")
    if made.cases:
        echo(f"{'scene':<20} {'cheapest that is good enough':<30} {'/ floor':>8} {'RMS error':>10} {'p99.9':>8}")
    for answer in map(_answer, made.cases):
        if answer["method"] is None:
            echo(f"{answer['case']:<20} -")
            continue
        mark = "" if answer["good_enough"] else "  (not good enough, although the most accurate)"
        numbers = f"{answer['ratio']:>8.2f} {answer['rms_error']:>10.1e} {answer['p999_error']:>8.1e}"
        echo(f"{answer['case']:<20} {answer['method']:<30} {numbers} {answer['quantity']}{mark}")
        if answer["case"].startswith(MODEL_CASE):
            _echo_visibility(answer)
    for case in made.shadows.cases:
        if case.texels is not None and case.order is not None:
            found = f"p99.9 {case.texels.p999:.1e} in rays of texels, order {case.order:.1f} with outlines"
            echo(f"{'shadow, ' + case.name:<20} {found}")
    for claim in made.claims:
        if claim.held is False or claim.undecided:
            verdict = "undecided" if claim.undecided else "does not hold"
            echo(f"{verdict}: {claim.text}; {claim.measured}")
    if changes is not None:
        for change in changes:
            echo(str(change))
        if not changes:
            echo("no method became slower or less accurate, within the noise")
        echo(str(agreed))
    for path in files:
        echo(str(path))
