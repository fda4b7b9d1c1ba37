"""Work in worker processes, as libraries that hold the interpreter lock for seconds would freeze the window."""

from __future__ import annotations

import io
import itertools
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from translucent.errors import RenderError, TranslucentWarning
from translucent.geometry.mesh import Mesh
from translucent.media.density import DensityGrid
from translucent.preview.tasks import CancelledError, Task
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.texture import Texture

#: Seconds between checks whether the result is still wanted.
PATIENCE = 0.1

#: Niceness of worker processes, so that the window comes first.
NICENESS = 10

#: Seconds that canceled work has to end, before its process is ended.
PARTING = 5.0

#: Types of large immutable values: sent once, and cached for as long as they live here.
KEPT = (Mesh, EnvironmentMap, Texture, DensityGrid)

Result = TypeVar("Result")


def in_a_process(task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
    """Result of `Companion.call` in a worker process of its own."""
    companion = Companion()
    try:
        return companion.call(task, work, *arguments)
    finally:
        companion.close()


class Companion:
    """Worker process that runs tasks one after the other; it starts with the first, and again if it had to end."""

    def __init__(self) -> None:
        self._running: _Running | None = None
        self._turn = threading.Lock()
        self._closed = False

    def call(self, task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
        """Run `work(report, *arguments)` and return its result, which calls ``report(share, detail)``; its warnings are
        given here.

        Parameters
        ----------
        task : Task
            Is told how far the work is. When nobody waits for it any more, the work ends at its next report, or if that
            takes too long, the process.
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
        while not self._turn.acquire(timeout=PATIENCE):
            task.report(task.share, task.detail)
        try:
            return self._call(task, work, *arguments)
        finally:
            self._turn.release()

    def _call(self, task: Task, work: Callable[..., Result], *arguments: Any) -> Result:
        running = self._running
        if running is None and not self._closed:
            running = self._running = _Running()
        if running is None or self._closed:
            self._end()
            raise CancelledError
        try:
            running.ask(work, arguments)
            failed, content = running.answer(task)
        except (EOFError, ConnectionError):
            status = running.status()
            self._end()
            raise RenderError(
                task.name,
                f"its process ended with status {status}, as when the memory is full",
                "close other programs, or ask for less",
            ) from None
        except CancelledError:
            if not running.stop():
                self._end()
            raise
        except BaseException:
            self._end()
            raise
        if failed:
            raise content
        return content  # type: ignore[no-any-return]

    def close(self, patience: float = PARTING) -> None:
        """End the worker process for good, whatever it is doing; it has `patience` seconds to clean up."""
        self._closed = True
        self._end(patience)

    def _end(self, patience: float = PARTING) -> None:
        running, self._running = self._running, None
        if running is not None:
            running.close(patience)


class _Running:
    """Running worker process, with the record of values sent to it."""

    def __init__(self) -> None:
        # Spawned, not forked: OpenGL and threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_run, args=(theirs, NICENESS), daemon=True)
        self._process.start()
        theirs.close()
        self._numbers = itertools.count(1)
        self._tokens: WeakKeyDictionary[object, int] = WeakKeyDictionary()
        self._sent: set[int] = set()
        self._at = 0

    def ask(self, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        """Send work, preceded by the values that it needs and that were not sent before."""
        stream = io.BytesIO()
        pickler = _Pickler(stream, self._token)
        pickler.dump((work, arguments))
        gone = self._sent - set(self._tokens.values())
        self._sent -= gone
        self._pipe.send(("drop", gone))
        for token, thing in pickler.found.items():
            if token not in self._sent:
                self._pipe.send(("keep", (token, thing)))
                self._sent.add(token)
        self._at = next(self._numbers)
        self._pipe.send(("work", (self._at, stream.getvalue())))

    def answer(self, task: Task) -> tuple[bool, Any]:
        """Answer of the work: whether it failed, and its result or error."""
        while True:
            if not self._pipe.poll(PATIENCE):
                task.report(task.share, task.detail)
                continue
            kind, content = self._pipe.recv()
            if kind in ("done", "failed"):
                return kind == "failed", content
            if kind == "warning":
                warnings.warn(content, TranslucentWarning, stacklevel=4)
            else:
                task.report(*content)

    def stop(self) -> bool:
        """Stop the work at its next report; returns whether it did so in time."""
        end = time.monotonic() + PARTING
        try:
            self._pipe.send(("stop", self._at))
            while self._pipe.poll(max(end - time.monotonic(), 0.0)):
                if self._pipe.recv()[0] in ("done", "failed"):
                    return True
        except (EOFError, ConnectionError):
            pass
        return False

    def status(self) -> int | None:
        """Exit status of the worker process."""
        self._process.join()
        return self._process.exitcode

    def close(self, patience: float) -> None:
        """End the worker process; it has some seconds to remove unfinished files."""
        self._process.terminate()
        self._process.join(patience)
        self._process.kill()
        self._process.join()  # only then it lets go of the file that it has half written
        self._pipe.close()

    def _token(self, thing: object) -> int:
        return self._tokens.setdefault(thing, next(self._numbers))


class _Pickler(pickle.Pickler):
    """Pickler that writes tokens for cached values; `found` has the values themselves."""

    def __init__(self, stream: io.BytesIO, token: Callable[[object], int]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._token = token
        self.found: dict[int, object] = {}

    def persistent_id(self, thing: object) -> int | None:
        if not isinstance(thing, KEPT):
            return None
        token = self._token(thing)
        self.found[token] = thing
        return token


class _Unpickler(pickle.Unpickler):
    """Unpickler for the output of `_Pickler`."""

    def __init__(self, stream: io.BytesIO, kept: dict[int, object]) -> None:
        super().__init__(stream)
        self._kept = kept

    def persistent_load(self, token: Any) -> object:
        return self._kept[token]


def _run(pipe: Connection, niceness: int) -> None:
    """Main loop of the worker process, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window answers Ctrl-C, and ends this process
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # not at once: files are removed that are half written
    warnings.showwarning = lambda message, *_, **__: pipe.send(("warning", str(message)))
    if hasattr(os, "nice"):
        os.nice(niceness)
    kept: dict[int, object] = {}
    while True:
        try:
            kind, content = pipe.recv()
        except (EOFError, OSError):
            return
        if kind == "keep":
            token, kept[token] = content
        elif kind == "drop":
            for token in content:
                del kept[token]
        elif kind == "work":
            _work(pipe, kept, *content)


def _work(pipe: Connection, kept: dict[int, object], number: int, content: bytes) -> None:
    def report(share: float | None, detail: str = "") -> None:
        while pipe.poll():
            if pipe.recv() == ("stop", number):
                raise CancelledError
        pipe.send(("report", (share, detail)))

    answer: tuple[str, object]
    try:
        work, arguments = _Unpickler(io.BytesIO(content), kept).load()
        result = work(report, *arguments)
    except Exception as error:  # noqa: BLE001 - raised where the result is waited for
        answer = "failed", error
    else:
        answer = "done", result
    with suppress(OSError):  # nobody is there any more
        pipe.send(answer)
