"""Bake jobs: a plain dict in and files out, so that a process on another machine can run them.

A job holds what JSON can hold, so it can be kept, sent and hashed:

===============  ==========================================================================================
``model``        path of a mesh or glTF file
``output``       path of the file to write; its record goes beside it
``unit``         of the model's coordinates (default m)
``settings``     arguments of `bake_thickness` by name: mode, size, rays, ...; ``max_distance``, ``tolerance`` and
                 ``high_distance`` in metres, or as shares of the mesh's diagonal, such as ``"10%"``
``medium``       extinction (r, g, b) in 1/m, for mode ``transmittance``
``high``         path of the mesh that the details come from, and ``cage`` that of a cage around it, in the unit
``vertices``     True: thickness per vertex instead of a map
``unwrap``       True: new UVs, whatever the model has
``normalize``    True: store shares of the largest value; ``invert``: 1 minus them
``outside``      True: read files that a glTF model links to wherever they are, not only below its folder
``resume``       True: keep finished parts in ``OUTPUT.resume.npz``, and go on from there
``threads``      how many (default: all processors); results do not depend on it
``max_escaped``  of `bake_many`: share of rays without an exit above which a map is suspect (default 0.05)
===============  ==========================================================================================

Only ``model`` and ``output`` are needed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from translucent.bake.bake import bake_thickness
from translucent.bake.record import file_hash, files_of, read_record
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import ThicknessMap, VertexThickness
from translucent.bake.vertices import bake_vertex_thickness
from translucent.bake.writing import MAP_SUFFIXES, VERTEX_SUFFIXES, check_map_output
from translucent.errors import InputError
from translucent.files.reading import read_bytes
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import read_gltf
from translucent.gltf.load import SUFFIXES
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.units import metres_per_unit
from translucent.version import VERSION

Job = dict[str, Any]
#: Callback with the share that is done, 0..1, and the rays traced so far.
Progress = Callable[[float, int], None]

KEYS = {
    "model", "output", "unit", "settings", "medium", "high", "cage", "vertices", "unwrap", "normalize", "invert",
    "resume", "threads", "max_escaped", "outside",
}  # fmt: skip
#: Version of the set of files that a bake writes; another number makes them anew.
FILES = 2
#: Largest distance of a part of a body from its surface, as a share of the diagonal: that of rounding.
ON_SURFACE = 1e-4
#: Keys that do not change the contents of the file.
_HOW = {"output", "model", "high", "cage", "resume", "threads", "max_escaped", "outside"}
_LENGTHS = ("max_distance", "tolerance", "high_distance")
#: Keys without meaning for vertices: those that are a mistake, and those that merely have a default.
_OF_MAPS, _TEXELS = ("tile", "high", "cage", "high_distance"), ("size", "supersample", "padding")


def check_job(job: Job) -> None:
    """Raise `InputError` or `RenderError` if a job is found invalid before any work is done."""
    if unknown := sorted(set(job) - KEYS):
        raise InputError(f"bake job with {unknown[0]!r}", "not a known key", f"use {', '.join(sorted(KEYS))}")
    if missing := [key for key in ("model", "output") if not isinstance(job.get(key), str)]:
        raise InputError("bake job", f"no {missing[0]}", "give a path as text")
    metres_per_unit(job.get("unit", "m"))
    if not 0 <= (share := job.get("max_escaped", 0)) <= 1:
        raise InputError(f"max_escaped {share!r}", "not in 0..1", "give a share of the rays, for example 0.05")
    suffixes = VERTEX_SUFFIXES if job.get("vertices") else MAP_SUFFIXES
    normalize, invert = bool(job.get("normalize")), bool(job.get("invert"))
    output = Path(job["output"])
    suffix = check_map_output(output, suffixes, normalize=normalize, invert=invert)
    settings = job.get("settings", {})
    of_maps = [key for key in (*_OF_MAPS, "normalize", "invert", "resume") if job.get(key) or settings.get(key)]
    if job.get("vertices") and of_maps:
        raise InputError("thickness per vertex", f"{of_maps[0]} is of maps", "leave one of the two out")
    if suffix == ".glb" and settings.get("tile") is not None:
        raise InputError(f"tile {settings['tile']!r}", "glTF has no tiles", "write another file, or leave it out")
    if suffix == ".glb" and settings.get("mode") == "local" and not job.get("vertices"):
        raise InputError(f"output {str(output)!r}", "mode 'local' has no unit", "write another file, or bake lengths")
    _settings(job, 1.0)


def _settings(job: Job, diagonal: float) -> Job:
    """The arguments of a bake, checked; shares are of the diagonal in metres."""
    given = dict(job.get("settings", {}))
    for key in _LENGTHS:
        if isinstance(given.get(key), str):
            given[key] = diagonal * _share(key, given[key])
    known = {field.name for field in dataclasses.fields(BakeSettings)} - {"medium"}
    if unknown := sorted(set(given) - known):
        raise InputError(f"bake setting {unknown[0]!r}", "not a known setting", f"use {', '.join(sorted(known))}")
    if job.get("medium") is not None:
        given["medium"] = Medium(absorption=job["medium"])
    # A glTF material may bring the medium that this mode needs.
    late = given.get("mode") == "transmittance" and has_parts(job) and "medium" not in given
    BakeSettings(**({**given, "medium": Medium(absorption=1.0)} if late else given))
    return given


def _share(key: str, text: str) -> float:
    try:
        share = float(text.removesuffix("%")) / 100 if text.endswith("%") else float("nan")
    except ValueError:
        share = float("nan")
    if not 0 < share < float("inf"):
        raise InputError(f"{key} {text!r}", "not a share such as '10%'", "give one, or a number of metres")
    return share


def has_parts(job: Job) -> bool:
    """True if the objects of the model are baked one by one, and not as one mesh."""
    return Path(job["model"]).suffix.lower() in SUFFIXES and (stays_gltf(job) or not job.get("vertices"))


def stays_gltf(job: Job) -> bool:
    """True if the output is a copy of the model's glTF file."""
    return Path(job["output"]).suffix.lower() == ".glb" and Path(job["model"]).suffix.lower() in SUFFIXES


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
            for data in _parts(Path(job[key]), bool(job.get("outside"))):
                digest.update(key.encode() + hashlib.sha256(data).digest())
    return digest.hexdigest()


