"""Claims of the project about itself, checked on the numbers of a report."""

from __future__ import annotations

from collections.abc import Sequence

from translucent.bench.claim import over_cases
from translucent.bench.frontier import NOISES, error_of
from translucent.bench.hard.measure import CASES as HARD_CASES
from translucent.bench.record import CaseRecord, Claim, HardCase, Slab
from translucent.bench.row import Row
from translucent.bench.scattering.claims import scattering_claims
from translucent.bench.shadows.claims import shadow_claims
from translucent.bench.shadows.record import Shadows

#: Largest time of signed depth, as a multiple of the floor.
MOST_OF_FLOOR = 1.25

#: A time with a noise of `NOISES` standard errors beyond this share of it decides nothing about the frontier: next to
#: none of the others could beat it.
VAGUE = 0.25

#: Surfaces on a ray beyond which most of what is drawn is hidden.
MANY_LAYERS = 8

#: Times smaller than that of a shortcut: the error of signed depth on concave bodies.
FACTOR = 100.0

#: Cases at whose place or shape float32 from the camera and float16 are lost.
LOST = ("slab", "far slab", "far knot")

#: Visibly wrong: this much more than signed depth, and more than float32 has to say at all.
VISIBLE_FACTOR, VISIBLE = 10.0, 1e-6


def check_claims(
    cases: Sequence[CaseRecord],
    hard_cases: Sequence[HardCase],
    slabs: Sequence[Slab] = (),
    shadows: Shadows | None = None,
) -> tuple[Claim, ...]:
    """All claims, each with the numbers behind it."""
    closed = [case for case in cases if case.closed and case.absorption_only and not case.failure]
    concave = [case for case in closed if not case.convex]
    far = [case for case in closed if case.name.startswith("far")]
    lost = [case for case in closed if case.name in LOST]
    return (
        over_cases(
            "SignedDepth is on the Pareto frontier of every closed case that only absorbs", closed, _on_frontier
        ),
        over_cases(f"SignedDepth takes at most {MOST_OF_FLOOR} times the floor on these", closed, _near_floor),
        over_cases(
            f"SignedDepth has at most 1/{FACTOR:.0f} of the error of constant thickness on concave cases",
            concave,
            lambda case: _smaller(case, "constant thickness"),
        ),
        over_cases(
            f"SignedDepth has at most 1/{FACTOR:.0f} of the error of back-face depth on concave cases, where rays "
            "leave the body and enter again",
            concave,
            lambda case: _smaller(case, "BackFaceDepth, unmarked") if case.layers > 2 else (None, ""),
        ),
        over_cases(
            "float16 is visibly off on thin and far cases", lost, lambda case: _off(case, "SignedDepth in float16")
        ),
        over_cases(
            "distances from the camera are visibly off on far cases",
            far,
            lambda case: _off(case, "SignedDepth from the camera"),
        ),
        *scattering_claims(cases, slabs),
        *shadow_claims(shadows or Shadows()),
        _hard(hard_cases),
    )


def _row(case: CaseRecord, method: str) -> Row | None:
    return next((row for row in case.rows if row.method == method and row.ratio is not None), None)


def _on_frontier(case: CaseRecord) -> tuple[bool | None, str]:
    row = _row(case, "SignedDepth")
    if row is None:
        return None, ""
    error = error_of(row, case.quantity)
    if row.ratio is None or error is None:
        return row.pareto, ""
    if row.pareto and NOISES * row.ratio.noise > VAGUE * row.ratio.median:
        return None, f"{row.ratio.median:.2f} ± {row.ratio.noise:.2f} times the floor, too vague to be beaten"
    return row.pareto, f"{row.ratio.median:.2f} times the floor, error {error:.1e}"


def _near_floor(case: CaseRecord) -> tuple[bool | None, str]:
    row = _row(case, "SignedDepth")
    if row is None or row.ratio is None:
        return None, ""
    words = f"{row.ratio.median:.2f} ± {row.ratio.noise:.2f}"
    if row.ratio.median > MOST_OF_FLOOR:
        words += _why_slow(case)
    if abs(row.ratio.median - MOST_OF_FLOOR) <= NOISES * row.ratio.noise:
        return None, words
    return row.ratio.median <= MOST_OF_FLOOR, words


def _why_slow(case: CaseRecord) -> str:
    """Reason why signed depth is slower than the floor there."""
    if case.bodies > 1:
        return " (several media: three optical depths and the path are added up, 20 bytes per pixel and not 8)"
    if case.layers > MANY_LAYERS:
        return f" ({case.layers} layers: the floor skips hidden surfaces by its depth test, signed depth adds them)"
    return ""


def _smaller(case: CaseRecord, shortcut: str) -> tuple[bool | None, str]:
    factor = _error_factor(case, shortcut)
    return (None, "") if factor is None else (factor >= FACTOR, f"{factor:.2g} times smaller")


def _off(case: CaseRecord, shortcut: str) -> tuple[bool | None, str]:
    factor, row = _error_factor(case, shortcut), _row(case, shortcut)
    error = None if row is None else error_of(row, case.quantity)
    if factor is None or error is None:
        return None, ""
    return factor >= VISIBLE_FACTOR and error > VISIBLE, f"error {error:.1e}, {factor:.2g} times SignedDepth's"


def _error_factor(case: CaseRecord, shortcut: str) -> float | None:
    """Ratio of the shortcut's error to that of signed depth."""
    ours, theirs = _row(case, "SignedDepth"), _row(case, shortcut)
    if ours is None or theirs is None:
        return None
    mine, other = error_of(ours, case.quantity), error_of(theirs, case.quantity)
    if mine is None or other is None:
        return None
    return other / max(mine, 1e-12)


def _hard(hard_cases: Sequence[HardCase]) -> Claim:
    text = f"All hard cases {HARD_CASES[0].id} to {HARD_CASES[-1].id} hold"
    if not hard_cases:
        return Claim(text, None, "none has been measured in this run")
    failed = [f"{case.id} {case.title}: {case.result}" for case in hard_cases if not case.passed]
    measured = {case.id for case in hard_cases}
    missing = [case.id for case in HARD_CASES if case.id not in measured]
    if missing:
        failed.append(f"{len(missing)} not measured: {', '.join(missing)}")
    return Claim(text, not failed, "; ".join(failed) or f"{len(measured)} measured")
