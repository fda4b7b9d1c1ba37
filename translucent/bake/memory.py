"""Memory that freed arrays leave, where the environment would have each of them fetched from the system anew."""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache

#: Parameters of glibc's mallopt (malloc.h), and the largest values that glibc itself would come to.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
MOST_REUSED = 32 << 20


@cache  # once for a process
def reuse_freed_memory() -> None:
    """Let arrays reuse the memory of freed ones, if ``MALLOC_TRIM_THRESHOLD_`` is set, as it is in workers of Dask.

    glibc learns from what is freed that such sizes are needed again, unless one of its thresholds is set: then each
    array of more than 128 KB is mapped anew, and its pages are cleared when they are first written. That is a tenth of
    the time of a bake. Afterwards it is as if glibc had learned; larger arrays go back to the system as before.
    """
    if sys.platform != "linux" or "MALLOC_TRIM_THRESHOLD_" not in os.environ:
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # other C libraries have none
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, MOST_REUSED)
        mallopt(M_TRIM_THRESHOLD, 2 * MOST_REUSED)
