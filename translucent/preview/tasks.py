"""Tasks in background threads, with progress and cancellation."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

from translucent.errors import TranslucentError


class CancelledError(Exception):
    """Exception that ends the work of a canceled task."""


def _nothing(_: Any) -> None:
    """Replacement for the work of a canceled task."""


@dataclass(eq=False)
class Task:
    """Task under way.

    Attributes
    ----------
    name : str
        Shown to the user; empty for work that nobody waits for.
    work : callable
        Takes the task, to which it reports its progress.
    then : callable
        Takes the result, in the thread that polls.
    share : float, optional
        Finished fraction of the work, if that is known.
    detail : str
        Current step of the work.
    key : Hashable, optional
        Identity of the result, see `Lane.request`.
    """

    name: str
    work: Callable[[Task], Any]
    then: Callable[[Any], None] = _nothing
    started: float = field(default_factory=time.monotonic)
    share: float | None = None
    detail: str = ""
    key: Hashable = None
    result: Any = None
    error: Exception | None = None
    cancelled: bool = False
    finished: bool = False

    @property
    def seconds(self) -> float:
        """Seconds since the task was requested."""
        return time.monotonic() - self.started

    @property
    def progress(self) -> str:
        """Progress of the task, in words."""
        fraction = "" if self.share is None else f"{self.share:.0%}"
        parts = " ".join(filter(None, (self.detail, fraction, f"{self.seconds:.0f} s")))
        return f"{self.name}: {parts}"

    def cancel(self) -> None:
        """Cancel the task: the work ends at its next report, or does not start."""
        self.cancelled = True
        # A task may wait long behind another one, and what it would have drawn is large.
        self.work = self.then = _nothing

    def report(self, fraction: float | None, detail: str = "") -> None:
        """Report the progress of the work; raises `CancelledError` if it is canceled."""
        if self.cancelled:
            raise CancelledError
        self.share, self.detail = fraction, detail

    def run(self) -> None:
        """Do the work, in a thread of a `Lane`."""
        try:
            if not self.cancelled:
                self.result = self.work(self)
        except CancelledError:
            pass
        except Exception as error:  # noqa: BLE001 - whatever it is, the window reports it and stays
            self.error = error
        finally:
            self.finished = True


class Lane:
    """Thread that runs one task after the other; a new task replaces the last one.

    Parameters
    ----------
    name : str
    """

    def __init__(self, name: str) -> None:
        self.task: Task | None = None
        self._failed = set[Hashable]()
        self._waiting: SimpleQueue[Task | None] = SimpleQueue()
        # A daemon: nobody who closes the window waits for a reference that nobody will see.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def start(self, name: str, work: Callable[[Task], Any], then: Callable[[Any], None] = _nothing) -> Task:
        """Start work; work under way is canceled."""
        if self.task is not None:
            self.task.cancel()
        self.task = Task(name, work, then)
        self._waiting.put(self.task)
        return self.task

    def request(self, key: Hashable, name: str, work: Callable[[Task], Any]) -> None:
        """Start work, unless other work is under way; `key` identifies its result, see `failed`."""
        if self.task is None:
            self.start(name, work).key = key

    def failed(self, key: Hashable) -> bool:
        """True if the work for this key failed, or was canceled by the user: it should not be requested again."""
        return key in self._failed

    def poll(self, refuse: Callable[[Exception], None]) -> None:
        """Deliver a result that is ready, or its error."""
        task = self.task
        if task is None or not task.finished:
            return
        self.task = None
        if task.key is not None and (task.cancelled or task.error is not None):
            self._failed.add(task.key)
        if task.cancelled:
            return
        if task.error is None:
            task.then(task.result)
        else:
            refuse(task.error)

    def close(self, patience: float = 0.5) -> None:
        """Cancel work under way, and end the thread, unless that takes longer than `patience` seconds."""
        if self.task is not None:
            self.task.cancel()
        self._waiting.put(None)
        self._thread.join(patience)

    @property
    def ended(self) -> bool:
        """True if the thread has ended."""
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (task := self._waiting.get()) is not None:
            task.run()
            del task  # or it, and its model, would stay until the next one


def problem(error: Exception) -> str:
    """Message of an error: those of the toolkit as they are, and a defect by its type."""
    if isinstance(error, TranslucentError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory; close other programs, or use a smaller model or picture"
    return f"unexpected {type(error).__name__}: {error or 'no details'}"
