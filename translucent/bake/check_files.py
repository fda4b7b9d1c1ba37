"""The files of a bake, read back and checked against the truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from translucent.bake.check import MapCheck, check_map
from translucent.bake.jobs import stays_gltf
from translucent.bake.reading import load_thickness_map
from translucent.errors import InputError
from translucent.materials.gltf import GltfMaterial, materials_of
from translucent.materials.gltf_file import read_gltf
from translucent.materials.gltf_scene import thickness_map
from translucent.medium import Medium
from translucent.units import metres_per_unit

if TYPE_CHECKING:
    from translucent.bake.jobs import Job, Results
    from translucent.bake.record import Record


def _medium(material: GltfMaterial, metres: float) -> Medium | None:
    """What fills an object of this material, per metre of the world; None for clear ones, which would show nothing."""
    found = material.medium()
    return Medium(absorption=found.extinction / metres) if found is not None and found.extinction.any() else None


def check_output(job: Job, record: Record, results: Results) -> dict[str, MapCheck]:
    """A check per map that a job has written, by the name of its mesh; quantised as the file is.

    Parameters
    ----------
    job, record, results
        As `bake_file` takes and returns them.

    Raises
    ------
    InputError
        If no map can be seen.
    """
    path = Path(job["output"])
    medium = None if job.get("medium") is None else Medium(absorption=job["medium"])
    if path.suffix.lower() != ".glb":
        (result,) = results.values()
        return {result.mesh.name: check_map(result.mesh, load_thickness_map(path), medium)}
    # A bake from another format into a .glb is in metres; a glTF file keeps its unit.
    metres = metres_per_unit(job.get("unit", "m")) if stays_gltf(job) else 1.0
    file = read_gltf(path)
    materials = materials_of(file)
    found = {}
    for one in record["maps"]:
        mesh = results[tuple(one["place"])].mesh
        if "material" in one and (values := thickness_map(file, materials[one["material"]])) is not None:
            name = mesh.name if mesh.name not in found else f"{mesh.name} ({one['place'][0]})"
            inside = medium or _medium(materials[one["material"]], metres)
            found[name] = check_map(mesh, metres * values, inside)
    if not found:
        raise InputError(f"check of {str(path)!r}", "it has no map", "give a model with an inside")
    return found
