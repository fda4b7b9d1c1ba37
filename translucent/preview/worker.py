"""One pool of worker processes, as libraries that hold the interpreter lock for seconds would freeze the window.

Processes start when there is work for them, and end when others are idle, too. Work that somebody waits for goes first.
Large values are in files that all processes map: see `preview.sharing`.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from bisect import insort
from collections.abc import Callable
from contextlib import suppress
from enum import IntEnum
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from translucent.errors import RenderError, TranslucentWarning
from translucent.geometry.mesh import Mesh
from translucent.media.density import DensityGrid
from translucent.preview.sharing import Channel, Parcel
from translucent.preview.tasks import CancelledError, Task
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.texture import Texture

#: Seconds between checks whether the result is still wanted.
PATIENCE = 0.1

#: Policy of a scheduler that has others run at once when they want to, so that the window comes first. Before a frame
#: that wakes up may go on, Linux leaves even nice processes the rest of their slice: a millisecond or more, at each of
#: the many times that a frame waits.
IDLE: int | None = getattr(os, "SCHED_IDLE", None)

#: Niceness where the system knows no such policy.
NICENESS = 19

#: Seconds that canceled work has to end, before its process is ended.
PARTING = 5.0

#: Largest number of processes, the last of which is for `Urgency.PICTURE`; and of those that stay without work.
MOST, MOST_IDLE = 5, 2

#: Types of large immutable values: sent once, and cached for as long as they live here.
KEPT = (Mesh, EnvironmentMap, Texture, DensityGrid)

Result = TypeVar("Result")


class Urgency(IntEnum):
    """Urgency of work: what the picture waits for, what the user waits for, and what is for later."""

    PICTURE = 0
    ANSWER = 1
    LATER = 2


class Pool:
    """Pool of worker processes for the work of several threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []
        self._waiting: list[tuple[Urgency, int]] = []
        self._numbers = itertools.count(1)
        self._kept = _Kept()
        self._closed = False

    def call(
        self, task: Task, work: Callable[..., Result], *arguments: Any, urgency: Urgency = Urgency.ANSWER
    ) -> Result:
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
        urgency : Urgency

        Raises
        ------
        CancelledError
            If nobody waits.
        RenderError
            If the process dies.
        Exception
            What `work` raises.
        """
        worker = self._taken(task, work, urgency)
        try:
            worker.ask(work, arguments)
            failed, content = worker.answer(task)
        except (EOFError, ConnectionError):
            status = worker.status()
            self._end(worker)
            if self._closed:
                raise CancelledError from None
            raise RenderError(
                task.name,
                f"its process ended with status {status}, as when the memory is full",
                "close other programs, or ask for less",
            ) from None
        except CancelledError:
            self._give_back(worker) if worker.stop() else self._end(worker)
            raise
        except BaseException:
            self._end(worker)
            raise
        self._give_back(worker)
        if failed:
            raise content
        return content  # type: ignore[no-any-return]

    def close(self, patience: float = PARTING) -> None:
        """End all processes for good, whatever they are doing; they have `patience` seconds to clean up."""
        with self._changed:
            self._closed = True
            idle, self._idle = self._idle, []
            running = [*idle, *self._busy]
        for worker in running:
            worker.terminate()
        end = time.monotonic() + patience
        for worker in running:
            worker.close(max(end - time.monotonic(), 0.0))

    def _taken(self, task: Task, work: Callable[..., Any], urgency: Urgency) -> _Worker:
        """Worker for some work: one that has done such before, or is idle, or a new one."""
        ticket = urgency, next(self._numbers)
        with self._changed:
            insort(self._waiting, ticket)
            try:
                most = MOST - (urgency > Urgency.PICTURE)
                while not self._closed and (self._waiting[0] != ticket or len(self._busy) >= most):
                    self._changed.wait(PATIENCE)
                    task.report(task.share, task.detail)
                if self._closed:
                    raise CancelledError
            finally:
                self._waiting.remove(ticket)
                self._changed.notify_all()
            self._idle = [worker for worker in self._idle if worker.alive]
            known = [worker for worker in self._idle if work.__module__ in worker.modules]
            worker = (known or self._idle)[-1] if self._idle else _Worker(self._kept)
            if self._idle:
                self._idle.remove(worker)
            self._busy.append(worker)
            return worker

    def _give_back(self, worker: _Worker) -> None:
        with self._changed:
            self._busy.remove(worker)
            self._idle.append(worker)
            surplus = [self._idle.pop(0) for _ in range(len(self._idle) - MOST_IDLE)]
            with suppress(ConnectionError):  # whoever has died is told by its next work
                for idle in self._idle:
                    idle.forget()
            self._changed.notify_all()
        for worker in surplus:
            worker.close(PARTING)

    def _end(self, worker: _Worker) -> None:
        worker.close(PARTING)
        with self._changed:
            self._busy.remove(worker)
            self._changed.notify_all()


class _Kept:
    """Tokens of large values, and what they were packed into, for as long as they live here."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self._packed: WeakKeyDictionary[object, tuple[int, Parcel]] = WeakKeyDictionary()
        self._lock = threading.RLock()

    def packed(self, value: object) -> tuple[int, Parcel]:
        """Token and parcel of a value; from then on its arrays, too, are those of the file."""
        with self._lock:
            if (found := self._packed.get(value)) is None:
                found = self.take(value, Parcel.of(value))
                if found[1].file is not None:
                    vars(value).update(vars(found[1].open()))
            return found

    def take(self, value: object, parcel: Parcel) -> tuple[int, Parcel]:
        """Token of a value that came in a parcel."""
        with self._lock:
            found = self._packed[value] = next(self._numbers), parcel
            return found

    @property
    def tokens(self) -> set[int]:
        """Tokens of all values that are still alive."""
        with self._lock:
            return {token for token, _ in self._packed.values()}


