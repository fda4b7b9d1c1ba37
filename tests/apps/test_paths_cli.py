"""Random paths on the command line, and how their progress is reported."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from translucent.commands import console
from translucent.commands import render as command
from translucent.commands.console import ProgressLine, time_text
from translucent.geometry.solids import Box

pytestmark = pytest.mark.usefixtures("one_renderer")

JADE = ("bear", "--preset", "jade", "--method", "path-traced", "--size", "16x12")


def test_a_picture_of_paths_with_its_noise(run: Run, tmp_path: Path) -> None:
    done = run("render", *JADE, "--paths", 4, "--samples", 2, "-o", tmp_path / "bear.npz", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["plan"]["method"].startswith("PathTraced(paths=4, seed=0), thickness by SignedDepth")
    assert found["seconds"]["path_trace"] > 0
    arrays = np.load(tmp_path / "bear.npz")
    assert arrays["standard_error"].shape == arrays["radiance"].shape == (12, 16, 3)
    assert (arrays["standard_error"][arrays["coverage"]] > 0).mean() > 0.9


def test_the_plan_of_paths_is_explained(run: Run) -> None:
    done = run("explain", *JADE[:5], "--paths", 8)
    assert done.code == 0
    assert "path_trace: requested: 8 random paths for each pixel" in done.out
    assert "limit: radiance is the mean of 8 random paths; frame.standard_error states its noise" in done.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("bear", "--paths", 4), "--paths; this option applies only to --method path-traced; add --method path-traced"),
        ((*JADE, "--paths", 1), "PathTraced paths 1; the value must be a whole number in 2 to 1048576"),
        (
            (*JADE, "--interfaces", "traced"),
            "path tracing replaces interfaces; omit interfaces, or choose another method",
        ),
        (
            (*JADE, "--scattering", "single"),
            "path tracing replaces scattering; omit scattering, or choose another method",
        ),
        ((*JADE, "--backend", "cpu"), "use tl.reference.path_trace(scene, size, paths), or an OpenGL backend"),
    ],
)
def test_what_does_not_go_with_paths(run: Run, tmp_path: Path, options: tuple[object, ...], message: str) -> None:
    done = run("render", *options, "-o", tmp_path / "bear.png")
    assert done.code == 2
    assert message in done.err
    assert not (tmp_path / "bear.png").exists()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """A clock that shows its only entry."""
    now = [100.0]
    monkeypatch.setattr(console.time, "monotonic", lambda: now[0])
    return now


def test_progress_tells_how_long_the_rest_takes(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    """Counted from what was done when the first share was known; in a file, a line now and then."""
    tell = ProgressLine("path tracing on a machine")
    shares = {100.0: 0.1, 100.5: 0.15, 110.0: 0.2, 115.0: 0.4, 141.0: 1.0, 150.0: 0.5, 160.0: 0.9}
    shares |= {191.0: 0.92, 222.0: 0.94, 236.0: 0.96}  # after 31, 31 and 45 s, of 41, 72 and 86 in all
    for now, share in shares.items():
        clock[0] = now
        tell(share)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "path tracing on a machine: 20%, about 80 s left",
        "path tracing on a machine: 90%, about 2 s left",
        "path tracing on a machine: 92%, about 8 s left",
        "path tracing on a machine: 96%, about 7 s left",
    ]


def test_quick_work_tells_nothing(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    tell = ProgressLine("path tracing")
    for share in (0.0, 0.5, 0.9, 1.0):
        tell(share)
        clock[0] += 0.3
    assert capsys.readouterr().err == ""


def test_many_triangles_are_told_before_they_take_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    body = tl.Object(Box((0, 0, 0), (1, 1, 1)).tessellate(1), tl.Medium(absorption=1.0))
    scene = tl.Scene([body, body], tl.Camera.look_at((0, 0, 9), (0, 0, 0)))
    command.tell_of_many_faces(scene)
    monkeypatch.setattr(command, "MANY_FACES", 12)
    monkeypatch.setattr(command, "PREPARING", 1.0)
    command.tell_of_many_faces(scene)
    told = "preparing 12 triangles: up to 12 s of processor time; Ctrl-C stops it"
    assert capsys.readouterr().err.splitlines() == [told]  # one mesh of two objects


@pytest.mark.parametrize(("seconds", "text"), [(3.2, "3 s"), (150.0, "2 min"), (9000.0, "2.5 h")])
def test_times_are_told_in_words(seconds: float, text: str) -> None:
    assert time_text(seconds) == text
