"""Bake jobs: a plain dict in and files out, so that a process on another machine can run them.

A job holds what JSON can hold, so it can be kept, sent and hashed:

===============  ==========================================================================================
``model``        path of a mesh or glTF file
``output``       path of the file to write; its record goes beside it
``unit``         of the model's coordinates (default m)
``settings``     arguments of `bake_thickness` by name: mode, size, rays, ...; ``max_distance``, ``tolerance`` and
                 ``high_distance`` in metres, or as fractions of the mesh's diagonal, such as ``"10%"``
``medium``       extinction (r, g, b) in 1/m, for mode ``transmittance``
``high``         path of the mesh that the details come from, and ``cage`` that of a cage around it, in the unit
``vertices``     True: thickness per vertex instead of a map
``unwrap``       True: new UVs, whatever the model has
``normalize``    True: store fractions of the largest value; ``invert``: 1 minus them
``values_only``  True: an .exr file has one channel
``outside``      True: read files that a glTF model links to wherever they are, not only below its folder
``resume``       True: keep finished parts in ``OUTPUT.resume.npz``, and go on from there
``threads``      how many (default: all processors); results do not depend on it
``max_escaped``  of `bake_many`: fraction of rays without an exit above which a map is suspect (default 0.05)
===============  ==========================================================================================

Only ``model`` and ``output`` are needed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from translucent.bake.bake import bake_thickness, bake_vertex_thickness
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.gltf_targets import (
    PrimitiveKey,
    Target,
    find_targets,
    first_transforms,
    left_out,
    primitive_name,
)
from translucent.bake.record import Record, add_record, file_hash, files_of, read_record
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import (
    MAP_SUFFIXES,
    VERTEX_SUFFIXES,
    ThicknessMap,
    VertexThickness,
    add_map,
    add_uv_file,
    check_map_output,
    save_map,
    save_vertices,
    shared,
    write_maps,
    write_vertices,
)
from translucent.errors import InputError
from translucent.files.paths import OutputFiles
from translucent.files.reading import read_bytes
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, read_gltf
from translucent.gltf.load import SUFFIXES
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.units import metres_per_unit
from translucent.version import VERSION

Job = dict[str, Any]
#: Results by mesh and primitive of a glTF file; else one, for (0, 0).
Results = dict[PrimitiveKey, Any]
#: Callback with the fraction that is done, 0..1, and the rays traced so far.
Progress = Callable[[float, int], None]

KEYS = {
    "model", "output", "unit", "settings", "medium", "high", "cage", "vertices", "unwrap", "normalize", "invert",
    "values_only", "resume", "threads", "max_escaped", "outside",
}  # fmt: skip
#: Version of the set of files that a bake writes; another number makes them anew.
FILES = 2
#: Largest distance of a part of a body from its surface, as a fraction of the diagonal: that of rounding.
ON_SURFACE = 1e-4
#: Keys that do not change the contents of the file.
_HOW = {"output", "model", "high", "cage", "resume", "threads", "max_escaped", "outside"}
_LENGTHS = ("max_distance", "tolerance", "high_distance")
#: Largest length of the name of a map, and the characters besides letters and digits that are safe in file names.
_LONGEST, _SAFE = 60, "._-"
#: Keys without meaning for vertices: mistakes, and keys that merely have a default.
_OF_MAPS, _TEXELS = ("tile", "high", "cage", "high_distance"), ("size", "supersample", "padding")


def check_job(job: Job) -> None:
    """Raise `InputError` or `RenderError` if a job is found invalid before any work is done."""
    if unknown := sorted(set(job) - KEYS):
        raise InputError(
            f"bake job with {unknown[0]!r}", "a bake job has no such key", f"use {', '.join(sorted(KEYS))}"
        )
    if missing := [key for key in ("model", "output") if not isinstance(job.get(key), str)]:
        raise InputError("bake job", f"the job has no key {missing[0]}", "add this key with a path as text")
    metres_per_unit(job.get("unit", "m"))
    if not 0 <= (fraction := job.get("max_escaped", 0)) <= 1:
        raise InputError(
            f"max_escaped {fraction!r}", "the value must lie in 0..1", "give a fraction of the rays, for example 0.05"
        )
    suffixes = VERTEX_SUFFIXES if job.get("vertices") else MAP_SUFFIXES
    output = Path(job["output"])
    storing = _storing(job)
    suffix = check_map_output(output, suffixes, normalize=storing["normalize"], invert=storing["invert"])
    settings = job.get("settings", {})
    of_maps = [key for key in (*_OF_MAPS, "normalize", "invert", "resume") if job.get(key) or settings.get(key)]
    if job.get("vertices") and of_maps:
        raise InputError(
            "thickness is baked per vertex",
            f"{of_maps[0]} applies only to thickness maps",
            f"omit {of_maps[0]}, or bake a thickness map",
        )
    if suffix == ".glb" and settings.get("tile") is not None:
        raise InputError(
            f"tile {settings['tile']!r}",
            "a glTF file cannot hold UDIM tiles",
            "choose another output format, or omit the tile",
        )
    if suffix == ".glb" and settings.get("mode") == "local" and not job.get("vertices"):
        raise InputError(
            f"output {str(output)!r}",
            "mode 'local' bakes a fraction, which glTF cannot store as a thickness",
            "choose another output format, or another mode",
        )
    _settings(job, 1.0)


def _settings(job: Job, diagonal: float) -> Job:
    """Checked arguments of a bake; fractions of the diagonal are converted to metres."""
    given = dict(job.get("settings", {}))
    for key in _LENGTHS:
        if isinstance(given.get(key), str):
            given[key] = diagonal * _fraction(key, given[key])
    known = {field.name for field in dataclasses.fields(BakeSettings)} - {"medium"}
    if unknown := sorted(set(given) - known):
        raise InputError(f"bake setting {unknown[0]!r}", "not a known setting", f"use {', '.join(sorted(known))}")
    if job.get("medium") is not None:
        given["medium"] = Medium(absorption=job["medium"])
    # A glTF material may bring the medium that this mode needs.
    late = given.get("mode") == "transmittance" and has_parts(job) and "medium" not in given
    BakeSettings(**({**given, "medium": Medium(absorption=1.0)} if late else given))
    return given


def _fraction(key: str, text: str) -> float:
    try:
        fraction = float(text.removesuffix("%")) / 100 if text.endswith("%") else float("nan")
    except ValueError:
        fraction = float("nan")
    if not 0 < fraction < float("inf"):
        raise InputError(
            f"{key} {text!r}",
            "the value is not a percentage such as '10%'",
            "give a percentage of the diagonal, or a number of metres",
        )
    return fraction


def has_parts(job: Job) -> bool:
    """True if the objects of the model are baked one by one, and not as one mesh."""
    return Path(job["model"]).suffix.lower() in SUFFIXES and (stays_gltf(job) or not job.get("vertices"))


def stays_gltf(job: Job) -> bool:
    """True if the output is a copy of the model's glTF file."""
    return Path(job["output"]).suffix.lower() == ".glb" and Path(job["model"]).suffix.lower() in SUFFIXES


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
        return _bake_gltf(job, about, progress)
    mesh = load_mesh(job["model"], unit=job.get("unit", "m"), allow_outside=bool(job.get("outside")))
    if job.get("unwrap"):
        mesh = dataclasses.replace(mesh, uv=None)
    result = bake_one(job, mesh, progress=progress)
    if isinstance(result, VertexThickness):
        record = save_vertices(result, output, about=about)
    else:
        record = save_map(result, output, **_storing(job), about=about)
    return record, {(0, 0): result}


