"""Seconds of each pass: what they cover."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import trimesh

import translucent as tl
from translucent.gpu.timer import PassTimer
from translucent.planning.passes import PassName


def test_what_is_drawn_again_in_a_frame_adds_up(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    class Query:
        """Whatever is drawn takes a second more than the time before."""

        elapsed = 0

        def __enter__(self) -> None:
            self.elapsed += 10**9

        def __exit__(self, *_: object) -> None: ...

    with renderer.gpu.context.current():
        timer = PassTimer(renderer.gpu.context.gl)
    monkeypatch.setattr(timer, "_gl", type("Gl", (), {"query": lambda _, time: Query()})())
    for name in ("depth", "shade", "depth", "depth"):
        with timer.measure(name):
            pass
    assert timer.seconds() == {"depth": 1.0 + 2.0 + 3.0, "shade": 1.0}
    timer.begin_frame()
    assert timer.seconds() == {}
    with timer.measure("depth"):
        pass
    assert timer.seconds() == {"depth": 4.0}


@pytest.mark.parametrize("samples", [1, 3])
def test_times_of_passes_are_those_of_all_samples(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch, samples: int
) -> None:
    measured: Counter[str] = Counter()
    original = PassTimer.measure

    @contextmanager
    def counting(self: PassTimer, name: str) -> Iterator[Any]:
        measured[name] += 1
        with original(self, name):
            yield

    monkeypatch.setattr(PassTimer, "measure", counting)
    box = trimesh.creation.box((1, 1, 1))
    scene = tl.showcase(
        tl.Mesh(box.vertices, box.faces), tl.Medium(absorption=(1, 2, 3), ior=1.5), size=(16, 12), stage="none"
    )
    frame = renderer.render(scene, size=(16, 12), samples=samples)
    # Of several samples, one more is drawn: the ray through the pixel center, for thickness, of which no light is seen.
    light = {PassName.TRACED}
    assert measured == {
        step.name: samples if samples == 1 or step.name in light else samples + 1 for step in frame.plan.passes
    }
    assert frame.seconds.keys() == {*measured, "total"}
