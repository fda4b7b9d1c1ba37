"""A glTF file as one mesh: the triangles of all its nodes where these place them, without materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from translucent.files.reading import require_room
from translucent.geometry.mesh import Mesh, Triangles, joined
from translucent.gltf.accessors import Accessors
from translucent.gltf.fields import refused
from translucent.gltf.file import read_gltf
from translucent.gltf.geometry import raw_mesh
from translucent.gltf.left_out import LeftOut
from translucent.gltf.load import check_extensions, scene_transforms
from translucent.gltf.scene_media import primitives


def read_whole(path: Path, allow_outside: bool = False) -> Triangles:
    """Read vertices, faces and, if all parts have them, texture coordinates of the default scene, in the file's unit.

    Raises
    ------
    InputError
        If the file is broken, compressed or without triangles.
    """
    file = read_gltf(path, allow_outside)
    left_out = LeftOut()  # of looks, which a mesh has none of
    check_extensions(file, left_out)
    accessors, size = Accessors(file), 0
    meshes: dict[int, list[Mesh | None]] = {}
    parts: list[Triangles] = []
    with np.errstate(under="ignore"):
        for node, matrix in scene_transforms(file, left_out).items():
            index = file.items("nodes")[node].get("mesh")
            if index is None or not matrix[:3, :3].any():
                continue
            entry = file.item("meshes", index)
            if index not in meshes:
                listed = primitives(file, entry)
                meshes[index] = [raw_mesh(accessors, primitive, f"mesh {index}") for primitive in listed]
            for mesh in filter(None, meshes[index]):
                size += 4 * (mesh.vertices.nbytes + mesh.faces.nbytes)  # until they are one mesh
                require_room(f"glTF {str(path)!r}", "its parts in all places", size, file.stored, "split the file")
                parts.append(_placed(mesh, matrix))
    if not parts:
        raise refused(file, "it has no faces", "give a triangle mesh, not points or lines")
    return joined(parts, f"glTF {str(path)!r}")


def _placed(mesh: Mesh, matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Triangles:
    """Place a part in the world; a mirrored one is rewound so that its outside stays outside."""
    if (matrix == np.eye(4)).all():
        return mesh.vertices, mesh.faces, mesh.uv
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], faces, mesh.uv
