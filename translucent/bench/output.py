"""A report as files: ``report.json``, ``.csv``, ``.svg`` and a page that needs no network; and as text."""

from __future__ import annotations

import base64
import dataclasses
import io
import math
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

import numpy as np

from translucent.bench import figures
from translucent.bench.claims import SHADOW_CLAIMS, USUAL
from translucent.bench.figures import require_packages
from translucent.bench.judgement import (
    ERROR_FLOOR,
    GOOD_ENOUGH,
    MAX_INVALID,
    WORST,
    advise,
    error_of,
    summarize,
    visibility_words,
)
from translucent.bench.plots import AXES, UNITS, pareto_svg, plotted, scaling_groups, scaling_svg, shadow_plots
from translucent.bench.record import MODEL_CASE, CaseRecord, MethodRow, Report, ReportPicture, Shadows, Slab, TimedRow
from translucent.errors import RenderError
from translucent.files.paths import csv_text, made_folder, require_folder, write_text_atomically
from translucent.files.reading import read_text

if TYPE_CHECKING:
    from jinja2 import Environment


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
                text = " ".join(map(str, number)) if isinstance(number, tuple) else number
                line[f"{name}.{part}" if part else name] = text
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
                f"the folder is not writable ({error.strerror or error})",
                "check the permissions of the folder",
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


def _ratio(row: TimedRow) -> str:
    return f"{row.ratio.median:>9.2f}{row.ratio.noise:>6.2f}" if row.ratio else f"{'':>15}"


def _unmeasured(name: str, row: TimedRow) -> str:
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


#: Rows of a legend that stands beside its plot; longer ones stand below.
MOST_BESIDE = 22

#: Magnitudes of errors at which the color of a heat map changes: anything below the first has none.
STEPS = tuple(10.0**exponent for exponent in range(-7, 0))

#: Indices of colors in a heat map: none, and two stripes. Pixels from one stripe to the next.
_TRANSPARENT = 2 * len(STEPS) + 1
_STRIPE, _HATCH = _TRANSPARENT + 1, 6

#: Errors of slabs that are good, and that are bearable.
_GOOD, _BEARABLE = 0.03, 0.05


def build_page(report: Report) -> str:
    """The page as HTML. The same record gives the same text.

    Raises
    ------
    RenderError
        If the packages of the extra ``report`` are not installed.
    """
    figures.require_packages()
    from markupsafe import Markup

    ordered = sorted(report.cases, key=lambda case: not case.name.startswith(MODEL_CASE))  # the user's come first
    cases = [_case(case, f"{n}-{_identifier(case.name)}") for n, case in enumerate(ordered, start=1)]
    text: str = (
        _environment()
        .get_template("page.html.j2")
        .render(
            report=report,
            provenance=report.provenance,
            style=Markup(figures.css_variables() + "\n" + _resource("page.css")),
            cases=cases,
            answers=summarize([(case["record"], case["advice"]) for case in cases]),
            scaling=[
                {"axis": axis, "label": AXES[axis], "series": group, "svg": Markup(scaling_svg(axis, group))}
                for axis, group in scaling_groups(report.scaling).items()
            ],
            slabs=_slab_tables(report.slabs),
            shadows=None if report.shadows == Shadows() else report.shadows,
            shadow_claims=[judge(report) for judge in SHADOW_CLAIMS],
            shadow_plots={title: Markup(svg) for title, svg in shadow_plots(report.shadows).items()},
            usual=USUAL,
            scale=scale_colors(),
            good_enough=GOOD_ENOUGH,
            worst=WORST,
            max_invalid=MAX_INVALID,
            error_floor=ERROR_FLOOR,
            units=UNITS,
        )
    )
    return text


@cache
def _environment() -> Environment:
    """Templates, compiled once, that escape all values and fail on unknown names."""
    environment = figures.page_templates("translucent.bench", "templates")
    environment.filters.update(
        error=figures.error_text,
        limit=figures.limit_text,
        signed=figures.signed_error_text,
        ratio=figures.ratio_text,
        ms=figures.ms_text,
        share=figures.fraction_text,
        change=figures.change_text,
        signed_share=figures.signed_fraction_text,
        count=figures.count_text,
        rounded=figures.rounded_text,
        data=_data_address,
        heat=heat_map,
        seen=visibility_words,
    )
    environment.globals.update(swatch=figures.swatch, mark=_mark)
    return environment


def _resource(name: str) -> str:
    return files("translucent.bench").joinpath("templates", name).read_text(encoding="utf-8")


