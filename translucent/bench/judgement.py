"""Judgement of the numbers of a report: the Pareto frontier, advice on methods, visible differences, and changes
between two reports.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bench.record import (
    CaseRecord,
    ColorDifference,
    MethodRow,
    Quantity,
    Report,
    TimedRow,
)

#: Factor within which times are equal, as are times within `NOISES` standard errors: two runs differ by as much. A
#: report compares some hundred pairs of rows of about the same time. By chance five of them differ at two standard
#: errors, and none at three.
TIME_MARGIN = 1.05
NOISES = 3.0

#: Factor within which errors are equal, as are all below `ERROR_FLOOR`: float32 of a path has no more to say.
ERROR_MARGIN = 1.5
ERROR_FLOOR = 1e-6

#: Errors up to a hundred roundings of float32, which the hard cases call exact, are rounding: of two such, neither is
#: the smaller one, whatever the digits say.
ROUNDING = 100 * float(np.finfo(np.float32).eps) / 2

#: RMS error up to which a method is good enough for a picture: in light, one step of an 8-bit display; in thickness,
#: a tenth of a millimeter on a body of a meter.
GOOD_ENOUGH: Mapping[Quantity, float] = {"thickness": 1e-4, "transmittance": 1 / 255, "radiance": 1 / 255}

#: Multiple of these that the error of one pixel in a thousand may reach: beyond it, flaws are few but plain.
WORST = 10.0

#: Largest fraction of covered pixels that an advised method may mark as invalid.
MAX_INVALID = 1e-3

#: A difference of color in CIELAB 1976 that is just noticed, side by side (Mahy, Van Eycken & Oosterlinck 1994,
#: "Evaluation of uniform color spaces developed after the adoption of CIELAB and CIELUV").
JUST_NOTICEABLE = 2.3

#: Linear Rec.709 with the white point D65 to CIE XYZ (IEC 61966-2-1).
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])

#: Below the cube of this CIELAB is linear (CIE 15).
_KNEE = 6.0 / 29.0

#: Between two runs on one machine: relative noise of a ratio to the floor, standard errors beyond which two medians
#: differ, and the fraction of pixels on which rasterizers may differ.
RUN_NOISE, RUN_NOISES, PIXELS = 0.15, 4.0, 1e-3


def error_of(row: MethodRow, quantity: Quantity) -> float | None:
    """Root mean square error, by which methods are ranked. None where there is none to trust."""
    errors = row.errors(quantity)
    return None if errors is None else errors.rms


def mark_frontier(rows: Sequence[MethodRow], quantity: Quantity) -> tuple[MethodRow, ...]:
    """Mark the rows on the frontier by `MethodRow.pareto`."""
    known = [row for row in rows if _coordinates(row, quantity) is not None]
    return tuple(
        dataclasses.replace(row, pareto=row in known and not any(beats(other, row, quantity) for other in known))
        for row in rows
    )


def beats(one: MethodRow, other: MethodRow, quantity: Quantity) -> bool:
    """True if one row is clearly better in time or error, and not clearly worse in the other.

    A row that marks pixels as not to be trusted leaves a part of the picture out: it beats none that marks fewer.
    """
    a, b = _coordinates(one, quantity), _coordinates(other, quantity)
    if a is None or b is None or (one.invalid or 0.0) > (other.invalid or 0.0) + 1e-3:
        return False
    (time_a, noise_a, error_a), (time_b, noise_b, error_b) = a, b
    margin = max((TIME_MARGIN - 1.0) * min(time_a, time_b), NOISES * math.hypot(noise_a, noise_b))
    faster, slower = time_a + margin < time_b, time_a > time_b + margin
    tied = max(error_a, error_b) <= ROUNDING
    better, worse = not tied and error_a * ERROR_MARGIN < error_b, not tied and error_a > error_b * ERROR_MARGIN
    return (faster and not worse) or (better and not slower)


def _coordinates(row: MethodRow, quantity: Quantity) -> tuple[float, float, float] | None:
    """Time, its noise, and error."""
    error = error_of(row, quantity)
    if row.ratio is None or error is None or row.kind == "floor":
        return None
    return row.ratio.median, row.ratio.noise, max(error, ERROR_FLOOR)


@dataclass(frozen=True)
class Advice:
    """Advice on the method for a scene.

    Attributes
    ----------
    row : MethodRow
        The cheapest method that is good enough; among equally cheap ones, one that the planner calls exact, and the
        more accurate. Where none is good enough, the most accurate one.
    cost, error : float
        Ratio to the floor, and RMS error, of `row`.
    good_enough : bool
    cheaper : MethodRow or None
        The most accurate of the methods that clearly cost less.
    constant : MethodRow or None
        One thickness for all pixels, as viewers of glTF files take it.
    times_better : float or None
        RMS error of `constant` by that of `row`, where errors below float32's own count as those.
    """

    row: MethodRow
    cost: float
    error: float
    good_enough: bool
    cheaper: MethodRow | None
    constant: MethodRow | None
    times_better: float | None


def advise(case: CaseRecord) -> Advice | None:
    """Advice for the scene of a case; None where nothing was measured."""
    measured = [
        (row, row.ratio.median, errors)
        for row in case.rows
        if row.ratio is not None and (errors := row.errors(case.quantity)) is not None
    ]
    kept = [one for one in measured if (one[0].invalid or 0.0) <= MAX_INVALID]
    # Without OpenGL only where nothing else runs.
    usable = [one for one in kept if one[0].kind == "method"] or [one for one in kept if one[0].kind == "cpu"]
    if not usable:
        return None
    limit = GOOD_ENOUGH[case.quantity]
    good = [(row, cost, e) for row, cost, e in usable if e.rms <= limit and e.p999 <= WORST * limit]
    if good:
        equal = min(cost for _, cost, _ in good) * TIME_MARGIN
        best = [one for one in good if one[1] <= equal]
        row, cost, errors = min(best, key=lambda one: (not one[0].exact, max(one[2].rms, ERROR_FLOOR), one[1]))
    else:
        row, cost, errors = min(usable, key=lambda one: one[2].rms)
    cheaper = [one for one in usable if one[1] * TIME_MARGIN < cost]
    constant = next(((row, e) for row, _, e in measured if row.family == "constant thickness"), None)
    return Advice(
        row,
        cost,
        errors.rms,
        good_enough=bool(good),
        cheaper=min(cheaper, key=lambda one: one[2].rms)[0] if cheaper else None,
        constant=None if constant is None else constant[0],
        times_better=None if constant is None else constant[1].rms / max(errors.rms, ERROR_FLOOR),
    )


def summarize(cases: Sequence[tuple[CaseRecord, Advice | None]]) -> list[tuple[MethodRow, list[str], float, float]]:
    """Methods that are good enough, those for the most scenes first: row, titles of scenes, least and largest cost."""
    by_method: dict[str, list[tuple[str, Advice]]] = {}
    for case, advice in cases:
        if advice is not None and advice.good_enough:
            by_method.setdefault(advice.row.method, []).append((case.title, advice))
    return [
        (found[0][1].row, [title for title, _ in found], min(a.cost for _, a in found), max(a.cost for _, a in found))
        for found in sorted(by_method.values(), key=len, reverse=True)
    ]


@np.errstate(under="ignore")  # of light behind a dense medium
def lab(linear: npt.ArrayLike) -> Array:
    """(..., 3): CIELAB 1976 of linear Rec.709 colors (..., 3) in 0..1, with white as L* = 100."""
    relative = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0) @ (_XYZ / _XYZ.sum(axis=1, keepdims=True)).T
    f = np.where(relative > _KNEE**3, np.cbrt(relative), relative / (3.0 * _KNEE**2) + 4.0 / 29.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


@np.errstate(under="ignore")
def color_difference(rendered: npt.ArrayLike, right: npt.ArrayLike) -> ColorDifference:
    """Color difference of linear colors (n, 3), one or more: Euclidean distances in CIELAB 1976."""
    distance = np.linalg.norm(lab(rendered) - lab(right), axis=-1)
    median, p999 = np.quantile(distance, (0.5, 0.999))
    return ColorDifference(float(median), float(p999), float(distance.max()))


def visibility_words(row: MethodRow) -> str:
    """Words on whether the difference from the truth is visible; empty where it was not measured."""
    found = row.color_difference
    if found is None:
        return ""

    def delta(value: float) -> str:
        return f"{value:.2g}" if value < 9.95 else f"{value:.0f}"

    bar = f"{JUST_NOTICEABLE} is just noticed"
    if found.max <= JUST_NOTICEABLE:
        return f"nobody would see the difference: no pixel is off by more than {delta(found.max)} in CIELAB, and {bar}"
    if found.p999 <= JUST_NOTICEABLE:
        return (
            f"hardly anybody would see the difference: one pixel in a thousand is off by more than "
            f"{delta(found.p999)} in CIELAB, up to {delta(found.max)}, and {bar}"
        )
    if found.median <= JUST_NOTICEABLE:
        return f"the difference would be seen in places: up to {delta(found.p999)} in CIELAB, and {bar}"
    off = f"half of the pixels are off by {delta(found.median)} in CIELAB"
    return f"the difference would be seen at a glance: {off}, and {bar}"


@dataclass(frozen=True)
class Change:
    """Change between two reports: its type, case and method, and the numbers before and after."""

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
        Number of those whose larger one exceeds the smaller one by no more than `RUN_NOISE` of it.
    farthest : str
        Case and method whose ratios are farthest apart, with both; empty without ratios.
    """

    ratios: int
    within: int
    farthest: str

    def __str__(self) -> str:
        if not self.ratios:
            return "no ratio to the floor is in both"
        count = f"{self.within} of {self.ratios} ratios to the floor ({self.within / self.ratios:.1%})"
        return f"{count} agree within {RUN_NOISE:.0%}; farthest apart: {self.farthest}"


