"""Work in a process of its own: what it is sent and keeps, how it ends, and what is reported when it dies."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.processes import PATIENCE, runs, until
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box
from translucent.preview import worker
from translucent.preview.tasks import CancelledError, Task
from translucent.preview.worker import Pool, Urgency, report

_seen: list[Mesh] = []


@pytest.fixture
def task() -> Task:
    return Task("baking", lambda _: None, lambda _: None)


def pid() -> int:
    return os.getpid()


def slow() -> None:
    report(0.5, str(os.getpid()))
    time.sleep(60.0)


def steps() -> None:
    for i in range(10_000):
        report(i / 10_000, str(os.getpid()))
        time.sleep(0.001)


def dies() -> None:
    os._exit(9)


def warns(text: str) -> Any:
    warnings.warn(text, tl.TranslucentWarning, stacklevel=1)
    return np.arange(3)


def refuses() -> None:
    raise tl.InputError("cheese", "it is no mesh", "give one")


def same_mesh(mesh: Mesh) -> tuple[bool, int]:
    """True if the mesh is the very one of the last call, and its number of faces."""
    _seen.append(mesh)
    return len(_seen) > 1 and _seen[-2] is mesh, len(mesh.faces)


def alive() -> int:
    """Number of meshes of other calls that there still are."""
    del _seen[:]
    kept = __import__("sys")._getframe(2).f_locals["kept"]
    return sum(isinstance(one, Mesh) for one in kept.values())


def plane(count: int) -> Mesh:
    """A mesh with so many vertices, and as many faces."""
    corners = np.random.default_rng(0).normal(size=(count, 3))
    return Mesh(corners, (np.arange(3 * count) % count).reshape(-1, 3))


def held(mesh: Mesh) -> None:
    report(None, str(os.getpid()))
    time.sleep(60.0)


def files(folder: str) -> set[str]:
    """Numbers of the files in a folder, or without a name, that this process has mapped."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    return {line.split()[4] for line in lines if folder in line}


def grown(mesh: Mesh, folder: str) -> tuple[Mesh, np.ndarray, set[str]]:
    """A larger mesh, normals, and the files that are mapped."""
    return Mesh(2.0 * mesh.vertices, mesh.faces), mesh.face_normals, files(folder)


def mapped(folder: str, mesh: Mesh) -> tuple[float, set[str]]:
    return float(mesh.vertices[-1, 0]), files(folder)


def policies() -> set[int]:
    return {os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}


def cancelling(task: Task) -> Callable[..., None]:
    reported = task.report

    def cancel(share: float | None, detail: str = "") -> None:
        reported(share, detail)
        if share is not None:
            task.cancel()

    return cancel


def test_a_process_that_nobody_waits_for_ends(task: Task, pool: Pool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "PARTING", 0.2)
    monkeypatch.setattr(task, "report", cancelling(task))
    with pytest.raises(CancelledError):
        pool.call(task, slow)
    with pytest.raises(ProcessLookupError):
        os.kill(int(task.detail), 0)


def test_work_that_reports_ends_and_its_process_goes_on(
    task: Task, pool: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "PARTING", PATIENCE)
    monkeypatch.setattr(task, "report", cancelling(task))
    with pytest.raises(CancelledError):
        pool.call(task, steps)
    # What was meant for the last work does not stop the next.
    for _ in range(2):
        assert pool.call(Task("next", lambda _: None, lambda _: None), pid) == int(task.detail)


@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="this system knows no idle processes")
def test_processes_run_when_nobody_else_wants_to_unless_the_picture_waits(
    task: Task, pool: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "IDLE", os.SCHED_IDLE)
    for urgency, policy in 2 * [
        (Urgency.PICTURE, os.SCHED_OTHER),
        (Urgency.ANSWER, os.SCHED_IDLE),
        (Urgency.LATER, os.SCHED_IDLE),
    ]:
        assert pool.call(task, policies, urgency=urgency) == {policy}


def test_a_process_that_dies_is_told_and_the_next_one_begins(task: Task, pool: Pool) -> None:
    with pytest.raises(tl.RenderError, match=r"baking; the worker process ended with status 9"):
        pool.call(task, dies)
    assert pool.call(task, pid) != os.getpid()


def test_what_the_work_refuses_is_raised_here(task: Task, pool: Pool) -> None:
    first = pool.call(task, pid)
    with pytest.raises(tl.InputError, match="cheese; it is no mesh"):
        pool.call(task, refuses)
    assert pool.call(task, pid) == first


def test_warnings_come_back_with_the_result(task: Task, pool: Pool) -> None:
    with pytest.warns(tl.TranslucentWarning, match="look out"):
        np.testing.assert_array_equal(pool.call(task, warns, "look out"), np.arange(3))


