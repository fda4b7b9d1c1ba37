"""Fixtures of the tests of the report."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import translucent as tl
from translucent.bench import output, plots
from translucent.bench.drawing import BenchContext, Effort

#: Rounds are few and frames small: tests look for numbers, and judge no time.
HASTE = Effort(0.0, 0.0, 0.4)


@pytest.fixture
def empty_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages and figures with nothing in the plots of cases: matplotlib takes most of the time of a page."""
    for module in (output, plots):
        monkeypatch.setattr(module, "pareto_svg", lambda *_: '<svg xmlns="http://www.w3.org/2000/svg"></svg>')


@pytest.fixture
def bench(renderer: tl.Renderer) -> Iterator[BenchContext]:
    with renderer.gpu.context.current():
        made = BenchContext(renderer, effort=Effort(0.0, 0.0, 1.0))
        yield made
        made.release()
