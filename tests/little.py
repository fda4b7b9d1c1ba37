"""Pictures for tests that only ask whether they are made: what takes time and changes nothing of that is little."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from translucent.bake import batch
from translucent.planning.shadow_maps import ShadowMaps
from translucent.scene import stages


def with_few_shadows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make maps of shadows of 128 texels a side, where no size is stated, and of 8 directions on stages."""
    monkeypatch.setattr(ShadowMaps.__init__, "__defaults__", (128, None))
    monkeypatch.setattr(stages, "ENVIRONMENT_SHADOWS", 8)


def without_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have batches bake in this process: each of theirs takes most of a second to start."""

    def here(task: Callable[[Any], Any], items: list[Any], *_: Any) -> Iterator[Any]:
        for item in items:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # as in the processes
                result = task(item)
            yield result

    monkeypatch.setattr(batch, "in_processes", here)
