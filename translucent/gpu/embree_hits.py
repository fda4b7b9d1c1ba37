"""Nearest surfaces on rays by Embree, on the triangles that the hierarchies on the GPU hold."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import embree_scene, point_from
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.hierarchies import packed_mesh
from translucent.scene.scene import Scene

if TYPE_CHECKING:
    from embreex.rtcore_scene import EmbreeScene

Floats = npt.NDArray[np.float32]

#: Triangles from which on a mesh has an Embree scene of its own, which is built once however its body moves; and the
#: largest number of these in a scene, as each ray is traced through all of them.
OWN_SCENE, MOST_OWN = 1 << 14, 4

#: Coordinates of a mesh from which on a ray starts where it is nearest to the middle instead, less this much: farther
#: off its start is rounded to more than small triangles.
FAR_AWAY = 4.0

#: Rays of a thread at least: it takes about 50 microseconds to start one.
_LEAST_RAYS = 1 << 13

_NOTHING = np.float32(CONSTANTS["NOTHING"])

_scenes: WeakKeyDictionary[Mesh, EmbreeScene] = WeakKeyDictionary()


def mesh_scene(mesh: Mesh) -> EmbreeScene:
    """Embree scene of a `packed_mesh`, made once for each mesh, in about 0.7 s for a million triangles."""
    if (found := _scenes.get(mesh)) is None:
        packed = packed_mesh(mesh)
        found = _scenes[mesh] = embree_scene(_geometry(mesh, packed.center, packed.scale * np.eye(3), np.zeros(3)))
    return found


class RayHits(NamedTuple):
    """Nearest surfaces on rays.

    Attributes
    ----------
    path : (n,) float32
        Metres from the origin; NOTHING where nothing is hit.
    object : (n,) int32
        Number of the object; -1 where nothing is hit.
    triangle : (n,) int32
        Of its `packed_mesh`; -1 where nothing is hit.
    weights : (2, n) float32
        Of the second and the third corner.
    """

    path: Floats
    object: npt.NDArray[np.int32]
    triangle: npt.NDArray[np.int32]
    weights: Floats


@dataclass(frozen=True, eq=False)
class _EmbreePart:
    """Embree scene of some objects, one geometry each, in its own coordinates of about -1 to 1.

    These are `scale` times `linear` (3, 3), where that is not None, times what rays are off `middle` (3,).
    """

    scene: EmbreeScene
    objects: npt.NDArray[np.int32]
    scale: np.float32
    linear: Floats | None
    middle: Floats

    def nearest(self, origins: Floats, directions: Floats, reach: Floats | None) -> RayHits:
        """Nearest surfaces, of those within some metres where `reach` is given."""
        with np.errstate(under="ignore", over="ignore", invalid="ignore"):
            # From the middle before anything is multiplied: near a tiny body far from the center little is rounded.
            # By columns: loops over three numbers of a row take four times as long.
            offsets = np.empty(origins.shape, np.float32)
            for axis in range(3):
                np.subtract(origins[:, axis], self.middle[axis], out=offsets[:, axis])
            local, along = self._turned(offsets), self._turned(directions)
            local *= self.scale
            ahead: Floats | None = None
            if not max(local.max(initial=0.0), -local.min(initial=0.0)) <= FAR_AWAY / np.sqrt(3.0):  # or NaN
                ahead = self._starts_ahead(local, along)
            end = None if reach is None else reach * self.scale
            if end is not None and ahead is not None:
                end -= ahead
            found = self.scene.run(local, along, end, output=True)
            path, missed = found["tfar"], np.flatnonzero(found["primID"] < 0)
            if ahead is not None:
                path += ahead
            path /= self.scale
        objects = self.objects.take(found["geomID"], mode="clip")
        path[missed], objects[missed] = _NOTHING, -1
        return RayHits(path, objects, found["primID"], np.stack([found["u"], found["v"]]))

    def _starts_ahead(self, local: Floats, along: Floats) -> Floats:
        """Let rays (n, 3) that start far away start near the part; returns (n,): how far ahead, in its coordinates."""
        ahead = np.zeros(len(local), np.float32)
        far = np.flatnonzero(np.einsum("ij,ij->i", local, local) > FAR_AWAY**2)
        speed = np.einsum("ij,ij->i", along[far], along[far])
        nearest = -np.einsum("ij,ij->i", local[far], along[far]) / speed
        ahead[far] = np.maximum(nearest - FAR_AWAY / np.sqrt(speed), 0.0)
        local[far] += ahead[far, None] * along[far]
        return ahead

    def _turned(self, vectors: Floats) -> Floats:
        """Vectors (n, 3) in the axes of the part. Threads of BLAS would wait for more in a busy loop."""
        if self.linear is None:
            return vectors
        x, y, z = vectors.T
        turned = np.empty((len(vectors), 3), np.float32)
        for i, row in enumerate(self.linear):
            turned[:, i] = row[0] * x + row[1] * y + row[2] * z
        return turned


class EmbreeHits:
    """Nearest surfaces of a scene's objects on many rays.

    Large meshes are traced in coordinates of their own, all others together in those of the world.

    Parameters
    ----------
    scene : Scene
    center : (3,) float64
        Where positions count from.
    """

    def __init__(self, scene: Scene, center: Array) -> None:
        objects = scene.objects
        by_size = sorted(range(len(objects)), key=lambda i: -len(objects[i].mesh.faces))
        own = [i for i in by_size if len(objects[i].mesh.faces) >= OWN_SCENE][:MOST_OWN] if len(objects) > 1 else [0]
        self._parts = [_own_part(scene, i, center) for i in own]
        if rest := [i for i in range(len(objects)) if i not in own]:
            self._parts.append(_common_part(scene, rest, center))
        processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        # Two are most often one core, where two threads together take no less time, and more of it on both.
        self._threads = max(processors // 2, 1)

    def nearest(self, origins: Floats, directions: Floats) -> RayHits:
        """Nearest surfaces on rays from origins (n, 3) along directions (n, 3)."""
        rows = _chunks(len(origins), self._threads)
        if len(rows) == 1:
            return self._nearest(origins, directions)
        with ThreadPoolExecutor(len(rows)) as pool:
            found = list(pool.map(lambda own: self._nearest(origins[own], directions[own]), rows))
        return RayHits(*(np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True)))

    def _nearest(self, origins: Floats, directions: Floats) -> RayHits:
        hits = self._parts[0].nearest(origins, directions, None)
        for part in self._parts[1:]:
            found = part.nearest(origins, directions, hits.path)
            nearer = found.object >= 0
            for values, new in zip(hits, found, strict=True):
                values[..., nearer] = new[..., nearer]
        return hits


class EmbreeHitsCache:
    """Cache of the hits of the last scene, kept as long as its bodies are the same and stand still."""

    def __init__(self) -> None:
        self._held: EmbreeHits | None = None
        self._key: Hashable = None
        self._scene: ref[Scene] | None = None

    def of(self, scene: Scene, center: Array) -> EmbreeHits:
        """The hits of a scene, with positions from a center, which belongs to the scene."""
        if self._held is None or self._scene is None or self._scene() is not scene:
            key = tuple((ref(body.mesh), body.matrix.tobytes()) for body in scene.objects), center.tobytes()
            if self._held is None or self._key != key:
                self._held = None
                self._held, self._key = EmbreeHits(scene, center), key
            self._scene = ref(scene)
        return self._held


def _chunks(count: int, threads: int) -> list[slice]:
    """Rows of so many rays for each of some threads."""
    if (parts := min(threads, count // _LEAST_RAYS)) <= 1:
        return [slice(0, count)]
    edges = np.linspace(0, count, parts + 1).astype(int).tolist()
    return [slice(begin, end) for begin, end in pairwise(edges)]


def _geometry(mesh: Mesh, center: Array, linear: Array, moved: Array) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Vertices of a mesh, from its center, transformed and moved; and its faces in the order of its `packed_mesh`."""
    with np.errstate(under="ignore", over="ignore", invalid="ignore"):  # vertices that no face uses may be anywhere
        vertices = ((mesh.vertices - center) @ linear.T + moved).astype(np.float32)
    return vertices, mesh.faces[packed_mesh(mesh).faces]


