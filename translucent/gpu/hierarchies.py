"""Hierarchies on the GPU: those of the meshes of a scene, and one of its objects, as textures that rays walk through.

One 16-byte texel is a node: six bounds of 16 bits, and a link. Triangles lie in the order of the leaves, three texels
each, with the corners' smooth normals as 2 x 16 bits on an octahedron (Cigolle et al. 2014).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.geometry.bvh import Floats, Hierarchy, build_hierarchy
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals
from translucent.gpu.body_uniforms import bounded_extinction
from translucent.gpu.constants import HIERARCHY_WIDTH_BITS
from translucent.gpu.layout import TRACED_BODY
from translucent.gpu.ledger import before_making
from translucent.media.medium import Medium
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

Words = npt.NDArray[np.uint32]

#: Steps of the grid on which bounds lie, between the ends of a hierarchy.
STEPS = 65535

_WIDTH = 1 << HIERARCHY_WIDTH_BITS

#: Bits of a leaf's link that hold its first triangle; three others hold how many follow it, the highest tells a leaf.
_FIRST_BITS = 28


@dataclass(frozen=True, eq=False)
class PackedMesh:
    """Hierarchy of one mesh as texels, in coordinates from -1 to 1 along its longest side.

    Attributes
    ----------
    nodes : (8, n, 4) uint32
        Of `packed_nodes`; triangles count from the first of the mesh.
    triangles : (3 m, 4) uint32
    center : (3,) float64
    scale : float
        Of coordinates of the mesh, less the center.
    """

    nodes: Words
    triangles: Words
    center: Array
    scale: float


_packed: WeakKeyDictionary[Mesh, PackedMesh] = WeakKeyDictionary()


def packed_mesh(mesh: Mesh) -> PackedMesh:
    """The hierarchy of a mesh as texels, made once for each mesh."""
    if (found := _packed.get(mesh)) is None:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        center = 0.5 * low + 0.5 * high
        scale = 1.0 / max(float((high - low).max()) / 2, float(np.finfo(np.float64).tiny))
        corners = ((mesh.vertices - center) * scale).astype(np.float32)[mesh.faces]
        tree = build_hierarchy(corners.min(axis=1), corners.max(axis=1))
        triangles = np.empty((*mesh.faces.shape, 4), np.uint32)
        triangles[..., :3] = corners[tree.faces].view(np.uint32)
        triangles[..., 3] = packed_normals(drawn_normals(mesh)[tree.faces])
        found = _packed[mesh] = PackedMesh(packed_nodes(tree), triangles.reshape(-1, 4), center, scale)
    return found


def packed_nodes(tree: Hierarchy) -> Words:
    """(8, n, 4): nodes of a hierarchy within -1 to 1, in the orders of all octants.

    Bounds are rounded outwards by one to two steps; links count from the first node of their order.
    """
    half = STEPS / 2
    low = np.clip(np.floor((tree.low.astype(np.float64) + 1) * half) - 1, 0, STEPS).astype(np.uint32)
    high = np.clip(np.ceil((tree.high.astype(np.float64) + 1) * half) + 1, 0, STEPS).astype(np.uint32)
    leaf = tree.count > 0
    held = np.uint32(1 << 31) | (tree.count - 1).astype(np.uint32) << _FIRST_BITS | tree.first.astype(np.uint32)
    bounds = [low[:, 0] | low[:, 1] << 16, low[:, 2] | high[:, 0] << 16, high[:, 1] | high[:, 2] << 16]
    nodes = np.empty((8, len(leaf), 4), np.uint32)
    for order, found in zip(tree.orders, nodes, strict=True):
        link = np.where(leaf, held, (order + tree.size).astype(np.uint32))
        found[order] = np.stack([*bounds, link], axis=1)
    return nodes


def packed_normals(normals: npt.NDArray[np.floating]) -> Words:
    """(...,): unit vectors (..., 3) as 2 x 16 bits on an octahedron; 4e-5 rad off at most."""
    size = np.abs(normals).sum(axis=-1, keepdims=True)
    at = normals / np.where(size > 0, size, 1.0)
    folded = (1 - np.abs(at[..., 1::-1])) * np.where(at[..., :2] >= 0, 1.0, -1.0)
    steps = np.rint((np.where(at[..., 2:] < 0, folded, at[..., :2]) + 1) * (STEPS / 2)).astype(np.uint32)
    return np.asarray(steps[..., 0] | steps[..., 1] << 16)


@dataclass(frozen=True, eq=False)
class _Span:
    """Nodes of one mesh in the texture: the first, and how many there are in each of eight orders."""

    first: int
    count: int


class SceneHierarchies:
    """Textures of the hierarchies of a set of meshes; bodies may move without a new upload of them.

    Attributes
    ----------
    nodes, triangles : moderngl.Texture
    object_nodes : int
        Nodes of the hierarchy of objects.
    """

    def __init__(self, gl: moderngl.Context, meshes: Sequence[Mesh], objects: int) -> None:
        before_making(gl)
        self._packed = [packed_mesh(mesh) for mesh in meshes]
        self._rows = -(-2 * objects // _WIDTH)
        self._spans: dict[int, _Span] = {}
        start = self._rows * _WIDTH
        parts, triangles, first = [np.zeros((start, 4), np.uint32)], 0, start
        for mesh, packed in zip(meshes, self._packed, strict=True):
            self._spans[id(mesh)] = _Span(first, packed.nodes.shape[1])
            for order in packed.nodes:
                nodes = order.copy()
                nodes[:, 3] += np.where(nodes[:, 3] >= 1 << 31, triangles, first).astype(np.uint32)
                parts.append(nodes)
                first += len(nodes)
            triangles += len(packed.triangles) // 3
        self.nodes = _texture(gl, np.concatenate(parts))
        self.triangles = _texture(gl, np.concatenate([packed.triangles for packed in self._packed]))
        self.object_nodes = 0

    def place(self, scene: Scene, center: Array) -> tuple[npt.NDArray[np.float32], tuple[float, float, float, float]]:
        """Write the hierarchy of objects where they are.

        Returns
        -------
        rows : (objects, texels, 4) float32
            A `TRACED_BODY` of each object.
        frame : (4,) floats
            Center and scale of the coordinates of the hierarchy of objects; positions count from `center`.
        """
        boxes = np.stack([body.bounds - center for body in scene.objects])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        middle = 0.5 * low + 0.5 * high
        scale = 1.0 / max(float((high - low).max()) / 2, float(np.finfo(np.float64).tiny))
        local: Floats = ((boxes - middle) * scale).astype(np.float32)
        tree = build_hierarchy(local[:, 0], local[:, 1], leaf_size=1)
        nodes = packed_nodes(tree)[0]
        leaf = nodes[:, 3] >= 1 << 31
        nodes[leaf, 3] = np.uint32(1 << 31) | tree.faces[nodes[leaf, 3] & 0x0FFFFFFF].astype(np.uint32)
        reserved = np.zeros((self._rows * _WIDTH, 4), np.uint32)
        reserved[: len(nodes)] = nodes
        self.nodes.write(reserved, viewport=(0, 0, _WIDTH, self._rows))
        self.object_nodes = len(nodes)
        ranks = np.unique([body.priority for body in scene.objects], return_inverse=True)[1] + 1.0
        media = _media_numbers(scene)
        rows = []
        for i, body in enumerate(scene.objects):
            own = {"rank": ranks[i] if _decides(scene, body) else 0.0, "slot": media[i]}
            rows.append({**self._row(scene, body, center), **own})
        return TRACED_BODY.pack(rows), (*middle, scale)

    def _row(self, scene: Scene, body: Object, center: Array) -> Mapping[str, npt.ArrayLike]:
        packed, span = packed_mesh(body.mesh), self._spans[id(body.mesh)]
        local = packed.scale * np.linalg.inv(body.matrix[:3, :3])
        offset = local @ (center - body.matrix[:3, 3]) - packed.scale * packed.center
        rows = np.column_stack([local, offset])
        medium, surface = body.medium or Medium(), body.surface or Surface()
        opaque = body.medium is None
        return {
            "local_x": rows[0],
            "local_y": rows[1],
            "local_z": rows[2],
            "first_node": divmod(span.first, 1 << 12),
            "node_count": divmod(span.count, 1 << 12),
            "extinction": bounded_extinction(medium, scene.diagonal),
            "outwards": -1.0 if body.mesh.diagnosis.inverted else 1.0,
            "emission": np.asarray(medium.emission),
            "kind": _kind(body),
            "color": body.base_color if opaque else np.asarray(surface.color),
            "transmission": surface.transmission,
            "ior": surface.ior if opaque else medium.ior,
            "dispersion": surface.dispersion,
            "roughness": surface.roughness,
            "plain": float(body.surface is None if opaque else surface.plain and body.mesh.colors is None),
            "passed": surface.diffuse_transmission * np.asarray(surface.diffuse_transmission_color),
            "passed_share": surface.diffuse_transmission,
            "emissive": np.asarray(surface.emissive),
            "metallic": surface.metallic,
            "one_sided": float(not surface.double_sided),
        }

    def release(self) -> None:
        """Free the textures."""
        self.nodes.release()
        self.triangles.release()


class HierarchyCache:
    """Cache of the hierarchies of the last scene, kept as long as the meshes are the same."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._held: SceneHierarchies | None = None
        self._meshes: tuple[Mesh, ...] = ()
        self._objects = 0

    def of(self, scene: Scene) -> SceneHierarchies:
        """The hierarchies of a scene."""
        meshes = tuple(dict.fromkeys(body.mesh for body in scene.objects))
        if self._held is None or self._meshes != meshes or self._objects != len(scene.objects):
            self.release()
            self._held = SceneHierarchies(self._gl, meshes, len(scene.objects))
            self._meshes, self._objects = meshes, len(scene.objects)
        return self._held

    def release(self) -> None:
        """Free the textures."""
        if self._held is not None:
            self._held.release()
            self._held = None


