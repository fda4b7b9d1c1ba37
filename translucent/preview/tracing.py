"""Hierarchies of large meshes, made in a worker process while the picture does without traced rays."""

from __future__ import annotations

import threading
from weakref import WeakSet

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals, has_drawn_normals, keep_drawn_normals, made_normals
from translucent.gpu.packed_meshes import PackedMesh, has_packed, keep_packed, pack_mesh
from translucent.preview.tasks import Lane, Report, Task
from translucent.preview.worker import PATIENCE, Pool, Urgency
from translucent.scene.scene import Scene

#: Largest number of triangles whose hierarchy is built without a worker process.
PACKED_AT_ONCE = 20_000

#: Held while normals are made.
_smoothing = threading.Lock()

UNTIL = "interfaces in screen space, until rays can be traced through the mesh"
NEVER = "interfaces in screen space, since the mesh could not be prepared for rays"


class Tracing:
    """Maker of what rays need of the meshes of the scene on show, one mesh at a time.

    Attributes
    ----------
    told : str
        Why rays are not traced, or nothing.
    """

    def __init__(self) -> None:
        self.told = ""
        self._refused: WeakSet[Mesh] = WeakSet()
        self._asked: tuple[Mesh, Task] | None = None

    def ready(self, scene: Scene, pool: Pool, lane: Lane) -> bool:
        """True if rays can be traced through all meshes at once; else what is missing is requested."""
        self.told = ""
        missing = [mesh for mesh in dict.fromkeys(item.mesh for item in scene.objects) if not _is_ready(mesh)]
        if not missing:
            return True
        if self._asked is not None and (self._asked[1].cancelled or self._asked[1].error is not None):
            self._refused.add(self._asked[0])
            self._asked = None
        if self._refused.intersection(missing):
            self.told = NEVER
            return False
        self.told = UNTIL
        if lane.task is None:
            mesh = missing[0]
            task = lane.start("preparing rays", lambda task: _prepare(task, pool, mesh), lambda _: None)
            self._asked = mesh, task
        return False


def _is_ready(mesh: Mesh) -> bool:
    return len(mesh.faces) <= PACKED_AT_ONCE or has_packed(mesh)


def _prepare(task: Task, pool: Pool, mesh: Mesh) -> None:
    have_smoothed(task, pool, mesh)
    keep_packed(mesh, pool.call(task, packed, mesh, drawn_normals(mesh), urgency=Urgency.PICTURE))


def have_smoothed(task: Task, pool: Pool, mesh: Mesh) -> None:
    """Have a worker process make the `drawn_normals` of a mesh, once: who asks meanwhile waits for the same."""
    while not _smoothing.acquire(timeout=PATIENCE):
        task.report(task.share, task.detail)
    try:
        if not has_drawn_normals(mesh):
            keep_drawn_normals(mesh, pool.call(task, smoothed, mesh, urgency=Urgency.PICTURE))
    finally:
        _smoothing.release()


def smoothed(report: Report, mesh: Mesh) -> npt.NDArray[np.float32]:
    """`drawn_normals` of a mesh."""
    report(None, "normals")
    return made_normals(mesh)


def packed(report: Report, mesh: Mesh, normals: npt.NDArray[np.float32]) -> PackedMesh:
    """`packed_mesh` of a mesh."""
    report(None, "hierarchy")
    return pack_mesh(mesh, normals)
