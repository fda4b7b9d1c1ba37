"""Strips of a map, baked in threads and put together on a canvas with a checkpoint.

Strips are independent of one another: surface points of their texels, on the mesh itself or projected from it to a
mesh with the details, and the thickness there. A bake can be interrupted at any time, and go on from its checkpoint.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from contextvars import copy_context
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Mask
from translucent.bake.atlas import Atlas, Unwrapped
from translucent.bake.measure import Measure
from translucent.bake.rays import Points, PreparedMesh, barycentric, blend
from translucent.bake.settings import BakeSettings
from translucent.errors import InputError
from translucent.files.images import read_arrays
from translucent.files.paths import write_atomically
from translucent.geometry.mesh import Mesh
from translucent.version import VERSION

#: Default distance on either side of the low mesh within which the high one is searched, as a fraction of the diagonal.
SEARCH = 0.02


#: Texels (before supersampling) in a strip, about: one strip is what a thread takes at a time.
STRIP_TEXELS = 1 << 14

#: Names of the counts of a strip.
COUNTS = ("traced", "cast", "escaped", "above", "samples", "missed", "overlapping")

#: Seconds between writes of a checkpoint, and how many times longer than the last write they are at least.
EVERY, REST = 5.0, 20.0

Item = TypeVar("Item")

Result = TypeVar("Result")

#: Callback with the number of texels or corners done, their total, and the number of rays traced.
Progress = Callable[[int, int, int], None]

#: Number of queued pieces of work for each thread; their results wait for their turn.
AHEAD = 4


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of points of a low-poly mesh to a high-poly one, along its smooth normals or from a cage.

    Attributes
    ----------
    low, high : PreparedMesh
    cage : (m, 3, 3) float64 or None
        Corners of the cage's faces in metres, one for each face of `low`.
    distance : float
        In metres, to either side, where there is no cage.
    """

    low: PreparedMesh
    high: PreparedMesh
    cage: Array | None
    distance: float

    @classmethod
    def of(
        cls,
        low: PreparedMesh,
        unwrapped: Unwrapped,
        high: PreparedMesh,
        given: Mesh,
        cage: Mesh | None,
        distance: float | None,
    ) -> Projection:
        """Projection for a `given` mesh that was `unwrapped`.

        Raises
        ------
        InputError
            If the cage has not the vertices and faces of the given mesh.
        """
        corners = None
        if cage is not None:
            if len(cage.vertices) != len(given.vertices) or len(cage.faces) != len(given.faces):
                raise InputError(
                    f"cage {cage.name!r}",
                    f"{len(cage.vertices)} vertices and {len(cage.faces)} faces, but mesh {given.name!r} has "
                    f"{len(given.vertices)} and {len(given.faces)}",
                    "make the cage by moving the vertices of the mesh outwards",
                )
            corners = cage.vertices[unwrapped.vertex][unwrapped.mesh.faces[low.faces]]
        return cls(low, high, corners, SEARCH * given.diagonal if distance is None else distance)

    def points(self, points: Points, weights: Array) -> tuple[Points, npt.NDArray[np.bool_]]:
        """Points on the detailed mesh for points on the coarse mesh, and (k,) whether one was found.

        Parameters
        ----------
        points : Points
            Of the low mesh (k).
        weights : (k, 3) float64
            Barycentric ones of their faces.
        """
        middle = points.exact * self.low.radius + self.low.embree.center
        if self.cage is None:
            begin = middle + self.distance * points.normal
            along, reach = -points.normal, np.full(len(points), 2.0 * self.distance)
        else:
            begin = blend(self.cage[points.face], weights)
            along = middle - begin
            length = np.sqrt((along**2).sum(axis=1))
            along = along / np.where(length > 0, length, 1.0)[:, None]
            reach = 2.0 * length
        return self._first_points(begin, along, reach)

    def _first_points(self, begin: Array, along: Array, reach: Array) -> tuple[Points, npt.NDArray[np.bool_]]:
        """First points of the high mesh on rays in metres, from outside and within `reach`."""
        high = self.high
        origin = (begin - high.embree.center) / high.radius
        face, _ = high.embree.first_hits(origin, along)
        plane = high.planes[np.maximum(face, 0)]
        normal = plane[:, :3]
        cosine = (normal * along).sum(axis=1)
        facing = (face >= 0) & (cosine < 0)
        distance = (plane[:, 3] - (normal * origin).sum(axis=1)) / np.where(facing, cosine, 1.0)
        found = facing & (distance >= 0) & (distance * high.radius <= reach)
        face, point = face[found], (origin + distance[:, None] * along)[found]
        return high.points(face, barycentric(high.corners[face], point)), found


