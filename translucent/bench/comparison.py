"""Comparison of two reports of one machine: changes in time or accuracy beyond their noise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from translucent.bench.frontier import ERROR_FLOOR, ERROR_MARGIN
from translucent.bench.record import CaseRecord, Report
from translucent.bench.row import Row
from translucent.bench.shadows.record import ShadowRow, Shadows

#: Relative noise of a ratio to the floor between runs on one machine.
TIME_SHARE = 0.15

#: Number of standard errors beyond which the difference of two medians is significant.
NOISES = 4.0

#: Shares of pixels on which rasterizers may differ.
PIXEL_SHARE = 1e-3


@dataclass(frozen=True)
class Change:
    """Change between two reports.

    Attributes
    ----------
    kind : {"slower", "faster", "less accurate", "more accurate", "marks more", "fails", "gone"}
    where : str
        Case and method.
    text : str
        Before and after.
    """

    kind: Literal["slower", "faster", "less accurate", "more accurate", "marks more", "fails", "gone"]
    where: str
    text: str

    @property
    def worse(self) -> bool:
        """True if the change is for the worse."""
        return self.kind not in ("faster", "more accurate")

    def __str__(self) -> str:
        return f"{self.kind}: {self.where}: {self.text}"


@dataclass(frozen=True)
class Agreement:
    """Agreement of the ratios to the floor in two reports.

    Attributes
    ----------
    ratios : int
        Number of ratios that both have, of scenes at the same size, scaling and shadows.
    within : int
        Number of those whose larger one exceeds the smaller one by no more than `TIME_SHARE` of it.
    farthest : str
        Case and method of those that are farthest apart, with both ratios; empty without ratios.
    """

    ratios: int
    within: int
    farthest: str

    def __str__(self) -> str:
        if not self.ratios:
            return "no ratio to the floor is in both"
        share = f"{self.within} of {self.ratios} ratios to the floor ({self.within / self.ratios:.1%})"
        return f"{share} agree within {TIME_SHARE:.0%}; farthest apart: {self.farthest}"


def agreement(old: Report, new: Report) -> Agreement:
    """Agreement of the ratios in two reports: of two runs of one version on one machine, their reproducibility."""
    before, after = _ratios(old), _ratios(new)
    # On a logarithmic scale, so that neither report is the one in the denominator.
    apart = {key: abs(math.log(after[key] / ratio)) for key, ratio in before.items() if key in after}
    within = sum(distance <= math.log1p(TIME_SHARE) for distance in apart.values())
    farthest = ""
    if apart:
        key = max(apart, key=lambda one: apart[one])
        farthest = f"{key[0]}, {before[key]:.2f} and {after[key]:.2f}"
    return Agreement(len(apart), within, farthest)


def compare_reports(old: Report, new: Report) -> tuple[Change, ...]:
    """Changes between two reports, those for the worse first. What only the new report has is no change."""
    changes = list(_changes(old, new))
    return tuple(sorted(changes, key=lambda change: not change.worse))


def machines_differ(old: Report, new: Report) -> str | None:
    """Reason why the times of two reports cannot be compared, if there is one."""
    pairs = {
        "device": (old.provenance.renderer, new.provenance.renderer),
        "processor": (old.provenance.processor, new.provenance.processor),
        "processors": (str(old.provenance.processors), str(new.provenance.processors)),
    }
    wrong = [f"{name} {a!r}, now {b!r}" for name, (a, b) in pairs.items() if a != b]
    return "; ".join(wrong) or None


def _ratios(report: Report) -> dict[tuple[str, tuple[int, int]], float]:
    """Ratios to the floor by case and method, and the size of the picture, where it is not the case's own."""
    found = {
        (f"{case.name} / {row.method}", case.size): row.ratio
        for case in report.cases
        for row in case.rows
        if row.kind != "floor"
    }
    found |= {
        (f"{series.axis} {point.x} / {series.method}", (0, 0)): point.ratio
        for series in report.scaling
        for point in series.points
        if series.family != "depth only"
    }
    found |= {
        (f"shadow, {case.name} / {row.method}", (0, 0)): row.ratio for case in report.shadows.cases for row in case.rows
    }
    return {key: ratio.median for key, ratio in found.items() if ratio is not None}


