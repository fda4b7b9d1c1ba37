"""Work in a process of its own: libraries that hold the interpreter's lock for seconds would stop the window."""

from __future__ import annotations

import multiprocessing
import signal
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from translucent.errors import RenderError, TranslucentWarning
from translucent.preview.tasks import Task

#: Seconds between looks whether anybody still waits for the result.
PATIENCE = 0.1

Result = TypeVar("Result")


def in_a_process(task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
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
    # Spawned, not forked: OpenGL and threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_run, args=(theirs, work, arguments), daemon=True)
    process.start()
    theirs.close()
    try:
        while True:
            if not ours.poll(PATIENCE):
                task.report(task.share, task.detail)
                continue
            kind, content = ours.recv()
            if kind == "done":
                return content  # type: ignore[no-any-return]
            if kind == "failed":
                raise content
            if kind == "warning":
                warnings.warn(content, TranslucentWarning, stacklevel=2)
            else:
                task.report(*content)
    except (EOFError, ConnectionError):
        process.join()
        raise RenderError(
            task.name,
            f"its process ended with status {process.exitcode}, as when the memory is full",
            "close other programs, or ask for less",
        ) from None
    finally:
        process.terminate()
        process.join()
        ours.close()


def _run(pipe: Connection, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """In the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window answers Ctrl-C, and ends this process
    warnings.showwarning = lambda message, *_, **__: pipe.send(("warning", str(message)))
    try:
        result = work(lambda share, detail: pipe.send(("report", (share, detail))), *arguments)
    except Exception as error:  # noqa: BLE001 - raised where the result is waited for
        pipe.send(("failed", error))
    else:
        pipe.send(("done", result))
