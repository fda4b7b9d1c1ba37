"""Work in threads: what nobody waits for any more does not keep what it would have needed."""

from __future__ import annotations

import gc
import threading
import weakref

import numpy as np

from tests.processes import PATIENCE, until
from translucent.preview.tasks import Lane, Task


def test_a_task_that_waits_and_is_cancelled_lets_go_of_what_it_holds() -> None:
    lane, begun, end = Lane("test"), threading.Event(), threading.Event()
    done = []

    def long(_: Task) -> None:
        begun.set()
        end.wait(PATIENCE)

    def ask() -> weakref.ref[np.ndarray]:
        scene = np.zeros(8)
        lane.start("draw", lambda _: scene.sum(), lambda _: done.append(scene))
        return weakref.ref(scene)

    lane.start("long", long, print)
    assert begun.wait(PATIENCE)
    waiting = [ask() for _ in range(5)]
    gc.collect()
    assert [one() is None for one in waiting] == [True] * 4 + [False]
    task = lane.task
    assert task is not None
    end.set()
    until(lambda: task.finished)
    lane.poll(print)
    assert len(done) == 1
    lane.close()
