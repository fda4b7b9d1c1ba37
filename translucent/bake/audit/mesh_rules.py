"""Findings about meshes as boundaries of bodies: holes, winding, and bodies that share space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from translucent.arrays import Array
from translucent.bake.audit.body import Body, Placement, material_name
from translucent.bake.audit.finding import MaterialFinding, Severity
from translucent.geometry.mesh import Mesh
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile
from translucent.gltf.geometry import raw_mesh
from translucent.gltf.scene_media import primitives

#: Share of rays without an exit from which on a hole is an error.
LEAKS = 0.02

#: Points of each of two bodies whose boxes meet, and most winding numbers, times triangles, that are worked out.
POINTS, MOST_WORK = 48, 5e7

#: Winding numbers between these are those of points on a surface; shares of points that make bodies cross.
ON_SURFACE, CROSSING = (0.2, 0.8), 0.05


def mesh_findings(file: GltfFile, body: Body) -> Iterator[MaterialFinding]:
    """Findings about holes and winding of a body with a thickness."""
    if body.material.thickness == 0:
        return
    found = body.mesh.diagnosis
    if not found.closed:
        count = found.open_edges.count
        text = (
            f"the mesh has holes ({count} open edge{'s' if count != 1 else ''}), and {body.escaped:.1%} of the rays "
            "find no exit: a volume must be closed, and ray tracers leak"
        )
        do = "close it; or, if a sheet is meant, write thicknessFactor 0 and tint it by baseColorFactor"
        severity: Severity = "error" if body.escaped > LEAKS else "warning"
        yield MaterialFinding(severity, "open-mesh", body.where, text, do, body.material.index, body.key)
    elif body.escaped > LEAKS:
        text = f"{body.escaped:.1%} of the rays find no exit, although the mesh is closed: parts of it are inside out"
        do = "turn these parts, or split what crosses itself"
        yield MaterialFinding("warning", "inside-out", body.where, text, do, body.material.index, body.key)
    yield from _winding(file, body)


def _winding(file: GltfFile, body: Body) -> Iterator[MaterialFinding]:
    """Findings about the winding as the file has it, before it is mended here."""
    primitive = primitives(file, file.item("meshes", body.key[0]))[body.key[1]]
    plain = {**primitive, "attributes": {"POSITION": primitive["attributes"].get("POSITION")}}
    raw = raw_mesh(Accessors(file), plain, body.name)
    if raw is None:
        return
    found, do = raw.diagnosis, "make the winding consistent, with normals outwards"
    if found.mixed_edges:
        text = f"faces disagree about their winding at {found.mixed_edges.count} edges: viewers cull some from outside"
    elif found.inverted:
        text = "all faces look inwards: viewers show the far side, or nothing"
    elif found.inside_out_parts:
        text = f"{found.inside_out_parts} closed parts look inwards"
    else:
        return
    yield MaterialFinding("error", "winding", body.where, text, do, body.material.index, body.key)


def overlap_findings(bodies: Sequence[Body]) -> Iterator[MaterialFinding]:
    """Findings about bodies that cross each other, or lie in one another."""
    placed = [(body, one) for body in bodies if body.material.thickness > 0 for one in body.placements]
    vertices = [body.placed(one) for body, one in placed]
    boxes = [(points.min(axis=0), points.max(axis=0)) for points in vertices]
    work = 0.0
    for i, j in combinations(range(len(placed)), 2):
        if (boxes[i][0] >= boxes[j][1]).any() or (boxes[i][1] <= boxes[j][0]).any():
            continue
        if placed[i][0].mesh is placed[j][0].mesh and placed[i][1] is placed[j][1]:
            continue  # primitives that bound one body
        work += POINTS * (len(placed[i][0].mesh.faces) + len(placed[j][0].mesh.faces))
        if work > MOST_WORK:
            yield _unchecked(placed[i][0])
            return
        yield from _pair(*placed[i], *placed[j])


def _unchecked(body: Body) -> MaterialFinding:
    text = "many or large bodies are near each other: whether the later ones cross was not looked at"
    do = "check them in parts, if it matters"
    return MaterialFinding("note", "overlap-unchecked", body.where, text, do, body.material.index, body.key)


def _pair(one: Body, at: Placement, other: Body, there: Placement) -> Iterator[MaterialFinding]:
    """Finding about two bodies whose boxes share space."""
    mine, theirs = _inside(one, at, other, there), _inside(other, there, one, at)
    where = f"{material_name(one.material)}, node {at.name!r}, and {material_name(other.material)}, node {there.name!r}"
    if mine > 1 - CROSSING or theirs > 1 - CROSSING:
        inner, outer = (at.name, there.name) if mine > theirs else (there.name, at.name)
        text = (
            f"{inner!r} lies inside {outer!r}: three.js and Filament do not show one transmissive body through another"
        )
        do = "leave it for ray tracers; for viewers give one of them alphaMode BLEND, or none of the transmission"
        yield MaterialFinding("note", "nested", where, text, do, one.material.index, one.key)
    elif mine > CROSSING and theirs > CROSSING:
        text = f"the bodies cross ({mine:.0%} and {theirs:.0%} of their surfaces lie in the other): what fills the "
        text += "common space, both media or one, renderers decide differently"
        do = "let them touch without crossing, or tell the renderer which one wins (tl.Object(priority=...))"
        yield MaterialFinding("warning", "overlap", where, text, do, one.material.index, one.key)


def _inside(body: Body, at: Placement, other: Body, there: Placement) -> float:
    """Share of a body's surface that lies inside another, of the part that is not on its surface."""
    step = max(1, len(body.points) // POINTS)
    world = _moved(at.matrix, body.points[::step])
    local = np.linalg.solve(there.matrix[:3, :3], (world - there.matrix[:3, 3]).T).T
    low, high = other.mesh.bounds
    boxed = ((local > low) & (local < high)).all(axis=1)
    winding = np.zeros(len(local))
    winding[boxed] = [_winding_number(other.mesh, point) for point in local[boxed]]
    clear = (winding <= ON_SURFACE[0]) | (winding >= ON_SURFACE[1])
    return float(np.mean(winding[clear] >= ON_SURFACE[1])) if clear.any() else 0.0


def _moved(matrix: Array, points: Array) -> Array:
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def _winding_number(mesh: Mesh, point: Array) -> float:
    return abs(mesh.winding_number(point))
