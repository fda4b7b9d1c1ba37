"""A glTF file baked into a copy of itself: each primitive that light enters, in the mesh's own space."""

from __future__ import annotations

from pathlib import Path

from translucent.bake.glb_builder import GlbBuilder
from translucent.bake.gltf_maps import write_maps
from translucent.bake.gltf_targets import find_targets
from translucent.bake.gltf_vertices import write_vertices
from translucent.bake.jobs import Job, Progress, Results, bake_one
from translucent.bake.record import Record
from translucent.errors import InputError
from translucent.materials.gltf_file import read_gltf
from translucent.medium import Medium
from translucent.units import metres_per_unit


def bake_gltf(job: Job, about: Record, progress: Progress | None = None) -> tuple[Record, Results]:
    """Do a job whose model and output are glTF files; see `translucent.bake.jobs.bake_file`."""
    metres = metres_per_unit(job.get("unit", "m"))
    output, vertices = Path(job["output"]), bool(job.get("vertices"))
    size = job.get("settings", {}).get("size", 1024)
    builder = GlbBuilder(read_gltf(job["model"], bool(job.get("outside"))))
    targets = find_targets(builder, metres, needs_uv=not vertices, new_uv=bool(job.get("unwrap")), size=size)
    if job.get("high") is not None and len(targets) > 1:
        raise InputError(f"high mesh {job['high']!r}", f"{len(targets)} objects get thickness", "bake them one by one")
    results: Results = {}
    rays_before = 0
    for number, target in enumerate(targets):
        tell = None
        if progress is not None:

            def tell(share: float, rays: int, number: int = number, before: int = rays_before) -> None:
                progress((number + share) / len(targets), before + rays)

        part = f".{number}" if len(targets) > 1 else ""
        result = bake_one(job, target.mesh, target.medium, tell, part)
        rays_before += result.report.rays
        results[target.place] = result
    if vertices:
        return write_vertices(builder, output, results, metres=metres, about=about), results
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    places = {target.place: target for target in targets}
    record = write_maps(builder, output, results, targets=places, metres=metres, medium=medium, about=about)
    return record, results
