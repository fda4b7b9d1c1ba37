"""Local process pool in which no worker process takes the others along when it dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from translucent.bake.memory import reuse_freed_memory

#: Seconds that a worker process has for cleaning up when the work is canceled.
PATIENCE = 5.0

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_processes(
    task: Callable[[Item], Result], items: list[Item], workers: int, lost: Callable[[Item], Result]
) -> Iterator[Result]:
    """Results of a task for each item, as they come.

    Processes are spawned, not forked: OpenGL and threads do not survive a fork. When one dies (out of memory, or a
    crash in a library), what was running is done again, one item at a time; `lost` makes the result of an item whose
    process dies even then. Where the iteration is ended early, or its process is killed, the processes end, too.

    Parameters
    ----------
    task : callable
        Found by its name in the processes, so it must be a function of a module.
    items : list
        What pickle can send.
    workers : int
        At most so many processes.
    lost : callable
    """
    waiting = deque(items)
    suspects: deque[Item] = deque()
    while waiting or suspects:
        # A suspect gets a process of its own, so that it can take nothing else along.
        alone = bool(suspects)
        running: dict[Future[Result], Item] = {}
        with _Pool(1 if alone else workers) as pool:
            source = deque([suspects.popleft()]) if alone else waiting
            broken: list[Item] = []
            while (source or running) and not broken:
                while source and len(running) < workers and not broken:
                    item = source.popleft()
                    try:
                        running[pool.submit(_do, task, item)] = item
                    except BrokenProcessPool:  # a process died of something else while it waited
                        broken += [item, *running.values()]
                        running.clear()
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    item = running.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        broken.append(item)
                    else:
                        yield future.result()
            broken += running.values()
        if alone:
            yield from map(lost, broken)
        else:
            suspects.extend(broken)


class _Pool(ProcessPoolExecutor):
    """Worker processes that end at once when the work is canceled."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if kind is not None:
            # Not public before Python 3.14, which has terminate_workers().
            processes = list((self._processes or {}).values())
            manager: Any = self._executor_manager_thread  # typeshed takes it for something else
            for process in processes:
                process.terminate()
            self.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.join(PATIENCE)
                process.kill()  # one that was asked while it started may not have heard
                process.join()
            if manager is not None:  # it waits for the processes, too, and may be about to write down that one ended
                manager.join(1.0)
        self.shutdown(wait=True, cancel_futures=True)


def _do(task: Callable[[Item], Result], item: Item) -> Result:
    """Run a task in a worker process. Where it has tidied up since the process is to end, that ends; a pool would go
    on.
    """
    try:
        return task(item)
    except SystemExit:
        os._exit(143)


def _begin() -> None:
    """Set up a worker process: the parent handles Ctrl-C, and ends the worker so that its files are removed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_follow_parent, daemon=True).start()
    warnings.simplefilter("ignore")  # results tell their warnings
    reuse_freed_memory()


def _follow_parent() -> None:
    """End this worker process when its parent is gone, as reading its pipe would wait forever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE)
    os._exit(143)  # what was running did not hear


def _end(*_: Any) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough; a second one would disturb the tidying
    sys.exit(143)
