"""Processes and threads that tests wait for: on what they do, and not for a time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

#: Seconds after which a test that waits fails: no machine is as slow.
PATIENCE = 300.0


def until(done: Callable[[], object]) -> None:
    """Wait until something is so."""
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.002)


def runs(process: int) -> bool:
    """True if there is such a process, and it does not merely wait for somebody to look at how it ended."""
    try:
        os.kill(process, 0)
        status = Path(f"/proc/{process}/stat").read_text()
    except ProcessLookupError:
        return False
    except FileNotFoundError:  # it has ended in between, or this system has no such files
        return not Path("/proc/self/stat").exists()
    return status.rpartition(")")[2].split()[0] not in "ZX"