def _storing(job: Job) -> dict[str, bool]:
    return {key: bool(job.get(key)) for key in ("normalize", "invert", "values_only")}


def bake_one(
    job: Job,
    mesh: Mesh,
    medium: Medium | None = None,
    progress: Progress | None = None,
    part: str = "",
    around: Mesh | None = None,
) -> ThicknessMap | VertexThickness:
    """Bake one mesh with the settings of a job.

    Parameters
    ----------
    job : dict
    mesh : Mesh
    medium : Medium, optional
        For mode ``transmittance``, if the job has none.
    progress : callable, optional
    part : str
        Tells the parts of a job apart that keep what is finished.
    around : Mesh, optional
        The body whose surface the mesh is a part of.
    """
    given = _settings(job, mesh.diagonal)
    if given.get("mode") == "transmittance":
        given.setdefault("medium", medium)
    if around is not None and not (job.get("vertices") or job.get("high")):
        given |= {"high": around, "high_distance": ON_SURFACE * around.diagonal}
    for key in ("high", "cage"):
        if job.get(key) is not None:
            given[key] = load_mesh(job[key], unit=job.get("unit", "m"), allow_outside=bool(job.get("outside")))
    report = None
    if progress is not None:

        def report(done: int, total: int, rays: int) -> None:
            progress(done / max(total, 1), rays)

    given |= {"threads": job.get("threads"), "progress": report}
    if job.get("vertices"):
        return bake_vertex_thickness(mesh, **{key: value for key, value in given.items() if key not in _TEXELS})
    if job.get("resume"):
        given["checkpoint"] = Path(f"{job['output']}{part}.resume.npz")
    return bake_thickness(mesh, **given)


