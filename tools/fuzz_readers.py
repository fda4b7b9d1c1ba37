"""Damaged files for every reader: ``python tools/fuzz_readers.py RUNS SEED [--seeds FOLDER] [--reader NAME]``.

Each run damages a good file, at random and by the seed, and reads it. It may be read, or refused by an `InputError` of
one printable line. Everything else is a fault: another exception, a warning that is not the toolkit's, a word of a
library, more than 20 seconds of processor time, or more than 1 GB. Each run is a process of its own, whose time and
largest resident memory the system tells, and which may crash. Faults are printed, and their files kept in a folder
that is named at the end; the exit status is 1 then. With --seeds, files of that folder are damaged as well, which are
as large as they are.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from fuzz_seeds import Reader, packed_glb, readers

import translucent as tl

SECONDS, MEMORY = 20, 10**9
#: Characters of the longest message.
LONGEST = 300

_NUMBERS = (
    "0", "-1", "1e308", "-1e308", "1e-308", "1e999", "nan", "inf", "255", "65535", "2147483647", "2147483648",
    "4294967295", "9" * 30, "9" * 400, "9" * 5000, "0.5", "-0", "", "x", "\x1b[31m",
)  # fmt: skip
_WORDS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x3F800000, 0x7FC00000)
_LINKS = ("../secret.bin", "/etc/passwd", "%2e%2e/secret.bin", "file:///etc/passwd", "/dev/zero", "/dev/stdin", "a\0b")


def nested(depth: int) -> Any:
    """Lists within lists."""
    value: Any = 0
    for _ in range(depth):
        value = [value]
    return value


def _values(chance: random.Random) -> Any:
    """A value that does not belong where it is put."""
    return chance.choice(
        [None, True, -1, 0, 1, 2, 3.5, 1e308, 10**30, 10**250, 2**31, 2**63, "", "x", "\x1b]0;title\x07\u202e", [], {}]
        + [[1, 2, 3], [None] * 3, ["a"] * 16, {"index": 0}, {"a": {}}, nested(90), nested(900), *_LINKS, "é" * 5000]
    )


def damaged_json(text: str, chance: random.Random) -> str:
    """A JSON text with some values exchanged, removed or repeated."""
    tree = json.loads(text)
    for _ in range(chance.randint(1, 3)):
        holders = [holder for holder in _holders(tree) if holder]
        if not holders:
            break
        holder = chance.choice(holders)
        key = chance.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
        match chance.randrange(5):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.append(holder[key])
            case 2:
                holder[key] = chance.choice(
                    [one for h in holders for one in (h.values() if isinstance(h, dict) else h)]
                )
                if not _acyclic(tree):
                    return text
            case _:
                holder[key] = _values(chance)
    try:
        made = json.dumps(tree)
    except RecursionError:  # damage upon damage
        return text
    if chance.random() < 0.1:
        digits = [i for i, c in enumerate(made) if c.isdigit()]
        at = chance.choice(digits) if digits else 0
        made = made[:at] + chance.choice(_NUMBERS) + made[at + 1 :]
    return made


def _acyclic(tree: Any) -> bool:
    try:
        json.dumps(tree)
    except (ValueError, RecursionError):
        return False
    return True


def _holders(tree: Any) -> list[Any]:
    found, pending = [], [tree]
    while pending:
        one = pending.pop()
        if isinstance(one, dict | list):
            found.append(one)
            pending += one.values() if isinstance(one, dict) else one
    return found


def damaged_bytes(data: bytes, chance: random.Random) -> bytes:
    """Bytes with some of them exchanged, removed, repeated or cut off."""
    made = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        # Headers are where the harm is.
        at = chance.randrange(len(made) + 1) if chance.random() < 0.5 else chance.randrange(min(len(made), 128) + 1)
        match chance.randrange(7):
            case 0:
                made[at : at + 1] = bytes([chance.randrange(256)])
            case 1:
                made[at : at + 4] = chance.choice(_WORDS).to_bytes(4, chance.choice(("little", "big")))
            case 2:
                del made[at : at + chance.randint(1, 64)]
            case 3:
                made[at:at] = made[at : at + chance.randint(1, 64)] * chance.choice((1, 2, 100))
            case 4:
                del made[at:]
            case 5:
                made[at:at] = chance.choice((b"(", b"{", b'"', b"'''", b"<", b"@", b"[", b"\0")) * chance.choice(
                    (1, 9, 9999)
                )
            case _:
                _exchange_number(made, chance)
    return bytes(made)


def _exchange_number(made: bytearray, chance: random.Random) -> None:
    digits = [i for i in range(min(len(made), 4096)) if 48 <= made[i] <= 57]
    if digits:
        start = end = chance.choice(digits)
        while end < len(made) and made[end] in b"0123456789.":
            end += 1
        made[start:end] = chance.choice(_NUMBERS).encode()


def damaged(name: str, data: bytes, chance: random.Random) -> bytes:
    """A good file of this name, damaged."""
    if name.endswith((".gltf", ".json")) and chance.random() < 0.8:
        return damaged_json(data.decode(), chance).encode("utf-8", "surrogatepass")
    if name.endswith(".glb") and chance.random() < 0.8:
        size = int.from_bytes(data[12:16], "little")
        return packed_glb(damaged_json(data[20 : 20 + size].decode(), chance), data[28 + size :])
    return damaged_bytes(data, chance)


class Run(NamedTuple):
    """One run: ``"read"``, ``"refused"`` or what went wrong; processor time in seconds and largest memory in bytes."""

    found: str
    seconds: float
    memory: int


def attempt(reader: Reader, path: Path) -> str:
    """``"read"``, ``"refused"``, or what went wrong."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", tl.TranslucentWarning)
            reader.read(path)
    except tl.InputError as error:
        text = str(error)
        if isinstance(error.__cause__, MemoryError):
            return "it asked for too much memory"
        if len(text) > LONGEST or not text.isprintable():
            return f"its message is {len(text)} characters long, or not printable: {text[:500]!r}"
        return "refused"
    except Exception:  # noqa: BLE001
        return traceback.format_exc()
    return "read"


