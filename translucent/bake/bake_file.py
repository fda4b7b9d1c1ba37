"""Bake jobs on files: a model is read, baked and written, with the record beside it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from translucent.bake.gltf.bake import bake_gltf
from translucent.bake.jobs import Job, Progress, Results, bake_one, check_job, content_hash, has_parts
from translucent.bake.record import Record
from translucent.bake.thickness_map import VertexThickness
from translucent.bake.writing import save_map, save_vertices
from translucent.mesh_files import load_mesh


def bake_file(job: Job, progress: Progress | None = None, content: str | None = None) -> tuple[Record, Results]:
    """Run a bake job and write its files.

    Parameters
    ----------
    job : dict
        See `translucent.bake.jobs`.
    progress : callable, optional
    content : str, optional
        The `content_hash` of the job, where it is known.

    Returns
    -------
    record : dict
        As it was written beside the output.
    results : dict
        A `ThicknessMap` or `VertexThickness` per mesh and primitive of a glTF file; else one, for (0, 0).
        Maps that are files of their own are in the space of the scene, those in a glTF file in that of their meshes.

    Raises
    ------
    InputError
        If the job or its model is wrong.
    RenderError
        If a file cannot be written, or a package is missing.
    """
    check_job(job)
    output = Path(job["output"])
    about = {"hash": content or content_hash(job), "model": job["model"], "model_unit": job.get("unit", "m")}
    if has_parts(job):
        return bake_gltf(job, about, progress)
    mesh = load_mesh(job["model"], unit=job.get("unit", "m"), allow_outside=bool(job.get("outside")))
    if job.get("unwrap"):
        mesh = dataclasses.replace(mesh, uv=None)
    result = bake_one(job, mesh, progress=progress)
    if isinstance(result, VertexThickness):
        record = save_vertices(result, output, about=about)
    else:
        normalize, invert = bool(job.get("normalize")), bool(job.get("invert"))
        record = save_map(result, output, normalize=normalize, invert=invert, about=about)
    return record, {(0, 0): result}