@dataclass(frozen=True, eq=False)
class Strip:
    """Strip: some rows of a map.

    Attributes
    ----------
    values, errors : (rows, w) float32
    coverage, valued : (rows, w) bool
        Texels that a triangle touches, and texels that have a value: without a high mesh, the same.
    owners : (m,) bool
        Faces that some texel shows.
    counts : (len(COUNTS),) int64
    """

    values: Floats
    errors: Floats
    coverage: Mask
    valued: Mask
    owners: Mask
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Strips:
    """Baker of strips of a map. Any number of threads may ask at once.

    Attributes
    ----------
    low : PreparedMesh
        With the texture coordinates.
    shown : (k,) int64
        The faces of `low` that the atlas has.
    atlas : Atlas
        `supersample` times as wide and high as the map.
    measure : Measure
        On the mesh whose thickness is baked.
    projection : Projection or None
        From `low` to that mesh, where it is another.
    """

    low: PreparedMesh
    shown: npt.NDArray[np.int64]
    atlas: Atlas
    measure: Measure
    projection: Projection | None

    @property
    def rows(self) -> int:
        """Rows of the map in a strip."""
        return max(1, STRIP_TEXELS // self.measure.settings.size)

    def bake(self, begin: int) -> Strip:
        """The strip that begins at row `begin` of the map."""
        settings = self.measure.settings
        size, fine = settings.size, settings.supersample
        rows = min(self.rows, size - begin)
        samples = self.atlas.strip(begin * fine, (begin + rows) * fine)
        face = self.shown[samples.face]
        points = self.low.points(face, samples.barycentric)
        found = np.ones(len(points), dtype=bool)
        if self.projection is not None:
            points, found = self.projection.points(points, samples.barycentric)
        measured = self.measure.at(points)
        texel = (samples.row // fine - begin) * size + samples.column // fine
        coverage, overlapping = np.zeros((2, rows * size), dtype=bool)
        coverage[texel] = True
        overlapping[texel[samples.overlapping]] = True
        values, errors, valued = _gathered(
            texel[found], samples.inside[found], measured.values, measured.errors, rows * size
        )
        owners = np.zeros(len(self.low.faces), dtype=bool)
        owners[face] = True
        counts = [measured.traced, measured.cast, measured.escaped, measured.above]
        counts += [len(texel), int((~found).sum()), int(overlapping.sum())]
        values, errors = values.reshape(rows, size), errors.reshape(rows, size)
        coverage, valued = coverage.reshape(rows, size), valued.reshape(rows, size)
        return Strip(values, errors, coverage, valued, owners, np.array(counts, dtype=np.int64))


def _gathered(
    texel: npt.NDArray[np.int64], inside: Mask, values: Array, errors: Array, count: int
) -> tuple[Floats, Floats, Mask]:
    """Means (count,) of the samples of each texel, their standard errors, and which texels have any.

    Samples beside the triangles count only where a texel has none inside them.
    """
    used = inside | (np.bincount(texel[inside], minlength=count) == 0)[texel]
    texel, values, errors = texel[used], values[used], errors[used]
    samples = np.bincount(texel, minlength=count)
    divisor = np.maximum(samples, 1)
    with np.errstate(under="ignore"):
        mean = np.bincount(texel, weights=values, minlength=count) / divisor
        error = np.sqrt(np.bincount(texel, weights=errors * errors, minlength=count)) / divisor
        return mean.astype(np.float32), error.astype(np.float32), samples > 0


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

    def __init__(self, size: int, faces: int, strips: int) -> None:
        self.size, self.strips = size, strips
        shape = (size, size)
        self.values, self.errors = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self.coverage, self.valued = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        self.done, self.owners = np.zeros(strips, dtype=bool), np.zeros(faces, dtype=bool)
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
        if not os.path.isfile(self._path):
            return
        requested = f"checkpoint {str(self._path)!r}"
        found = read_arrays(self._path, requested, ("key", *self._ARRAYS), "remove it")
        if str(found.pop("key")) != self._key:
            raise InputError(
                requested,
                "the file holds an unfinished bake of another mesh, or with other settings",
                "delete the file, or bake with the same mesh and settings as before",
            )
        for name, array in found.items():
            own = getattr(canvas, name)
            if (array.shape, array.dtype) != (own.shape, own.dtype):
                raise InputError(
                    requested,
                    f"the stored array {name} has the shape {array.shape}, and not {own.shape}",
                    "delete the file",
                )
            setattr(canvas, name, array)

    def keep(self, canvas: Canvas) -> None:
        """Write `canvas` if the last write was long enough ago, atomically; raises `RenderError` if that fails."""
        if (started := time.monotonic()) < self._next:
            return
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


def in_order(
    task: Callable[[Item], Result], items: Iterable[Item], threads: int, stop: threading.Event
) -> Generator[Result, None, None]:
    """Results of a task for each item, in the order of the items, each as soon as possible.

    Whatever ends the iteration early sets `stop`, which the task is to heed, and joins the threads.
    """
    # How NumPy treats floating-point errors belongs to the context; the caller's choice holds in all threads.
    context = copy_context()
    waiting: deque[Future[Result]] = deque()
    pool = ThreadPoolExecutor(threads)
    try:
        for item in items:
            waiting.append(pool.submit(context.copy().run, task, item))
            if len(waiting) >= AHEAD * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def bake_strips(
    strips: Strips, canvas: Canvas, threads: int, progress: Progress | None, checkpoint: Checkpoint | None
) -> None:
    """Bake the strips that `canvas` lacks."""
    missing = [number for number in range(canvas.strips) if not canvas.done[number]]
    begins = [number * strips.rows for number in missing]
    # Closed whatever is raised here, an interruption by the user as well: that ends the threads.
    with closing(in_order(strips.bake, begins, threads, strips.measure.stop)) as baked:
        for number, begin, strip in zip(missing, begins, baked, strict=True):
            canvas.put(number, begin, strip)
            if checkpoint is not None:
                checkpoint.keep(canvas)
            if progress is not None:
                texels = min(int(canvas.done.sum()) * strips.rows, canvas.size) * canvas.size
                progress(texels, canvas.size**2, canvas.count("traced"))
