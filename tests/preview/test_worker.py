"""Work in a process of its own: what it is sent and keeps, how it ends, and what is told when it dies."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box
from translucent.preview import worker
from translucent.preview.tasks import CancelledError, Report, Task
from translucent.preview.worker import Pool

_seen: list[Mesh] = []


@pytest.fixture
def task() -> Task:
    return Task("baking", lambda _: None, lambda _: None)


@pytest.fixture
def pool() -> Iterator[Pool]:
    made = Pool()
    yield made
    made.close()


def pid(report: Report) -> int:
    return os.getpid()


def slow(report: Report) -> None:
    report(0.5, str(os.getpid()))
    time.sleep(60.0)


def steps(report: Report) -> None:
    for i in range(10_000):
        report(i / 10_000, str(os.getpid()))
        time.sleep(0.001)


def dies(report: Report) -> None:
    os._exit(9)


def warns(report: Report, text: str) -> Any:
    warnings.warn(text, tl.TranslucentWarning, stacklevel=1)
    return np.arange(3)


def refuses(report: Report) -> None:
    raise tl.InputError("cheese", "it is no mesh", "give one")


def same_mesh(report: Report, mesh: Mesh) -> tuple[bool, int]:
    """Whether the mesh is the very one of the last call, and how many faces it has."""
    _seen.append(mesh)
    return len(_seen) > 1 and _seen[-2] is mesh, len(mesh.faces)


def alive(report: Report) -> int:
    """How many meshes of other calls there still are."""
    del _seen[:]
    kept = __import__("sys")._getframe(2).f_locals["kept"]
    return sum(isinstance(one, Mesh) for one in kept.values())


def cancelling(task: Task) -> Callable[..., None]:
    report = task.report

    def cancel(share: float | None, detail: str = "") -> None:
        report(share, detail)
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
    monkeypatch.setattr(task, "report", cancelling(task))
    with pytest.raises(CancelledError):
        pool.call(task, steps)
    # What was meant for the last work does not stop the next.
    for _ in range(2):
        assert pool.call(Task("next", lambda _: None, lambda _: None), pid) == int(task.detail)


def test_a_process_that_dies_is_told_and_the_next_one_begins(task: Task, pool: Pool) -> None:
    with pytest.raises(tl.RenderError, match=r"baking; its process ended with status 9"):
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