def agreement(old: Report, new: Report) -> Agreement:
    """Agreement of the ratios in two reports: of two runs of one version on one machine, their reproducibility."""
    before, after = _ratios(old), _ratios(new)
    # On a logarithmic scale, so that neither report is the one in the denominator.
    apart = {key: abs(math.log(after[key] / ratio)) for key, ratio in before.items() if key in after}
    within = sum(distance <= math.log1p(RUN_NOISE) for distance in apart.values())
    farthest = ""
    if apart:
        key = max(apart, key=lambda one: apart[one])
        farthest = f"{key[0]}, {before[key]:.2f} and {after[key]:.2f}"
    return Agreement(len(apart), within, farthest)


def compare_reports(old: Report, new: Report) -> tuple[Change, ...]:
    """Changes between two reports, those for the worse first. What only the new report has is no change."""
    return tuple(sorted(_changes(old, new), key=lambda change: not change.worse))


def machines_differ(old: Report, new: Report) -> str | None:
    """Reason why the times of two reports cannot be compared, if there is one."""
    a, b = old.provenance, new.provenance
    pairs = {
        "device": (a.renderer, b.renderer),
        "processor": (a.processor, b.processor),
        "processors": (str(a.processors), str(b.processors)),
    }
    return "; ".join(f"{name} {one!r}, now {other!r}" for name, (one, other) in pairs.items() if one != other) or None


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
    """Changes of what both reports have, case by case."""
    cases = {case.name: case for case in new.cases}
    for before in old.cases:
        if (after := cases.get(before.name)) is None:
            continue  # fewer cases were requested
        if after.failure and not before.failure:
            yield Change("fails", before.name, after.failure)
        rows = {row.method: row for row in after.rows}
        for row in before.rows:
            if (now := rows.get(row.method)) is not None:
                yield from _row_changes(before, after, row, now)
    shadows = {case.name: case for case in new.shadows.cases}
    for shadow in old.shadows.cases:
        if (found := shadows.get(shadow.name)) is None:
            continue
        where = f"shadow, {shadow.name}"
        if found.failure and not shadow.failure:
            yield Change("fails", where, found.failure)
        techniques = {row.method: row for row in found.rows}
        for one in shadow.rows:
            if (other := techniques.get(one.method)) is None:
                continue
            yield from _time_change(f"{where} / {one.method}", one, other)
            # Points differ with the size of the picture.
            if shadow.compared_points == found.compared_points and one.errors and other.errors:
                a, b = one.errors.median, other.errors.median
                yield from _error_change(f"{where} / {one.method}", "median error in transmittance", a, b)
    hard = {case.id: case for case in new.hard_cases}
    for held in old.hard_cases:
        if held.passed and held.id in hard and not hard[held.id].passed:
            yield Change("fails", held.id, hard[held.id].result)


