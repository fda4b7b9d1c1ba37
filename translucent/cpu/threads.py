"""Thread pool on all processors: NumPy and Embree release the interpreter lock while they compute."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(task: Callable[[Item], Result], items: Iterable[Item], threads: int) -> list[Result]:
    """Results of a task for each item, in their order; the first exception stops what has not begun."""
    # How NumPy treats floating-point errors belongs to the context; the caller's choice holds in all threads.
    context = copy_context()
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda item: context.copy().run(task, item), items))
