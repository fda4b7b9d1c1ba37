"""A workspace with a ball, and a display for the tests that open the window: Xvfb, if it is there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.preview.waiting import SIZE, environment, wait
from tests.processes import PATIENCE
from translucent.planning.scattering import Diffusion
from translucent.preview import worker
from translucent.preview.document import Display, Document, Model
from translucent.preview.quality import StepTimes
from translucent.preview.worker import Pool
from translucent.preview.workspace import Workspace


@pytest.fixture(autouse=True)
def not_nice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worker processes that tests wait for are not nice: they would wait for the tests beside them."""
    monkeypatch.setattr(worker, "NICENESS", 0)
    monkeypatch.setattr(worker, "IDLE", None)


@pytest.fixture
def pool() -> Iterator[Pool]:
    """Worker processes, which end with the test."""
    made = Pool()
    yield made
    made.close()


@pytest.fixture
def quick_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures at rest are drawn in one step, and not in up to 256; light diffuses in cells of a 16th of a body."""
    monkeypatch.setattr(StepTimes, "stride", lambda *_: 1)
    # What `checked` has wrapped: the wrapper has no defaults.
    monkeypatch.setattr(Diffusion.__init__.__wrapped__, "__defaults__", (16,))  # type: ignore[attr-defined]


@pytest.fixture
def work() -> Iterator[Workspace]:
    """A workspace that shows a ball, without the samples of smooth edges: they take most of the time of a picture."""
    made = Workspace(Document(Model("sphere"), display=Display(antialias=False)))
    made.size = SIZE
    wait(made, lambda: made.loaded is not None)
    yield made
    made.close()


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """The name of a display of our own."""
    pytest.importorskip("imgui_bundle", reason="the extra 'ui' is not installed")
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb: the window is not tested (apt-get install xvfb)")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "2600x1700x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as stream:
            number = stream.readline().strip()
        if not number:
            pytest.skip("Xvfb does not start here: the window is not tested")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(PATIENCE)


Preview = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def preview(display: str, tmp_path: Path) -> Preview:
    """Runs ``translucent preview`` on that display."""

    def run(*arguments: str, script: str = "") -> subprocess.CompletedProcess[str]:
        (tmp_path / "script.toml").write_text(script or '[[action]]\ndo = "frame"\n')
        command = [sys.executable, "-m", "translucent", "preview", *arguments, "--size", "640x480", "--json"]
        command += ["--script", str(tmp_path / "script.toml"), "--screenshot", str(tmp_path / "window.png")]
        own = environment(display, tmp_path)
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, env=own, check=False)

    return run
