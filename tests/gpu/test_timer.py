"""Seconds of each pass: what they cover."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
import trimesh

import translucent as tl
from translucent.gpu import pass_costs as timers
from translucent.gpu.pass_costs import PassTimer
from translucent.planning.passes import PassName


def test_what_is_drawn_again_in_a_frame_adds_up(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    class Query:
        """Whatever is drawn takes a second more than the time before."""

        elapsed = 0
        mglo = SimpleNamespace(begin=lambda: None, end=lambda: None)

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


def test_what_takes_longer_than_32_bits_of_nanoseconds_is_read_in_64(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    gl = renderer.gpu.context.gl
    with renderer.gpu.context.current():
        timer, texture = PassTimer(gl), gl.texture((512, 512), 4)
        framebuffer = gl.framebuffer([texture])
        for name in ("one", "other"):
            with timer.measure(name):
                framebuffer.clear(0.5)
        short = timer.seconds()
        monkeypatch.setattr(timers, "_SATURATED", 0)  # as if moderngl's 32 bits were too few for any of them
        assert timer.seconds() == short
        assert 0 < short["one"] != short["other"] > 0
        framebuffer.release()
        texture.release()


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
    # Of several samples, one more is drawn: the ray through the pixel center, for thickness alone.
    light = {PassName.TRACED}
    assert measured == {
        step.name: samples if samples == 1 or step.name in light else samples + 1 for step in frame.plan.passes
    }
    assert frame.seconds.keys() == {*measured, "total"}
