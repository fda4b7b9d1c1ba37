"""Export of a mesh as a glTF file of its own: for meshes that come from formats without materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.bake.gltf.builder import INDICES, GlbBuilder
from translucent.errors import InputError
from translucent.geometry.grouping import equal_rows
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import GltfFile, Json

Indices = npt.NDArray[np.int64]

#: Angle between face and smooth normal, in degrees, beyond which a corner keeps the face's: an edge stays an edge.
CREASE = 30.0


def mesh_file(mesh: Mesh) -> GltfFile:
    """Make a .glb with this mesh, its UVs if it has any, normals, and a clear material; nothing is written yet.

    Raises
    ------
    InputError
        If its coordinates are beyond float32.
    """
    vertex, faces, normals = _split_at_edges(mesh)
    if np.abs(mesh.vertices).max() > np.finfo(np.float32).max:
        raise InputError(f"mesh {mesh.name!r}", "coordinates beyond float32, which glTF has", "scale the mesh")
    tree: Json = {
        "asset": {"version": "2.0", "generator": "translucent"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": mesh.name}],
    }
    builder = GlbBuilder(GltfFile(Path(mesh.name), tree))
    with np.errstate(under="ignore"):
        positions = mesh.vertices[vertex].astype(np.float32)
    attributes = {
        "POSITION": builder.add_accessor(positions, bounds=True),
        "NORMAL": builder.add_accessor(normals),
    }
    if mesh.uv is not None:
        with np.errstate(under="ignore"):
            uv = np.column_stack([mesh.uv[:, 0], 1.0 - mesh.uv[:, 1]]).astype(np.float32)  # glTF counts v downwards
        attributes["TEXCOORD_0"] = builder.add_accessor(uv[vertex])
    surface = {"metallicFactor": 0, "roughnessFactor": 0}
    builder.add("materials", {"name": mesh.name, "pbrMetallicRoughness": surface})
    indices = builder.add_accessor(faces.astype(np.uint32).ravel(), INDICES)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    builder.add("meshes", {"name": mesh.name, "primitives": [primitive]})
    return builder.file()


def _split_at_edges(mesh: Mesh) -> tuple[Indices, Indices, npt.NDArray[np.float32]]:
    """Vertices of the mesh to repeat where it has edges, faces of them, and a unit normal for each."""
    points = equal_rows(mesh.vertices)
    # Across a seam of the UVs the surface is as smooth as elsewhere.
    welded = Mesh(mesh.vertices[points.first], points.of[mesh.faces].astype(np.int32))
    smooth = welded.vertex_normals[points.of]
    own, corner = mesh.face_normals[:, None], smooth[mesh.faces]
    sharp = np.einsum("fck,fck->fc", np.broadcast_to(own, corner.shape), corner) < np.cos(np.radians(CREASE))
    sharp &= own.any(axis=2)  # a face without area has no normal
    with np.errstate(under="ignore"):
        normals = np.where(sharp[..., None], own, corner).astype(np.float32).reshape(-1, 3)
    split = equal_rows(np.column_stack([mesh.faces.ravel(), normals]))
    return mesh.faces.ravel()[split.first].astype(np.int64), split.of.reshape(-1, 3), normals[split.first]
