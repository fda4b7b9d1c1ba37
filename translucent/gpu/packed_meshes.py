"""Hierarchies of meshes as texels, through which rays walk; needs no OpenGL, so that any process can make them.

One 16-byte texel is a node: six bounds of 16 bits, and a link. Triangles lie in the order of the leaves, three texels
each, with the corners' smooth normals as 2 x 16 bits on an octahedron (Cigolle et al. 2014).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.geometry.bvh import Hierarchy, build_hierarchy
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals

Words = npt.NDArray[np.uint32]

#: Steps of the grid on which bounds lie, between the ends of a hierarchy.
STEPS = 65535

#: Bits of a leaf's link that hold its first triangle; three others hold how many follow it, the highest tells a leaf.
FIRST_BITS = 28

#: Triangles that are packed at a time.
_CHUNK = 1 << 15


@dataclass(frozen=True, eq=False)
class PackedMesh:
    """Hierarchy of one mesh as texels, in coordinates from -1 to 1 along its longest side.

    Attributes
    ----------
    nodes : (8, n, 4) uint32
        Of `packed_nodes`; triangles count from the first of the mesh.
    triangles : (3 m, 4) uint32
    faces : (m,) int32
        Faces of the mesh in the order of the triangles.
    center : (3,) float64
    scale : float
        Of coordinates of the mesh, less the center.
    """

    nodes: Words
    triangles: Words
    faces: npt.NDArray[np.int32]
    center: Array
    scale: float


_packed: WeakKeyDictionary[Mesh, PackedMesh] = WeakKeyDictionary()


def packed_mesh(mesh: Mesh) -> PackedMesh:
    """The hierarchy of a mesh as texels, made once for each mesh."""
    if (found := _packed.get(mesh)) is None:
        found = _packed[mesh] = pack_mesh(mesh, drawn_normals(mesh))
    return found


def keep_packed(mesh: Mesh, packed: PackedMesh) -> None:
    """Cache this `packed_mesh`, which has been made elsewhere."""
    _packed[mesh] = packed


def has_packed(mesh: Mesh) -> bool:
    """True if `packed_mesh` has been made."""
    return mesh in _packed


def pack_mesh(mesh: Mesh, normals: npt.NDArray[np.float32]) -> PackedMesh:
    """Build the hierarchy of a mesh with these `drawn_normals`."""
    center, scale = frame(*mesh.bounds)
    with np.errstate(under="ignore", over="ignore"):  # vertices that no face uses may be anywhere
        vertices = ((mesh.vertices - center) * scale).astype(np.float32)
    count = len(mesh.faces)
    low, high = np.empty((2, count, 3), np.float32)
    for part in _chunks(count):
        corners = vertices[mesh.faces[part]]
        low[part], high[part] = corners.min(axis=1), corners.max(axis=1)
    tree = build_hierarchy(low, high)
    del low, high
    nodes = packed_nodes(tree)
    triangles = np.empty((count, 3, 4), np.uint32)
    for part in _chunks(count):
        faces = tree.faces[part]
        triangles[part, :, :3] = vertices[mesh.faces[faces]].view(np.uint32)
        triangles[part, :, 3] = packed_normals(normals[faces])
    return PackedMesh(nodes, triangles.reshape(-1, 4), tree.faces, center, scale)


def _chunks(count: int) -> Iterator[slice]:
    """Slices of so many, some of them each, so that little memory is taken meanwhile."""
    return (slice(begin, begin + _CHUNK) for begin in range(0, count, _CHUNK))


def frame(low: Array, high: Array) -> tuple[Array, float]:
    """Middle of bounds, and the scale by which their longest side reaches from -1 to 1."""
    return 0.5 * low + 0.5 * high, 1.0 / max(float((high - low).max()) / 2, float(np.finfo(np.float64).tiny))


def packed_nodes(tree: Hierarchy) -> Words:
    """(8, n, 4): nodes of a hierarchy within -1 to 1, in the orders of all octants.

    Bounds are rounded outwards by one to two steps: first those that rays of the octant come to first, x, y and z, then
    the others. Links count from the first node of their order.
    """
    half = STEPS / 2
    nodes = np.empty((8, len(tree.size), 4), np.uint32)
    for part in _chunks(len(tree.size)):
        low = np.clip(np.floor((tree.low[part].astype(np.float64) + 1) * half) - 1, 0, STEPS).astype(np.uint32)
        high = np.clip(np.ceil((tree.high[part].astype(np.float64) + 1) * half) + 1, 0, STEPS).astype(np.uint32)
        count, first = tree.count[part], tree.first[part].astype(np.uint32)
        held = np.uint32(1 << 31) | (count - 1).astype(np.uint32) << FIRST_BITS | first
        for octant, (order, found) in enumerate(zip(tree.orders[:, part], nodes, strict=True)):
            turned = (octant >> np.arange(3) & 1).astype(bool)
            near, far = np.where(turned, high, low).T, np.where(turned, low, high).T
            bounds = [near[0] | near[1] << 16, near[2] | far[0] << 16, far[1] | far[2] << 16]
            link = np.where(count > 0, held, (order + tree.size[part]).astype(np.uint32))
            found[order] = np.stack([*bounds, link], axis=1)
    return nodes


def packed_normals(normals: npt.NDArray[np.floating]) -> Words:
    """(...,): unit vectors (..., 3) as 2 x 16 bits on an octahedron; 6.5e-5 rad off at most.

    Half a step in each coordinate moves a point of the octahedron by sqrt(6) / 65535, at a distance of 1 / sqrt(3).
    """
    size = np.abs(normals).sum(axis=-1, keepdims=True)
    at = normals / np.where(size > 0, size, 1.0)
    folded = (1 - np.abs(at[..., 1::-1])) * np.where(at[..., :2] >= 0, 1.0, -1.0)
    steps = np.rint((np.where(at[..., 2:] < 0, folded, at[..., :2]) + 1) * (STEPS / 2)).astype(np.uint32)
    return np.asarray(steps[..., 0] | steps[..., 1] << 16)