def _kind(body: Object) -> float:
    """Kind of an object, as ``shaders/transport/traced_interfaces.frag`` numbers them."""
    if body.medium is None:
        return 2.0
    return 3.0 if body.covers else 0.0 if body.sheet_thickness is None else 1.0


def _decides(scene: Scene, body: Object) -> bool:
    """Whether a body determines the index of refraction of the rays in it."""
    solid = body.medium is not None and body.sheet_thickness is None
    return solid and (body.has_interface or scene.overlap == "priority")


def _media_numbers(scene: Scene) -> list[float]:
    """A number for each object, the same for those of one medium."""
    numbers: dict[Medium | None, int] = {}
    return [float(numbers.setdefault(body.medium, len(numbers))) for body in scene.objects]


def _texture(gl: moderngl.Context, texels: Words) -> moderngl.Texture:
    rows = -(-len(texels) // _WIDTH)
    if rows > (limit := int(gl.info["GL_MAX_TEXTURE_SIZE"])):
        raise RenderError(
            "tracing rays through the meshes",
            f"{len(texels):,} texels, and this OpenGL holds {limit * _WIDTH:,}",
            "use interfaces=tl.ScreenInterfaces(), or coarser meshes",
        )
    padded = np.zeros((rows * _WIDTH, 4), np.uint32)
    padded[: len(texels)] = texels
    texture = gl.texture((_WIDTH, rows), 4, padded, dtype="u4")
    texture.filter = moderngl.NEAREST, moderngl.NEAREST
    return texture
