"""Measured bodies of a glTF file: true thickness along normals and view rays, and the stated thickness.

All lengths are in units of the mesh, in its own space, where glTF states thickness. There a stated length and a true
one in the same direction compare as they are: a node scales both alike. Views are straight rays from all sides, each
where it enters from outside first, and their thickness is all of the body that they cross, as in pictures without
refraction.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from translucent.arrays import Array, Integers
from translucent.bake.gltf_targets import Bodies, PrimitiveKey, primitive_name, read_primitive
from translucent.bake.rays import OFFSET, Directions, InwardRays, Points, PreparedMesh
from translucent.bake.settings import BakeSettings
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.materials import GltfMaterial
from translucent.gltf.nodes import thickness_at

#: Points of a body's surface, and rays into it from each.
POINTS, RAYS = 1024, 8

#: Irrational steps of an even sequence over a triangle (Roberts 2018, "The unreasonable effectiveness of
#: quasirandom sequences": the powers of the inverse of the plastic number).
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


@dataclass(frozen=True)
class Placement:
    """Node that shows a body: its name and index in messages, and mesh to world (4x4)."""

    name: str
    matrix: Array


@dataclass(frozen=True, eq=False)
class Body:
    """Body of a glTF file with its measured and its stated thickness.

    Attributes
    ----------
    key : (int, int)
        Mesh and primitive.
    name : str
    material : GltfMaterial
    entry : dict
        The material's JSON.
    placements : tuple of Placement
    mesh : Mesh
        All of its surface, that of adjacent primitives included.
    points, normals : (n, 3)
        On the primitive, evenly, with outward normals.
    stated : (n,)
        Thickness there that the material states.
    beneath, around : (n,)
        True one along the inward normal, and its mean over the hemisphere around it, weighted by the cosine, as bakes
        have it; infinite where a ray finds no exit.
    views : (m, 3)
        Directions of view rays; `cosines` (m,) are theirs with the surface where they enter, `seen_stated` (m,) is the
        thickness stated there, `chords` (m,) all that they cross.
    escaped : float
        Fraction of rays that found no exit.
    texture_problem : str
        Why the thickness texture could not be read, if so.
    """

    key: PrimitiveKey
    name: str
    material: GltfMaterial
    entry: Json
    placements: tuple[Placement, ...]
    mesh: Mesh
    points: Array
    normals: Array
    stated: Array
    beneath: Array
    around: Array
    views: Array
    cosines: Array
    seen_stated: Array
    chords: Array
    escaped: float
    texture_problem: str = ""

    @property
    def where(self) -> str:
        """Material, mesh and nodes, for messages."""
        nodes = [repr(one.name) for one in self.placements]
        more = f" and {len(nodes) - 2} more" if len(nodes) > 2 else ""
        return f"{material_name(self.material)}, mesh {self.name!r}, node {', '.join(nodes[:2])}{more}"

    @property
    def typical(self) -> tuple[float, float, float]:
        """Medians of the true thickness: along normals, around them, and along views; NaN without any exit."""
        finite = [values[np.isfinite(values)] for values in (self.beneath, self.around, self.chords)]
        beneath, around, chords = (float(np.median(values)) if values.size else math.nan for values in finite)
        return beneath, around, chords

    def world_views(self) -> Array:
        """(m,): world length of 1 in mesh space along each view, by the first node that shows the body."""
        return np.asarray(np.linalg.norm(self.views @ self.placements[0].matrix[:3, :3].T, axis=1))

    def world_normals(self) -> Array:
        """(n,): world length of 1 in mesh space along each normal."""
        return np.asarray(np.linalg.norm(self.normals @ self.placements[0].matrix[:3, :3].T, axis=1))

    def placed(self, placement: Placement) -> Array:
        """(k, 3): vertices of the body in the world."""
        matrix = placement.matrix
        return np.asarray(self.mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])


def material_name(material: GltfMaterial) -> str:
    """Name of a material in messages."""
    return f"material {material.index} {material.name!r}" if material.name else f"material {material.index}"


def measure_body(
    file: GltfFile, bodies: Bodies, key: PrimitiveKey, material: GltfMaterial, placements: tuple[Placement, ...]
) -> Body | None:
    """Measure the body of a primitive; None where it has no area.

    Raises
    ------
    InputError
        If its data are wrong.
    """
    mesh, whole, first = _surfaces(file, bodies, key)
    try:
        surface = PreparedMesh.of(whole)
    except InputError:
        return None  # flat, or inside out beyond repair
    points, weights, faces = _points(surface, first, len(mesh.faces))
    if not len(points):
        return None
    stated, problem = _stated(file, material, key, mesh, weights, faces - first)
    beneath, around, chords, views = _rays(surface, points)
    visible = _entering(surface, points, views)
    cosines = np.einsum("rki,ki->rk", views, -points.normal)
    outer = chords[visible.T]
    return Body(
        key,
        primitive_name(file, key),
        material,
        file.item("materials", material.index),
        placements,
        whole,
        points.exact * surface.radius + surface.embree.center,
        points.normal,
        stated,
        beneath,
        around,
        views.transpose(1, 0, 2)[visible.T],
        np.clip(cosines.T[visible.T], 0.0, 1.0),
        np.repeat(stated[:, None], views.shape[0], axis=1)[visible.T],
        outer,
        float(np.isinf(chords).mean()),
        problem,
    )


def _surfaces(file: GltfFile, bodies: Bodies, key: PrimitiveKey) -> tuple[Mesh, Mesh, int]:
    """Mesh of a primitive, that of its whole body, and where the faces of the one begin in the other."""
    mesh = read_primitive(file, key, 1.0)
    if (joined := bodies.joined(key)) is None:
        return mesh, mesh, 0
    return bodies.wound(key, mesh), *joined


def _points(surface: PreparedMesh, first: int, count: int) -> tuple[Points, Array, Integers]:
    """Points on `count` faces of the mesh from `first` on, their barycentric weights, and faces of the mesh."""
    own = np.flatnonzero((surface.faces >= first) & (surface.faces < first + count))
    corners = surface.corners[own]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    until = np.cumsum(area)
    if not len(until):
        return surface.points(own, np.empty((0, 3))), np.empty((0, 3)), own
    at = np.searchsorted(until, (np.arange(POINTS) + 0.5) / POINTS * until[-1])
    chosen = own[np.minimum(at, len(own) - 1)]
    u, v = np.moveaxis((0.5 + np.arange(POINTS)[:, None] * _STEPS) % 1.0, -1, 0)
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    weights = np.column_stack([1.0 - u - v, u, v])
    return surface.points(chosen, weights), weights, surface.faces[chosen]


def _stated(
    file: GltfFile, material: GltfMaterial, key: PrimitiveKey, mesh: Mesh, weights: Array, faces: Integers
) -> tuple[Array, str]:
    """(n,): stated thickness, and the reason if its texture cannot be read."""
    constant = np.full(len(faces), material.thickness)
    if not material.has_thickness_texture:
        return constant, ""
    number = material.thickness_transform.tex_coord
    if f"TEXCOORD_{number}" not in file.item("meshes", key[0])["primitives"][key[1]]["attributes"]:
        return constant, f"the primitive has no TEXCOORD_{number}, the texture coordinates of the thickness texture"
    uv = read_primitive(file, key, 1.0, number).uv
    assert uv is not None
    corners = _uv_corners(file, key, number, mesh)[faces]
    found = np.einsum("kc,kci->ki", weights, corners)
    try:
        return thickness_at(file, material, np.column_stack([found[:, 0], 1.0 - found[:, 1]])), ""
    except InputError as error:
        return constant, str(error)


def _uv_corners(file: GltfFile, key: PrimitiveKey, number: int, mesh: Mesh) -> Array:
    """(m, 3, 2): UVs at the corners of a primitive's faces, with the winding that `mesh` has."""
    textured = read_primitive(file, key, 1.0, number)
    assert textured.uv is not None
    corners = textured.uv[textured.faces]
    same = np.einsum("fi,fi->f", textured.face_normals, mesh.face_normals) >= 0
    return np.asarray(np.where(same[:, None, None], corners, corners[:, ::-1]))


