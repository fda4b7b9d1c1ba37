"""Memory that freed arrays leave: processes that bake keep it for the next ones."""

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
    """Let arrays reuse the memory of freed ones; for processes that do nothing but bake.

    glibc gives memory back to the system when arrays are freed, and the system clears each page anew for the next ones.
    It learns from their sizes to do so less, but for some sizes of maps that still takes a twentieth of a bake. Larger
    arrays than 32 MB go back as before. Other C libraries stay as they are.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, MOST_REUSED)
        mallopt(M_TRIM_THRESHOLD, 2 * MOST_REUSED)


def reuse_freed_memory_if_fixed() -> None:
    """`reuse_freed_memory` where ``MALLOC_TRIM_THRESHOLD_`` is set, as it is in workers of Dask.

    With that, glibc learns nothing: each array of more than 128 KB is mapped anew, which takes an eighth of a bake.
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ:
        reuse_freed_memory()