def _parts(path: Path, allow_outside: bool) -> list[bytes]:
    """Paths of a file and, for a .gltf, of its links."""
    data = [read_bytes(path, f"mesh {str(path)!r}")]
    if path.suffix.lower() in SUFFIXES:
        file = read_gltf(path, allow_outside)
        holders = [*file.items("buffers"), *file.items("images")]
        data += [file.resource(one) for one in holders if isinstance(one.get("uri"), str)]
    return data


def is_done(job: Job, content: str) -> bool:
    """True if the job's files exist, complete and with this content."""
    output = Path(job["output"])
    record = read_record(output)
    return (
        record is not None
        and record.get("hash") == content
        and bool(files := files_of(record))
        and all(_is_whole(output.with_name(one["file"]), one.get("sha256")) for one in files)
    )


def _is_whole(path: Path, sha256: object) -> bool:
    return path.is_file() and file_hash(path) == sha256


Results = dict[tuple[int, int], Any]


def bake_one(
    job: Job,
    mesh: Mesh,
    medium: Medium | None = None,
    progress: Progress | None = None,
    part: str = "",
    around: Mesh | None = None,
) -> ThicknessMap | VertexThickness:
    """Bake one mesh as a job asks for.

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
        The body of whose surface the mesh is a part.
    """
    given = _settings(job, mesh.diagonal)
    if given.get("mode") == "transmittance":
        given.setdefault("medium", medium)
    if around is not None and not (job.get("vertices") or job.get("high")):
        given |= {"high": around, "high_distance": ON_SURFACE * around.diagonal}
    for key in ("high", "cage"):
        if job.get(key) is not None:
            given[key] = load_mesh(job[key], unit=job.get("unit", "m"), allow_outside=bool(job.get("outside")))
    tell = None
    if progress is not None:

        def tell(done: int, total: int, rays: int) -> None:
            progress(done / max(total, 1), rays)

    given |= {"threads": job.get("threads"), "progress": tell}
    if job.get("vertices"):
        return bake_vertex_thickness(mesh, **{key: value for key, value in given.items() if key not in _TEXELS})
    if job.get("resume"):
        given["checkpoint"] = Path(f"{job['output']}{part}.resume.npz")
    return bake_thickness(mesh, **given)