def _identifier(name: str) -> str:
    """Name with only the characters of an HTML identifier."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "x"


def _case(case: CaseRecord, name: str) -> dict[str, Any]:
    """Values of a case for the template of the page."""
    from markupsafe import Markup

    rows = plotted(case)
    tall = len(rows) > MOST_BESIDE
    index = {row.method: str(number) for number, row in enumerate(rows, start=1)}
    by_method = {row.method: row for row in case.rows}
    legend = [(index[row.method], row, error_of(row, case.quantity)) for row in rows]
    length = max(1, math.ceil(len(legend) / (3 if tall else 1)))
    refused: dict[str, list[str]] = {}
    for row in case.rows:
        if row.refusal is not None:
            refused.setdefault(row.refusal, []).append(row.method)
    lines = max(1, math.ceil(len(case.pictures) / 8))  # up to eight pictures in each, all about equally long
    return {
        "record": case,
        "id": name,
        "advice": advise(case),
        "legend": [legend[i : i + length] for i in range(0, len(legend), length)],
        "svg": Markup(pareto_svg(case, index, f"pareto-{name}", (1160, 560) if tall else (760, 520))) if rows else None,
        "pictures": [(picture, by_method.get(picture.method), heat_map(picture)) for picture in case.pictures],
        "picture_columns": max(6, math.ceil(len(case.pictures) / lines)),
        "measured": [row for row in case.rows if row.refusal is None and row.failure is None],
        "refused": refused,
        "scattered": [row for row in case.rows if row.light is not None],
        "failed": [row for row in case.rows if row.failure is not None],
        "sampled": any(row.sampled is not None for row in case.rows),
        "errors": [
            (row, words, errors)
            for row in case.rows
            for words, errors in (
                *((quantity, row.errors(quantity)) for quantity in UNITS),
                ("radiance, 16 samples", row.sampled),
            )
            if errors is not None
        ],
    }


def _slab_tables(slabs: Sequence[Slab]) -> list[dict[str, Any]]:
    """A table for each anisotropy and index of refraction: depths are its columns, rows are albedos with slabs."""
    tables: dict[tuple[float, float], list[Slab]] = {}
    for slab in slabs:
        tables.setdefault((slab.anisotropy, slab.ior), []).append(slab)
    return [
        {
            "anisotropy": anisotropy,
            "ior": ior,
            "depths": sorted({slab.depth for slab in members}),
            "rows": [
                (albedo, [slab for slab in members if slab.albedo == albedo])
                for albedo in sorted({slab.albedo for slab in members})
            ],
        }
        for (anisotropy, ior), members in tables.items()
    ]


def _mark(error: float) -> str:
    """Class of a cell with the error of a slab."""
    return "good" if abs(error) <= _GOOD else "" if abs(error) <= _BEARABLE else "bad"


def heat_map(picture: ReportPicture) -> str | None:
    """The error of a picture as a ``data:`` address; None where it has none.

    Too small is blue, too large red, pale to dark in steps of ten; what is not covered is transparent, and pixels that
    the method marks as invalid are striped. All pictures of the page have one scale.
    """
    from PIL import Image

    if picture.error is None:
        return None
    error = picture.error.array()
    known = np.where(np.isfinite(error), error, 0.0)
    indices = len(STEPS) + np.sign(known).astype(int) * np.searchsorted(STEPS, np.abs(known), side="right")
    indices = np.where(np.isfinite(error), indices, _TRANSPARENT)
    if picture.invalid is not None:
        rows, columns = np.indices(error.shape)
        stripes = np.where((rows + columns) % _HATCH < _HATCH // 2, _STRIPE, _STRIPE + 1)
        indices = np.where(picture.invalid.array(), stripes, indices)
    image = Image.fromarray(indices.astype(np.uint8))  # gray, until it has a palette
    image.putpalette([channel for color in _palette() for channel in color])
    stream = io.BytesIO()
    image.save(stream, format="PNG", transparency=_TRANSPARENT, optimize=True)
    return _data_address(base64.b64encode(stream.getvalue()).decode("ascii"))


def _data_address(png: str) -> str:
    """A PNG in base64 as an address."""
    return f"data:image/png;base64,{png}"


def scale_colors() -> list[tuple[str, str]]:
    """(color, least magnitude) of every step, from the most negative over none to the most positive."""
    powers = [figures.power_text(step) for step in STEPS]
    labels = [*(f"−{power}" for power in reversed(powers)), "0", *(f"+{power}" for power in powers)]
    colors = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in _palette()[: len(labels)]]
    return list(zip(colors, labels, strict=True))


@cache
def _palette() -> tuple[tuple[int, int, int], ...]:
    """Blue over white to red (a scale that color-blind readers can tell the ends of), transparent, and two stripes."""
    import matplotlib

    ends = 0.5 + 0.5 * np.linspace(0.14, 1.0, len(STEPS))
    positions = np.concatenate([1.0 - ends[::-1], [0.5], ends])
    colors = np.rint(matplotlib.colormaps["RdBu_r"](positions)[:, :3] * 255).astype(int)
    return (*(tuple(color) for color in colors.tolist()), (0, 0, 0), (90, 90, 90), (190, 190, 190))
