"""Work in a process of its own: libraries that hold the interpreter's lock for seconds would stop the window."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from translucent.errors import RenderError, TranslucentWarning
from translucent.preview.tasks import Task

#: Seconds between looks whether anybody still waits for the result.
PATIENCE = 0.1

#: Seconds in which a process that has been told to end removes what it has half written.
PARTING = 5.0

Result = TypeVar("Result")


def in_a_process(task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
    """The result of `Companion.call` in a process for this alone."""
    companion = Companion()
    try:
        return companion.call(task, work, *arguments)
    finally:
        companion.close()


class Companion:
    """A process that does one thing after the other; it begins with the first of them, and again if it had to end."""

    def __init__(self) -> None:
        self._running: tuple[BaseProcess, Connection] | None = None

    def call(self, task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
        """The result of `work(report, *arguments)`, which calls ``report(share, detail)``; its warnings are given here.

        Parameters
        ----------
        task : Task
            Is told how far the work is; the process ends when nobody waits for it any more.
        work : callable
            A function of a module: the process finds it by its name.
        *arguments
            What pickle can send.

        Raises
        ------
        CancelledError
            If nobody waits.
        RenderError
            If the process dies.
        Exception
            What `work` raises.
        """
        process, pipe = self._running = self._running or _start()
        try:
            pipe.send((work, arguments))
            failed, content = _answer(task, pipe)
        except (EOFError, ConnectionError):
            process.join()
            self.close()
            raise RenderError(
                task.name,
                f"its process ended with status {process.exitcode}, as when the memory is full",
                "close other programs, or ask for less",
            ) from None
        except BaseException:
            self.close()  # nothing else would stop what it is at
            raise
        if failed:
            raise content
        return content  # type: ignore[no-any-return]

    def close(self) -> None:
        """End the process, whatever it is at."""
        if self._running is not None:
            process, pipe = self._running
            self._running = None
            process.terminate()
            process.join(PARTING)
            process.kill()
            pipe.close()


def _start() -> tuple[BaseProcess, Connection]:
    # Spawned, not forked: OpenGL and threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_run, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return process, ours


def _answer(task: Task, pipe: Connection) -> tuple[bool, Any]:
    """Whether the work failed, and its result or error."""
    while True:
        if not pipe.poll(PATIENCE):
            task.report(task.share, task.detail)
            continue
        kind, content = pipe.recv()
        if kind in ("done", "failed"):
            return kind == "failed", content
        if kind == "warning":
            warnings.warn(content, TranslucentWarning, stacklevel=3)
        else:
            task.report(*content)


def _run(pipe: Connection) -> None:
    """In the process: until nobody is at the other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window answers Ctrl-C, and ends this process
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    warnings.showwarning = lambda message, *_, **__: pipe.send(("warning", str(message)))
    while True:
        try:
            work, arguments = pipe.recv()
        except EOFError:
            return
        try:
            result = work(lambda share, detail: pipe.send(("report", (share, detail))), *arguments)
        except Exception as error:  # noqa: BLE001 - raised where the result is waited for
            pipe.send(("failed", error))
        else:
            pipe.send(("done", result))
