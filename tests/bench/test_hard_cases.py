"""The hard cases are all there, hold, and can fail."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.bench.hard import Checks, HardCheck
from translucent.bench.hard_light import HARD_CASES as ALL


def test_there_is_one_of_each() -> None:
    assert [case.name for case in ALL] == [f"H{i:02}" for i in range(1, len(ALL) + 1)]
    assert all(case.title and case.promise for case in ALL)


def test_the_page_on_the_report_names_the_first_and_the_last() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "report-errors.md").read_text(encoding="utf-8")
    assert f"{ALL[0].name} to {ALL[-1].name} are inputs" in page


@pytest.mark.parametrize("case", [case for case in ALL if case.name != "H23"], ids=lambda case: case.name)
def test_it_holds(renderer: tl.Renderer, case: HardCheck) -> None:
    found = case.measure(renderer)
    assert found.passed, found.result
    assert found.error is None or found.error <= case.limit


def test_distances_from_the_camera_would_fail(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    far = next(case for case in ALL if case.name == "H07")
    render = Checks.render

    def from_the_camera(checks: Checks, scene: tl.Scene, size: tuple[int, int], *_: object) -> tl.Frame:
        return render(checks, scene, size, tl.SignedDepth(anchored=False))

    monkeypatch.setattr(Checks, "render", from_the_camera)
    found = far.measure(renderer)
    assert not found.passed
    assert found.error is not None
    assert found.error > 10 * far.limit


def check(*values: float, limit: float = 1.0) -> tuple[bool, float | None, str]:
    def run(checks: Checks) -> None:
        for value in values:
            checks.error("off by", value)

    found = HardCheck("H00", "t", "p", run, limit, "").measure(None)  # type: ignore[arg-type]
    return found.passed, found.error, found.result


def test_the_worst_error_counts() -> None:
    assert check(0.1, -0.5, 0.2) == (True, 0.5, "off by 1.0e-01; off by 5.0e-01; off by 2.0e-01")
    assert check(0.1, 2.0) == (False, 2.0, "wrong: off by 2.0e+00")
    assert check(0.1, np.nan, 0.2)[:2] == (False, None)
    assert check(np.inf)[:2] == (False, None)


def test_what_raises_has_failed_and_what_is_not_refused_too() -> None:
    def broken(checks: Checks) -> None:
        raise ZeroDivisionError("oops")

    def lenient(checks: Checks) -> None:
        checks.refused("nonsense", lambda: 3, "word")

    def other(checks: Checks) -> None:
        checks.refused("nonsense", lambda: tl.Medium(anisotropy=2.0), "color")

    found = [dataclasses.replace(ALL[0], check=run).measure(None) for run in (broken, lenient, other)]  # type: ignore[arg-type]
    assert [case.passed for case in found] == [False] * 3
    assert found[0].result == "wrong: ZeroDivisionError: oops"
    assert "gave int, no error" in found[1].result
