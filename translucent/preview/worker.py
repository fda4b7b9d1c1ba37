"""Worker processes, as libraries that hold the interpreter lock for seconds would freeze the window.

Processes start when there is work for them, and end when others are idle, too. Work that the picture waits for goes
first, and at normal priority; all other work is done when nobody else wants to run. Large arrays travel in files that
all processes map into memory. Such a file has no name: it ends with the last process that holds it, however that ends;
and where memory is short, the system writes its pages to disk, which shared memory would keep.
"""

from __future__ import annotations

import io
import itertools
import mmap
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import threading
import time
import warnings
from bisect import insort
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from multiprocessing import reduction
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

from translucent.assets import newest_shader
from translucent.errors import RenderError, TranslucentWarning
from translucent.files.reading import size_text
from translucent.geometry.mesh import Mesh
from translucent.media.density import DensityGrid
from translucent.preview.tasks import CancelledError, Task
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.texture import Texture

if TYPE_CHECKING:
    from translucent.renderer import Renderer

#: Seconds between checks whether the result is still requested.
PATIENCE = 0.1

#: Policy of a scheduler that has others run at once when they want to, so that the window comes first. Before a frame
#: that wakes up may go on, Linux leaves even nice processes the rest of their slice: a millisecond or more, at each of
#: the many times that a frame waits. What the picture waits for has processes of normal priority: on a machine whose
#: cores are all busy, idle ones get a second of processor in minutes. Linux lets none return from that policy.
IDLE: int | None = getattr(os, "SCHED_IDLE", None)

#: Niceness where the system knows no such policy.
NICENESS = 19

#: Seconds that canceled work has to end, before its process is ended.
PARTING = 5.0

#: Largest number of processes, the last one for `Urgency.PICTURE`; and of processes that stay without work.
MOST, MOST_IDLE = 5, 2

#: Types of large immutable values: sent once, and cached for as long as they live here.
KEPT = (Mesh, EnvironmentMap, Texture, DensityGrid)

#: Bytes of an array from which on it lies in a file, where arrays begin at multiples of so many bytes.
LARGE, ALIGNMENT = 1 << 20, 64

#: Finds the token that replaces a value in a message, or None if the value itself is to be sent.
Token = Callable[[object], int | None]

Result = TypeVar("Result")


class Urgency(IntEnum):
    """Urgency of work: the picture waits for it, the user does, or nobody."""

    PICTURE = 0
    ANSWER = 1
    LATER = 2


