"""Claims about light that is scattered many times, checked on the numbers of a report."""

from __future__ import annotations

from collections.abc import Sequence

from translucent.bench.claim import over_cases
from translucent.bench.record import CaseRecord, Claim, Slab, SlabWay
from translucent.bench.row import Row

#: Resolutions of which the finer one has to be nearer, and the one that the planner takes.
COARSE, FINE = "Diffusion, resolution 16", "Diffusion, resolution 32"

#: Share of the mean by which a coarse solution may be the better one by chance, where both are as near as it goes.
CHANCE = 0.005

#: Slabs in which light diffuses: of such an albedo and reduced optical depth diffusion errs by no more than this.
DIFFUSING_ALBEDO, DIFFUSING_DEPTH, DIFFUSING_ERROR = 0.9, 4.0, 0.03

#: Largest error of what the planner takes.
PLANNED_ERROR = 0.05


def scattering_claims(cases: Sequence[CaseRecord], slabs: Sequence[Slab]) -> tuple[Claim, ...]:
    """All of them."""
    cases = [case for case in cases if case.truth_noise is not None and not case.failure]
    diffusing = [slab for slab in slabs if slab.albedo >= DIFFUSING_ALBEDO and slab.reduced_depth >= DIFFUSING_DEPTH]
    planned = [slab for slab in slabs if slab.ior > 1.0]
    return (
        over_cases("Diffusion(32) is nearer to the truth than the layer on every scattering case", cases, _nearer),
        over_cases("Diffusion(32) is nearer than what engines do, fitted or not", cases, _nearer_than_engines),
        over_cases("the error of Diffusion does not grow from a resolution of 16 to one of 32", cases, _finer),
        _within(
            f"Diffusion is within {DIFFUSING_ERROR} of the reflectance and transmittance of slabs of an albedo from "
            f"{DIFFUSING_ALBEDO} and a reduced optical depth from {DIFFUSING_DEPTH:g}",
            diffusing,
            "diffusion",
            DIFFUSING_ERROR,
        ),
        _within(
            f"what the planner takes for slabs with interfaces is within {PLANNED_ERROR} of theirs",
            planned,
            "planned",
            PLANNED_ERROR,
        ),
    )


def _nrmse(case: CaseRecord, method: str) -> float | None:
    return next((row.light.nrmse for row in case.rows if row.method == method and row.light is not None), None)


def _nearer(case: CaseRecord) -> tuple[bool | None, str]:
    ours, layer = _nrmse(case, FINE), _nrmse(case, "ScatteringLayer")
    if ours is None or layer is None:
        return None, ""
    return ours < layer, f"nRMSE {ours:.3f}, the layer {layer:.3f}"


def _nearer_than_engines(case: CaseRecord) -> tuple[bool | None, str]:
    ours = _nrmse(case, FINE)
    others: list[tuple[float, Row]] = [
        (row.light.nrmse, row) for row in case.rows if row.kind == "counter-example" and row.light is not None
    ]
    if ours is None or not others:
        return None, ""
    least, row = min(others, key=lambda each: each[0])
    return ours < least, f"{ours:.3f}, {row.method} {least:.3f}"


def _finer(case: CaseRecord) -> tuple[bool | None, str]:
    coarse, fine = _nrmse(case, COARSE), _nrmse(case, FINE)
    if coarse is None or fine is None:
        return None, ""
    return fine <= coarse + CHANCE, f"{coarse:.3f} to {fine:.3f}"


def _within(text: str, slabs: Sequence[Slab], way: SlabWay, limit: float) -> Claim:
    if not slabs:
        return Claim(text, None, "no slabs in this run to check it on")
    worst = max(slabs, key=lambda slab: abs(slab.error(way)))
    beyond = sum(abs(slab.error(way)) > limit for slab in slabs)
    where = f"albedo {worst.albedo:g}, depth {worst.depth:g}, g {worst.anisotropy:g}, ior {worst.ior:g}"
    return Claim(
        text, not beyond, f"at most {abs(worst.error(way)):.3f}, at {where}; beyond on {beyond} of {len(slabs)} slabs"
    )
