"""Meshes of a page: vertices from the center of each mesh in float32, as the renderer draws them, and normals."""

from __future__ import annotations

from typing import Any

import numpy as np

from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals
from translucent.page.container import Container

#: Endings of names that meshes have of their files.
_FILES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")


def name_of(mesh: Mesh) -> str:
    """Name of a mesh for people: without the ending of its file."""
    stem, dot, ending = mesh.name.rpartition(".")
    return stem if stem and (dot + ending).lower() in _FILES else mesh.name


def mesh_told(mesh: Mesh, into: Container, *, with_normals: bool, with_looks: bool) -> dict[str, Any]:
    """Entry of a mesh in a page's header; its arrays go into the container."""
    low, high = mesh.bounds
    faces = mesh.faces.astype(np.uint32)
    told: dict[str, Any] = {
        "name": mesh.name,
        "center": mesh.center.tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "diagonal": mesh.diagonal,
        "offsets": into.add((mesh.vertices - mesh.center).astype(np.float32), "rows"),
        "faces": into.add(faces, "rows"),
        "normals": None,
        "normal_index": None,
        "uv": None,
        "colors": None,
    }
    if with_normals:
        told |= _normals(mesh, faces, into)
    if with_looks and mesh.uv is not None:
        told["uv"] = into.add(mesh.uv.astype(np.float32), "rows")
    if with_looks and mesh.colors is not None:
        told["colors"] = into.add(np.asarray(mesh.colors, np.float32), "rows")
    return told


def _normals(mesh: Mesh, faces: np.ndarray, into: Container) -> dict[str, int | None]:
    """Normals of vertices, where all faces at each agree; else those that there are, and which each corner has."""
    normals = drawn_normals(mesh).reshape(-1, 3)
    ofs = np.zeros((len(mesh.vertices), 3), np.float32)
    ofs[faces.ravel()] = normals
    if np.array_equal(ofs[faces.ravel()], normals):
        return {"normals": into.add(ofs, "rows"), "normal_index": None}
    found, index = np.unique(normals, axis=0, return_inverse=True)
    return {
        "normals": into.add(found.astype(np.float32), "rows"),
        "normal_index": into.add(index.reshape(faces.shape).astype(np.uint32), "rows"),
    }
