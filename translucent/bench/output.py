"""A report as files, and as text for terminals: ``report.json``, ``.csv``, ``.html`` and ``.svg`` in a folder."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args, get_type_hints

from translucent.bench.figures import require_packages
from translucent.bench.record import CaseRecord, MethodRow, Report, ShadowRow, Shadows
from translucent.errors import RenderError
from translucent.files.folders import made_folder
from translucent.files.paths import require_folder, write_text_atomically
from translucent.files.reading import read_text
from translucent.files.tables import csv_text

#: Largest size of a report in bytes: it holds pictures.
_LARGEST = 1 << 28

_HEAD = (
    f"{'method':<38}{'ms':>8}{'p95':>8}{'÷ floor':>9}{'±':>6}{'frame':>7}{'passes':>7}{'layers':>7}{'ms/layer':>9}"
    f"{'RMS':>9}{'p99.9':>9}{'invalid':>9}"
)
#: Of cases with a path traced truth: errors as fractions of its mean.
_SCATTERED_HEAD = _HEAD[: _HEAD.index("RMS") - 6] + f"{'nRMSE':>9}{'4x4':>9}{'bias r':>8}{'g':>8}{'b':>8}{'ms once':>9}"


def write_report(report: Report, path: Path) -> None:
    """Write ``report.json``: complete, or not at all."""
    write_text_atomically(path, report.to_json())


def read_report(path: Path) -> Report:
    """Read the report of a file.

    Raises
    ------
    InputError
        If it cannot be read, or is no report.
    """
    text = read_text(path, f"report {str(path)!r}", _LARGEST, do="give a report.json")
    return Report.from_json(text, path.name)


def write_csv(report: Report, path: Path) -> None:
    """Write the rows of all cases, one a line, under the names of their fields: ``thickness.rms``, ``wall.median``."""
    hints, columns = get_type_hints(MethodRow), ["case", "quantity", "triangles", "size", "compared_size"]
    for name, hint in hints.items():
        group = [kind for kind in get_args(hint) if dataclasses.is_dataclass(kind)]
        columns += [f"{name}.{part.name}" for kind in group for part in dataclasses.fields(kind)] or [name]
    write_text_atomically(path, csv_text(columns, (_flat(case, row) for case in report.cases for row in case.rows)))


def _flat(case: CaseRecord, row: MethodRow) -> dict[str, Any]:
    line: dict[str, Any] = {
        "case": case.name,
        "quantity": case.quantity,
        "triangles": case.triangles,
        "size": "x".join(map(str, case.size)),
        "compared_size": "x".join(map(str, case.compared_size)),
    }
    for name, value in dataclasses.asdict(row).items():
        for part, number in value.items() if isinstance(value, dict) else [("", value)]:
            if number is not None or part:
                # Numbers of the channels with spaces between them.
                shown = " ".join(map(str, number)) if isinstance(number, tuple) else number
                line[f"{name}.{part}" if part else name] = shown
    return line


@contextmanager
def checked_folder(folder: Path) -> Iterator[None]:
    """Make the folder if it is not there, and raise before any work is done where nothing could be written into it.

    After an error a folder that was made and is empty is removed.

    Raises
    ------
    InputError
        If its name, or that of a folder above, is one of a file.
    RenderError
        If it cannot be made or written to, or what draws the page is not installed.
    """
    require_folder(folder, f"output {str(folder)!r}")
    require_packages()
    with made_folder(folder):
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise RenderError(
                f"output {str(folder)!r}",
                f"it is no folder that can be written to ({error.strerror or error})",
                "check its permissions",
            ) from error
        yield


def write_outputs(report: Report, folder: Path) -> list[Path]:
    """Write ``report.json``, ``.csv``, ``.html`` and ``.svg`` into a folder, each complete or not at all.

    The figure is left out where no scene has numbers, and one of an earlier report removed.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    RenderError
        If a file cannot be written.
    """
    from translucent.bench.page import build_page
    from translucent.bench.plots import overview_svg

    write_report(report, folder / "report.json")
    write_csv(report, folder / "report.csv")
    write_text_atomically(folder / "report.html", build_page(report))
    names = ["report.json", "report.csv", "report.html"]
    figure = overview_svg(report)
    if figure is None:
        (folder / "report.svg").unlink(missing_ok=True)
    else:
        write_text_atomically(folder / "report.svg", figure)
        names.append("report.svg")
    return [folder / name for name in names]


def table(report: Report) -> str:
    """Every row of every case, hard cases and claims, as aligned text."""
    return "\n".join(_lines(report))


def _lines(report: Report) -> Iterator[str]:
    made = report.provenance
    yield f"{made.renderer}, {made.processors} processors; {report.seconds:.0f} s of measuring"
    for case in report.cases:
        yield ""
        yield (
            f"{case.title}: {case.why}; {case.triangles} triangles, {case.layers} layers, "
            f"{case.size[0]}x{case.size[1]}; errors in {case.quantity}; * on the Pareto frontier"
        )
        if case.failure:
            yield f"  failed: {case.failure}"
            continue
        head = _HEAD if case.truth_noise is None else _SCATTERED_HEAD
        yield head + (f"{'RMS of 16':>11}" if any(row.sampled for row in case.rows) else "")
        yield from (_row(case, row) for row in case.rows)
    yield from _shadow_lines(report.shadows)
    if report.hard_cases:
        yield ""
        passed = sum(case.passed for case in report.hard_cases)
        yield f"hard cases: {passed} of {len(report.hard_cases)} hold"
        yield from (f"  {case.id} {case.title}: {case.result}" for case in report.hard_cases if not case.passed)
    if report.claims:
        yield ""
    for claim in report.claims:
        state = {True: "held", False: "NOT HELD", None: "undecided" if claim.undecided else "not checked"}[claim.held]
        yield f"{state}: {claim.text}: {claim.measured}"


def _shadow_lines(shadows: Shadows) -> Iterator[str]:
    for case in shadows.cases:
        yield ""
        yield f"shadow, {case.title}: {case.why}; {case.triangles} triangles; errors in transmittance"
        if case.failure:
            yield f"  failed: {case.failure}"
            continue
        if case.texels is not None:
            found = f"median {case.texels.median:.1e}, p99.9 {case.texels.p999:.1e}"
            yield f"  in the rays of {case.texel_size} x {case.texel_size} texels: {found}"
        yield f"{'method':<38}{'÷ depth':>9}{'±':>6}{'median':>9}{'p99':>9}{'p99.9':>9}{'with outlines, mean':>21}"
        for row in case.rows:
            if row.errors is None:
                yield _unmeasured(row.method, row)
                continue
            errors = f"{row.errors.median:>9.1e}{row.errors.p99:>9.1e}{row.errors.p999:>9.1e}{row.edges or 0.0:>21.1e}"
            yield f"{row.method:<38}{_ratio(row)}{errors}"
    for sky in shadows.sky:
        yield f"{sky.environment}, {sky.directions} directions: error {sky.error:.1%} of the mean, {sky.seconds:.2f} s"
    for caustic in shadows.caustics:
        for one in caustic.rows:
            found = f"power {one.power:+.2%}, nRMSE {one.nrmse:.3f}, at most {one.most:.3f}, {one.seconds:.1f} s"
            yield f"caustic, {caustic.title}, {one.photons:,} photons: {found}"
    for medium in shadows.media:
        for one in medium.rows:
            found = f"mean {one.power:+.1%}, nRMSE {one.nrmse:.3f}, at most {one.most:.3f}, {one.seconds:.1f} s"
            yield f"caustic in {medium.title.lower()}, {one.photons:,} photons: {found}"


def _ratio(row: MethodRow | ShadowRow) -> str:
    return f"{row.ratio.median:>9.2f}{row.ratio.noise:>6.2f}" if row.ratio else f"{'':>15}"


def _unmeasured(name: str, row: MethodRow | ShadowRow) -> str:
    return f"{name:<38}{'failed' if row.failure else 'refused'}: {row.failure or row.refusal}"


def _row(case: CaseRecord, row: MethodRow) -> str:
    name = f"{row.method}{' *' if row.pareto else ''}"
    if row.failure or row.refusal or row.wall is None:
        return _unmeasured(name, row)
    line = f"{name:<38}{row.wall.median:>8.2f}{row.wall.p95:>8.2f}{_ratio(row)}"
    line += f"{row.frame_ratio.median:>7.2f}" if row.frame_ratio else f"{'':>7}"
    line += f"{'' if row.passes is None else row.passes:>7}{'' if row.layers is None else row.layers:>7}"
    line += f"{row.ms_per_layer:>9.2f}" if row.ms_per_layer is not None else f"{'':>9}"
    if row.light is not None:
        bias = "".join(f"{one:>+8.1%}" for one in row.light.bias)
        solved = "" if row.light.solve_seconds is None else f"{1e3 * row.light.solve_seconds:.0f}"
        return f"{line}{row.light.nrmse:>9.3f}{row.light.block:>9.3f}{bias}{solved:>9}"
    errors = row.errors(case.quantity)
    line += f"{errors.rms:>9.1e}{errors.p999:>9.1e}" if errors else f"{'':>18}"
    line += f"{row.invalid:>9.2%}" if row.invalid is not None else f"{'':>9}"
    return line + f"{row.sampled.rms:>11.1e}" if row.sampled else line.rstrip()
