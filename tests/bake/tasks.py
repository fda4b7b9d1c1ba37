"""Tasks for processes of the pool, which import this file: little is imported here, as each process waits for it."""

from __future__ import annotations

import os
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


def tell_and_sleep(item: int) -> int:
    """Print the process's id first."""
    print(os.getpid(), flush=True)
    time.sleep(600.0)
    return item
