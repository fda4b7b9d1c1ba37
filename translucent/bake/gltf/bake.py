"""Baking of a glTF file: each primitive that light enters, into a copy of the file, or into maps of their own.

In the file thickness is in the mesh's own space, as glTF has it; in maps it is in metres of the scene.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from translucent.bake.gltf.bodies import first_transforms, transformed
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.gltf.maps import write_maps
from translucent.bake.gltf.targets import Target, find_targets, left_out
from translucent.bake.gltf.vertices import write_vertices
from translucent.bake.jobs import Job, Progress, Results, bake_one, stays_gltf
from translucent.bake.map_files import save_maps
from translucent.bake.record import Record
from translucent.errors import InputError
from translucent.gltf.file import read_gltf
from translucent.media.medium import Medium
from translucent.units import metres_per_unit


def bake_gltf(job: Job, about: Record, progress: Progress | None = None) -> tuple[Record, Results]:
    """Run a job whose model is a glTF file; see `translucent.bake.bake_file.bake_file`."""
    metres = metres_per_unit(job.get("unit", "m"))
    output, vertices, inside = Path(job["output"]), bool(job.get("vertices")), stays_gltf(job)
    size = job.get("settings", {}).get("size", 1024)
    builder = GlbBuilder(read_gltf(job["model"], bool(job.get("outside"))))
    new = bool(job.get("unwrap"))
    targets = find_targets(builder, metres, size=size, needs_uv=not vertices, new_uv=new, plain_uv=not inside)
    if job.get("high") is not None and len(targets) > 1:
        raise InputError(f"high mesh {job['high']!r}", f"{len(targets)} objects get thickness", "bake them one by one")
    if lost := left_out(builder.file(), targets):
        about = {**about, "left_out": lost}
    if not inside:
        targets = _placed(builder, targets, metres)
    results = _bake(job, targets, progress)
    if vertices:
        return write_vertices(builder, output, results, metres=metres, about=about), results
    keys = {target.key: target for target in targets}
    if not inside:
        how = {key: bool(job.get(key)) for key in ("normalize", "invert")}
        return save_maps(builder, output, results, keys, **how, about=about), results
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    record = write_maps(builder, output, results, targets=keys, metres=metres, medium=medium, about=about)
    return record, results


def _placed(builder: GlbBuilder, targets: list[Target], metres: float) -> list[Target]:
    """Targets as the nodes place them."""
    matrices = first_transforms(builder.file())
    placed = []
    for target in targets:
        matrix = matrices.get(target.key[0], np.eye(4))
        around = None if target.around is None else transformed(target.around, matrix, metres)
        mesh = transformed(target.mesh, matrix, metres)
        placed.append(dataclasses.replace(target, mesh=mesh, around=around))
    return placed


def _bake(job: Job, targets: list[Target], progress: Progress | None) -> Results:
    results: Results = {}
    rays_before = 0
    for number, target in enumerate(targets):
        tell = None
        if progress is not None:

            def tell(share: float, rays: int, number: int = number, before: int = rays_before) -> None:
                progress((number + share) / len(targets), before + rays)

        part = f".{number}" if len(targets) > 1 else ""
        result = bake_one(job, target.mesh, target.medium, tell, part, target.around)
        rays_before += result.report.rays
        results[target.key] = result
    return results
