"""A baked map shown on its model, and work in a process of its own; the baker itself has tests elsewhere."""

from __future__ import annotations

import dataclasses
import os
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.preview import baking
from translucent.preview.document import Orbit
from translucent.preview.elsewhere import in_a_process
from translucent.preview.tasks import CancelledError, Task
from translucent.solids import Box

BOX = Box((0.0, 0.0, 0.0), (0.02, 0.02, 0.02)).tessellate()


@pytest.fixture
def task() -> Task:
    return Task("baking", lambda _: None, lambda _: None)


def test_the_model_is_painted_with_its_map(task: Task) -> None:
    body = tl.Object(BOX, tl.Medium(absorption=1.0))
    baked = baking.bake_map(task, body, tl.Medium(absorption=2.0), "transmittance", 32, 4)
    assert baked.map.settings.medium == tl.Medium(absorption=2.0)
    assert (baked.map.settings.size, baked.map.settings.rays) == (32, 4)
    assert task.share is not None
    values = baked.map.values[baked.map.coverage]
    assert float(baked.thickest_text("mm").removesuffix(" mm")) == pytest.approx(1e3 * values.max(), rel=1e-4)
    assert 0.0 < baked.covered < 1.0
    orbit = Orbit(distance=6.0, yaw=0.0, pitch=0.0)
    scene = baked.seen_from(orbit)
    assert baked.seen_from(dataclasses.replace(orbit)) is scene
    assert scene.objects[0].mesh.uv is not None
    assert scene.objects[0].surface is not None
    assert scene.objects[0].surface.color_texture is not None


def test_what_the_baker_refuses_is_told(task: Task) -> None:
    with pytest.raises(tl.InputError, match=r"rays 1"):
        baking.bake_map(task, tl.Object(BOX, tl.Medium(absorption=1.0)), tl.Medium(), "cone", 8, 1)


def slow(report: Callable[[float | None, str], None]) -> None:
    report(0.5, str(os.getpid()))
    time.sleep(60.0)


def dies(report: Callable[[float | None, str], None]) -> None:
    os._exit(9)


def warns(report: Callable[[float | None, str], None], text: str) -> Any:
    warnings.warn(text, tl.TranslucentWarning, stacklevel=1)
    return np.arange(3)


def test_a_process_that_nobody_waits_for_ends(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    report = task.report

    def cancel(share: float | None, detail: str = "") -> None:
        report(share, detail)
        if share is not None:
            task.cancel()

    monkeypatch.setattr(task, "report", cancel)
    with pytest.raises(CancelledError):
        in_a_process(task, slow)
    with pytest.raises(ProcessLookupError):
        os.kill(int(task.detail), 0)


def test_a_process_that_dies_is_told(task: Task) -> None:
    with pytest.raises(tl.RenderError, match=r"baking; its process ended with status 9"):
        in_a_process(task, dies)


def test_warnings_come_back_with_the_result(task: Task) -> None:
    with pytest.warns(tl.TranslucentWarning, match="look out"):
        np.testing.assert_array_equal(in_a_process(task, warns, "look out"), np.arange(3))
