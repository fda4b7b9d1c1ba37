"""Check that a map matches the texture coordinates of the file that it is for, which is read again."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from translucent.arrays import Array
from translucent.bake.gltf.bodies import Bodies, first_transforms, transformed
from translucent.bake.record import Record
from translucent.errors import RenderError, TranslucentWarning
from translucent.geometry.mesh import Mesh
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import GltfMaterial

#: Corners: positions (n, 3) in metres and texture coordinates (n, 2), v upwards, or none.
Corners = tuple[Array, Array | None]

#: Tolerances of positions, as shares of the diagonal, and of texture coordinates.
SAME = 1e-4
#: Share of the vertices that may differ: those on seams that a repair has closed.
MOST_OTHERS = 0.01


def require_uv_of(corners: Corners, mesh: Mesh, path: Path) -> None:
    """Raise unless a map of `mesh` can be read with the texture coordinates in a file.

    Parameters
    ----------
    corners
        Of the file.
    mesh : Mesh
        As it was baked.
    path : Path
        The file, for the error.

    Raises
    ------
    RenderError
        If its vertices are not in the file, or have other texture coordinates there.
    """
    from scipy.spatial import cKDTree

    positions, uv = corners
    asked = f"check of the map of {mesh.name!r}"
    if uv is None:
        raise RenderError(asked, f"{str(path)!r} has no texture coordinates", "bake it again with --unwrap")
    assert mesh.uv is not None
    with np.errstate(under="ignore"):
        known = cKDTree(np.column_stack([(positions - mesh.center) / mesh.diagonal, uv]))
        used = np.unique(mesh.faces)
        wanted = np.column_stack([(mesh.vertices[used] - mesh.center) / mesh.diagonal, mesh.uv[used]])
        distance, _ = known.query(wanted, p=np.inf)
    others = float(np.mean(distance > SAME))
    if others > MOST_OTHERS:
        found = f"{others:.0%} of its vertices have other texture coordinates in {str(path)!r}"
        raise RenderError(asked, found, "the map does not belong to that file; bake it again with --unwrap")


def own_corners(file: GltfFile, part: Record, metres: float, material: GltfMaterial | None = None) -> Corners:
    """Corners of a primitive in its own space; with a material, at the coordinates of its thickness texture."""
    accessors = Accessors(file)
    mesh, primitive = part["place"]
    attributes = file.item("meshes", mesh)["primitives"][primitive]["attributes"]
    tex_coord = part.get("tex_coord", 0) if material is None else material.thickness_transform.tex_coord
    positions = metres * accessors.vectors(attributes["POSITION"], "VEC3")
    if f"TEXCOORD_{tex_coord}" not in attributes:
        return positions, None
    uv = accessors.vectors(attributes[f"TEXCOORD_{tex_coord}"], "VEC2")
    if material is not None:
        uv = material.thickness_transform.apply(uv)
    return positions, np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])


def placed_corners(file: GltfFile, part: Record, metres: float) -> Corners:
    """Corners of a primitive as the first node places it."""
    matrix = _matrix(file, part)
    positions, uv = own_corners(file, part, metres)
    return positions @ matrix[:3, :3].T + metres * matrix[:3, 3], uv


def placed_around(file: GltfFile, part: Record, metres: float) -> Mesh | None:
    """Corners of the body that a primitive bounds with others, as the first node places it."""
    around = Bodies(file, metres).around((part["place"][0], part["place"][1]))
    return None if around is None else transformed(around, _matrix(file, part), metres)


def _matrix(file: GltfFile, part: Record) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # the bake has told them
        return first_transforms(file).get(part["place"][0], np.eye(4))


def mesh_corners(path: Path, metres: float) -> Corners:
    """Corners of a mesh in any other file, as stored."""
    import trimesh

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        parts = trimesh.load_scene(path, process=False).dump()
    uv = [getattr(part.visual, "uv", None) for part in parts]
    known = [(np.asarray(part.vertices), one) for part, one in zip(parts, uv, strict=True) if one is not None]
    if not known:
        return np.zeros((0, 3)), None
    positions, coordinates = (np.concatenate(arrays) for arrays in zip(*known, strict=True))
    return metres * positions, np.asarray(coordinates, dtype=np.float64)
