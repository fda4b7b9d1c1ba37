"""A report as aligned text, for terminals."""

from __future__ import annotations

from collections.abc import Iterator

from translucent.bench.record import CaseRecord, Report
from translucent.bench.row import Row
from translucent.bench.shadows.record import ShadowRow, Shadows

_HEAD = (
    f"{'method':<38}{'ms':>8}{'p95':>8}{'÷ floor':>9}{'±':>6}{'frame':>7}{'passes':>7}{'layers':>7}{'ms/layer':>9}"
    f"{'RMS':>9}{'p99.9':>9}{'invalid':>9}"
)
#: Of cases with a path traced truth: errors as shares of its mean.
_SCATTERED_HEAD = _HEAD[: _HEAD.index("RMS") - 6] + f"{'nRMSE':>9}{'4x4':>9}{'bias r':>8}{'g':>8}{'b':>8}{'ms once':>9}"


def table(report: Report) -> str:
    """Every row of every case, hard cases and claims."""
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
    yield from _shadows(report.shadows)
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


def _shadows(shadows: Shadows) -> Iterator[str]:
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
        yield from map(_shadow_row, case.rows)
    for sky in shadows.sky:
        yield f"{sky.environment}, {sky.directions} directions: error {sky.error:.1%} of the mean, {sky.seconds:.2f} s"
    for caustic in shadows.caustics:
        for row in caustic.rows:
            found = f"power {row.power:+.2%}, nRMSE {row.nrmse:.3f}, at most {row.most:.3f}, {row.seconds:.1f} s"
            yield f"caustic, {caustic.title}, {row.photons:,} photons: {found}"
    for medium in shadows.media:
        for row in medium.rows:
            found = f"mean {row.power:+.1%}, nRMSE {row.nrmse:.3f}, at most {row.most:.3f}, {row.seconds:.1f} s"
            yield f"caustic in {medium.title.lower()}, {row.photons:,} photons: {found}"


def _shadow_row(row: ShadowRow) -> str:
    if row.errors is None:
        return f"{row.method:<38}{'failed' if row.failure else 'refused'}: {row.failure or row.refusal}"
    line = f"{row.method:<38}" + (f"{row.ratio.median:>9.2f}{row.ratio.noise:>6.2f}" if row.ratio else f"{'':>15}")
    return f"{line}{row.errors.median:>9.1e}{row.errors.p99:>9.1e}{row.errors.p999:>9.1e}{row.edges or 0.0:>21.1e}"


def _row(case: CaseRecord, row: Row) -> str:
    name = f"{row.method}{' *' if row.pareto else ''}"
    if row.failure or row.refusal or row.wall is None:
        return f"{name:<38}{'failed' if row.failure else 'refused'}: {row.failure or row.refusal}"
    line = f"{name:<38}{row.wall.median:>8.2f}{row.wall.p95:>8.2f}"
    line += f"{row.ratio.median:>9.2f}{row.ratio.noise:>6.2f}" if row.ratio else f"{'':>15}"
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
