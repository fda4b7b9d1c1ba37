"""Whether frames got slower: two checkouts of the project draw the same frames in turns.

``python tools/compare_checkouts.py OLDER [NEWER]``; NEWER is this checkout unless given, and ``git worktree add`` makes
others. Each draws in a process of its own an absorbing body without interfaces, lights or scattering; the times are
processor time, which other programs hardly change.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from pathlib import Path

ROUNDS = 40

#: Answers every line on its input with the processor time of some frames.
DRAWS = """
import time
import translucent as tl
scene = tl.showcase(tl.load_mesh("meshes/knot.ply"), tl.Medium.from_color((0.8, 0.3, 0.2), 0.01), (512, 512))
renderer = tl.Renderer()
for _ in range(5):
    renderer.render(scene, (512, 512))
print("ready", flush=True)
while input() != "end":
    begin = time.process_time()
    for _ in range(5):
        renderer.render(scene, (512, 512))
    print((time.process_time() - begin) / 5, flush=True)
"""


class Checkout:
    """A process that draws with the code of a checkout."""

    def __init__(self, root: Path) -> None:
        if not (root / "translucent" / "__init__.py").is_file():
            raise SystemExit(f"{root}: no checkout of this project; give the folder that holds translucent/")
        self._process = subprocess.Popen(
            [sys.executable, "-c", DRAWS],
            cwd=root,
            env={**os.environ, "PYTHONPATH": str(root)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._answer()

    def seconds(self) -> float:
        """Processor time of a frame."""
        self._ask("")
        return float(self._answer())

    def end(self) -> None:
        """End the process."""
        self._ask("end")
        self._process.wait()

    def _ask(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a checkout cannot draw; what it says is above")
        return line


def main() -> int:
    """Measure and print."""
    if not 2 <= len(sys.argv) <= 3:
        raise SystemExit(__doc__)
    roots = [Path(text).resolve() for text in sys.argv[1:]] + [Path(__file__).resolve().parents[1]]
    older, newer = (Checkout(root) for root in roots[:2])
    times: list[tuple[float, float]] = []
    for number in range(ROUNDS):
        if number % 2:
            after, before = newer.seconds(), older.seconds()
        else:
            before, after = older.seconds(), newer.seconds()
        times.append((before, after))
    older.end()
    newer.end()
    ratios = [after / before for before, after in times]
    low, median, high = statistics.quantiles(ratios, n=4)
    print(f"{1e3 * statistics.median(before for before, _ in times):.2f} ms of processor time for a frame before")
    print(f"{1e3 * statistics.median(after for _, after in times):.2f} ms after")
    print(f"ratio {median:.3f}, quartiles {low:.3f} and {high:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
