"""Models from files, the large ones read by a worker process."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals, has_drawn_normals, keep_drawn_normals
from translucent.preview.document import Model
from translucent.preview.loaded import Loaded
from translucent.preview.scenes import material_of
from translucent.preview.tasks import Report, Task
from translucent.preview.worker import Pool, Urgency
from translucent.scene.scene import Scene

#: Bytes of a file from which on it is read by a worker process: while a picture is on show, and before. Whatever reads
#: it holds the interpreter's lock now and then, which nobody sees in a window without a picture, and no process need
#: be started for the first one.
LARGE_BESIDE_PICTURE, LARGE_FILE = 1 << 18, 1 << 23

Normals: TypeAlias = list[tuple[Mesh, npt.NDArray[np.float32]]]


def load_with(task: Task, pool: Pool, model: Model, allow_outside: bool = False, *, pictured: bool = False) -> Loaded:
    """Load a model here, or if it is large, in a worker process; `pictured` while the window shows another.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    large = LARGE_BESIDE_PICTURE if pictured else LARGE_FILE
    if not (os.path.isfile(model.path) and os.path.getsize(model.path) > large):
        return load(model, allow_outside)
    loaded, normals = pool.call(task, load_elsewhere, model, allow_outside, urgency=Urgency.PICTURE)
    for mesh, made in normals:
        keep_drawn_normals(mesh, made)
    return loaded


def load_elsewhere(report: Report, model: Model, allow_outside: bool) -> tuple[Loaded, Normals]:
    """Load a model; with the normals that have been made of its meshes."""
    report(None, f"reading {Path(model.path).name}")
    loaded = load(model, allow_outside)
    meshes = dict.fromkeys(item.mesh for item in loaded.scene.objects)
    return loaded, [(mesh, drawn_normals(mesh)) for mesh in meshes if has_drawn_normals(mesh)]


def load(model: Model, allow_outside: bool = False) -> Loaded:
    """Load a model, and compute everything that would delay its first picture.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    from translucent.assets import mesh_names, mesh_path
    from translucent.gltf.load import SUFFIXES, load_scene
    from translucent.mesh_files import load_mesh
    from translucent.scene.showcase import showcase

    if Path(model.path).suffix.lower() in SUFFIXES:
        scene: Scene = load_scene(model.path, model.unit, allow_outside=allow_outside)
    elif model.path in mesh_names() and not Path(model.path).exists():
        scene = showcase(load_mesh(mesh_path(model.path)), stage="none")
    else:
        scene = showcase(load_mesh(model.path, unit=model.unit, allow_outside=allow_outside), stage="none")
    for item in scene.objects:
        _ = item.mesh.diagnosis, item.bounds  # slow for large meshes, and kept
        if item.has_interface or item.surface is not None:
            drawn_normals(item.mesh)
    return Loaded(model, scene, material_of(scene))
