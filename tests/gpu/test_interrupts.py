"""Ctrl-C at any point of a frame, threads and forks: the next frames are right, or one line says why there are none."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

import moderngl
import numpy as np
import pytest

import translucent as tl
from translucent import threads as deferrals
from translucent.geometry.solids import Sphere
from translucent.gpu import context as contexts
from translucent.gpu import pass_costs as timers
from translucent.gpu import renderer as renderers
from translucent.threads import DeferredSignals

SIZE = (12, 8)
MEDIUM = tl.Medium(absorption=(1, 2, 3))
SCENE = tl.showcase(Sphere().tessellate(12), MEDIUM, SIZE, environment=tl.Environment.gradient(0.2, 1.0))
WATCHED = [module.__file__ for module in (contexts, renderers, timers)]
#: Contexts and queries.
BEGUN_AND_ENDED = [(moderngl.__file__, "__enter__"), (moderngl.__file__, "__exit__")]


@contextmanager
def interrupted_at(line: int, watched: Sequence[str | None] = WATCHED) -> Iterator[list[str]]:
    """Press Ctrl-C at one of the lines that are executed within; the list has those before it."""
    seen: list[str] = []

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        code = frame.f_code
        if code.co_name == "_release":  # of an earlier renderer
            return None
        if code.co_filename not in watched and (code.co_filename, code.co_name) not in BEGUN_AND_ENDED:
            return None
        if event == "line":
            seen.append(f"{os.path.basename(frame.f_code.co_filename)}:{frame.f_lineno}")
            if len(seen) == line:
                signal.raise_signal(signal.SIGINT)
        return trace

    before = sys.gettrace()
    # What is raised while an earlier renderer is collected, Python does not pass on.
    gc.collect()
    gc.disable()
    sys.settrace(trace)
    try:
        yield seen
    finally:
        sys.settrace(before)
        gc.enable()


@pytest.fixture(autouse=True)
def little_to_collect() -> None:
    """Keep what lives already out of the hundreds of collections in a test: each took a tenth of a second."""
    gc.collect()
    gc.freeze()


def picture(renderer: tl.Renderer) -> np.ndarray:
    return renderer.render(SCENE, SIZE).radiance


def check(renderer: tl.Renderer, line: int, expected: np.ndarray) -> bool:
    """Interrupt a frame at a line, and draw again; whether there is such a line."""
    with interrupted_at(line) as seen:
        try:
            picture(renderer)
        except KeyboardInterrupt:
            pass
        else:
            return False
    where = seen[-1]
    gc.collect()  # what the interrupted frame had begun
    np.testing.assert_array_equal(picture(renderer), expected, where)
    assert contexts._entered.stack == [], where
    return True


def test_a_frame_that_is_interrupted_anywhere_leaves_a_renderer_that_works() -> None:
    with tl.Renderer() as renderer, tl.Renderer() as other:
        expected = picture(renderer)
        with interrupted_at(0) as seen:
            np.testing.assert_array_equal(picture(renderer), expected)
        # Where contexts and queries begin and end, each line once, and some of the lines between them.
        lines = {where: line for line, where in reversed([*enumerate(seen, 1)])}
        between = [line for where, line in lines.items() if where.startswith("renderer.py")]
        begun = [line for where, line in lines.items() if not where.startswith("renderer.py")]
        assert len(begun) > 20
        for line in sorted({*begun, *between[::8]}):
            assert check(renderer, line, expected)
        np.testing.assert_array_equal(picture(other), expected)
    with tl.Renderer() as fresh:
        np.testing.assert_array_equal(picture(fresh), expected)


def test_an_interrupted_frame_leaves_other_queries_and_contexts_alone() -> None:
    """In a context of somebody else, a query that goes on would spoil each of theirs."""
    with tl.Renderer() as owner, owner.gpu.context.current() as gl, tl.Renderer(context=gl) as guest:
        expected = picture(guest)
        with interrupted_at(0) as seen:
            picture(guest)
        begins = [i + 1 for i, where in enumerate(seen) if where.startswith("__init__.py")]
        assert len(begins) >= 2
        for line in begins:
            assert check_adopted(guest, line, expected)
            assert gl.error == "GL_NO_ERROR"
            with gl.query(time=True) as query:
                pass
            assert query.elapsed >= 0
            assert gl.error == "GL_NO_ERROR"


def check_adopted(renderer: tl.Renderer, line: int, expected: np.ndarray) -> bool:
    with interrupted_at(line), pytest.raises(KeyboardInterrupt):
        picture(renderer)
    np.testing.assert_array_equal(picture(renderer), expected)
    return True


def test_what_was_interrupted_says_so() -> None:
    with tl.Renderer() as renderer:
        engine = renderer.gpu
        with interrupted_at(8), pytest.raises(KeyboardInterrupt):
            picture(renderer)
        with pytest.raises(tl.RenderError, match=r"^rendering; the renderer was interrupted; create a new renderer$"):
            engine.render(renderer.plan(SCENE), SIZE)
        assert renderer.gpu is not engine


# Signals

#: Draws two frames, with Ctrl-C as soon as moderngl calls this function of its Python part within `Context.program`.
STRUCK = """
import signal, sys
import _moderngl
import translucent as tl
from translucent.geometry.solids import Sphere

