"""Ctrl-C and SIGTERM at random moments: no process may crash, and what is made next is what it would have been.

``python tools/fuzz_interrupts.py [RUNS] [SEED] [--only KIND]`` interrupts RUNS processes (60), in turn ``render``,
``bake``, ``page`` and ``preview`` from the command line, and rendering, baking, pages and cells of notebooks in Python,
with no shaders compiled before. A command fails if it ends by a signal, shows a traceback, takes 20 s to end, or leaves
anything but the old output or a new one that is whole. In Python, the same is made again in that process, and has to be
equal to what an uninterrupted one makes. Cells are run by the shell of IPython, which kernels are made of. Where there
is no display the window opens on none: see tools/headless_window.py. ``--keep FILE`` keeps what each process prints,
and its exit code. Prints each failure, and at the end how many there were of each kind; exits with 1 if there was one.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import translucent as tl
from translucent.assets import mesh_path

#: Seconds that a process has to end, on a machine that does nothing else.
PATIENCE = 20.0

COMMANDS = {
    "render": (["goblet", "--preset", "crystal", "--size", "64x48"], "out.png"),
    "bake": (["bear", "--size", "256", "--rays", "64"], "out.exr"),
    "page": (["bear"], "out.html"),
    "preview": (["goblet", "--size", "640x480"], None),
}

#: Content of the output before a command begins.
OLD = b"what was there before"


def scene() -> tl.Scene:
    """Scene with many programs."""
    return tl.showcase(tl.load_mesh(mesh_path("goblet"), unit="m"), tl.preset("crystal").medium, (64, 48))


def made_by(kind: str) -> Callable[[], bytes]:
    """Function that makes bytes in Python anew at each call; only its renderer lives on."""
    if kind == "notebook":
        return made_by_cell("scene()")
    renderer, mesh = tl.Renderer(), tl.load_mesh(mesh_path("bear"), unit="m")
    page = Path(tempfile.mkdtemp()) / "out.html"

    def of_page() -> bytes:
        tl.write_page(scene(), page)
        return page.read_bytes()

    return {
        "render": lambda: renderer.render(scene(), (64, 48)).radiance.tobytes(),
        "bake": lambda: tl.bake_thickness(mesh, size=128, rays=64).values.tobytes(),
        "page": of_page,
    }[kind]


def made_by_cell(code: str) -> Callable[[], bytes]:
    """Function that runs a notebook cell and returns what it shows."""
    from IPython.core.interactiveshell import InteractiveShell
    from traitlets.config import Config

    shell = InteractiveShell.instance(config=Config({"HistoryManager": {"enabled": False}}), user_ns={"scene": scene})
    shown: list[dict[str, str]] = []
    shell.displayhook.write_format_data = lambda data, _: shown.append(data)

    def run() -> bytes:
        shown.clear()
        shell.run_cell(code).raise_error()
        return re.sub(r"drawn in [\d.]+ s", "", shown[-1]["text/html"]).encode()

    return run


def in_python(kind: str, after: float) -> None:
    """Make it with an interruption, print whether that was in time, and how a second one comes out."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    make = made_by(kind)
    interrupted = False
    begin = time.monotonic()
    try:
        signal.setitimer(signal.ITIMER_REAL, after)
        make()
    except KeyboardInterrupt:
        interrupted = True
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    seconds = time.monotonic() - begin
    print(int(interrupted), f"{seconds:.3f}", hashlib.sha256(make()).hexdigest())


