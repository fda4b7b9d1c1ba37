"""Watch over the main thread of a process: another thread looks every few milliseconds what it is at."""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from pathlib import Path
from types import FrameType

#: Seconds between two looks.
INTERVAL = 0.004

#: Functions of the toolkit that are named, the innermost last.
TOLD = 4


class Sampler:
    """Looks at the main thread; what holds the interpreter's lock is seen when it lets go."""

    def __init__(self) -> None:
        self._main = threading.main_thread().ident
        self._seen: Counter[str] = Counter()
        threading.Thread(target=self._run, daemon=True).start()

    def begin(self) -> None:
        """Forget what was seen."""
        self._seen = Counter()

    def told(self) -> str:
        """Functions that the thread was most often in since then."""
        return ", ".join(f"{count} x {where}" for where, count in self._seen.most_common(3))

    def _run(self) -> None:
        while True:
            time.sleep(INTERVAL)
            frame = sys._current_frames().get(self._main or 0)
            if (where := _where(frame)) is not None:
                self._seen[where] += 1


def _where(frame: FrameType | None) -> str | None:
    names: list[str] = []
    while frame is not None and len(names) < TOLD:
        path = Path(frame.f_code.co_filename)
        if "translucent" in path.parts:
            names.append(f"{path.stem}.{frame.f_code.co_name}:{frame.f_lineno}")
        frame = frame.f_back
    return " > ".join(reversed(names)) if names else "outside the toolkit"
