"""Claims of the project about itself, checked on the numbers of a report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from translucent.bench.judgement import NOISES, error_of
from translucent.bench.record import (
    CONSTANT,
    HALF,
    OPAQUE,
    CaseRecord,
    CausticCase,
    CausticMediumCase,
    CausticRow,
    Claim,
    MethodRow,
    Report,
    ShadowCase,
    SkyRow,
    Slab,
    SlabModel,
)

#: Largest time of signed depth, as a multiple of the floor.
MOST_OF_FLOOR = 1.25

#: A time with a noise of `NOISES` standard errors beyond this fraction of it decides nothing about the frontier: next
#: to none of the others could beat it.
VAGUE = 0.25

#: Surfaces on a ray beyond which most of what is drawn is hidden.
MANY_LAYERS = 8

#: How many times smaller than that of a shortcut the error of signed depth on concave bodies is.
FACTOR = 100.0

#: Cases at whose place or shape float32 from the camera and float16 are lost.
LOST = ("slab", "far slab", "far knot")

#: Visibly wrong: this much more than signed depth, and more than float32 has to say at all.
VISIBLE_FACTOR, VISIBLE = 10.0, 1e-6

#: A coarse and a fine resolution; the fine one, which the planner takes, has to be nearer.
COARSE, FINE = "Diffusion, resolution 16", "Diffusion, resolution 32"

#: Fraction of the mean by which a coarse solution may be the better one by chance, where both are equally near.
CHANCE = 0.005

#: Slabs in which light diffuses: of such an albedo and reduced optical depth diffusion errs by no more than this.
DIFFUSING_ALBEDO, DIFFUSING_DEPTH, DIFFUSING_ERROR = 0.9, 4.0, 0.03

#: Largest error of the planner's choice for slabs.
PLANNED_ERROR = 0.05

#: Largest error of transmittance in the rays of texels, for 99.9 % of them.
EXACT = 1e-5

#: Largest time of a map of `USUAL` texels along a side, as a multiple of a depth-only one.
MOST_OF_DEPTH, USUAL = 1.3, 1024

#: Least order with which errors fall with the width of texels, where outlines are among them.
LEAST_ORDER = 0.9

#: Shortcuts of shadows have at least this many times the median error.
SHADOW_FACTOR = 10.0

#: Smaller errors of transmittance than this are float32's, and count as it.
LEAST_ERROR = 1e-6

#: Largest error of so many directions of an environment, as a fraction of the mean.
SKY_ERROR, DIRECTIONS = 0.05, 32

#: Least order with which these errors fall with the number of directions.
LEAST_SKY_ORDER = 0.5

#: Largest errors of caustics of so many photons: of power, and of irradiance.
POWER_ERROR, CAUSTIC_ERROR, PHOTONS = 0.01, 0.2, 250_000

#: Judges a claim by a report.
Judge = Callable[[Report], Claim]


@dataclass(frozen=True)
class Verdict:
    """Check of a claim on one case: whether it holds there, None where noise leaves it open, with the numbers."""

    where: str
    held: bool | None
    words: str
    badness: float = 0.0


@dataclass(frozen=True)
class ClaimRule:
    """Claim over several cases: it holds where it holds on all, and does not where it fails on one.

    Attributes
    ----------
    text : str
    cases : callable
        Takes the cases of the claim from a report.
    check : callable
        Verdict on one of them; None where it has not the numbers.
    worst : bool
        Names the worst of the cases on which it holds, in place of all.
    """

    text: str
    cases: Callable[[Report], Iterable[Any]]
    check: Callable[[Any], Verdict | None]
    worst: bool = False

    def __call__(self, report: Report) -> Claim:
        """Judge the claim by a report."""
        found = [one for case in self.cases(report) if (one := self.check(case)) is not None]
        if self.worst:
            found.sort(key=lambda one: -one.badness)
        wrong = [f"not on {one.where!r}: {one.words}" for one in found if one.held is False]
        open_ = [f"undecided on {one.where!r}: {one.words}" for one in found if one.held is None]
        right = [f"{one.where}: {one.words}" for one in found if one.held]
        if self.worst and right:
            first = next(one for one in found if one.held)
            right = [f"worst of {len(right)}: {first.where}, {first.words}"]
        held = False if wrong else None if open_ or not right else True
        nothing = f"{'nothing' if self.worst else 'no case'} in this run to check it on"
        # A claim that is undecided everywhere names these cases alone.
        return Claim(self.text, held, "; ".join([*wrong, *open_, *right]) or nothing)


def _closed(report: Report) -> list[CaseRecord]:
    return [case for case in report.cases if case.closed and case.absorption_only and not case.failure]


def _concave(report: Report) -> list[CaseRecord]:
    return [case for case in _closed(report) if not case.convex]


def _row(case: CaseRecord, method: str) -> MethodRow | None:
    return next((row for row in case.rows if row.method == method and row.ratio is not None), None)


def _on_frontier(case: CaseRecord) -> Verdict | None:
    row = _row(case, "SignedDepth")
    if row is None or row.ratio is None or (error := error_of(row, case.quantity)) is None:
        return None if row is None else Verdict(case.name, row.pareto, "")
    if row.pareto and NOISES * row.ratio.noise > VAGUE * row.ratio.median:
        words = f"{row.ratio.median:.2f} ± {row.ratio.noise:.2f} times the floor, too vague to be beaten"
        return Verdict(case.name, None, words)
    return Verdict(case.name, row.pareto, f"{row.ratio.median:.2f} times the floor, error {error:.1e}")


def _near_floor(case: CaseRecord) -> Verdict | None:
    row = _row(case, "SignedDepth")
    if row is None or row.ratio is None:
        return None
    words = f"{row.ratio.median:.2f} ± {row.ratio.noise:.2f}"
    if row.ratio.median > MOST_OF_FLOOR and case.bodies > 1:
        words += " (several media: three optical depths and the path are added up, 20 bytes per pixel and not 8)"
    elif row.ratio.median > MOST_OF_FLOOR and case.layers > MANY_LAYERS:
        words += f" ({case.layers} layers: the floor skips hidden surfaces by its depth test, signed depth adds them)"
    vague = abs(row.ratio.median - MOST_OF_FLOOR) <= NOISES * row.ratio.noise
    return Verdict(case.name, None if vague else row.ratio.median <= MOST_OF_FLOOR, words)


def _smaller(shortcut: str, least_layers: int = 0) -> Callable[[CaseRecord], Verdict | None]:
    def check(case: CaseRecord) -> Verdict | None:
        found = _beside(case, shortcut)
        if found is None or case.layers <= least_layers:
            return None
        return Verdict(case.name, found[0] >= FACTOR, f"{found[0]:.2g} times smaller")

    return check


def _off(shortcut: str) -> Callable[[CaseRecord], Verdict | None]:
    def check(case: CaseRecord) -> Verdict | None:
        if (found := _beside(case, shortcut)) is None:
            return None
        factor, error = found
        held = factor >= VISIBLE_FACTOR and error > VISIBLE
        return Verdict(case.name, held, f"error {error:.1e}, {factor:.2g} times SignedDepth's")

    return check


def _beside(case: CaseRecord, shortcut: str) -> tuple[float, float] | None:
    """Error of a shortcut, and its ratio to the error of signed depth."""
    rows = _row(case, "SignedDepth"), _row(case, shortcut)
    errors = [None if row is None else error_of(row, case.quantity) for row in rows]
    ours, theirs = errors
    return None if ours is None or theirs is None else (theirs / max(ours, 1e-12), theirs)


METHOD_CLAIMS: tuple[Judge, ...] = (
    ClaimRule("SignedDepth is on the Pareto frontier of every closed case that only absorbs", _closed, _on_frontier),
    ClaimRule(f"SignedDepth takes at most {MOST_OF_FLOOR} times the floor on these", _closed, _near_floor),
    ClaimRule(
        f"SignedDepth has at most 1/{FACTOR:.0f} of the error of constant thickness on concave cases",
        _concave,
        _smaller("constant thickness"),
    ),
    ClaimRule(
        f"SignedDepth has at most 1/{FACTOR:.0f} of the error of back-face depth on concave cases, where rays "
        "leave the body and enter again",
        _concave,
        _smaller("BackFaceDepth, unmarked", 2),
    ),
    ClaimRule(
        "float16 is visibly off on thin and far cases",
        lambda report: [case for case in _closed(report) if case.name in LOST],
        _off("SignedDepth in float16"),
    ),
    ClaimRule(
        "distances from the camera are visibly off on far cases",
        lambda report: [case for case in _closed(report) if case.name.startswith("far")],
        _off("SignedDepth from the camera"),
    ),
)


def _scattered(report: Report) -> list[CaseRecord]:
    return [case for case in report.cases if case.truth_noise is not None and not case.failure]


def _nrmse(case: CaseRecord, method: str) -> float | None:
    return next((row.light.nrmse for row in case.rows if row.method == method and row.light is not None), None)


def _nearer(case: CaseRecord) -> Verdict | None:
    ours, layer = _nrmse(case, FINE), _nrmse(case, "ScatteringLayer")
    if ours is None or layer is None:
        return None
    return Verdict(case.name, ours < layer, f"nRMSE {ours:.3f}, the layer {layer:.3f}")


def _nearer_than_engines(case: CaseRecord) -> Verdict | None:
    ours = _nrmse(case, FINE)
    others = [(row.light.nrmse, row.method) for row in case.rows if row.kind == "counter-example" and row.light]
    if ours is None or not others:
        return None
    least, method = min(others)
    return Verdict(case.name, ours < least, f"{ours:.3f}, {method} {least:.3f}")


def _finer(case: CaseRecord) -> Verdict | None:
    coarse, fine = _nrmse(case, COARSE), _nrmse(case, FINE)
    if coarse is None or fine is None:
        return None
    return Verdict(case.name, fine <= coarse + CHANCE, f"{coarse:.3f} to {fine:.3f}")


SCATTERING_CLAIMS: tuple[Judge, ...] = (
    ClaimRule("Diffusion(32) is nearer to the truth than the layer on every scattering case", _scattered, _nearer),
    ClaimRule(
        "Diffusion(32) is nearer than what engines do, fitted or not",
        _scattered,
        _nearer_than_engines,
    ),
    ClaimRule("the error of Diffusion does not grow from a resolution of 16 to one of 32", _scattered, _finer),
)


def _diffusing_slabs(report: Report) -> Claim:
    text = (
        f"Diffusion is within {DIFFUSING_ERROR} of the reflectance and transmittance of slabs of an albedo from "
        f"{DIFFUSING_ALBEDO} and a reduced optical depth from {DIFFUSING_DEPTH:g}"
    )
    found = [one for one in report.slabs if one.albedo >= DIFFUSING_ALBEDO and one.reduced_depth >= DIFFUSING_DEPTH]
    return _within(text, found, "diffusion", DIFFUSING_ERROR)


def _planned_slabs(report: Report) -> Claim:
    text = f"what the planner takes for slabs with interfaces is within {PLANNED_ERROR} of theirs"
    return _within(text, [slab for slab in report.slabs if slab.ior > 1.0], "planned", PLANNED_ERROR)


def _within(text: str, slabs: Sequence[Slab], model: SlabModel, limit: float) -> Claim:
    if not slabs:
        return Claim(text, None, "no slabs in this run to check it on")
    worst = max(slabs, key=lambda slab: abs(slab.error(model)))
    beyond = sum(abs(slab.error(model)) > limit for slab in slabs)
    where = f"albedo {worst.albedo:g}, depth {worst.depth:g}, g {worst.anisotropy:g}, ior {worst.ior:g}"
    words = f"at most {abs(worst.error(model)):.3f}, at {where}; beyond on {beyond} of {len(slabs)} slabs"
    return Claim(text, not beyond, words)


SLAB_CLAIMS: tuple[Judge, ...] = (_diffusing_slabs, _planned_slabs)


def _shadows(report: Report) -> list[ShadowCase]:
    return [case for case in report.shadows.cases if not case.failure]


def _exact(case: ShadowCase) -> Verdict | None:
    if case.texels is None:
        return None
    return Verdict(case.name, case.texels.p999 <= EXACT, f"{case.texels.p999:.1e}", case.texels.p999)


def _falling(case: ShadowCase) -> Verdict | None:
    if case.order is None:
        return None
    return Verdict(case.name, case.order >= LEAST_ORDER, f"{case.order:.2f}", -case.order)


def _cheap(case: ShadowCase) -> Verdict | None:
    found = next((row.ratio for row in case.rows if row.kind == "method" and row.size == USUAL), None)
    if found is None:
        return None
    vague = abs(found.median - MOST_OF_DEPTH) <= NOISES * found.noise
    words = f"{found.median:.2f} ± {found.noise:.2f}"
    return Verdict(case.name, None if vague else found.median <= MOST_OF_DEPTH, words, found.median)


def _shortcuts(case: ShadowCase) -> Verdict | None:
    medians = {row.method: row.errors.median for row in case.rows if row.errors is not None}
    ours = medians.get(f"map of {USUAL}")
    found = [(medians[name], name) for name in (OPAQUE, CONSTANT, HALF) if name in medians]
    if ours is None or not found:
        return None
    error, name = min(found)
    factor = error / max(ours, LEAST_ERROR)
    return Verdict(case.name, factor >= SHADOW_FACTOR, f"{name} {error:.1e}, {factor:.2g} times", -factor)


def _near_sky(row: SkyRow) -> Verdict:
    return Verdict(row.environment, row.error <= SKY_ERROR, f"{row.error:.1%}", row.error)


def _skies(report: Report) -> Iterator[list[SkyRow]]:
    for name in dict.fromkeys(row.environment for row in report.shadows.sky):
        rows = [row for row in report.shadows.sky if row.environment == name]
        yield sorted(rows, key=lambda row: row.directions)


def _converging(rows: list[SkyRow]) -> Verdict | None:
    fewest, most = rows[0], rows[-1]
    if fewest.directions == most.directions or not most.error > 0.0:
        return None
    order = math.log(fewest.error / most.error) / math.log(most.directions / fewest.directions)
    words = f"order {order:.2f}: {fewest.error:.1%} with {fewest.directions}, {most.error:.1%} with {most.directions}"
    return Verdict(fewest.environment, order >= LEAST_SKY_ORDER, words, -order)


def _caustics(report: Report) -> list[tuple[CausticCase, list[CausticRow]]]:
    """Caustics on grounds, with their rows of many photons."""
    found = [(case, [row for row in case.rows if row.photons >= PHOTONS]) for case in report.shadows.caustics]
    return [(case, rows) for case, rows in found if rows and not case.failure]


def _powerful(given: tuple[CausticCase, list[CausticRow]]) -> Verdict:
    case, rows = given
    off = max((row.power for row in rows), key=abs)
    vague = abs(abs(off) - POWER_ERROR) <= case.power_noise
    words = f"{off:+.2%}, that of the truth ± {case.power_noise:.2%}"
    return Verdict(case.name, None if vague else abs(off) <= POWER_ERROR, words, abs(off))


def _sharp(given: tuple[CausticCase | CausticMediumCase, list[CausticRow]]) -> Verdict:
    case, rows = given
    worst = max(rows, key=lambda row: row.nrmse)
    held = None if worst.nrmse <= CAUSTIC_ERROR < worst.most else worst.nrmse <= CAUSTIC_ERROR
    return Verdict(case.name, held, f"{worst.nrmse:.3f}, at most {worst.most:.3f}", worst.nrmse)


def _near_in_medium(case: CausticMediumCase) -> Verdict | None:
    if case.failure or not (rows := [row for row in case.rows if row.photons]):
        return None
    found = _sharp((case, rows[-1:]))
    without = "".join(f"; without {one.nrmse:.3f}" for one in case.rows if not one.photons)
    return Verdict(found.where, found.held, found.words + without, found.badness)


_worst = partial(ClaimRule, worst=True)

SHADOW_MAP_CLAIMS: tuple[Judge, ...] = (
    _worst(
        "In the rays of a shadow map's texels, transmittance is within 1e-5 of the reference, but for one "
        "in a thousand and for outlines",
        _shadows,
        _exact,
    ),
    _worst(
        f"Errors of shadows fall with the width of texels, outlines included: order {LEAST_ORDER:g} or better",
        _shadows,
        _falling,
    ),
    _worst(
        f"A shadow map takes at most {MOST_OF_DEPTH:g} times as long as one of depth alone, at {USUAL} texels, "
        "where bodies have one medium and nothing opaque is in the way",
        lambda report: [case for case in _shadows(report) if case.alike and not case.opaque],
        _cheap,
    ),
    _worst(
        f"It takes at most {MOST_OF_DEPTH:g} times as long where media differ, or something opaque is in the way",
        lambda report: [case for case in _shadows(report) if case.opaque or not case.alike],
        _cheap,
    ),
    _worst(
        f"Opaque shadow maps, one thickness for each body and float16 are at least {SHADOW_FACTOR:g} times as far off "
        f"as a map of {USUAL}, in the median",
        _shadows,
        _shortcuts,
    ),
)
SKY_CLAIMS: tuple[Judge, ...] = (
    _worst(
        f"Shadows of an environment by {DIRECTIONS} directions are within {SKY_ERROR:.0%} of the mean",
        lambda report: [row for row in report.shadows.sky if row.directions == DIRECTIONS],
        _near_sky,
    ),
    _worst(
        "Errors of shadows of an environment fall with the root of the number of directions, or faster",
        _skies,
        _converging,
    ),
)
CAUSTIC_CLAIMS: tuple[Judge, ...] = (
    _worst(
        f"Caustics have the power of the truth within {POWER_ERROR:.0%}, from {PHOTONS:,} photons", _caustics, _powerful
    ),
    _worst(
        f"Caustics are within {CAUSTIC_ERROR:g} of the mean, blurred by a pixel, from {PHOTONS:,} photons",
        _caustics,
        _sharp,
    ),
)
MEDIUM_CLAIMS: tuple[Judge, ...] = (
    _worst(
        f"In fog, wax and milk, light behind glass is within {CAUSTIC_ERROR:g} of the mean, with photons",
        lambda report: report.shadows.media,
        _near_in_medium,
    ),
)

#: All claims about shadows and caustics, as the page repeats them.
SHADOW_CLAIMS = (*SHADOW_MAP_CLAIMS, *SKY_CLAIMS, *CAUSTIC_CLAIMS, *MEDIUM_CLAIMS)


def hard_claim(known: Sequence[str]) -> Judge:
    """Claim that all hard cases with these identifiers hold."""

    def judge(report: Report) -> Claim:
        text, found = f"All hard cases {known[0]} to {known[-1]} hold", report.hard_cases
        if not found:
            return Claim(text, None, "none has been measured in this run")
        failed = [f"{case.id} {case.title}: {case.result}" for case in found if not case.passed]
        missing = sorted({*known} - {case.id for case in found}, key=known.index)
        if missing:
            failed.append(f"{len(missing)} not measured: {', '.join(missing)}")
        return Claim(text, not failed, "; ".join(failed) or f"{len({case.id for case in found})} measured")

    return judge
