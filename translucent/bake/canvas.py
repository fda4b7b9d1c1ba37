"""Canvas of a map in progress, and its checkpoint file in case the bake is interrupted."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.bake.settings import BakeSettings
from translucent.bake.strips import COUNTS, Strip
from translucent.errors import InputError
from translucent.files.paths import write_atomically
from translucent.files.unpacking import read_arrays
from translucent.geometry.mesh import Mesh
from translucent.version import VERSION

#: Seconds between writes of a checkpoint, and how many times longer than the last write they are at least.
EVERY, REST = 5.0, 20.0


@dataclass(eq=False)
class Canvas:
    """Canvas of a map: strips put together.

    Parameters
    ----------
    size : int
        Texels a side.
    faces : int
        Of the mesh.
    strips : int
    """

    size: int
    faces: int
    strips: int
    done: npt.NDArray[np.bool_] = field(init=False)
    values: npt.NDArray[np.float32] = field(init=False)
    errors: npt.NDArray[np.float32] = field(init=False)
    coverage: npt.NDArray[np.bool_] = field(init=False)
    valued: npt.NDArray[np.bool_] = field(init=False)
    owners: npt.NDArray[np.bool_] = field(init=False)
    counts: npt.NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        shape = (self.size, self.size)
        self.values, self.errors = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self.coverage, self.valued = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        self.done, self.owners = np.zeros(self.strips, dtype=bool), np.zeros(self.faces, dtype=bool)
        self.counts = np.zeros(len(COUNTS), dtype=np.int64)

    def put(self, number: int, row: int, strip: Strip) -> None:
        """Add strip `number`, which begins at `row`."""
        rows = slice(row, row + len(strip.values))
        self.values[rows], self.errors[rows] = strip.values, strip.errors
        self.coverage[rows], self.valued[rows] = strip.coverage, strip.valued
        self.owners |= strip.owners
        self.counts += strip.counts
        self.done[number] = True

    def count(self, name: str) -> int:
        """Value of one of `COUNTS`."""
        return int(self.counts[COUNTS.index(name)])


class Checkpoint:
    """Checkpoint file with the finished strips of a bake.

    Parameters
    ----------
    path : Path
    key : str
        What the bake depends on; a file with another key is of another bake.
    """

    _ARRAYS = ("done", "values", "errors", "coverage", "valued", "owners", "counts")

    def __init__(self, path: Path, key: str) -> None:
        self._path, self._key = path, key
        self._next = time.monotonic() + EVERY

    def read(self, canvas: Canvas) -> None:
        """Fill `canvas` from the file, if there is one.

        Raises
        ------
        InputError
            If the file is no checkpoint of this bake.
        """
        if not self._path.is_file():
            return
        asked = f"checkpoint {str(self._path)!r}"
        found = read_arrays(self._path, asked, ("key", *self._ARRAYS), "remove it")
        if str(found.pop("key")) != self._key:
            raise InputError(asked, "it is of another mesh or other settings", "remove it, or bake as before")
        for name, array in found.items():
            own = getattr(canvas, name)
            if (array.shape, array.dtype) != (own.shape, own.dtype):
                raise InputError(asked, f"{name} of shape {array.shape}, not {own.shape}", "remove it")
            setattr(canvas, name, array)

    def keep(self, canvas: Canvas) -> None:
        """Write `canvas` if the last write was long enough ago."""
        if time.monotonic() >= self._next:
            self.write(canvas)

    def write(self, canvas: Canvas) -> None:
        """Write `canvas` atomically; raises `RenderError` if that fails."""
        started = time.monotonic()
        arrays = {name: getattr(canvas, name) for name in self._ARRAYS}

        def save(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, key=np.array(self._key), **arrays)

        write_atomically(self._path, save)
        ended = time.monotonic()
        self._next = ended + max(EVERY, REST * (ended - started))

    def remove(self) -> None:
        """Delete the file, since the bake is done."""
        self._path.unlink(missing_ok=True)


def bake_key(settings: BakeSettings, *meshes: Mesh | None) -> str:
    """Hash of everything that determines the result of a bake."""
    digest = hashlib.sha256(f"{VERSION} {sorted(settings.summary().items())}".encode())
    for mesh in meshes:
        for array in () if mesh is None else (mesh.vertices, mesh.faces, mesh.uv):
            digest.update(b"-" if array is None else array.tobytes())
            digest.update(b"|")
        digest.update(b"#")
    return digest.hexdigest()
