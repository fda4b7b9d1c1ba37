"""Advice on the method for a scene, from its rows by a rule that the page prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from translucent.bench.frontier import ERROR_FLOOR, TIME_MARGIN, error_of
from translucent.bench.record import CaseRecord
from translucent.bench.row import Quantity, Row

#: RMS error up to which a method is good enough for a picture: in light, one step of an 8-bit display; in thickness,
#: a tenth of a millimeter on a body of a meter.
GOOD_ENOUGH: Mapping[Quantity, float] = {"thickness": 1e-4, "transmittance": 1 / 255, "radiance": 1 / 255}

#: Times that, up to which the error of one pixel in a thousand may be: beyond it, flaws are few but plain.
WORST = 10.0

#: Largest share of covered pixels that an advised method may mark as invalid.
MAX_INVALID = 1e-3


@dataclass(frozen=True)
class Advice:
    """Advice on the method for a scene.

    Attributes
    ----------
    row : Row
        The cheapest method that is good enough; among equally cheap ones, one that the planner calls exact, and the
        more accurate. Where none is good enough, the most accurate one.
    good_enough : bool
    cheaper : Row or None
        The most accurate method of those that clearly cost less.
    constant : Row or None
        One thickness for all pixels, as viewers of glTF files take it.
    times_better : float or None
        RMS error of `constant` by that of `row`, where errors below float32's own count as those.
    """

    row: Row
    good_enough: bool
    cheaper: Row | None
    constant: Row | None
    times_better: float | None


def advise(case: CaseRecord) -> Advice | None:
    """Advice for the scene of a case; None where nothing was measured."""
    measured = [row for row in case.rows if row.ratio is not None and error_of(row, case.quantity) is not None]
    kept = [row for row in measured if (row.invalid or 0.0) <= MAX_INVALID]
    # Without OpenGL only where nothing else runs.
    usable = [row for row in kept if row.kind == "method"] or [row for row in kept if row.kind == "cpu"]
    good = [row for row in usable if _good_enough(row, case)]
    if not usable:
        return None
    if good:
        equal = min(map(_cost, good)) * TIME_MARGIN
        best = [row for row in good if _cost(row) <= equal]
        chosen = min(best, key=lambda row: (not row.exact, max(_error(row, case), ERROR_FLOOR), _cost(row)))
    else:
        chosen = min(usable, key=lambda row: _error(row, case))
    cheaper = [row for row in usable if _cost(row) * TIME_MARGIN < _cost(chosen)]
    constant = next((row for row in measured if row.family == "constant thickness"), None)
    return Advice(
        row=chosen,
        good_enough=bool(good),
        cheaper=min(cheaper, key=lambda row: _error(row, case), default=None),
        constant=constant,
        times_better=None if constant is None else _error(constant, case) / max(_error(chosen, case), ERROR_FLOOR),
    )


@dataclass(frozen=True)
class Summary:
    """Summary line of the advice: the scenes of one method.

    Attributes
    ----------
    row : Row
        One of those advised.
    titles : tuple of str
        Of the scenes.
    ratios : (low, high)
        Its cost in them.
    """

    row: Row
    titles: tuple[str, ...]
    ratios: tuple[float, float]


def summarize(cases: Sequence[tuple[CaseRecord, Advice | None]]) -> list[Summary]:
    """Summarize the methods that are good enough, those for the most scenes first."""
    by_method: dict[str, list[tuple[CaseRecord, Row]]] = {}
    for case, advice in cases:
        if advice is not None and advice.good_enough:
            by_method.setdefault(advice.row.method, []).append((case, advice.row))
    found = []
    for members in sorted(by_method.values(), key=len, reverse=True):
        costs = [_cost(row) for _, row in members]
        found.append(Summary(members[0][1], tuple(case.title for case, _ in members), (min(costs), max(costs))))
    return found


def _good_enough(row: Row, case: CaseRecord) -> bool:
    errors, limit = row.errors(case.quantity), GOOD_ENOUGH[case.quantity]
    return errors is not None and errors.rms <= limit and errors.p999 <= WORST * limit


def _cost(row: Row) -> float:
    assert row.ratio is not None, "measured"
    return row.ratio.median


def _error(row: Row, case: CaseRecord) -> float:
    error = error_of(row, case.quantity)
    assert error is not None, "measured"
    return error