def _own_part(scene: Scene, number: int, center: Array) -> _EmbreePart:
    body = scene.objects[number]
    packed, linear = packed_mesh(body.mesh), body.matrix[:3, :3]
    middle = point_from(packed.center, body.matrix, center).astype(np.float32)
    inverse = np.linalg.inv(linear)
    size = float(np.abs(inverse).max())
    turned = None if np.array_equal(inverse, size * np.eye(3)) else (inverse / size).astype(np.float32)
    scale = np.float32(packed.scale * size)
    return _EmbreePart(mesh_scene(body.mesh), np.array([number], np.int32), scale, turned, middle)


def _common_part(scene: Scene, numbers: Sequence[int], center: Array) -> _EmbreePart:
    # Lengths in a power of two of metres, which rounds nothing.
    scale = 2.0 ** -float(np.round(np.log2(scene.diagonal)))
    geometries = []
    for i in numbers:
        body = scene.objects[i]
        middle = point_from(body.mesh.center, body.matrix, center)
        geometries.append(_geometry(body.mesh, body.mesh.center, scale * body.matrix[:3, :3], scale * middle))
    objects, nowhere = np.array(numbers, np.int32), np.zeros(3, np.float32)
    return _EmbreePart(embree_scene(*geometries), objects, np.float32(scale), None, nowhere)