@dataclass(frozen=True, eq=False)
class WorkerMessage:
    """Pickled value.

    Attributes
    ----------
    text : bytes
    spans : tuple of (begin, end)
        Bytes of its large arrays in the file.
    file : int, optional
        Descriptor of the file with its large arrays, which closes with the message; None without any.
    """

    text: bytes = b""
    spans: tuple[tuple[int, int], ...] = ()
    file: int | None = None

    @classmethod
    def of(cls, value: object, token: Token | None = None) -> WorkerMessage:
        """Pack a value; parts of it that have a token are left out.

        Raises
        ------
        RenderError
            If there is no room for its arrays.
        """
        stream, arrays = io.BytesIO(), list[memoryview]()
        _Pickler(stream, arrays, token).dump(value)
        if not arrays:
            return cls(stream.getvalue())
        spans = []
        try:
            with tempfile.TemporaryFile() as file:
                for array in arrays:
                    begin = file.seek(-(-file.tell() // ALIGNMENT) * ALIGNMENT)
                    file.write(array)
                    spans.append((begin, begin + array.nbytes))
                file.flush()
                return cls(stream.getvalue(), tuple(spans), os.dup(file.fileno()))
        except OSError as error:
            size = size_text(sum(array.nbytes for array in arrays))
            found = f"{tempfile.gettempdir()} has no space for {size} of meshes and pictures ({error.strerror})"
            raise RenderError(
                "work of another process", found, "free some disk space, or set TMPDIR to another folder"
            ) from error

    def open(self, known: Callable[[int], object] | None = None) -> Any:
        """Unpack the value, whose large arrays are read-only views of the file; `known` has the values for tokens."""
        views: list[memoryview] = []
        if self.file is not None:
            memory = memoryview(mmap.mmap(self.file, 0, access=mmap.ACCESS_READ))
            views = [memory[begin:end] for begin, end in self.spans]
        return _Unpickler(io.BytesIO(self.text), views, known).load()

    def __del__(self) -> None:
        if self.file is not None:
            os.close(self.file)


class _Pickler(pickle.Pickler):
    """Pickler that leaves out values with tokens, and collects large arrays."""

    def __init__(self, stream: io.BytesIO, arrays: list[memoryview], token: Token | None) -> None:
        def stays(array: pickle.PickleBuffer) -> bool:
            raw = array.raw()
            if raw.nbytes >= LARGE:
                arrays.append(raw)
            return raw.nbytes < LARGE

        super().__init__(stream, protocol=5, buffer_callback=stays)  # no method: the cycle would keep the values alive
        self._token = token

    def persistent_id(self, value: object) -> int | None:
        return None if self._token is None else self._token(value)


class _Unpickler(pickle.Unpickler):
    """Unpickler that looks tokens up."""

    def __init__(self, stream: io.BytesIO, views: list[memoryview], known: Callable[[int], object] | None) -> None:
        super().__init__(stream, buffers=views)
        self._known = known

    def persistent_load(self, token: Any) -> object:
        assert self._known is not None
        return self._known(token)


@dataclass(frozen=True)
class Channel:
    """End of a pipe for messages, each with a type and a number.

    Attributes
    ----------
    pipe : Connection
    peer : int
        Identifier of the process at the other end.
    """

    pipe: Connection
    peer: int

    def send(self, kind: str, number: int, message: WorkerMessage) -> None:
        """Send a message."""
        self.pipe.send((kind, number, message.text, message.spans))
        if message.file is not None:
            reduction.send_handle(self.pipe, _handle(message.file), self.peer)

    def receive(self) -> tuple[str, int, WorkerMessage]:
        """Type, number and message that the other end has sent; waits for it."""
        kind, number, text, spans = self.pipe.recv()
        file = _descriptor(reduction.recv_handle(self.pipe)) if spans else None
        return kind, number, WorkerMessage(text, spans, file)


if sys.platform == "win32":
    import msvcrt

    def _handle(descriptor: int) -> int:
        return msvcrt.get_osfhandle(descriptor)

    def _descriptor(handle: int) -> int:
        return msvcrt.open_osfhandle(handle, os.O_RDONLY)

else:

    def _handle(descriptor: int) -> int:
        return descriptor

    _descriptor = _handle


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
        """Call ``work(*arguments)`` in a worker process, and return its result; its warnings are given here.

        Parameters
        ----------
        task : Task
            Gets what the work reports, see `report`. Once it is canceled, the work ends at its next report, or if that
            takes too long, with its process.
        work : callable
            A function of a module: the process finds it by its name.
        *arguments
            Values that pickle can send.
        urgency : Urgency

        Raises
        ------
        CancelledError
            If the task is canceled.
        RenderError
            If the process dies.
        Exception
            Any that `work` raises.
        """
        worker = self._taken(task, work, urgency)
        try:
            worker.ask(work, arguments)
            failed, content = worker.answer(task)
        except (EOFError, ConnectionError):
            worker.process.join(PARTING)
            status = worker.process.exitcode
            self._end(worker)
            if self._closed:
                raise CancelledError from None
            found = f"the worker process ended with status {status}, perhaps because the memory was full"
            raise RenderError(task.name, found, "close other programs, or use smaller settings") from None
        except CancelledError:
            self._return(worker) if worker.stop() else self._end(worker)
            raise
        except BaseException:
            self._end(worker)
            raise
        self._return(worker)
        if failed:
            raise content
        return content  # type: ignore[no-any-return]

    def close(self, patience: float = PARTING) -> None:
        """End all processes for good, whatever they are doing; they have `patience` seconds to clean up."""
        with self._changed:
            self._closed = True
            running, self._idle = [*self._idle, *self._busy], []
        for worker in running:
            worker.process.terminate()
        end = time.monotonic() + patience
        for worker in running:
            worker.close(max(end - time.monotonic(), 0.0))

    def _taken(self, task: Task, work: Callable[..., Any], urgency: Urgency) -> _Worker:
        """Worker for a task: one that has done similar work before, an idle one, or a new one."""
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
            self._idle = [worker for worker in self._idle if worker.process.is_alive()]
            pictures = urgency is Urgency.PICTURE
            alike = [worker for worker in self._idle if worker.pictures == pictures]
            known = [worker for worker in alike if work.__module__ in worker.modules]
            worker = (known or alike)[-1] if alike else _Worker(self._kept, pictures=pictures)
            if alike:
                self._idle.remove(worker)
            self._busy.append(worker)
            return worker

    def _return(self, worker: _Worker) -> None:
        with self._changed:
            self._busy.remove(worker)
            self._idle.append(worker)
            surplus = []
            while len(self._idle) > MOST_IDLE:  # one of each priority stays
                pictures = 2 * sum(one.pictures for one in self._idle) > len(self._idle)
                surplus.append(next(one for one in self._idle if one.pictures == pictures))
                self._idle.remove(surplus[-1])
            with suppress(ConnectionError):  # one that has died is noticed at its next work
                for idle in self._idle:
                    idle.forget()
            self._changed.notify_all()
        for other in surplus:
            other.close(PARTING)

    def _end(self, worker: _Worker) -> None:
        worker.close(PARTING)
        with self._changed:
            self._busy.remove(worker)
            self._changed.notify_all()


class _Kept:
    """Tokens and messages of large values, for as long as these live here."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self._packed: WeakKeyDictionary[object, tuple[int, WorkerMessage]] = WeakKeyDictionary()
        self._lock = threading.RLock()

    def packed(self, value: object) -> tuple[int, WorkerMessage]:
        """Token and message of a value; from then on its arrays, too, are those of the file."""
        with self._lock:
            if (found := self._packed.get(value)) is None:
                found = self.take(value, WorkerMessage.of(value))
                if found[1].file is not None:
                    vars(value).update(vars(found[1].open()))
            return found

    def take(self, value: object, message: WorkerMessage) -> tuple[int, WorkerMessage]:
        """Token for a value that came in a message, and that message."""
        with self._lock:
            found = self._packed[value] = next(self._numbers), message
            return found

    @property
    def tokens(self) -> set[int]:
        """Tokens of all sent values that this process still references."""
        with self._lock:
            return {token for token, _ in self._packed.values()}


class _Worker:
    """Running worker process, with the record of values sent to it.

    Attributes
    ----------
    process : BaseProcess
    pictures : bool
        It does what the picture waits for, at normal priority.
    modules : set of str
        Modules of the work that it has done, for which it is prepared.
    """

    def __init__(self, kept: _Kept, *, pictures: bool) -> None:
        # Spawned, not forked: OpenGL and threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=_run, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()
        assert self.process.pid is not None
        with suppress(OSError):  # containers may forbid it, or it has ended
            if pictures:
                pass
            elif IDLE is not None:
                _make_idle(self.process.pid, IDLE)
            elif hasattr(os, "setpriority"):
                os.setpriority(os.PRIO_PROCESS, self.process.pid, NICENESS)
        self.pictures = pictures
        self._channel = Channel(pipe, self.process.pid)
        self._kept, self._sent = kept, set[int]()
        self._closing = threading.Lock()
        self._known: dict[int, object] = {}
        self._number = 0
        self.modules: set[str] = set()

    def ask(self, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        """Send work, preceded by the values that it needs and that were not sent before."""
        found: dict[int, WorkerMessage] = {}
        self._known = {}

        def token(value: object) -> int | None:
            if not isinstance(value, KEPT):
                return None
            number, message = self._kept.packed(value)
            found[number], self._known[number] = message, value
            return number

        requested = WorkerMessage.of((work, arguments), token)
        self.forget()
        for number in found.keys() - self._sent:
            self._channel.send("keep", number, found[number])
            self._sent.add(number)
        self._number += 1
        self._channel.send("work", self._number, requested)
        self.modules.add(work.__module__)

    def forget(self) -> None:
        """Have the process drop all values that nobody here holds any more."""
        for number in self._sent - self._kept.tokens:
            self._channel.send("drop", number, WorkerMessage())
            self._sent.discard(number)

    def answer(self, task: Task) -> tuple[bool, Any]:
        """Answer of the work: whether it failed, and its result or error."""
        while True:
            if not self._channel.pipe.poll(PATIENCE):
                task.report(task.share, task.detail)
                continue
            kind, number, message = self._channel.receive()
            content = message.open(self._known.__getitem__)
            if kind in ("done", "failed"):
                self._known = {}
                return kind == "failed", content
            if kind == "made":
                self._known[number] = content
                self._kept.take(content, message)
            elif kind == "warning":
                warnings.warn(content, TranslucentWarning, stacklevel=4)
            else:
                task.report(*content)

    def stop(self) -> bool:
        """Stop the work at its next report; returns whether it did so in time."""
        end = time.monotonic() + PARTING
        with suppress(EOFError, ConnectionError):
            self._channel.send("stop", self._number, WorkerMessage())
            while self._channel.pipe.poll(max(end - time.monotonic(), 0.0)):
                if self._channel.receive()[0] in ("done", "failed"):
                    return True
        return False

    def close(self, patience: float) -> None:
        """End the worker process; it has some seconds to remove unfinished files."""
        self.process.terminate()
        self.process.join(patience)
        with self._closing:  # the thread that waits for its work, and the one that closes the pool, may both do so
            self.process.kill()
            self.process.join()  # only then it lets go of the file that it has half written
            self._channel.pipe.close()


def _make_idle(process: int, policy: int) -> None:
    """Give a process and its threads a policy, on a busy machine also those of libraries that it has begun by now."""
    os.sched_setscheduler(process, policy, os.sched_param(0))  # of the first thread, and of all that it begins
    for thread in os.listdir(f"/proc/{process}/task"):
        with suppress(ProcessLookupError):  # it has ended
            os.sched_setscheduler(int(thread), policy, os.sched_param(0))


#: Takes the progress of the work of this process; None in the window's own.
_listener: Callable[[float | None, str], None] | None = None


def report(fraction: float | None, detail: str = "") -> None:
    """Report the progress of work in a worker process: the finished fraction, if that is known, and the current step.

    Raises
    ------
    CancelledError
        If nobody waits for the work any more.
    """
    if _listener is not None:
        _listener(fraction, detail)


def worker_renderer() -> Renderer:
    """Renderer of this worker process, with the shaders as they are on disk."""
    return _renderer(newest_shader())


@lru_cache(maxsize=1)
def _renderer(written: float) -> Renderer:
    from translucent.renderer import Renderer

    return Renderer()


def _run(pipe: Connection) -> None:
    """Main loop of the worker process, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window answers Ctrl-C, and ends this process
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_follow_parent, daemon=True).start()
    channel = Channel(pipe, os.getppid())
    warnings.showwarning = lambda message, *_, **__: channel.send("warning", 0, WorkerMessage.of(str(message)))
    kept: dict[int, object] = {}
    while True:
        try:
            kind, number, message = channel.receive()
        except (EOFError, OSError):
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            return
        if kind == "keep":
            kept[number] = message.open()
        elif kind == "drop":
            del kept[number]
        elif kind == "work":
            _work(channel, kept, number, message)


def _end(*_: object) -> None:
    """End after half-written files are removed, and only once, as that takes a while."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(1)


def _follow_parent() -> None:
    """End this process when the window is gone, which work without reports would not notice."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PARTING)
    os._exit(1)


def _work(channel: Channel, kept: dict[int, object], number: int, message: WorkerMessage) -> None:
    global _listener

    def listen(fraction: float | None, detail: str) -> None:
        while channel.pipe.poll():
            if channel.receive()[:2] == ("stop", number):
                raise CancelledError
        channel.send("report", number, WorkerMessage.of((fraction, detail)))

    numbers = {id(value): one for one, value in kept.items()}
    made = list[object]()

    def token(value: object) -> int | None:
        if not isinstance(value, KEPT):
            return None
        if id(value) not in numbers:
            made.append(value)
            numbers[id(value)] = -len(made)
            channel.send("made", -len(made), WorkerMessage.of(value))
        return numbers[id(value)]

    kind, _listener = "done", listen
    try:
        work, arguments = message.open(kept.__getitem__)
        answer = WorkerMessage.of(work(*arguments), token)
    except Exception as error:  # noqa: BLE001 - raised where the result is waited for
        kind, answer = "failed", WorkerMessage.of(error)
    with suppress(OSError):  # the window may have gone
        channel.send(kind, number, answer)