class Fuzzer:
    """Interrupted processes, and what uninterrupted ones make."""

    def __init__(self, folder: Path, seed: int, kept: Path | None) -> None:
        self.folder, self.random, self._kept = folder, random.Random(seed), kept
        self.environment = {**os.environ, "MESA_SHADER_CACHE_DISABLE": "true", "XDG_CONFIG_HOME": str(folder)}
        self.interrupted = 0
        #: Seconds of commands, and seconds and digest of what Python makes, where nothing interrupts it.
        self._seconds: dict[str, float] = {}
        self._made: dict[str, tuple[float, str]] = {}

    def command(self, verb: str) -> str:
        """Interrupt a command; what is wrong with how it ends, or nothing."""
        options, name = COMMANDS[verb]
        output = self.folder / name if name else None
        shown = verb != "preview" or "DISPLAY" in os.environ
        main = ["-m", "translucent"] if shown else [str(Path(__file__).with_name("headless_window.py"))]
        words = [sys.executable, *main, verb, *options, *(["-o", str(output)] if output else [])]
        if verb not in self._seconds:
            begin = time.monotonic()
            if output:
                self._ended(words, None, None)
            self._seconds[verb] = time.monotonic() - begin if output else 8.0
        if output:
            output.write_bytes(OLD)
        number = self.random.choice([signal.SIGINT, signal.SIGTERM])
        code, error = self._ended(words, self.random.uniform(0.0, self._seconds[verb]), number)
        self.interrupted += code in (130, 143)
        # Before its first line runs, Python itself answers: SIGTERM ends it, Ctrl-C shows where it was.
        early = (code, error) == (-signal.SIGTERM, "") or (code == -signal.SIGINT and "translucent" not in error)
        if code not in (0, 130, 143) and not early:
            return f"exit code {code}: {error[-300:]}"
        if "Traceback" in error and not early:
            return error[-300:]
        if left := [path.name for path in self.folder.glob(".partial-*")]:
            return f"it left {sorted(left)}"
        if output and (content := output.read_bytes()) != OLD and code in (130, 143) and len(content) < 1000:
            return f"it left {len(content)} bytes"
        return ""

    def python(self, kind: str) -> str:
        """Interrupt Python; what is wrong with how it goes on, or nothing."""
        words = [sys.executable, __file__, "--inside", kind]
        if kind not in self._made:
            done = subprocess.run([*words, "3600"], env=self.environment, capture_output=True, text=True, check=True)
            _, took, digest = done.stdout.split()[-3:]
            self._made[kind] = float(took), digest
        seconds, digest = self._made[kind]
        after = self.random.uniform(0.001, seconds)
        done = subprocess.run([*words, str(after)], env=self.environment, capture_output=True, text=True, check=False)
        self._keep([*words, str(after)], done.returncode, done.stdout + done.stderr)
        if done.returncode or not done.stdout:
            return f"exit code {done.returncode} after {after:.3f} s: {done.stderr[-300:]}"
        interrupted, _, found = done.stdout.split()[-3:]
        self.interrupted += int(interrupted)
        return "" if found == digest else f"after {after:.3f} s the next one is another"

    def _ended(self, words: list[str], after: float | None, number: int | None) -> tuple[int, str]:
        # A shell that starts this in the background has its children ignore Ctrl-C.
        heed = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
        process = subprocess.Popen(
            words, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=heed
        )
        if after is not None and number is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(after)
            process.send_signal(number)
        try:
            error = process.communicate(timeout=PATIENCE if after is not None else 600.0)[1]
        except subprocess.TimeoutExpired:
            process.kill()
            error = f"it goes on {process.communicate()[1]}"
        self._keep(
            [*words, f"{signal.Signals(number or 0)!r} after {after} s" if number else ""], process.returncode, error
        )
        return process.returncode, error

    def _keep(self, words: list[str], code: int, said: str) -> None:
        if self._kept is not None:
            with self._kept.open("a", encoding="utf-8") as stream:
                stream.write(f"{' '.join(words)}\nexit code {code}\n{said}\n")


def main(runs: int, seed: int, only: str | None, kept: Path | None) -> int:
    with tempfile.TemporaryDirectory() as name:
        fuzzer = Fuzzer(Path(name), seed, kept)
        kinds: dict[str, Callable[[], str]] = {verb: partial(fuzzer.command, verb) for verb in COMMANDS}
        for kind in ("render", "bake", "page", "notebook"):
            kinds[f"{kind} in Python"] = partial(fuzzer.python, kind)
        chosen = [kind for kind in kinds if only is None or only in kind]
        counts, failed = Counter[str](), Counter[str]()
        for run in range(runs):
            said = chosen[run % len(chosen)]
            counts[said] += 1
            if problem := kinds[said]():
                failed[said] += 1
                print(f"run {run}, {said}: {problem}", flush=True)
    each = ", ".join(f"{kind} {failed[kind]} of {count}" for kind, count in counts.items())
    print(f"{runs} runs, {fuzzer.interrupted} interrupted at work; failed: {each}")
    return int(failed.total() > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="?", type=int, default=60)
    parser.add_argument("seed", nargs="?", type=int, default=0)
    parser.add_argument("--only", metavar="KIND", help="those whose name has this word")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="where to write what each process prints")
    parser.add_argument("--inside", nargs=2, metavar=("KIND", "SECONDS"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.inside:
        in_python(given.inside[0], float(given.inside[1]))
    else:
        sys.exit(main(given.runs, given.seed, given.only, given.keep))
