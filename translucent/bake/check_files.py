"""Checks of a bake's files, read back and compared with the truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from translucent.bake.check import MapCheck, NotSeenError, check_map
from translucent.bake.check_uv import mesh_corners, own_corners, placed_around, placed_corners, require_uv_of
from translucent.bake.gltf.bodies import Bodies
from translucent.bake.jobs import has_parts, stays_gltf
from translucent.bake.reading import load_thickness_map
from translucent.bake.record import parts_of
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, read_gltf
from translucent.gltf.materials import GltfMaterial, materials_of
from translucent.gltf.scene_media import thickness_map
from translucent.media.medium import Medium
from translucent.units import metres_per_unit

#: By the name of a mesh; None where the rest of its body hides it.
Checks = dict[str, MapCheck | None]

if TYPE_CHECKING:
    import numpy.typing as npt

    from translucent.bake.jobs import Job, Results
    from translucent.bake.record import Record


def check_output(job: Job, record: Record, results: Results) -> Checks:
    """Check each map that a job has written, quantized as in the file.

    Parameters
    ----------
    job, record, results
        As `bake_file` takes and returns them.

    Returns
    -------
    dict
        By the name of the mesh; None where the rest of its body hides it.

    Raises
    ------
    InputError
        If no map can be seen.
    RenderError
        If a map does not belong to the texture coordinates in the file that it is for.
    """
    path = Path(job["output"])
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    inside_file = path.suffix.lower() == ".glb"
    found = (_check_glb if inside_file else _check_maps)(job, record, results, medium)
    if not any(found.values()):
        raise InputError(f"check of {str(path)!r}", "it has no map that is seen", "give a model with an inside")
    return found


def _check_glb(job: Job, record: Record, results: Results, medium: Medium | None) -> Checks:
    """Checks of the maps in a glTF file."""
    path = Path(job["output"])
    # A bake from another format into a .glb is in metres; a glTF file keeps its unit.
    metres = metres_per_unit(job.get("unit", "m")) if stays_gltf(job) else 1.0
    file = read_gltf(path)
    bodies, found = Bodies(file, metres), Checks()
    for part in record["maps"]:
        key = part["place"][0], part["place"][1]
        mesh, material = results[key].mesh, _material_at(file, part)
        if "material" not in part or material is None or (values := thickness_map(file, material)) is None:
            continue
        require_uv_of(own_corners(file, part, metres, material), mesh, path)
        name = mesh.name if mesh.name not in found else f"{mesh.name} ({key[0]})"
        found[name] = _check(mesh, metres * values, medium or _medium(material, metres), bodies.around(key))
    return found


def _check_maps(job: Job, record: Record, results: Results, medium: Medium | None) -> Checks:
    """Checks of maps in files of their own."""
    output, metres = Path(job["output"]), metres_per_unit(job.get("unit", "m"))
    uv_file = output.with_name(record["uv_file"]["file"]) if "uv_file" in record else None
    path, found = uv_file or Path(job["model"]), Checks()
    for part, result in zip(parts_of(record), results.values(), strict=True):
        mesh, inside, body = result.mesh, medium, None
        if has_parts(job):
            file = read_gltf(path)
            corners, body = placed_corners(file, part, metres), placed_around(file, part, metres)
            inside = medium or _medium(_material_at(file, part), metres)
        elif uv_file is not None:
            corners = own_corners(read_gltf(uv_file), {"place": [0, 0]}, 1.0)
        else:
            corners = mesh_corners(path, metres)
        require_uv_of(corners, mesh, path)
        name = mesh.name if mesh.name not in found else f"{mesh.name} ({part['file']})"
        found[name] = _check(mesh, load_thickness_map(output.with_name(part["file"])), inside, body)
    return found


def _check(mesh: Mesh, values: npt.ArrayLike, medium: Medium | None, body: Mesh | None) -> MapCheck | None:
    try:
        return check_map(mesh, values, medium, body=body)
    except NotSeenError:
        return None


def _material_at(file: GltfFile, part: Record) -> GltfMaterial | None:
    mesh, primitive = part["place"]
    index = file.item("meshes", mesh)["primitives"][primitive].get("material")
    return None if index is None else materials_of(file)[index]


def _medium(material: GltfMaterial | None, metres: float) -> Medium | None:
    """Medium of an object with this material, per metre of the world; None for clear ones, which would show nothing."""
    found = None if material is None else material.medium()
    return Medium(absorption=found.extinction / metres) if found is not None and found.extinction.any() else None