def run_alone(reader: Reader, path: Path) -> Run:
    """Read a file in a process of its own, within the limits."""
    with tempfile.TemporaryFile() as told, tempfile.TemporaryFile() as printed:
        before = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads; none of them reads
            child = os.fork()
        if child == 0:
            _read_and_exit(reader, path, told.fileno(), printed.fileno())
        _, status, used = os.wait4(child, 0)
        told.seek(0)
        printed.seek(0)
        found, words = told.read().decode("utf-8", "replace"), printed.read(300)
    code = os.waitstatus_to_exitcode(status)
    seconds, memory = used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss
    if seconds > SECONDS:
        found = f"it took {seconds:.1f} s of processor time"
    elif code < 0:
        found = f"it was ended by signal {-code}"
    elif memory > MEMORY + (before if before > MEMORY / 2 else 0):  # in a test, what other tests have left
        found = f"it had {memory / 1e9:.2f} GB"
    elif words and found in ("read", "refused"):
        found = f"it printed {words!r}"
    return Run(found, seconds, memory)


def _read_and_exit(reader: Reader, path: Path, told: int, printed: int) -> NoReturn:
    """Read in the child, and leave what came of it in a file; never returns."""
    try:
        os.dup2(printed, 1)
        os.dup2(printed, 2)
        # Beyond the limits of a run, so that it is measured, and not only stopped; more would harm the machine.
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS + 1, SECONDS + 2))
        mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (mapped + 2 * MEMORY, resource.RLIM_INFINITY))
        signal.alarm(10 * SECONDS)  # of one that only waits
        os.write(told, attempt(reader, path).encode("utf-8", "replace"))
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(0)


@dataclass
class Tally:
    """Counts of what the runs were."""

    runs: int = 0
    read: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")
    largest: tuple[float, str] = (0.0, "")

    def __str__(self) -> str:
        return (
            f"{self.runs} runs: {self.read} read, {self.refused} refused, {len(self.faults)} faults; "
            f"the slowest took {self.slowest[0]:.2f} s of processor time ({self.slowest[1]}); "
            f"the largest had {self.largest[0] / 1e9:.2f} GB ({self.largest[1]})"
        )


def fuzz(known: dict[str, Reader], runs: int, seed: int, folder: Path, kept: Path) -> Tally:
    """Damage and read files, in turns; what went wrong is printed at once."""
    tally, names = Tally(), sorted(known)
    for reader in names:  # what they import is imported once, and not in each process
        name, good = known[reader].seeds[0]
        (folder / name).write_bytes(good)
        attempt(known[reader], folder / name)
    for run in range(runs):
        chance, reader = random.Random(f"{seed} {run}"), names[run % len(names)]
        name, good = chance.choice(known[reader].seeds)
        path = folder / name
        path.write_bytes(damaged(name, good, chance))
        found, seconds, memory = run_alone(known[reader], path)
        tally.slowest = max(tally.slowest, (seconds, f"{reader}, run {run}"))
        tally.largest = max(tally.largest, (memory, f"{reader}, run {run}"))
        tally.runs += 1
        if found in ("read", "refused"):
            setattr(tally, found, getattr(tally, found) + 1)
        else:
            tally.faults.append(f"{reader}, run {run}: {found}")
            (kept / f"{run}-{name}").write_bytes(path.read_bytes())
            print(f"{reader}, run {run}, {name}: {found}", file=sys.stderr, flush=True)
        path.unlink()
    return tally


def with_seeds(known: dict[str, Reader], folder: Path) -> dict[str, Reader]:
    """The readers with the files of a folder that are of their kinds and not large."""
    found = {name: Reader(reader.read, list(reader.seeds)) for name, reader in known.items()}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.stat().st_size < 300_000:
            for reader in found.values():
                if path.suffix.lower() in {Path(name).suffix for name, _ in reader.seeds}:
                    reader.seeds.append((path.name, path.read_bytes()))
    return found


def main() -> int:
    """Fuzz as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--seeds", type=Path, help="a folder with more good files")
    parser.add_argument("--reader", help="only this one")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, kept = Path(name), Path(tempfile.mkdtemp(prefix="fuzz-faults-"))
        known = readers(folder)
        if given.seeds is not None:
            known = with_seeds(known, given.seeds)
        if given.reader is not None:
            known = {given.reader: known[given.reader]}
        tally = fuzz(known, given.runs, given.seed, folder, kept)
    print(tally)
    if tally.faults:
        print(f"the files of the faults are in {kept}")
    else:
        kept.rmdir()
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
