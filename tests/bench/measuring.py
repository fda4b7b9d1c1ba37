"""Measurements of single cases, small and in haste."""

from __future__ import annotations

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.contenders import contenders
from translucent.bench.drawing import Studio
from translucent.bench.measure import CaseRun
from translucent.bench.record import CaseRecord


def case_of(mesh: tl.Mesh, **more: object) -> Case:
    return Case("mine", "Mine", "mine", lambda size: tl.showcase(mesh, size=size, stage="none"), **more)  # type: ignore[arg-type]


def measured(studio: Studio, case: Case, *names: str, size: tuple[int, int] = (64, 64)) -> CaseRecord:
    chosen = contenders(case.effect, quick=False, only=names)
    return CaseRun(studio, None, case, size, 0.0).measure(chosen)


def named(name: str) -> Case:
    return next(case for case in CASES if case.name == name)