class _Worker:
    """Running worker process, with the record of values sent to it.

    Attributes
    ----------
    modules : set of str
        That it has done work of, and has made ready what that needs.
    """

    def __init__(self, kept: _Kept) -> None:
        # Spawned, not forked: OpenGL and threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_run, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        assert self._process.pid is not None
        _give_way(self._process.pid)
        self._channel = Channel(pipe, self._process.pid)
        self._kept, self._sent = kept, set[int]()
        self._closing = threading.Lock()
        self._known: dict[int, object] = {}
        self._number = 0
        self.modules: set[str] = set()

    def ask(self, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        """Send work, preceded by the values that it needs and that were not sent before."""
        found: dict[int, Parcel] = {}
        self._known = {}

        def token(value: object) -> int | None:
            if not isinstance(value, KEPT):
                return None
            number, parcel = self._kept.packed(value)
            found[number], self._known[number] = parcel, value
            return number

        asked = Parcel.of((work, arguments), token)
        self.forget()
        for number in found.keys() - self._sent:
            self._channel.send("keep", number, found[number])
            self._sent.add(number)
        self._number += 1
        self._channel.send("work", self._number, asked)
        self.modules.add(work.__module__)

    def forget(self) -> None:
        """Have it drop what nobody here holds any more."""
        for number in self._sent - self._kept.tokens:
            self._channel.send("drop", number, Parcel(b""))
            self._sent.discard(number)

    def answer(self, task: Task) -> tuple[bool, Any]:
        """Answer of the work: whether it failed, and its result or error."""
        while True:
            if not self._channel.pipe.poll(PATIENCE):
                task.report(task.share, task.detail)
                continue
            kind, number, parcel = self._channel.receive()
            content = parcel.open(self._known.__getitem__)
            if kind in ("done", "failed"):
                self._known = {}
                return kind == "failed", content
            if kind == "made":
                self._known[number] = content
                self._kept.take(content, parcel)
            elif kind == "warning":
                warnings.warn(content, TranslucentWarning, stacklevel=4)
            else:
                task.report(*content)

    def stop(self) -> bool:
        """Stop the work at its next report; returns whether it did so in time."""
        end = time.monotonic() + PARTING
        try:
            self._channel.send("stop", self._number, Parcel(b""))
            while self._channel.pipe.poll(max(end - time.monotonic(), 0.0)):
                if self._channel.receive()[0] in ("done", "failed"):
                    return True
        except (EOFError, ConnectionError):
            pass
        return False

    @property
    def alive(self) -> bool:
        """True if the worker process is there."""
        return self._process.is_alive()

    def status(self) -> int | None:
        """Exit status of the worker process."""
        self._process.join(PARTING)
        return self._process.exitcode

    def terminate(self) -> None:
        """Ask the worker process to end."""
        self._process.terminate()

    def close(self, patience: float) -> None:
        """End the worker process; it has some seconds to remove unfinished files."""
        self._process.terminate()
        self._process.join(patience)
        with self._closing:  # whoever waits for its work, and whoever closes the pool, may do so at the same time
            self._process.kill()
            self._process.join()  # only then it lets go of the file that it has half written
            self._channel.pipe.close()


def _give_way(process: int) -> None:
    """Have a process that has just begun, and all its threads to come, let others run first."""
    with suppress(OSError):  # containers may forbid it, or it has ended
        if IDLE is not None:
            os.sched_setscheduler(process, IDLE, os.sched_param(0))
        elif hasattr(os, "setpriority"):
            os.setpriority(os.PRIO_PROCESS, process, NICENESS)


def _run(pipe: Connection) -> None:
    """Main loop of the worker process, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window answers Ctrl-C, and ends this process
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_follow_parent, daemon=True).start()
    channel = Channel(pipe, os.getppid())
    warnings.showwarning = lambda message, *_, **__: channel.send("warning", 0, Parcel.of(str(message)))
    kept: dict[int, object] = {}
    while True:
        try:
            kind, number, parcel = channel.receive()
        except (EOFError, OSError):
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            return
        if kind == "keep":
            kept[number] = parcel.open()
        elif kind == "drop":
            del kept[number]
        elif kind == "work":
            _work(channel, kept, number, parcel)


def _end(*_: object) -> None:
    """End, but not at once: files are removed that are half written; and only once, as that takes a while."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(1)


def _follow_parent() -> None:
    """End this process when the window is gone, which work that does not report would not hear of."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PARTING)
    os._exit(1)


def _work(channel: Channel, kept: dict[int, object], number: int, parcel: Parcel) -> None:
    def report(share: float | None, detail: str = "") -> None:
        while channel.pipe.poll():
            if channel.receive()[:2] == ("stop", number):
                raise CancelledError
        channel.send("report", number, Parcel.of((share, detail)))

    numbers = {id(value): one for one, value in kept.items()}
    made = list[object]()

    def token(value: object) -> int | None:
        if not isinstance(value, KEPT):
            return None
        if id(value) not in numbers:
            made.append(value)
            numbers[id(value)] = -len(made)
            channel.send("made", -len(made), Parcel.of(value))
        return numbers[id(value)]

    kind = "done"
    try:
        work, arguments = parcel.open(kept.__getitem__)
        answer = Parcel.of(work(report, *arguments), token)
    except Exception as error:  # noqa: BLE001 - raised where the result is waited for
        kind, answer = "failed", Parcel.of(error)
    with suppress(OSError):  # nobody is there any more
        channel.send(kind, number, answer)