def _rays(surface: PreparedMesh, points: Points) -> tuple[Array, Array, Array, Array]:
    """Thickness along the normals (n,), its mean around them (n,), and all inside along views (n, r), (r, n, 3)."""
    settings = BakeSettings(rays=RAYS)
    straight = -points.normal.T[:, :, None].astype(np.float32)
    spread = Directions.of(settings).at(points, 0, RAYS)
    exits = InwardRays(surface, settings, np.inf)
    beneath = exits.distances(points, straight)[0][:, 0]
    near = exits.distances(points, spread)[0]
    total = InwardRays(surface, dataclasses.replace(settings, gaps="total"), np.inf).distances(points, spread)[0]
    views = spread.transpose(2, 1, 0).astype(np.float64)
    with np.errstate(invalid="ignore"):
        around = near.mean(axis=1)
    radius = surface.radius
    return radius * beneath, radius * around, radius * total, views


def _entering(surface: PreparedMesh, points: Points, views: Array) -> Any:
    """(r, n): whether nothing of the body is before the point, on the view ray along each direction (r, n, 3)."""
    start = points.exact + OFFSET * surface.planes[points.face, :3] * 4.0
    origins = np.broadcast_to(start, views.shape).reshape(-1, 3)
    face, _ = surface.embree.first_hits(origins, -views.reshape(-1, 3))
    towards = np.einsum("rki,ki->rk", views, surface.planes[points.face, :3]) < 0
    return (face < 0).reshape(views.shape[:2]) & towards
