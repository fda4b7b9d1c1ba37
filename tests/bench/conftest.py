"""Fixtures of the tests of the report."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import translucent as tl
from translucent.bench.drawing import Studio


@pytest.fixture
def studio(renderer: tl.Renderer) -> Iterator[Studio]:
    with renderer.gpu.context.current():
        made = Studio(renderer)
        yield made
        made.release()
