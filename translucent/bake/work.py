"""Threaded work with progress, checkpoints and cancellation at any time."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from contextvars import copy_context
from typing import TypeVar

from translucent.bake.canvas import Canvas, Checkpoint
from translucent.bake.strips import Strips

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Callback with the number of texels or corners done, their total, and the number of rays traced.
Progress = Callable[[int, int, int], None]

#: Number of queued pieces of work for each thread; their results wait for their turn.
AHEAD = 4


def in_order(
    task: Callable[[Item], Result], items: Iterable[Item], threads: int, stop: threading.Event
) -> Generator[Result, None, None]:
    """Results of a task for each item, in their order, as they come.

    Whatever ends the iteration early sets `stop`, which the task is to heed, and waits for the threads.
    """
    # How NumPy treats floating-point errors belongs to the context; the caller's choice holds in all threads.
    context = copy_context()
    waiting: deque[Future[Result]] = deque()
    pool = ThreadPoolExecutor(threads)
    try:
        for item in items:
            waiting.append(pool.submit(context.copy().run, task, item))
            if len(waiting) >= AHEAD * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def bake_strips(
    strips: Strips, canvas: Canvas, threads: int, progress: Progress | None, checkpoint: Checkpoint | None
) -> None:
    """Bake the strips that `canvas` lacks."""
    missing = [number for number in range(canvas.strips) if not canvas.done[number]]
    begins = [number * strips.rows for number in missing]
    # Closed whatever is raised here, an interruption by the user as well: that ends the threads.
    with closing(in_order(strips.bake, begins, threads, strips.measure.stop)) as baked:
        for number, begin, strip in zip(missing, begins, baked, strict=True):
            canvas.put(number, begin, strip)
            if checkpoint is not None:
                checkpoint.keep(canvas)
            if progress is not None:
                texels = min(int(canvas.done.sum()) * strips.rows, canvas.size) * canvas.size
                progress(texels, canvas.size**2, canvas.count("traced"))
