"""Work on all processors in threads, and signals that wait where their exception would be lost, or end the process.

NumPy and Embree release the interpreter lock while they compute. Python runs handlers of signals in the main thread.
"""

from __future__ import annotations

import importlib
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache
from types import FrameType
from typing import Any, TypeVar

Handler = Callable[[int, FrameType | None], Any]


class DeferredSignals:
    """Context manager within which no Python handler of a signal runs: signals are raised again at its end.

    Python runs the handler of a signal between two instructions of the main thread, and a handler may raise, as that of
    Ctrl-C does. `moderngl.Context.program` calls Python for each uniform of a program that the driver has compiled,
    ignores that such a call has raised, and goes on with a null pointer. Blocking the signals does not help: another
    thread of the process takes them then, and the main thread still runs the handler. So the handlers are replaced.

    It takes 30 microseconds, on every system. Threads other than the main one run no handlers, and nothing is replaced
    there. May be nested; each is used once.
    """

    def __init__(self) -> None:
        self._handlers: dict[int, Handler] = {}
        self._deferred: set[int] = set()
        self._active = False

    def __enter__(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number in range(1, signal.NSIG):
            handler = signal.getsignal(number)
            if callable(handler):
                self._handlers[number] = handler
                signal.signal(number, self._defer)
        self._active = True

    def __exit__(self, *error: object) -> None:
        # Handlers may raise from here on, also between the lines below: until it is put back, each is called by _defer.
        self._active = False
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._raise_deferred()

    def _defer(self, number: int, frame: FrameType | None) -> None:
        if self._active:
            self._deferred.add(number)
            return
        signal.signal(number, self._handlers[number])
        self._handlers[number](number, frame)

    def _raise_deferred(self) -> None:
        """Raise every deferred signal, even if the handler of one ends this with an exception."""
        if self._deferred:
            try:
                signal.raise_signal(self._deferred.pop())
            finally:
                self._raise_deferred()


def import_trimesh(module: str = "trimesh") -> Any:
    """Import trimesh, or a module of it, as a whole.

    It catches whatever is raised while it imports other packages, Ctrl-C too, and would then be without these.
    """
    with DeferredSignals():
        return importlib.import_module(module)


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


@cache
def _blas() -> Any:
    """Controller of the BLAS that NumPy has loaded, and SciPy if it has: looking for it takes milliseconds."""
    from threadpoolctl import ThreadpoolController  # late: most commands multiply no matrices

    return ThreadpoolController().select(user_api="blas")


#: The `one_blas_thread` that have begun and not ended, and the lock that guards them.
_limited, _limiting = list[Any](), threading.Lock()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Context within which products of matrices use one thread of the processor, in the whole process.

    For a millisecond's work more threads gain nothing, and then wait in busy loops for longer than it took. Contexts
    may be nested, and overlap in several threads: the number of threads is restored at the end of the last one.
    """
    if os.environ.get("OPENBLAS_NUM_THREADS") == "1":  # as the command line has set it
        yield
        return
    with _limiting:
        _limited.append(None if _limited else _blas().limit(limits=1))
    try:
        yield
    finally:
        with _limiting:
            limit = _limited[0]
            _limited.pop()
            if not _limited:
                limit.restore_original_limits()