def _row_changes(before: CaseRecord, after: CaseRecord, old: MethodRow, new: MethodRow) -> Iterator[Change]:
    where = f"{before.name} / {old.method}"
    if old.wall is not None and (new.failure or new.refusal):
        yield Change("fails" if new.failure else "gone", where, str(new.failure or new.refusal))
    if before.size == after.size and old.kind != "floor":
        yield from _time_change(where, old, new)
    # Of one ray through each pixel or of several, the truth is another.
    if before.compared_size != after.compared_size or before.truth_rays != after.truth_rays:
        return
    one, other = old.errors(before.quantity), new.errors(before.quantity)
    if one is not None and other is not None:
        yield from _error_change(where, f"RMS error in {before.quantity}", one.rms, other.rms)
        if (new.invalid or 0.0) > (old.invalid or 0.0) + PIXELS:
            text = f"{old.invalid or 0.0:.2%} -> {new.invalid or 0.0:.2%} of pixels invalid"
            yield Change("marks more", where, text)


def _error_change(where: str, what: str, before: float, after: float) -> Iterator[Change]:
    a, b = max(before, ERROR_FLOOR), max(after, ERROR_FLOOR)
    if b > a * ERROR_MARGIN or a > b * ERROR_MARGIN:
        kind: Literal["less accurate", "more accurate"] = "less accurate" if b > a else "more accurate"
        yield Change(kind, where, f"{what} {before:.2g} -> {after:.2g}")


def _time_change(where: str, old: TimedRow, new: TimedRow) -> Iterator[Change]:
    if old.ratio is None or new.ratio is None:
        return
    difference = new.ratio.median - old.ratio.median
    margin = max(RUN_NOISE * old.ratio.median, RUN_NOISES * math.hypot(old.ratio.noise, new.ratio.noise))
    if abs(difference) > margin:
        text = f"{old.ratio.median:.2f} -> {new.ratio.median:.2f} times the floor (noise up to {margin:.2f})"
        yield Change("slower" if difference > 0 else "faster", where, text)
