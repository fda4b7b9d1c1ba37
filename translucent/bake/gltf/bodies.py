"""Bodies from primitives of a glTF file: closed by adjacent primitives, and placed by nodes.

Modelling tools split a mesh by its materials: of a vase in four primitives none is closed, and all of them are. Such a
primitive is joined with the other open ones of its mesh, if that closes edges, and has the thickness of all of them
together. What is closed by itself stays alone: what lies inside it, such as wine in a glass, is another body.
"""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np

from translucent.arrays import Array
from translucent.errors import TranslucentWarning
from translucent.geometry.mesh import Mesh, mended
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, Json
from translucent.gltf.geometry import primitive_mesh
from translucent.gltf.scene_media import node_transforms, primitives

#: Mesh and primitive of a file.
PrimitiveKey = tuple[int, int]

_TRIANGLES = (4, 5, 6)

#: Relative difference of axes within which nodes show a mesh in one size.
SAME_SIZE = 1e-4


def read_primitive(file: GltfFile, key: PrimitiveKey, metres: float, tex_coord: int | None = None) -> Mesh:
    """Read a primitive in its own space, in metres, with a set of its UVs or none."""
    primitive = primitives(file, file.item("meshes", key[0]))[key[1]]
    attributes = {"POSITION": primitive["attributes"].get("POSITION")}
    if tex_coord is not None:
        attributes["TEXCOORD_0"] = primitive["attributes"][f"TEXCOORD_{tex_coord}"]
    mesh = primitive_mesh(Accessors(file), {**primitive, "attributes": attributes}, primitive_name(file, key))
    assert mesh is not None  # its mode is one of triangles
    return mesh if metres == 1.0 else dataclasses.replace(mesh, vertices=mesh.vertices * metres)


def primitive_name(file: GltfFile, key: PrimitiveKey) -> str:
    """The name of a primitive's mesh or node, with its number where there are several."""
    mesh = file.item("meshes", key[0])
    users = [node for node in file.items("nodes") if node.get("mesh") == key[0] and node.get("name")]
    name = str(mesh.get("name") or (users[0]["name"] if users else f"mesh {key[0]}"))
    return name + (f"[{key[1]}]" if len(mesh["primitives"]) > 1 else "")


def triangle_primitives(file: GltfFile) -> dict[PrimitiveKey, Json]:
    """The primitives of triangles of all meshes that nodes use."""
    used = {node["mesh"] for node in file.items("nodes") if "mesh" in node}
    return {
        (index, i): primitive
        for index, mesh in enumerate(file.items("meshes"))
        if index in used
        for i, primitive in enumerate(primitives(file, mesh))
        if primitive.get("mode", 4) in _TRIANGLES
    }


class Bodies:
    """The bodies that the primitives of a file bound.

    Parameters
    ----------
    file : GltfFile
    metres : float
        Per unit of the file.
    """

    def __init__(self, file: GltfFile, metres: float) -> None:
        self._file, self._metres = file, metres
        self._triangles = tuple(triangle_primitives(file))
        self._outlines: dict[PrimitiveKey, Mesh] = {}
        self._joined: dict[int, tuple[Mesh, dict[PrimitiveKey, int]] | None] = {}

    def is_closed(self, key: PrimitiveKey) -> bool:
        """True if a primitive is closed, together with those adjacent to it."""
        whole = self.around(key) or self._outline(key)
        return whole.diagnosis.closed

    def around(self, key: PrimitiveKey) -> Mesh | None:
        """Body of an open primitive: joined with the other open ones of its mesh, if that closes edges."""
        joined = self.joined(key)
        return None if joined is None else joined[0]

    def joined(self, key: PrimitiveKey) -> tuple[Mesh, int] | None:
        """Body `around` an open primitive, and where its faces begin there; None of what stands alone."""
        if len(self._primitives(key[0])) == 1:  # the usual mesh, which need not be read and examined for that
            return None
        if self._outline(key).diagnosis.closed or (joined := self._join(key[0])) is None:
            return None
        return joined[0], joined[1][key]

    def wound(self, key: PrimitiveKey, mesh: Mesh) -> Mesh:
        """Mesh of a primitive, with the winding of its faces in the body `around` it."""
        joined = self._join(key[0])
        assert joined is not None
        whole, starts = joined
        normals = whole.face_normals[starts[key] : starts[key] + len(mesh.faces)]
        turned = np.einsum("fi,fi->f", mesh.face_normals, normals) < 0
        return dataclasses.replace(mesh, faces=np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces))

    def _outline(self, key: PrimitiveKey) -> Mesh:
        if key not in self._outlines:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TranslucentWarning)  # of faces that are turned: what is baked tells
                self._outlines[key] = read_primitive(self._file, key, self._metres)
        return self._outlines[key]

    def _primitives(self, index: int) -> list[PrimitiveKey]:
        return [key for key in self._triangles if key[0] == index]

    def _join(self, index: int) -> tuple[Mesh, dict[PrimitiveKey, int]] | None:
        """All open primitives of a mesh as one, and where the faces of each begin; None if that closes no edge."""
        if index not in self._joined:
            parts = {key: self._outline(key) for key in self._primitives(index)}
            parts = {key: part for key, part in parts.items() if not part.diagnosis.closed}
            self._joined[index] = None
            if len(parts) > 1:
                whole, starts = _joined(parts)
                before = sum(part.diagnosis.open_edges.count for part in parts.values())
                if whole.diagnosis.open_edges.count < before:
                    self._joined[index] = whole, starts
        return self._joined[index]


def _joined(parts: dict[PrimitiveKey, Mesh]) -> tuple[Mesh, dict[PrimitiveKey, int]]:
    meshes = list(parts.values())
    first_vertex = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first_face = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + begin for mesh, begin in zip(meshes, first_vertex, strict=False)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)  # as above
        whole = mended(Mesh(vertices, faces.astype(np.int32), name=meshes[0].name))
    return whole, dict(zip(parts, first_face.tolist(), strict=False))


def first_transforms(file: GltfFile) -> dict[int, Array]:
    """Mesh to world (4x4) of each mesh by the first node that shows it.

    Warns
    -----
    TranslucentWarning
        If nodes show a mesh in several sizes.
    """
    transforms, first = node_transforms(file), dict[int, Array]()
    for index, node in enumerate(file.items("nodes")):
        matrix = transforms[index]
        if "mesh" not in node or np.linalg.matrix_rank(matrix[:3, :3]) < 3:
            continue  # without an extent along some axis: it is hidden, or has no inside
        known = first.setdefault(node["mesh"], matrix)
        if not np.allclose(_sizes(known), _sizes(matrix), rtol=SAME_SIZE, atol=SAME_SIZE * np.abs(_sizes(known)).max()):
            name = file.item("meshes", node["mesh"]).get("name", f"mesh {node['mesh']}")
            told = f"glTF {str(file.path)!r}: nodes show {name!r} in several sizes; its map is that of the first"
            warnings.warn(told, TranslucentWarning, stacklevel=2)
    return first


def _sizes(matrix: Array) -> Array:
    """Metric of a matrix: the same for two that differ by a rotation, a translation or a reflection."""
    return np.asarray(matrix[:3, :3].T @ matrix[:3, :3])


def transformed(mesh: Mesh, matrix: Array, metres: float) -> Mesh:
    """A mesh in metres, moved by a matrix in units of its file; a mirrored one is turned outwards again."""
    vertices = mesh.vertices @ matrix[:3, :3].T + metres * matrix[:3, 3]
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return dataclasses.replace(mesh, vertices=vertices, faces=faces)
