"""Files from the window: drawn by another process, one at a time, and whole or not there."""

from __future__ import annotations

import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.preview.waiting import wait
from translucent.files.paths import write_atomically
from translucent.geometry.solids import Box
from translucent.planning.request import RenderRequest
from translucent.preview import exports, worker
from translucent.preview.document import Document, Model
from translucent.preview.exports import write_picture, write_turntable
from translucent.preview.worker import report
from translucent.preview.workspace import Workspace
from translucent.scene.showcase import showcase

SIZE = (64, 40)
SCENE = showcase(Box((-0.01, -0.01, -0.01), (0.01, 0.01, 0.01)).tessellate(), size=SIZE, stage="none")


@pytest.mark.parametrize("transparent", [False, True])
def test_a_picture_is_the_one_that_render_makes(tmp_path: Path, transparent: bool) -> None:
    write_picture(str(tmp_path / "a.png"), SCENE, SIZE, (0.5, "neutral"), RenderRequest(transparent=transparent))
    with tl.Renderer() as renderer:
        renderer.render(SCENE, SIZE, samples=16, transparent=transparent).save(tmp_path / "b.png", 0.5, "neutral")
    written, expected = (np.asarray(Image.open(tmp_path / name)) for name in ("a.png", "b.png"))
    assert written.shape[2] == (4 if transparent else 3)
    np.testing.assert_array_equal(written, expected)


def test_a_turntable_shows_the_model_from_all_around(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    at: list[str] = []
    monkeypatch.setattr(exports, "report", lambda _, detail: at.append(detail))
    write_turntable(str(tmp_path / "a.gif"), SCENE, SIZE, count=3)
    assert at == ["picture 1 of 3", "picture 2 of 3", "picture 3 of 3"]
    with Image.open(tmp_path / "a.gif") as moving:
        assert (moving.n_frames, moving.size) == (3, SIZE)


def test_the_window_has_another_process_write(work: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    work.export(str(path), write_picture, SCENE, SIZE)
    assert [task.name for task in work.busy if task.name.startswith("writing")] == ["writing a.png"]
    work.export(str(tmp_path / "b.png"), write_picture, SCENE, SIZE)
    assert "b.png' has not been written yet; another task is still running: writing a.png" in work.messages[-1].text
    wait(work, lambda: work.lanes["write"].task is None)
    assert work.messages[-1].text == f"wrote {path}"
    with Image.open(path) as image:
        assert image.size == SIZE
    assert [one.name for one in tmp_path.iterdir()] == ["a.png"]


def test_what_cannot_be_written_is_told_at_once(work: Workspace, tmp_path: Path) -> None:
    for name, reason in (("a.tiff", "suffix '.tiff'"), ("none/a.png", "none")):
        work.export(str(tmp_path / name), write_picture, SCENE, SIZE)
        assert work.lanes["write"].task is None
        assert work.messages[-1].kind == "error"
        assert reason in work.messages[-1].text


def slow(path: str) -> None:
    with Path(path).open("wb") as stream:
        try:
            stream.write(b"half")
            report(0.5, "at it")
            time.sleep(60.0)
        finally:
            Path(path).unlink()


def test_a_file_that_nobody_waits_for_is_not_left_half_written(
    work: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker._Worker, "stop", lambda _: False)  # it does not report for long
    path = tmp_path / "a.png"
    work.export(str(path), slow)
    task = work.lanes["write"].task
    assert task is not None
    wait(work, lambda: task.share == 0.5)
    assert path.exists()
    task.cancel()
    wait(work, lambda: task.finished)
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_background_that_cannot_be_written_is_told(work: Workspace, tmp_path: Path) -> None:
    def fails(path: str) -> None:
        raise tl.RenderError(f"writing {path!r}", "the disk is full", "make room")

    work.write(str(tmp_path / "map.exr"), lambda _: fails(str(tmp_path / "map.exr")))
    wait(work, lambda: work.lanes["write"].task is None)
    assert "the disk is full" in work.messages[-1].text


def test_a_window_that_is_closed_finishes_its_file(tmp_path: Path) -> None:
    work, begun = Workspace(Document(Model("sphere"))), threading.Event()
    path = tmp_path / "map.npy"

    def writes(to: str) -> None:
        begun.set()
        time.sleep(0.7)  # longer than other work is waited for
        Path(to).write_bytes(b"whole")

    work.write(str(path), lambda _: writes(str(path)))
    wait(work, begun.is_set)
    work.close()
    assert path.read_bytes() == b"whole"
    assert work.lanes["write"].ended


def hard(path: str) -> None:
    """Writes, and is not to be stopped."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    write_atomically(Path(path), lambda temporary: (temporary.write_bytes(b"half"), report(0.5, ""), time.sleep(60.0)))


def test_what_a_killed_process_has_left_is_removed(
    work: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker._Worker, "stop", lambda _: False)
    monkeypatch.setattr(worker, "PARTING", 0.3)
    work.export(str(tmp_path / "a.png"), hard)
    task = work.lanes["write"].task
    assert task is not None
    wait(work, lambda: task.share == 0.5)
    assert list(tmp_path.iterdir())
    task.cancel()
    wait(work, lambda: task.finished)
    assert not list(tmp_path.iterdir())


def slowly(path: str) -> None:
    """Writes in two halves."""

    def write(temporary: Path) -> None:
        temporary.write_bytes(b"ha")
        report(0.5, "")
        time.sleep(0.3)
        temporary.write_bytes(b"half")

    write_atomically(Path(path), write)


def test_a_window_closed_while_it_saves_leaves_the_file_whole_or_as_it_was(tmp_path: Path) -> None:
    work = Workspace(Document(Model("sphere")))
    (path := tmp_path / "a.png").write_bytes(b"whole")
    work.export(str(path), slowly)
    task = work.lanes["write"].task
    assert task is not None
    wait(work, lambda: task.share == 0.5)
    work.close()
    assert work.lanes["write"].ended
    assert [one.name for one in tmp_path.iterdir()] == ["a.png"]
    assert path.read_bytes() in (b"whole", b"half")
