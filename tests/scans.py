"""Third-party meshes, each read and examined once for all tests that look at it."""

from __future__ import annotations

import functools
from pathlib import Path

import translucent as tl


@functools.lru_cache(maxsize=16)
def scan(path: Path) -> tl.Mesh:
    """The mesh in a file."""
    return tl.load_mesh(path)
