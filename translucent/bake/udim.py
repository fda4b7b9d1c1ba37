"""Thickness maps over UDIM tiles: one file a tile, all of one scale."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from translucent.bake.atlas import tiles_of
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.gltf_targets import find_targets, first_transforms
from translucent.bake.jobs import Job, Progress, Results, bake_one, check_job, content_hash, has_parts
from translucent.bake.record import Record, add_record
from translucent.bake.thickness_map import ThicknessMap, add_map, shared
from translucent.errors import InputError
from translucent.files.paths import OutputFiles
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import read_gltf
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.units import metres_per_unit

#: Part of a file's name that a tile's number takes the place of.
UDIM = "<UDIM>"


def is_tiled(output: str | Path) -> bool:
    """True if the name of a file asks for one file a tile."""
    return UDIM in Path(output).name


def bake_tiles(job: Job, progress: Progress | None = None) -> tuple[Record, Results]:
    """Bake all tiles that a model's texture coordinates lie in, those of all its materials, into a file each.

    Parameters
    ----------
    job : dict
        See `translucent.bake.jobs`; its output has `UDIM` in its name.
    progress : callable, optional

    Returns
    -------
    record : dict
        Of all; it lies beside them, with `UDIM` in its name. Files that store fractions share one scale.
    results : dict of ThicknessMap
        By tile, as (tile, 0).

    Raises
    ------
    InputError
        If the job is wrong, or the texture coordinates are in no tile.
    """
    check_job({**job, "output": _name(job, 1001)})
    if job.get("settings", {}).get("tile") is not None:
        raise InputError(f"output {job['output']!r}", "--tile is given, too", "give one of the two")
    parts = _parts(job)
    tiles = sorted({tile for mesh, _, _ in parts for tile in tiles_of(mesh)} - {0})
    if not tiles:
        found = "its texture coordinates are in no tile from 1001 on"
        raise InputError(f"output {job['output']!r}", found, "leave out <UDIM>, or unwrap the model into tiles")
    results: Results = {}
    rays = 0
    for number, tile in enumerate(tiles):
        own = {**job, "settings": {**job.get("settings", {}), "tile": tile}}
        maps = []
        for mesh, medium, around in parts:
            if tile in tiles_of(mesh):
                maps.append(bake_one(own, mesh, medium, None, f".{tile}", around))
                rays += maps[-1].report.rays
        results[tile, 0] = _merged([one for one in maps if isinstance(one, ThicknessMap)])
        if progress is not None:
            progress((number + 1) / len(tiles), rays)
    about = {"hash": content_hash(job), "model": job["model"], "model_unit": job.get("unit", "m")}
    storing = {key: bool(job.get(key)) for key in ("normalize", "invert")}
    largest = max(float(np.max(one.values, initial=0.0)) for one in results.values())
    records = []
    with OutputFiles() as files:
        for tile in tiles:
            one = {**about, "tile": tile}
            path = Path(_name(job, tile))
            records.append(add_map(files, results[tile, 0], path, **storing, about=one, largest=largest))
        return add_record(files, Path(job["output"]), {**about, **shared(records), "maps": records}), results


def _name(job: Job, tile: int) -> str:
    output = Path(job["output"])
    return str(output.with_name(output.name.replace(UDIM, str(tile))))


def _parts(job: Job) -> list[tuple[Mesh, Medium | None, Mesh | None]]:
    """Meshes with their media, and the bodies that they are parts of: those of a glTF file that light enters."""
    unit, outside = job.get("unit", "m"), bool(job.get("outside"))
    if not has_parts(job):
        mesh = load_mesh(job["model"], unit=unit, allow_outside=outside)
        if mesh.uv is None:
            raise InputError(
                f"output {job['output']!r}", f"{mesh.name!r} has no texture coordinates", "leave out <UDIM>"
            )
        return [(mesh, None, None)]
    builder = GlbBuilder(read_gltf(job["model"], outside))
    targets = find_targets(builder, metres_per_unit(unit), plain_uv=True)
    matrices = first_transforms(builder.file())
    moved = [target.moved(matrices.get(target.key[0], np.eye(4)), metres_per_unit(unit)) for target in targets]
    return [(target.mesh, target.medium, target.around) for target in moved]


def _merged(maps: Sequence[ThicknessMap]) -> ThicknessMap:
    """Map of several meshes in one tile: where texels have a value of their own, that of the first mesh that has."""
    whole = maps[0]
    for one in maps[1:]:
        new = one.coverage & ~whole.coverage
        padded = (one.values > 0) & (whole.values == 0)
        whole = dataclasses.replace(
            whole,
            values=np.where(new | padded, one.values, whole.values),
            standard_error=np.where(new, one.standard_error, whole.standard_error),
            coverage=whole.coverage | one.coverage,
        )
    return whole
