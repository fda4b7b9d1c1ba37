"""Tasks for processes of the pool, which import this file: little is imported here, as each process waits for it."""

from __future__ import annotations

import ctypes
import os
import sys
import time


def die_or_double(number: int) -> int:
    """End the process at 3, like a crash would."""
    if number == 3:
        os._exit(9)
    return 2 * number


def sleep_long(number: int) -> int:
    """Sleep, but for 0."""
    if number:
        time.sleep(60)
    return number


def tell_and_hold(item: int) -> int:
    """Print the process's id, and let no other thread of it run for a minute, as some C libraries do."""
    os.write(1, f"{os.getpid()}\n".encode())  # in one piece, as the processes share the pipe
    if sys.platform == "linux":  # elsewhere only a thread sees that the parent is gone
        ctypes.PyDLL(None).sleep(60)
    time.sleep(60.0)
    return item
