"""Measurements of single cases, small and in haste."""

from __future__ import annotations

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.drawing import BenchContext
from translucent.bench.methods import MethodComparison
from translucent.bench.record import CaseRecord


def case_of(mesh: tl.Mesh, **more: object) -> Case:
    return Case("mine", "Mine", "mine", lambda size: tl.showcase(mesh, size=size, stage="none"), **more)  # type: ignore[arg-type]


def measured(bench: BenchContext, case: Case, *names: str, size: tuple[int, int] = (64, 64)) -> CaseRecord:
    bench.size = size
    found: CaseRecord = MethodComparison((case,), names).measure(bench, case)
    return found


def named(name: str) -> Case:
    return next(case for case in CASES if case.name == name)
