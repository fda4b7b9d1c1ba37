"""Thread pool on all processors: NumPy and Embree release the interpreter lock while they compute."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextvars import ContextVar, copy_context
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Event that is set when the work of the thread's pool is to end.
_ended: ContextVar[threading.Event] = ContextVar("ended")


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(task: Callable[[Item], Result], items: Iterable[Item], threads: int) -> list[Result]:
    """Results of a task for each item, in their order.

    The first exception, which may be a Ctrl-C, stops what has not begun, and what has at its next `end_if_stopped`.
    """
    # How NumPy treats floating-point errors belongs to the context; the caller's choice holds in all threads.
    context, ended = copy_context(), threading.Event()
    context.run(_ended.set, ended)
    with ThreadPoolExecutor(threads) as pool:
        try:
            return list(pool.map(lambda item: context.copy().run(task, item), items))
        except BaseException:
            ended.set()
            raise


def end_if_stopped() -> None:
    """Raise `CancelledError` in a thread of `in_threads` whose result nobody waits for; to be called every 100 ms."""
    ended = _ended.get(None)
    if ended is not None and ended.is_set():
        raise CancelledError