def _changes(old: Report, new: Report) -> Iterator[Change]:
    cases = {case.name: case for case in new.cases}
    for before in old.cases:
        after = cases.get(before.name)
        if after is None:
            continue  # fewer cases were asked for
        if after.failure and not before.failure:
            yield Change("fails", before.name, after.failure)
        rows = {row.method: row for row in after.rows}
        for row in before.rows:
            if (now := rows.get(row.method)) is not None:
                yield from _row_changes(before, after, row, now)
    yield from _shadow_changes(old.shadows, new.shadows)
    hard = {case.id: case for case in new.hard_cases}
    for case in old.hard_cases:
        if (found := hard.get(case.id)) is not None and case.passed and not found.passed:
            yield Change("fails", case.id, found.result)


def _row_changes(before: CaseRecord, after: CaseRecord, old: Row, new: Row) -> Iterator[Change]:
    where = f"{before.name} / {old.method}"
    if old.wall is not None and (new.failure or new.refusal):
        yield Change("fails" if new.failure else "gone", where, str(new.failure or new.refusal))
    if before.size == after.size and old.kind != "floor":
        yield from _time_change(where, old, new)
    # Of one ray through each pixel or of several, the truth is another.
    if before.compared_size == after.compared_size and before.truth_rays == after.truth_rays:
        yield from _error_change(where, before, old, new)


def _shadow_changes(old: Shadows, new: Shadows) -> Iterator[Change]:
    cases = {case.name: case for case in new.cases}
    for before in old.cases:
        if (after := cases.get(before.name)) is None:
            continue
        if after.failure and not before.failure:
            yield Change("fails", f"shadow, {before.name}", after.failure)
        rows = {row.method: row for row in after.rows}
        for row in before.rows:
            if (now := rows.get(row.method)) is None:
                continue
            where = f"shadow, {before.name} / {row.method}"
            yield from _time_change(where, row, now)
            # Points differ with the size of the picture.
            if before.compared_points == after.compared_points and row.errors and now.errors:
                yield from _median_change(where, row.errors.median, now.errors.median)


def _median_change(where: str, before: float, after: float) -> Iterator[Change]:
    a, b = max(before, ERROR_FLOOR), max(after, ERROR_FLOOR)
    if b > a * ERROR_MARGIN or a > b * ERROR_MARGIN:
        text = f"median error in transmittance {before:.2g} -> {after:.2g}"
        yield Change("less accurate" if b > a else "more accurate", where, text)


def _time_change(where: str, old: Row | ShadowRow, new: Row | ShadowRow) -> Iterator[Change]:
    if old.ratio is None or new.ratio is None:
        return
    difference = new.ratio.median - old.ratio.median
    margin = max(TIME_SHARE * old.ratio.median, NOISES * math.hypot(old.ratio.noise, new.ratio.noise))
    if abs(difference) > margin:
        text = f"{old.ratio.median:.2f} -> {new.ratio.median:.2f} times the floor (noise up to {margin:.2f})"
        yield Change("slower" if difference > 0 else "faster", where, text)


def _error_change(where: str, case: CaseRecord, old: Row, new: Row) -> Iterator[Change]:
    before, after = old.errors(case.quantity), new.errors(case.quantity)
    if before is None or after is None:
        return
    a, b = max(before.rms, ERROR_FLOOR), max(after.rms, ERROR_FLOOR)
    if b > a * ERROR_MARGIN or a > b * ERROR_MARGIN:
        text = f"RMS error in {case.quantity} {before.rms:.2g} -> {after.rms:.2g}"
        yield Change("less accurate" if b > a else "more accurate", where, text)
    if (new.invalid or 0.0) > (old.invalid or 0.0) + PIXEL_SHARE:
        yield Change("marks more", where, f"{old.invalid or 0.0:.2%} -> {new.invalid or 0.0:.2%} of pixels invalid")