def _bake_gltf(job: Job, about: Record, progress: Progress | None) -> tuple[Record, Results]:
    """Bake each primitive of a glTF file that light enters, into a copy of the file, or into maps of their own.

    In the file thickness is in the mesh's own space, as glTF has it; in maps it is in metres of the scene.
    """
    metres = metres_per_unit(job.get("unit", "m"))
    output, vertices, inside = Path(job["output"]), bool(job.get("vertices")), stays_gltf(job)
    size = job.get("settings", {}).get("size", 1024)
    builder = GlbBuilder(read_gltf(job["model"], bool(job.get("outside"))))
    new = bool(job.get("unwrap"))
    targets = find_targets(builder, metres, size=size, needs_uv=not vertices, new_uv=new, plain_uv=not inside)
    if job.get("high") is not None and len(targets) > 1:
        raise InputError(
            f"high mesh {job['high']!r}",
            f"{len(targets)} objects of the model get a thickness map, but a detailed mesh belongs to one object",
            "bake these objects one by one",
        )
    if lost := left_out(builder.file(), targets):
        about = {**about, "left_out": lost}
    if not inside:
        matrices = first_transforms(builder.file())
        targets = [target.moved(matrices.get(target.key[0], np.eye(4)), metres) for target in targets]
    results = _bake_targets(job, targets, progress)
    if vertices:
        return write_vertices(builder, output, results, metres=metres, about=about), results
    if not inside:
        return _save_maps(builder, job, results, targets, about), results
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    keys = {target.key: target for target in targets}
    record = write_maps(builder, output, results, targets=keys, metres=metres, medium=medium, about=about)
    return record, results


def _bake_targets(job: Job, targets: list[Target], progress: Progress | None) -> Results:
    results: Results = {}
    rays_before = 0
    for number, target in enumerate(targets):
        report = None
        if progress is not None:

            def report(fraction: float, rays: int, number: int = number, before: int = rays_before) -> None:
                progress((number + fraction) / len(targets), before + rays)

        part = f".{number}" if len(targets) > 1 else ""
        result = bake_one(job, target.mesh, target.medium, report, part, target.around)
        rays_before += result.report.rays
        results[target.key] = result
    return results


def _save_maps(
    builder: GlbBuilder, job: Job, results: Mapping[PrimitiveKey, ThicknessMap], targets: list[Target], about: Record
) -> Record:
    """Write the maps of a file as separate images, each in its own UVs, and their record beside them.

    Of one map ``thickness.exr`` is the file; of several it is ``thickness-NAME.exr`` for each, NAME being that of its
    material (and of its mesh where that is not enough), each with its record. ``thickness.exr.json`` is the record of
    all. Where UVs were made, the mesh that has them is beside the map, as ``thickness.exr.uv.glb``.
    """
    file, output = builder.file(), Path(job["output"])
    records: list[Record] = []
    paths = _paths(file, output, list(results)) if len(results) > 1 else dict.fromkeys(results, output)
    with OutputFiles() as files:
        if any(target.made_uv for target in targets):
            about = {**about, "uv_file": add_uv_file(files, file, output)}
        for target, (key, result) in zip(targets, results.items(), strict=True):
            one: Record = {**about, "place": list(key), "tex_coord": target.tex_coord}
            records.append(add_map(files, result, paths[key], **_storing(job), about=one))
        if len(records) == 1:
            return records[0]
        return add_record(files, output, {**about, **shared(records), "maps": records})


def _paths(file: GltfFile, output: Path, keys: list[PrimitiveKey]) -> dict[PrimitiveKey, Path]:
    """Path of each of several maps; names differ by more than case."""
    materials = dict.fromkeys(keys, "")
    for mesh, primitive in keys:
        index = file.item("meshes", mesh)["primitives"][primitive].get("material")
        if index is not None:
            materials[mesh, primitive] = str(file.item("materials", index).get("name") or f"material {index}")
    count = Counter(materials.values())
    taken: set[str] = set()
    paths = {}
    for key, material in materials.items():
        name = material if material and count[material] == 1 else f"{material} {primitive_name(file, key)}"
        kept = "".join(character if character.isalnum() or character in _SAFE else " " for character in name)
        name = "_".join(kept.split())[:_LONGEST].strip("._-") or "map"
        number = 2
        while (free := name if name.casefold() not in taken else f"{name}_{number}").casefold() in taken:
            number += 1
        taken.add(free.casefold())
        paths[key] = output.with_name(f"{output.stem}-{free}{output.suffix}")
    return paths


def content_hash(job: Job) -> str:
    """SHA-256 of everything that the result depends on: the bytes of the meshes, the settings, and the version.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    meant = {key: value for key, value in job.items() if key not in _HOW}
    meant["suffix"] = Path(job["output"]).suffix.lower()
    digest = hashlib.sha256(json.dumps([VERSION, FILES, meant], sort_keys=True).encode())
    for key in ("model", "high", "cage"):
        if job.get(key) is not None:
            path = Path(job[key])
            parts = [read_bytes(path, f"mesh {str(path)!r}")]
            if path.suffix.lower() in SUFFIXES:
                file = read_gltf(path, bool(job.get("outside")))
                holders = [*file.items("buffers"), *file.items("images")]
                parts += [file.resource(one) for one in holders if isinstance(one.get("uri"), str)]
            for data in parts:
                digest.update(key.encode() + hashlib.sha256(data).digest())
    return digest.hexdigest()


def is_done(job: Job, content: str) -> bool:
    """True if the job's files exist, complete and with this content."""
    output = Path(job["output"])
    record = read_record(output)
    return (
        record is not None
        and record.get("hash") == content
        and bool(files := files_of(record))
        and all(
            (path := output.with_name(one["file"])).is_file() and file_hash(path) == one.get("sha256") for one in files
        )
    )