def test_a_mesh_is_sent_once_and_kept_while_it_lives(task: Task, pool: Pool) -> None:
    first, second = Box().tessellate(), Box.slab().tessellate(2)
    assert pool.call(task, same_mesh, first) == (False, 12)
    assert pool.call(task, same_mesh, first) == (True, 12)
    assert pool.call(task, same_mesh, second) == (False, len(second.faces))
    assert pool.call(task, alive) == 2
    del first
    assert pool.call(task, alive) == 1


def test_a_pool_that_is_closed_begins_nothing(task: Task, pool: Pool) -> None:
    first = pool.call(task, pid)
    pool.close()
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)
    with pytest.raises(CancelledError):
        pool.call(task, pid)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells which files a process has mapped")
def test_large_arrays_lie_in_files_without_names_that_all_map(
    task: Task, pool: Pool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    mesh, folder = plane(100_000), str(tmp_path)
    positions = mesh.vertices.copy()
    larger, normals, seen = pool.call(task, grown, mesh, folder)
    np.testing.assert_array_equal(normals, Mesh(positions, mesh.faces).face_normals)
    np.testing.assert_array_equal(larger.vertices, 2.0 * positions)
    np.testing.assert_array_equal(mesh.vertices, positions)
    assert not any(array.flags.owndata or array.flags.writeable for array in (mesh.vertices, larger.vertices, normals))
    ours = files(folder)
    assert len(ours) == 3
    assert len(seen) == 1
    assert seen < ours
    # Nor is what came from there copied on its way to another one.
    value, seen = pool.call(task, mapped, folder, larger)
    assert value == 2.0 * positions[-1, 0]
    assert len(seen) == 2
    assert seen < files(folder) == ours
    del mesh, larger, normals
    gc.collect()
    assert not files(folder)
    assert pool.call(task, mapped, folder, plane(2))[1] == set()
    assert not list(tmp_path.iterdir())


KILLED = """
from tests.preview.test_worker import held, plane
from translucent.preview.tasks import Task
from translucent.preview.worker import Pool

class Told(Task):
    def report(self, share, detail=""):
        print(detail, flush=True)

if __name__ == "__main__":
    Pool().call(Told("holding", print, print), held, plane(100_000))
"""


def test_a_window_that_is_killed_leaves_no_process_and_no_file(tmp_path: Path) -> None:
    (script := tmp_path / "window.py").write_text(KILLED)
    (folder := tmp_path / "temporary").mkdir()
    environment = {**os.environ, "TMPDIR": str(folder), "PYTHONPATH": str(Path(__file__).parents[2])}
    window = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment)
    assert window.stdout is not None
    with window.stdout:
        while not (told := window.stdout.readline().strip()).isdigit():
            assert window.poll() is None
        window.kill()
        window.wait()
    until(lambda: not runs(int(told)))
    assert not list(folder.iterdir())


class Fake:
    """A worker without a process; its work is done when the test says so."""

    def __init__(self, _: object, *, pictures: bool) -> None:
        self.process = SimpleNamespace(is_alive=lambda: True)
        self.pictures = pictures
        self.modules = set[str]()

    def ask(self, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self.begun, self.go = arguments

    def answer(self, task: Task) -> tuple[bool, Any]:
        self.begun.append(task.name)
        self.go[task.name].wait(PATIENCE)
        return False, task.name

    def forget(self) -> None:
        pass

    def close(self, patience: float) -> None:
        pass


def test_what_is_urgent_goes_first_and_never_waits_for_what_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "_Worker", Fake)
    monkeypatch.setattr(worker, "MOST", 2)
    monkeypatch.setattr(worker, "PATIENCE", 0.01)
    pool, begun = Pool(), list[str]()
    order = {"bake": Urgency.LATER, "truth": Urgency.LATER, "probe": Urgency.ANSWER, "shaders": Urgency.PICTURE}
    go = {name: threading.Event() for name in order}
    threads = []
    for name, urgency in order.items():
        call = partial(pool.call, Task(name, print, print), pid, begun, go, urgency=urgency)
        threads.append(threading.Thread(target=call))
        threads[-1].start()
        until(lambda: len(begun) + len(pool._waiting) >= len(threads))
    until(lambda: len(begun) == 2)
    assert begun == ["bake", "shaders"]
    for name in ("shaders", "bake", "probe"):
        go[name].set()
    until(lambda: len(begun) == 4)
    assert begun == ["bake", "shaders", "probe", "truth"]
    go["truth"].set()
    for thread in threads:
        thread.join(PATIENCE)
