"""Audit of a glTF file: all translucent materials and the bodies that they fill; and repair of the file.

Repaired is what the file alone determines. Baked, into a material of its own, is each primitive whose thickness is
wrong; metallicFactor of what transmits becomes 0, and doubleSided of volumes goes. Everything else stays as it is: what
the file holds keeps its bytes and its index, and new images are put behind. Holes, windings, units and attenuations are
not touched: only who made the file knows what was meant.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import checked
from translucent.bake.audit.body import Body, Placement, measure_body
from translucent.bake.audit.rules import (
    SEVERITIES,
    MaterialCheck,
    MaterialFinding,
    attenuation_findings,
    material_findings,
    mesh_findings,
    overlap_findings,
    scale_findings,
    thickness_findings,
    viewer_colors,
)
from translucent.bake.bake import bake_thickness
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.gltf_targets import Bodies, Target, find_targets, require_uncompressed, triangle_primitives
from translucent.bake.jobs import ON_SURFACE
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import ThicknessMap, check_map_output, write_maps
from translucent.errors import InputError, TranslucentWarning
from translucent.gltf.file import GltfFile, label, read_gltf, write_gltf
from translucent.gltf.materials import materials_of
from translucent.gltf.nodes import node_transforms

#: Findings that a bake mends, and findings that a change of the material mends.
BAKED = frozenset(
    {
        "thickness-too-large",
        "thickness-too-small",
        "thickness-zero",
        "thickness-map-empty",
        "thickness-map-inverted",
        "thickness-map-off",
        "thickness-texture-unreadable",
        "shell-as-solid",
    }
)

WRITTEN = frozenset({"metal", "double-sided"})

#: Fraction of faces without a texel of their own from which on a baked map is not one of the body, if it has this many
#: texels for each face.
MOST_HIDDEN, ENOUGH_TEXELS = 0.5, 4


@checked
def check_materials(path: str | Path, *, allow_outside: bool = False) -> MaterialCheck:
    """Check the thickness and attenuation of a glTF file's translucent materials against its meshes.

    Compared are thicknessFactor and thicknessTexture with the true thickness of each mesh, by rays along its normals
    and along views; the attenuation, at that thickness; holes, winding and bodies that cross; scales of nodes; and
    what viewers are known to do differently.

    Parameters
    ----------
    path : path
        A .glb or .gltf file. Nothing is written; see `fix_materials`.
    allow_outside : bool
        Whether buffers and images may lie outside the file's folder.

    Returns
    -------
    MaterialCheck

    Raises
    ------
    InputError
        If the file is broken or compressed, or a value has a wrong type or is out of its range.
    RenderError
        If embreex, which traces the rays, is not installed.
    """
    return check_file(read_gltf(path, allow_outside))


def check_file(file: GltfFile) -> MaterialCheck:
    """Check an open file; see `check_materials`."""
    require_uncompressed(file)
    materials, entries = materials_of(file), file.items("materials")
    found: list[MaterialFinding] = []
    for material in materials:
        if material.transmits or material.has_volume:
            found += material_findings(material, entries[material.index])
    measured = _bodies(file)
    for body in measured:
        found += thickness_findings(body)
        found += attenuation_findings(body)
        found += scale_findings(body)
        found += mesh_findings(file, body)
    found += overlap_findings(measured)
    found = _gathered(found)
    found.sort(key=lambda one: SEVERITIES.index(one.severity))
    return MaterialCheck(file.path, tuple(found), tuple(_summary(body) for body in measured))


def _gathered(found: list[MaterialFinding]) -> list[MaterialFinding]:
    """Findings with one finding about unusual sizes in place of one per body."""
    sizes = [one for one in found if one.code == "size-unusual"]
    if len(sizes) < 2:
        return found
    first = dataclasses.replace(sizes[0], where=f"{sizes[0].where}, and {len(sizes) - 1} more bodies")
    return [one for one in found if one.code != "size-unusual"] + [first]


def _bodies(file: GltfFile) -> list[Body]:
    """Bodies whose material lets light in."""
    materials, bodies, placed = materials_of(file), Bodies(file, 1.0), _placements(file)
    found = []
    for key, primitive in triangle_primitives(file).items():
        index = primitive.get("material")
        if index is None or not materials[index].transmits or not placed[key[0]]:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TranslucentWarning)  # findings report faces that are turned
            body = measure_body(file, bodies, key, materials[index], tuple(placed[key[0]]))
        if body is not None:
            found.append(body)
    return found


def _placements(file: GltfFile) -> dict[int, list[Placement]]:
    """Nodes that show each mesh, without nodes that flatten it."""
    transforms, nodes = node_transforms(file), file.items("nodes")
    placed: dict[int, list[Placement]] = defaultdict(list)
    for index, node in enumerate(nodes):
        if "mesh" in node and np.linalg.matrix_rank(transforms[index][:3, :3]) == 3:
            placed[node["mesh"]].append(Placement(label(nodes, index).strip("'"), transforms[index]))
    return placed


def _summary(body: Body) -> dict[str, Any]:
    """Measurements of a body for people and programs."""
    normals, views = body.beneath * body.world_normals(), body.chords * body.world_views()
    return {
        "material": body.material.index,
        "name": body.material.name,
        "mesh": body.key[0],
        "primitive": body.key[1],
        "mesh_name": body.name,
        "nodes": [one.name for one in body.placements],
        "closed": body.mesh.diagnosis.closed,
        "stated": _statistics(body.stated * body.world_normals()),
        "along_normals": _statistics(normals),
        "along_views": _statistics(views),
        "mesh_space": {
            "stated": _statistics(body.stated),
            "along_normals": _statistics(body.beneath),
            "along_views": _statistics(body.chords),
        },
        "escaped": body.escaped,
        "colors": {name: color.tolist() for name, color in viewer_colors(body).items()},
    }


def _statistics(lengths: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, float] | None:
    finite = lengths[np.isfinite(lengths)]
    if not finite.size:
        return None
    return {"median": float(np.median(finite)), "p95": float(np.percentile(finite, 95))}


@checked
def fix_materials(
    path: str | Path,
    output: str | Path,
    *,
    size: int = 512,
    rays: int = 64,
    threads: int | None = None,
    allow_outside: bool = False,
) -> MaterialCheck:
    """Write a copy of a glTF file in which wrong thicknesses are replaced by baked ones.

    Parameters
    ----------
    path : path
        A .glb or .gltf file.
    output : path
        A .glb file. Of what is right it is a copy; without anything to mend, of all.
    size : int
        Texels along each side of a baked map.
    rays : int
        From each of them, around its normal; see `bake_thickness`.
    threads : int, optional
        Default: as many as there are processors.
    allow_outside : bool
        As for `check_materials`.

    Returns
    -------
    MaterialCheck
        Of the file that was written: what is left to do.

    Raises
    ------
    InputError
        If the file or a setting is wrong, or the output is no .glb; if a mesh has no UVs and xatlas is missing.
    RenderError
        If the file cannot be written, or embreex is missing.
    """
    output, settings = Path(output), BakeSettings(size=size, rays=rays)
    if output.suffix.lower() != ".glb":
        raise InputError(
            f"output {str(output)!r}", f"suffix {output.suffix!r}", "use .glb, which also holds the thickness maps"
        )
    check_map_output(output)
    file = read_gltf(path, allow_outside)
    found = check_file(file)
    builder = GlbBuilder(file)
    closed = {(body["mesh"], body["primitive"]) for body in found.bodies if body["closed"]}
    for material in {one.material for one in found.findings if one.code in WRITTEN}:
        _mend(builder, material)
    keys = {one.place for one in found.findings if one.code in BAKED and one.place in closed}
    hidden: list[MaterialFinding] = []
    if keys:
        targets = {target.key: target for target in find_targets(builder, size=size, only=keys)}
        results = {key: _bake_target(target, settings, threads) for key, target in targets.items()}
        write_maps(builder, output, results, targets=targets, about={"model": str(path), "model_unit": "m"})
        hidden = [wrong for one in found.findings if one.place in results for wrong in _hidden(one, results[one.place])]
    else:
        write_gltf(builder.file(), output)
    left = check_materials(output)
    findings = [*{one.place: one for one in hidden}.values(), *left.findings]
    findings.sort(key=lambda one: SEVERITIES.index(one.severity))
    return dataclasses.replace(left, findings=tuple(findings))


def _hidden(before: MaterialFinding, baked: ThicknessMap) -> Iterator[MaterialFinding]:
    """Finding about a body if most of its faces have no texels of their own in the baked map."""
    faces = len(baked.mesh.faces)
    fraction = baked.report.faces_without_texel / faces
    if fraction < MOST_HIDDEN or baked.values.size < ENOUGH_TEXELS * faces:
        return
    text = (
        f"{fraction:.0%} of the faces have no texel in the baked map: these faces are too small in UV space, or "
        "overlap other faces there"
    )
    do = "unwrap the mesh without overlaps, or remove its UVs: --fix then makes new UVs"
    yield dataclasses.replace(before, severity="error", code="map-without-texels", text=text, do=do)


def _mend(builder: GlbBuilder, index: int) -> None:
    """Make a material transmissive and single-sided."""
    material = GltfFile(Path(), builder.tree).item("materials", index)
    extensions = material.get("extensions", {})
    if extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > 0:
        surface = material.setdefault("pbrMetallicRoughness", {})
        if "metallicRoughnessTexture" not in surface:
            surface["metallicFactor"] = 0
    if "KHR_materials_volume" in extensions:
        material.pop("doubleSided", None)


def _bake_target(target: Target, settings: BakeSettings, threads: int | None) -> ThicknessMap:
    around = target.around
    if around is None:
        return bake_thickness(target.mesh, settings, threads=threads)
    near = dataclasses.replace(settings, high_distance=ON_SURFACE * around.diagonal)
    return bake_thickness(target.mesh, near, high=around, threads=threads)