scene = tl.showcase(Sphere().tessellate(12), tl.Medium(absorption=(1, 2, 3)), (12, 8), stage="none")
make = getattr(_moderngl, sys.argv[1])

def struck(*arguments):
    setattr(_moderngl, sys.argv[1], make)
    signal.raise_signal(signal.SIGINT)
    return make(*arguments)

setattr(_moderngl, sys.argv[1], struck)
with tl.Renderer() as renderer, tl.Renderer() as other:
    try:
        renderer.render(scene, (12, 8))
    except KeyboardInterrupt:
        assert (renderer.render(scene, (12, 8)).radiance == other.render(scene, (12, 8)).radiance).all()
        sys.exit(5)
"""


@pytest.mark.parametrize("within", ["make_attribute", "make_uniform", "make_uniform_block"])
def test_ctrl_c_while_a_program_is_made_is_no_crash(within: str) -> None:
    """moderngl goes on with a null pointer where a function that it calls raises."""
    done = subprocess.run([sys.executable, "-c", STRUCK, within], capture_output=True, text=True, check=False)
    assert done.returncode == 5, done.stderr


@contextmanager
def heard() -> Iterator[list[int]]:
    """Numbers of the signals that a handler has seen, which raises then; Ctrl-C and SIGTERM have it."""
    numbers: list[int] = []

    def handler(number: int, frame: FrameType | None) -> None:
        numbers.append(number)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield numbers
        assert {signal.getsignal(number) for number in before} == {handler}
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def test_deferred_signals_are_all_raised_at_the_end() -> None:
    def strike() -> None:
        with DeferredSignals():
            with DeferredSignals():
                signal.raise_signal(signal.SIGTERM)
                signal.raise_signal(signal.SIGINT)
            assert not numbers

    with heard() as numbers:
        with pytest.raises(KeyboardInterrupt):
            strike()
        assert sorted(numbers) == [signal.SIGINT, signal.SIGTERM]


def test_a_thread_leaves_handlers_alone() -> None:
    def look() -> None:
        with DeferredSignals():
            assert signal.getsignal(signal.SIGINT) is before

    before = signal.getsignal(signal.SIGINT)
    assert in_a_thread(look) is None


def test_signals_are_heard_wherever_their_deferral_is_interrupted() -> None:
    watched = [deferrals.__file__]
    with heard(), interrupted_at(0, watched) as seen, DeferredSignals():
        pass
    assert len(seen) > 100
    for line in range(1, len(seen) + 1):
        with heard() as numbers:
            with pytest.raises(KeyboardInterrupt), interrupted_at(line, watched), DeferredSignals():
                pass
            for number in (signal.SIGINT, signal.SIGTERM):
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(number)
            assert numbers == [signal.SIGINT, signal.SIGINT, signal.SIGTERM]


# Threads and forks


def in_a_thread(action: Callable[[], object]) -> BaseException | None:
    """Error of an action in a thread of its own."""
    raised: list[BaseException] = []

    def run() -> None:
        try:
            action()
        except BaseException as error:  # noqa: BLE001 - it is what is looked at
            raised.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return raised[0] if raised else None


def test_one_renderer_draws_one_picture_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    with tl.Renderer() as renderer:
        expected, met = picture(renderer), []
        read = renderers.GpuRenderer.read

        def slow(self: Any, *arguments: Any) -> Any:
            with monkeypatch.context() as patch:
                patch.setattr(renderers.GpuRenderer, "read", read)
                met.append(in_a_thread(lambda: picture(renderer)))
                with pytest.raises(tl.RenderError) as raised:
                    picture(renderer)  # as a progress callback might
                met.append(raised.value)
            return read(self, *arguments)

        monkeypatch.setattr(renderers.GpuRenderer, "read", slow)
        np.testing.assert_array_equal(picture(renderer), expected)
        monkeypatch.undo()
        assert [str(error) for error in met] == 2 * [
            "rendering; this renderer is in the middle of another picture; "
            "create one renderer for each thread, and begin no picture in a progress callback"
        ]
        assert isinstance(met[0], tl.RenderError)
        # One after the other they may.
        assert in_a_thread(lambda: np.testing.assert_array_equal(picture(renderer), expected)) is None
        np.testing.assert_array_equal(picture(renderer), expected)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_process_is_refused_at_once() -> None:
    with tl.Renderer() as renderer:
        expected = picture(renderer)
        reading, writing = os.pipe()
        if (child := os.fork()) == 0:
            # Whatever happens, this copy of the tests ends here.
            try:
                signal.alarm(60)
                told = []
                for action in (lambda: picture(renderer), tl.Renderer, lambda: tl.Renderer("egl")):
                    try:
                        action()
                    except tl.RenderError as error:
                        told.append(str(error))
                renderer.close()
                os.write(writing, "\n".join(told).encode())
            finally:
                os._exit(0)
        os.close(writing)
        with os.fdopen(reading) as told:
            lines = told.read().splitlines()
        assert os.waitpid(child, 0)[1] == 0
        assert len(lines) == 3
        assert set(lines) == {
            f"OpenGL in a forked process; process {os.getpid()} opened OpenGL before the fork, and the driver does "
            'not work after a fork; start processes with multiprocessing.get_context("spawn")'
        }
        np.testing.assert_array_equal(picture(renderer), expected)
